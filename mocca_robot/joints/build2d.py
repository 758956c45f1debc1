"""Flat parts with joints cut in: both neighbours get the same points, so there is neither gap nor overlap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.joints.joint import Joint
from mocca_robot.tolerances import TOLERANCES, Tolerances


def build_parts_2d(assembly: Assembly, joints: Sequence[Joint], tolerances: Tolerances = TOLERANCES) -> Assembly:
    """Return `assembly` with every joint's curve in place of its contact, exactly shared by both parts.

    Corners closer than the contact tolerance are welded to one coordinate first, also between parts that only
    touch in planar contacts, so that the built geometry is exact even where the drawing was not.
    """
    gap = 2.0 * tolerances.contact_gap * assembly.size
    rings = [ring for part in assembly.parts for ring in _polygon(part.shape).rings]
    ends = [j.contact.polygon for j in joints]
    weld = _Weld(np.concatenate([*ends, *rings]) if ends else np.concatenate(rings), gap)
    curves: list[list[tuple[Array, Array]]] = [[] for _ in assembly.parts]
    for joint in joints:
        points = np.concatenate([weld(joint.vertices[:1]), joint.vertices[1:-1], weld(joint.vertices[-1:])])
        i, j = joint.contact.parts
        curves[i].append((joint.contact.polygon, points))
        curves[j].append((joint.contact.polygon[::-1], points[::-1]))
    shapes = []
    for part, mine in zip(assembly.parts, curves):
        shape = _polygon(part.shape)
        built = [_with_curves(ring, mine, weld, gap) for ring in shape.rings]
        shapes.append(Polygon(built[0], tuple(built[1:]), shape.thickness))
    return assembly.with_shapes(shapes)


class _Weld:
    """Maps points to one representative per cluster; the first point of a cluster is its representative."""

    def __init__(self, points: Array, gap: float) -> None:
        tree = KDTree(points)
        representative = np.arange(len(points))
        pairs = tree.query_pairs(gap, output_type="ndarray")
        for low, high in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]:
            representative[high] = min(representative[high], representative[low])
        self._tree, self._targets, self._gap = tree, points[representative], gap

    def __call__(self, points: Array) -> Array:
        _, index = self._tree.query(points)
        return np.asarray(self._targets[index])


def _with_curves(ring: Array, curves: Sequence[tuple[Array, Array]], weld: _Weld, gap: float) -> Array:
    following = np.roll(ring, -1, axis=0)
    length = np.linalg.norm(following - ring, axis=1)
    t = (following - ring) / length[:, None]
    outward = np.stack([t[:, 1], -t[:, 0]], axis=1)
    on_edge: dict[int, list[tuple[float, Array]]] = {}
    for segment, points in curves:
        offset = segment[None] - ring[:, None]  # (edges, 2, 2)
        along = np.einsum("esd,ed->es", offset, t)
        off = np.abs(np.einsum("esd,ed->es", offset, outward)).max(axis=1)
        forward = (along[:, 0] < along[:, 1]) & (along[:, 0] >= -gap) & (along[:, 1] <= length + gap)
        for k in np.flatnonzero(forward & (off <= gap)):
            on_edge.setdefault(int(k), []).append((float(along[k, 0]), points))
    corners = weld(ring)
    pieces: list[Array] = []
    for edge in range(len(ring)):
        pieces.append(corners[edge : edge + 1])
        pieces.extend(points for _, points in sorted(on_edge.get(edge, ()), key=lambda item: item[0]))
    points = np.concatenate(pieces)
    repeated = (points == np.roll(points, 1, axis=0)).all(axis=1)
    return np.asarray(points[~repeated])


def _polygon(shape: object) -> Polygon:
    assert isinstance(shape, Polygon)
    return shape
