"""Where flat rigid parts touch, or nearly, wherever they have got to: corners of one against edges of another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.tolerances import COARSE, ROUNDING

NEAR = 0.06
"""Corners and edges nearer than this share of the size may meet within a step."""
DEEP = 1e-3
"""A corner deeper inside than this share of the size has come there past another edge."""
BESIDE = 1e-4
"""Share of the size by which a corner may lie beyond an edge's end and still rest on it: hinges wander."""
OPPOSED = 1e-3
"""Difference of cosines from which on one of two edges faces a corner more squarely."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Touches:
    """C corners near edges.

    Attributes:
        corner, edge: (C,) parts on either side.
        points: (C, 2) the corners, metres.
        normals: (C, 2) of the edges, out of their parts.
        gaps: (C,) metres.
    """

    corner: IntArray
    edge: IntArray
    points: Array
    normals: Array
    gaps: Array


def touches(rings: Sequence[Array], free: BoolArray, size: float) -> Touches:
    """Return what may touch of parts with `rings`, counter-clockwise (n, 2), of which `free` (N,) can move.

    Of two edges that meet in a corner pointing out, one keeps another part's corner away; of two that meet in one
    pointing in, both do.
    """
    polygons = [shapely.Polygon(ring) for ring in rings]
    first, second = shapely.STRtree(polygons).query(polygons, predicate="dwithin", distance=NEAR * size)
    sides = [_Sides.of(ring) for ring in rings]
    found = [
        (i, j, *touch)
        for i, j in zip(first.tolist(), second.tolist(), strict=True)
        if i != j and (free[i] or free[j])
        for touch in _between(sides[i], sides[j], size)
    ]
    return Touches(
        corner=read_only([f[0] for f in found], np.int64),
        edge=read_only([f[1] for f in found], np.int64),
        points=read_only(np.reshape([f[2] for f in found], (-1, 2))),
        normals=read_only(np.reshape([f[3] for f in found], (-1, 2))),
        gaps=read_only([f[4] for f in found]),
    )


@dataclass(frozen=True, eq=False)
class _Sides:
    """Edges of a ring, each from its corner on: starts (n, 2), unit directions, lengths, outward normals; and (n,) the
    sine by which the ring turns at each corner."""

    starts: Array
    along: Array
    lengths: Array
    normals: Array
    turns: Array

    @staticmethod
    def of(ring: Array) -> _Sides:
        edges = np.roll(ring, -1, axis=0) - ring
        lengths = np.linalg.norm(edges, axis=1)
        along = edges / lengths[:, None]
        before = np.roll(along, 1, axis=0)
        turns = before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]
        return _Sides(ring, along, lengths, np.stack([along[:, 1], -along[:, 0]], axis=1), turns)


def _between(corners: _Sides, edges: _Sides, size: float) -> Iterator[tuple[Array, Array, float]]:
    """Yield point, normal and gap of every corner of one part that an edge of the other keeps away."""
    for k in np.flatnonzero(corners.turns > -ROUNDING):
        point = corners.starts[k]
        far = ((point - edges.starts) * edges.along).sum(axis=1)
        gap = ((point - edges.starts) * edges.normals).sum(axis=1)
        facing = (np.stack([corners.normals[k - 1], corners.normals[k]]) @ edges.normals.T).min(axis=0)
        beside = (far > -BESIDE * size) & (far < edges.lengths + BESIDE * size)
        near = (gap < NEAR * size) & (gap > -DEEP * size)
        meets = np.flatnonzero(beside & near & (facing < -COARSE))
        for edge in _deciding(meets, edges.turns, gap, facing, size):
            yield point, edges.normals[edge], float(gap[edge])


def _deciding(meets: IntArray, turns: Array, gap: Array, facing: Array, size: float) -> list[int]:
    """Return which of the edges that a corner may meet keep it away: of two around a corner pointing out only one."""
    kept = set(meets.tolist())
    for edge in meets.tolist():
        before = (edge - 1) % len(turns)
        if edge in kept and before in kept and turns[edge] > ROUNDING:
            alike = abs(gap[edge] - gap[before]) <= DEEP * size
            squarely = facing[edge] - facing[before]
            if alike and abs(squarely) > OPPOSED:
                kept.discard(edge if squarely > 0.0 else before)
            else:
                kept.discard(edge if gap[edge] < gap[before] else before)
    return sorted(kept)
