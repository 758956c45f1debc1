"""Dragging a corner of flat parts that touch: every part that has the point there follows, none opens a gap.

The parts are looked at as a division of the plane. A corner that lies on a neighbour's edge becomes a corner of the
neighbour, too, and a neighbour's corner on an edge that will turn becomes a corner of that edge: then moving the one
point moves only edges that end in it, and both sides of each of them alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Polygon, signed_area
from mocca_robot.errors import InputError
from mocca_robot.geometry.polygons import to_shapely

NEAR = 1e-4
"""Share of the assembly's size within which points are one."""
VANISHED = 1e-3
"""Share of its area below which a part has vanished: nobody drags that far on purpose."""


def drag(assembly: Assembly, corner: Array, to: Array) -> Assembly:
    """Return flat parts whose corner at the point `corner` (2,), metres, lies at `to` (2,).

    Raises InputError where nothing has a corner there, and where a part would cross itself or vanish.
    """
    near = NEAR * assembly.size
    shapes = [p.shape for p in assembly.parts if isinstance(p.shape, Polygon)]
    if len(shapes) < len(assembly.parts):
        raise InputError("Corners can be dragged in flat parts only; change solid ones in a modeller.")
    rings = [[np.array(ring) for ring in shape.rings] for shape in shapes]
    if not any(_at(ring, corner, near) is not None for part in rings for ring in part):
        raise InputError(f"No part has a corner at ({corner[0]:.6g}, {corner[1]:.6g}) m.")
    everything = np.concatenate([ring for part in rings for ring in part])
    moved = [[_moved(ring, corner, to, everything, near) for ring in part] for part in rings]
    found = []
    for part, old, new in zip(assembly.parts, shapes, moved):
        _require_sound(part.name, old, new)
        found.append(Polygon(new[0], tuple(new[1:]), old.thickness))
    return assembly.with_shapes(found)


def _moved(ring: Array, corner: Array, to: Array, others: Array, near: float) -> Array:
    k = _at(ring, corner, near)
    if k is None:
        ring, k = _with_corner(ring, corner, near)
    if k is None:
        return ring
    before, after = ring[k - 1], ring[(k + 1) % len(ring)]
    behind = _between(before, ring[k], others, near)
    ahead = _between(ring[k], after, others, near)
    return np.concatenate([ring[:k], behind, [to], ahead, ring[k + 1 :]])


def _at(ring: Array, point: Array, near: float) -> int | None:
    distance = np.linalg.norm(ring - point, axis=1)
    k = int(distance.argmin())
    return k if distance[k] <= near else None


def _with_corner(ring: Array, point: Array, near: float) -> tuple[Array, int | None]:
    """Return the ring with a corner where `point` lies on one of its edges, and its place; else as it was."""
    for k in range(len(ring)):
        start, end = ring[k], ring[(k + 1) % len(ring)]
        if len(_between(start, end, point[None], near)):
            return np.insert(ring, k + 1, point, axis=0), k + 1
    return ring, None


def _between(start: Array, end: Array, points: Array, near: float) -> Array:
    """Return which of `points` (n, 2) lie on an edge between its ends, one of each, from its start on."""
    along = end - start
    length = float(np.linalg.norm(along))
    if length <= near:
        return np.zeros((0, 2))
    unit = along / length
    arm = points - start
    place = arm @ unit
    aside = np.abs(arm[:, 0] * unit[1] - arm[:, 1] * unit[0])
    inside = np.flatnonzero((aside <= near) & (place > near) & (place < length - near))
    inside = inside[np.argsort(place[inside])]
    kept: list[int] = []
    for i in inside:
        if not kept or place[i] - place[kept[-1]] > near:
            kept.append(int(i))
    return points[kept].reshape(-1, 2)


def _require_sound(name: str, old: Polygon, rings: Sequence[Array]) -> None:
    turned = any((signed_area(new) > 0) != (signed_area(was) > 0) for new, was in zip(rings, old.rings))
    shape = None if turned else to_shapely(Polygon(rings[0], tuple(rings[1:]), old.thickness))
    if shape is None or not shapely.is_valid(shape) or shapely.area(shape) < VANISHED * shapely.area(to_shapely(old)):
        raise InputError(f"With its corner there '{name}' would cross itself or vanish; keep it inside its neighbours.")
