"""Solid parts nested on print beds, with their number engraved on a face that touches nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.penetration import solid
from mocca_robot.errors import InputError
from mocca_robot.geometry.facets import facets
from mocca_robot.geometry.frames import tangents
from mocca_robot.tolerances import COARSE

SAME_PLANE = 1e-4
"""Cosine short of 1, and distance relative to the size, of two faces that count as one."""

SEGMENTS = {
    "0": "abcdef", "1": "bc", "2": "abged", "3": "abgcd", "4": "fgbc",
    "5": "afgcd", "6": "afgedc", "7": "abc", "8": "abcdefg", "9": "abcdfg",
}  # fmt: skip
"""Strokes of a seven-segment digit: a on top, then clockwise to f, g across the middle."""

_STROKES = {
    "a": (0.0, 1.0, 0.5, 1.0), "b": (0.5, 0.5, 0.5, 1.0), "c": (0.5, 0.0, 0.5, 0.5), "d": (0.0, 0.0, 0.5, 0.0),
    "e": (0.0, 0.0, 0.0, 0.5), "f": (0.0, 0.5, 0.0, 1.0), "g": (0.0, 0.5, 0.5, 0.5),
}  # fmt: skip
"""Ends (x, y, x, y) of each stroke in a cell half as wide as it is high."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A part on a bed: its number in the assembly sequence, from 1, and the mesh where it lies, metres."""

    name: str
    number: int
    mesh: Mesh


def print_beds(
    assembly: Assembly,
    bed: tuple[float, float],
    *,
    gap: float = 0.004,
    scale: float = 1.0,
    label_depth: float = 0.0,
    contacts: Sequence[Contact] = (),
) -> list[list[Placed]]:
    """Return the free and fixed parts of a 3D assembly nested on beds of `bed` (x, y) metres, bed by bed.

    Each part lies on its largest facet; parts stand in rows at least `gap` apart, deepest first. With
    `label_depth` > 0 (metres, after scaling) numbers are engraved into facets without a contact. Raises InputError
    for a part that is larger than the bed.
    """
    lying: list[tuple[Array, Placed]] = []
    for index, part in enumerate(assembly.parts):
        assert isinstance(part.shape, Mesh)
        mesh = Mesh(part.shape.vertices * scale, part.shape.faces)
        if label_depth > 0:
            mine = [c for c in contacts if index in c.parts]
            mesh = engraved(mesh, str(index + 1), label_depth, [(c.normal, c.polygon[0] * scale) for c in mine])
        mesh = _laid_down(mesh)
        lying.append((np.ptp(mesh.bounds, axis=0)[:2], Placed(part.name, index + 1, mesh)))
    lying.sort(key=lambda item: (-item[0][1], item[1].number))
    beds: list[list[Placed]] = []
    x = y = depth = np.inf
    for size, placed in lying:
        if (size > np.array(bed)).any():
            raise InputError(
                f"Part '{placed.name}' needs {size[0]:.4g} × {size[1]:.4g} m, the bed has {bed[0]:g} × {bed[1]:g} m; "
                "use a larger bed or a smaller scale."
            )
        if x + size[0] > bed[0]:
            x, y, depth = 0.0, y + depth + gap, size[1]
        if not y + size[1] <= bed[1]:
            beds.append([])
            x, y, depth = 0.0, 0.0, size[1]
        beds[-1].append(Placed(placed.name, placed.number, _moved(placed.mesh, np.array([x, y, 0.0]))))
        x += size[0] + gap
    return beds


