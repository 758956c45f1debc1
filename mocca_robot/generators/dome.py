"""A dome of rings in running bond; every joint is cut along a plane through the centre of the sphere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import DEFAULT_DENSITY, Assembly, Part
from mocca_robot.errors import InputError
from mocca_robot.generators.parameters import GeneratorParameters
from mocca_robot.generators.surface import Surface, thicken
from mocca_robot.tolerances import ROUNDING

DEFAULTS: dict[str, Any] = {
    "radius": 1.0,
    "thickness": 0.15,
    "blocks": [20, 20, 18, 16, 14, 11, 8],
    "base_deg": 90.0,
    "top_deg": 18.0,
    "cap": True,
    "shift": 0.5,
    "snap": 0.0,
    "key_lean_deg": 15.0,
    "door_deg": 0.0,
    "door_rings": 0,
    "density": DEFAULT_DENSITY,
}


@dataclass(frozen=True, eq=False)
class Ring:
    """One ring: (n + 1,) azimuths of its joints where they meet the bed below and the one above, ascending."""

    below: Array
    above: Array

    @property
    def closed(self) -> bool:
        """Return whether the last block meets the first."""
        return bool(self.below[-1] - self.below[0] > 2 * np.pi - ROUNDING)


def dome(given: Mapping[str, Any], _folder: Path) -> Assembly:
    """Return a dome (or, with a door, an igloo). The lowest ring is fixed; parts come ring by ring, the last block
    of a ring is its key: a wedge whose joints lean by `key_lean_deg`, so that it can be put in from above.

    Parameters: `radius` of the inside and `thickness` (m); `blocks` per ring, lowest first; polar angles `base_deg`
    and `top_deg` between which the rings are spread; `cap` closes the top; `shift` of each ring against the last,
    in blocks; `snap`: joints closer than this share of a block to one below are put above it (no slivers);
    `door_deg` × `door_rings`: a doorway around azimuth −90°.
    """
    p = GeneratorParameters("dome", given, DEFAULTS)
    base, top = np.deg2rad(p.number("base_deg", 5, 120.0)), np.deg2rad(p.number("top_deg", 0.0, 90.0))
    blocks = p.counts("blocks", 3)
    p.require_few(sum(blocks))
    if top >= base:
        raise InputError(f"dome.top_deg is {np.rad2deg(top):g}; it must be less than base_deg, {np.rad2deg(base):g}.")
    polar = np.linspace(base, top, len(blocks) + 1)
    radius = p.number("radius", 1e-3, 1e3)
    profile = radius * np.stack([np.sin(polar), np.cos(polar)], axis=1)
    door = np.deg2rad(p.at_least("door_deg", 0.0, 120.0))
    rings = running_bond(
        blocks,
        profile,
        shift=p.at_least("shift", 0.0, 1.0),
        snap=p.at_least("snap", 0.0, 0.5),
        lean=np.deg2rad(p.at_least("key_lean_deg", 0.0, 45.0)),
        door=door,
        door_rings=p.count("door_rings", 0, len(blocks) - 1) if door > 0 else 0,
    )
    surface, names = ring_surface(rings, profile, p.flag("cap"))
    outward = surface.points / np.linalg.norm(surface.points, axis=1)[:, None]
    meshes = thicken(surface, outward, p.number("thickness", 1e-4, 1e3))
    density = p.number("density", 0.0, 1e5)
    parts = [Part(name, mesh, density, fixed=ring == 0) for (name, ring), mesh in zip(names, meshes)]
    return Assembly("dome", tuple(parts))


def running_bond(
    blocks: list[int],
    profile: Array,
    *,
    shift: float,
    snap: float,
    lean: float,
    door: float = 0.0,
    door_rings: int = 0,
) -> list[Ring]:
    """Return the joints of every ring of a surface of revolution.

    `profile` is (n + 1, 2): radius and height of the beds, lowest first, metres; the other arguments are those of
    the dome, angles in radians.
    """
    rings: list[Ring] = []
    turn = 0.0
    for k, count in enumerate(blocks):
        if k < door_rings:
            inner = np.arange(1, count) + (0.25 if k % 2 else -0.25)
            share = np.asarray(np.r_[0.0, inner, count] / count, dtype=np.float64)
            joints = -np.pi / 2 + door / 2 + share * (2 * np.pi - door)
            if rings and snap > 0:
                joints[1:-1] = _snapped(joints[1:-1], rings[-1].above, snap * (2 * np.pi - door) / count)
            rings.append(Ring(joints, joints))
            continue
        width = 2 * np.pi / count
        turn += shift * width
        joints = np.asarray(turn + width * np.arange(count + 1), dtype=np.float64)
        if rings and snap > 0:
            joints[:-1] = _snapped(joints[:-1], rings[-1].above, snap * width)
            joints[-1] = joints[0] + 2 * np.pi
        slope = float(np.linalg.norm(profile[k + 1] - profile[k]))
        narrowing = max((profile[k, 0] - profile[k + 1, 0]) / slope, 0.0)
        # Meridians converge where the ring narrows; the wedge opens beyond that.
        opening = np.tan(min(lean + 0.5 * width * narrowing, 1.2)) if lean > 0 else 0.0
        swing = min(opening * slope / (profile[k, 0] + profile[k + 1, 0]), 0.3 * width)
        below, above = joints.copy(), joints.copy()
        for joint, sign in ((-2, 1.0), (-1, -1.0), (0, -1.0)):
            below[joint] += sign * swing
            above[joint] -= sign * swing
        rings.append(Ring(below, above))
    return rings


def _snapped(joints: Array, targets: Array, reach: float) -> Array:
    """Return `joints` with those closer than `reach` to one of `targets` (modulo a turn) put onto it."""
    away = (targets[None] - joints[:, None] + np.pi) % (2 * np.pi) - np.pi
    nearest = np.abs(away).argmin(axis=1)
    step = away[np.arange(len(joints)), nearest]
    return np.asarray(np.where(np.abs(step) < reach, joints + step, joints))


def ring_surface(rings: list[Ring], profile: Array, cap: bool) -> tuple[Surface, list[tuple[str, int]]]:
    """Return the surface of revolution that the rings cover, and the name and ring of each face."""
    points: list[Array] = []
    beds: list[tuple[Array, list[int]]] = []
    for k, (radius, height) in enumerate(profile):
        turns = np.concatenate([r.below for r in rings[k : k + 1]] + [r.above for r in (rings[k - 1 : k] if k else [])])
        turns = np.unique(np.round(turns % (2 * np.pi), 12) % np.round(2 * np.pi, 12))
        first = len(points)
        points += [np.array([radius * np.cos(t), radius * np.sin(t), height]) for t in turns]
        beds.append((turns, list(range(first, first + len(turns)))))
    faces: list[tuple[int, ...]] = []
    names: list[tuple[str, int]] = []
    for k, ring in enumerate(rings):
        for b in range(len(ring.below) - 1):
            lower = _between(*beds[k], ring.below[b], ring.below[b + 1])
            upper = _between(*beds[k + 1], ring.above[b], ring.above[b + 1])
            faces.append((*lower, *reversed(upper)))
            names.append((f"ring{k + 1:02d}_{b + 1:02d}", k))
    if cap:
        faces.append(tuple(beds[-1][1]))
        names.append(("cap", len(rings)))
    return Surface(np.array(points), tuple(faces)), names


def _between(turns: Array, corners: list[int], start: float, end: float) -> list[int]:
    """Return the corners of a bed from azimuth `start` to `end`, ascending."""
    along = (turns - start + ROUNDING) % (2 * np.pi) - ROUNDING
    order = np.argsort(along)
    return [corners[o] for o in order if along[o] <= end - start + ROUNDING]
