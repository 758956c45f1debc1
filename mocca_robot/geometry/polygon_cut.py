"""Polygons in space → triangles, cut by their shape alone.

Two parts that share a polygon store it from different corners and in opposite senses, with the last digits rounded
differently. Where it is warped, each cut makes another surface; so the cut depends on lengths, and where these are
equal, on where the corners lie.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.geometry.frames import tangents
from mocca_robot.tolerances import ROUNDING, TINY

CROSSES = 1e-14
"""Sine of an angle between two planes, times the size squared, below which they have no line in common."""

TIE = 1e-5
"""Diagonals whose lengths differ by a smaller share are equally long."""
FLAT = 1e-9
"""Share of a polygon's size up to which it is flat, so that any cut makes the same surface."""
LONG = 64
"""Corners from which a polygon is cut flat, whatever its shape: choosing each cut takes the square of their number."""
_COMPASS = np.array([0.5572, 0.6831, 0.4721])
"""A direction that no face of a drawing is likely to be square to."""


def triangulated(vertices: Array, faces: Sequence[Sequence[int]]) -> tuple[IntArray, IntArray]:
    """Return triangles (F, 3) that fill polygons given by the indices of their corners, and each one's polygon (F,).

    Triangles come in the order of the polygons. Corners
    that follow themselves count once; polygons with fewer than three are left out.
    """
    if not faces:
        return np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64)
    size = np.fromiter(map(len, faces), dtype=np.int64, count=len(faces))
    flat = np.fromiter(chain.from_iterable(faces), dtype=np.int64, count=int(size.sum()))
    start = np.cumsum(size) - size
    three, four = np.flatnonzero(size == 3), np.flatnonzero(size == 4)
    pieces = [flat[start[three, None] + np.arange(3)]]
    owner = [three]
    if len(four):
        pieces.append(_quads(vertices, flat[start[four, None] + np.arange(4)]).reshape(-1, 3))
        owner.append(np.repeat(four, 2))
    for k in np.flatnonzero(size > 4):
        cut = _polygon(vertices, flat[start[k] : start[k] + size[k]])
        pieces.append(cut)
        owner.append(np.full(len(cut), k))
    order = np.argsort(np.concatenate(owner), kind="stable")
    return np.concatenate(pieces)[order], np.concatenate(owner)[order]


def _quads(vertices: Array, quads: IntArray) -> IntArray:
    """Return (Q, 2, 3) triangles of quadrilaterals (Q, 4)."""
    p = vertices[quads]
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    worst = [_worst(p, normal, cut) for cut in (((0, 1, 2), (0, 2, 3)), ((1, 2, 3), (1, 3, 0)))]
    lengths = np.linalg.norm(np.stack([p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]]), axis=2)
    reach = p @ _COMPASS
    tie = np.abs(lengths[0] - lengths[1]) <= TIE * lengths.max(axis=0)
    shorter = np.where(tie, reach.argmax(axis=1) % 2 == 1, lengths[1] < lengths[0])
    # A cut outside a quadrilateral that bends in turns a triangle over.
    folded = [w <= ROUNDING for w in worst]
    second = np.where(folded[0] == folded[1], shorter, folded[0])
    q = np.where(second[:, None], np.roll(quads, -1, axis=1), quads)
    return np.stack([q[:, [0, 1, 2]], q[:, [0, 2, 3]]], axis=1)


def _worst(p: Array, normal: Array, cut: tuple[tuple[int, int, int], ...]) -> Array:
    """Return (Q,) the lesser share of the quadrilateral's area vector that the two triangles of a cut have."""
    scale = np.maximum(np.einsum("ij,ij->i", normal, normal), TINY)
    areas = [np.einsum("ij,ij->i", np.cross(p[:, b] - p[:, a], p[:, c] - p[:, a]), normal) for a, b, c in cut]
    return np.asarray(np.minimum(*areas) / scale)


def _polygon(vertices: Array, face: IntArray) -> IntArray:
    """Return the triangles of one polygon of five or more corners."""
    face = face[face != np.roll(face, 1)]
    if len(face) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    points = vertices[face]
    relative = points - points.mean(axis=0)
    normal = np.cross(relative, np.roll(relative, -1, axis=0)).sum(axis=0)
    length = float(np.linalg.norm(normal))
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if length <= CROSSES * size**2:
        return np.array([[face[0], face[k], face[k + 1]] for k in range(1, len(face) - 1)])
    normal /= length
    flat = relative @ tangents(normal).T
    if len(face) > LONG or np.abs(relative @ normal).max() <= FLAT * size:
        return face[_flat_cut(flat)]
    found = _ears(points, flat)
    return face[_flat_cut(flat) if found is None else found]


def _flat_cut(flat: Array) -> IntArray:
    """Return triangles, as indices, of a flat polygon (n, 2) that turns left; every corner keeps its edges."""
    from mocca_robot.geometry.triangulation import triangulate_loops

    if len(np.unique(flat, axis=0)) == len(flat):
        cut = triangulate_loops(flat, [np.arange(len(flat))])
        if len(cut) == len(flat) - 2:
            return cut
    import mapbox_earcut

    cut = np.asarray(mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], dtype=np.uint32)), dtype=np.int64)
    cut = cut.reshape(-1, 3)
    a, b = flat[cut[:, 1]] - flat[cut[:, 0]], flat[cut[:, 2]] - flat[cut[:, 0]]
    return np.where((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0)[:, None], cut[:, ::-1], cut)


def _ears(points: Array, flat: Array) -> IntArray | None:
    """Return triangles, as indices, of a warped polygon: the ear with the shortest cut goes first; None if none is."""
    left = list(range(len(points)))
    reach = points @ _COMPASS
    found = []
    while len(left) > 3:
        best: tuple[float, float, int] | None = None
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            if not _is_ear(flat, a, b, c, left):
                continue
            length = float(np.linalg.norm(points[c] - points[a]))
            if best is None or length < best[0] * (1 - TIE) or (length < best[0] * (1 + TIE) and reach[b] > best[1]):
                best = length, float(reach[b]), k
        if best is None:
            return None
        k = best[2]
        found.append([left[k - 1], left[k], left[(k + 1) % len(left)]])
        del left[k]
    return np.array([*found, left])


def _is_ear(flat: Array, a: int, b: int, c: int, left: Sequence[int]) -> bool:
    """Return whether the triangle a, b, c turns left and holds no other corner."""
    p, q, r = flat[a], flat[b], flat[c]
    if _cross(p, q, r) <= ROUNDING * float((r - p) @ (r - p)):
        return False
    others = flat[[v for v in left if v not in (a, b, c)]]
    sides = np.stack([_cross(u, v, others) for u, v in ((p, q), (q, r), (r, p))])
    return not bool((sides >= 0).all(axis=0).any())


def _cross(p: Array, q: Array, r: Array) -> Array:
    d, e = q - p, r - p
    return np.asarray(d[0] * e[..., 1] - d[1] * e[..., 0])