def write_beds(beds: Sequence[Sequence[Placed]], folder: Path, suffix: str = "3mf") -> list[Path]:
    """Return one file per bed, in millimetres; a 3MF keeps the parts apart and named."""
    if suffix not in ("3mf", "stl"):
        raise InputError(f"Print beds are written as 3mf or stl, not '{suffix}'.")
    import trimesh

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for k, bed in enumerate(beds):
        scene = trimesh.Scene()
        for placed in bed:
            mesh = trimesh.Trimesh(placed.mesh.vertices * 1e3, placed.mesh.faces, process=False)
            mesh.units = "millimeters"
            scene.add_geometry(mesh, geom_name=placed.name, node_name=placed.name)
        file = folder / f"bed_{k + 1:02d}.{suffix}"
        scene.export(file)
        files.append(file)
    return files


def engraved(mesh: Mesh, text: str, depth: float, touching: Sequence[tuple[Array, Array]] = ()) -> Mesh:
    """Return `mesh` with the digits of `text` cut `depth` (m) into the roomiest facet that lies in none of the planes
    `touching` (normal, point).
    """
    size = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    found = facets([mesh], COARSE * size)
    best: tuple[float, Array, Array, Array] | None = None
    for facet in range(len(found.count)):
        normal = found.normals[facet]
        corners = found.vertices[found.loops(facet)[0]]
        flat = any(
            abs(abs(float(n @ normal)) - 1.0) < SAME_PLANE and abs(float((corners[0] - p) @ n)) < SAME_PLANE * size
            for n, p in touching
        )
        if flat:
            continue
        first = corners[1] - corners[0]
        first = first / np.linalg.norm(first)
        second = np.cross(normal, first)
        outline = shapely.Polygon((corners - corners[0]) @ np.stack([first, second]).T)
        circle = shapely.maximum_inscribed_circle(outline)
        middle = corners[0] + np.array(circle.coords[0]) @ np.stack([first, second])
        if best is None or circle.length > best[0]:
            best = (float(circle.length), middle, first, normal)
    if best is None or best[0] < 4 * depth:
        return mesh
    radius, middle, first, normal = best
    cut = solid(mesh)
    for stroke in _strokes(text, radius, depth):
        turned = np.stack([first, np.cross(normal, first), normal], axis=1)
        cut = cut - stroke.transform(np.column_stack([turned, middle]))
    out = cut.to_mesh64()
    return Mesh(np.asarray(out.vert_properties)[:, :3], np.asarray(out.tri_verts, dtype=np.int64))


def _strokes(text: str, radius: float, depth: float) -> list:  # type: ignore[type-arg]
    """Return boxes, manifold3d solids, that cut `text` into z = 0 within `radius` of the origin."""
    import manifold3d

    # Cells are 0.5 wide with 0.25 between; the whole fits into the circle.
    width = 0.75 * len(text) - 0.25
    height = 1.7 * radius / float(np.hypot(width, 1.0))
    thick = 0.12 * height
    boxes = []
    for k, digit in enumerate(text):
        for segment in SEGMENTS[digit]:
            x0, y0, x1, y1 = _STROKES[segment]
            low = np.array([x0 + 0.75 * k - width / 2, y0 - 0.5]) * height - thick / 2
            high = np.array([x1 + 0.75 * k - width / 2, y1 - 0.5]) * height + thick / 2
            size = (float(high[0] - low[0]), float(high[1] - low[1]), 2 * depth)
            boxes.append(manifold3d.Manifold.cube(size).translate((float(low[0]), float(low[1]), -depth)))
    return boxes


def _laid_down(mesh: Mesh) -> Mesh:
    """Return the mesh turned onto its largest facet, its bounding box starting at the origin."""
    found = facets([mesh], COARSE * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))))
    area = np.zeros(len(found.count))
    corners = found.vertices[found.triangles]
    twice = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    np.add.at(area, found.facet, twice)
    normal = found.normals[int(area.argmax())]
    first, second = tangents(normal)
    turn = np.stack([first, -second, -normal])
    turned = Mesh(mesh.vertices @ turn.T, mesh.faces)
    return _moved(turned, -turned.bounds[0])


def _moved(mesh: Mesh, by: Array) -> Mesh:
    return Mesh(mesh.vertices + by, mesh.faces)
