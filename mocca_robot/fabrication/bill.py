"""The bill of parts: what has to be made, equal parts counted together."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.tolerances import COARSE, ROUNDING

_Kind = tuple[tuple[bool, float, int], Array]

COLUMNS = ("item", "count", "numbers", "parts", "size_mm", "density_kg_m3", "volume_cm3", "mass_g", "fixed")


@dataclass(frozen=True, kw_only=True)
class Item:
    """Equal parts.

    Attributes:
        numbers: their places in the assembly sequence, from 1.
        names: of the parts.
        size_m: edges of the bounding box as the parts stand in the assembly, flat ones with their thickness last.
        density, volume_m3, mass_kg: of one part.
        fixed: whether it stands on the ground.
    """

    numbers: tuple[int, ...]
    names: tuple[str, ...]
    size_m: tuple[float, ...]
    density: float
    volume_m3: float
    mass_kg: float
    fixed: bool


def bill(assembly: Assembly) -> tuple[Item, ...]:
    """Return the parts in assembly order, those of the same shape, material and role as one item.

    Shapes count as the same when volume, number of corners, and the moments and distances of the corners about the
    centroid agree within 1e-6: turned and moved copies of each other do, and so do mirrored ones.
    """
    groups: list[tuple[_Kind, list[int]]] = []
    for k, part in enumerate(assembly.parts):
        mine = _kind(part, assembly.size)
        for kind, members in groups:
            if kind[0] == mine[0] and np.allclose(kind[1], mine[1], rtol=COARSE, atol=ROUNDING):
                members.append(k)
                break
        else:
            groups.append((mine, [k]))
    return tuple(_item(assembly, members) for _, members in groups)


def _item(assembly: Assembly, members: list[int]) -> Item:
    parts = [assembly.parts[k] for k in members]
    first = parts[0]
    return Item(
        numbers=tuple(k + 1 for k in members),
        names=tuple(p.name for p in parts),
        size_m=size(first),
        density=first.density,
        volume_m3=first.shape.volume,
        mass_kg=first.mass,
        fixed=first.fixed,
    )


def size(part: Part) -> tuple[float, ...]:
    """Return the edges (m) of the part's bounding box; of a flat part its thickness comes last."""
    extent = tuple(float(v) for v in np.ptp(part.shape.bounds, axis=0))
    return (*extent, float(part.shape.thickness)) if isinstance(part.shape, Polygon) else extent


def _kind(part: Part, scale: float) -> _Kind:
    shape = part.shape
    points = np.concatenate(shape.rings) if isinstance(shape, Polygon) else shape.vertices
    relative = (points - part.centroid) / scale
    moments = np.linalg.eigvalsh(relative.T @ relative / len(points))
    radii = np.linalg.norm(relative, axis=1)
    flat = shape.thickness / scale if isinstance(shape, Polygon) else 0.0
    numbers = np.array([*moments, radii.min(), radii.max(), radii.mean(), flat, shape.volume / scale**3])
    return (part.fixed, part.density, len(points)), numbers


def bill_csv(assembly: Assembly) -> str:
    """Return the bill as CSV, with decimal points whatever the locale."""
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(COLUMNS)
    for number, item in enumerate(bill(assembly), 1):
        edges = " x ".join(f"{v * 1e3:.4g}" for v in item.size_m)
        table.writerow(
            [
                number,
                len(item.names),
                " ".join(map(str, item.numbers)),
                "; ".join(item.names),
                edges,
                f"{item.density:g}",
                f"{item.volume_m3 * 1e6:.4g}",
                f"{item.mass_kg * 1e3:.4g}",
                "yes" if item.fixed else "no",
            ]
        )
    return out.getvalue()
