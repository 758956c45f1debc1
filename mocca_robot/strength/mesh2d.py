"""Flat parts → triangles that keep the outline: graded points, Delaunay, splits until every outline edge is there."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial import Delaunay, cKDTree

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Polygon
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.strength.settings import NEAR

GROWTH = 0.35
"""By how much elements may grow per distance from the outline."""
ROUNDS = 30
"""Rounds of splitting outline edges until all are there; each halves what is missing."""
SMOOTHING = 4
"""How often inner points move to the middle of their neighbours."""
CLEAR = 0.55
"""Inner points keep this share of the local size from the outline."""


class NotMeshed(Exception):
    """The part has no mesh; the text says why."""


def triangulated2d(polygon: Polygon, size: float) -> tuple[Array, IntArray]:
    """Return points (n, 2) and triangles (m, 3), counter-clockwise, with edges of at most about `size` metres.

    Raises NotMeshed where the outline's edges cannot be kept.
    """
    shape = to_shapely(polygon)
    shapely.prepare(shape)
    pieces = _outline(polygon, size)
    extent = float(np.linalg.norm(np.ptp(polygon.exterior, axis=0)))
    points, ends = _conforming(pieces, extent)
    inner = _inside(shape, points, ends, size)
    for _ in range(SMOOTHING):
        found = _kept(shape, np.vstack([points, inner]))
        inner = _smoothed(np.vstack([points, inner]), found, len(points))
    everything = np.vstack([points, inner])
    triangles = _kept(shape, everything)
    sides = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    once, counts = np.unique(sides, axis=0, return_counts=True)
    if len(once[counts == 1]) != len(ends):
        raise NotMeshed("its outline is finer than the elements can follow")
    area = 0.5 * np.abs(_double(everything, triangles)).sum()
    if abs(area - shape.area) > NEAR * shape.area:
        raise NotMeshed("its outline crosses itself")
    return everything, triangles


def _double(points: Array, triangles: IntArray) -> Array:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.asarray((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))


def _outline(polygon: Polygon, size: float) -> list[Array]:
    """Return pieces (k, 2) of every edge of the outline, none longer than `size`, from corner to corner."""
    pieces = []
    for ring in polygon.rings:
        for a, b in zip(ring, np.roll(ring, -1, axis=0)):
            count = max(1, int(np.ceil(np.linalg.norm(b - a) / size)))
            pieces.append(a + np.linspace(0.0, 1.0, count + 1)[:, None] * (b - a))
    return pieces


def _conforming(pieces: list[Array], extent: float) -> tuple[Array, IntArray]:
    """Return points (n, 2) and outline edges (m, 2), split where another point lies in an edge's own circle."""
    stacked = np.concatenate(pieces)
    _, first, index = np.unique(np.round(stacked / (NEAR * extent)), axis=0, return_index=True, return_inverse=True)
    points, index = stacked[first], index.ravel()
    starts = np.concatenate([np.arange(len(p) - 1) for p in pieces])
    offsets = np.repeat(np.cumsum([0, *(len(p) for p in pieces[:-1])]), [len(p) - 1 for p in pieces])
    ends = np.stack([index[starts + offsets], index[starts + offsets + 1]], axis=1)
    for _ in range(ROUNDS):
        middles = points[ends].mean(axis=1)
        radii = 0.5 * np.linalg.norm(points[ends[:, 1]] - points[ends[:, 0]], axis=1)
        nearest, _ = cKDTree(points).query(middles)
        bad = nearest < (1.0 - NEAR) * radii
        if not bad.any():
            return points, ends
        fresh = len(points) + np.arange(int(bad.sum()))
        points = np.vstack([points, middles[bad]])
        halves = [np.stack([ends[bad, 0], fresh], axis=1), np.stack([fresh, ends[bad, 1]], axis=1)]
        ends = np.vstack([ends[~bad], *halves])
    raise NotMeshed("its outline has corners too sharp for elements")


def _inside(shape: shapely.Geometry, points: Array, ends: IntArray, size: float) -> Array:
    """Return inner points: centres of squares that are cut in four until they are as small as the outline asks."""
    lengths = np.linalg.norm(points[ends[:, 1]] - points[ends[:, 0]], axis=1)
    local = np.full(len(points), np.inf)
    np.minimum.at(local, ends.ravel(), np.repeat(lengths, 2))
    tree = cKDTree(points)
    low, high = points.min(axis=0), points.max(axis=0)
    counts = np.maximum(1, np.ceil((high - low) / size)).astype(int)
    x, y = (low[k] + (np.arange(counts[k]) + 0.5) * (high[k] - low[k]) / counts[k] for k in range(2))
    centres = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    half = np.tile(0.5 * (high - low) / counts, (len(centres), 1))
    done = []
    while len(centres):
        distance, nearest = (np.asarray(x) for x in tree.query(centres, k=min(4, len(points))))
        wanted = np.minimum(size, (local[nearest] + GROWTH * distance).min(axis=1))
        large = 2.0 * half.max(axis=1) > 1.3 * wanted
        fits = ~large & (distance[:, 0] > CLEAR * wanted) & shapely.contains_xy(shape, *centres.T)
        done.append(centres[fits])
        corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) * 0.5
        half = np.repeat(0.5 * half[large], 4, axis=0)
        centres = np.repeat(centres[large], 4, axis=0) + 2.0 * np.tile(corners, (int(large.sum()), 1)) * half
    return np.concatenate(done)


def _kept(shape: shapely.Geometry, points: Array) -> IntArray:
    """Return the Delaunay triangles inside the outline, counter-clockwise."""
    triangles = Delaunay(points).simplices.astype(np.int64)
    double = _double(points, triangles)
    triangles[double < 0.0] = triangles[double < 0.0][:, ::-1]
    inside = shapely.contains_xy(shape, *points[triangles].mean(axis=1).T)
    return np.asarray(triangles[inside & (np.abs(double) > NEAR**2 * np.ptp(points, axis=0).max() ** 2)])


def _smoothed(points: Array, triangles: IntArray, fixed: int) -> Array:
    """Return the points from `fixed` on, each in the middle of its neighbours."""
    a = triangles[:, [0, 1, 2, 1, 2, 0]].ravel(order="F")
    b = triangles[:, [1, 2, 0, 0, 1, 2]].ravel(order="F")
    sums = np.zeros_like(points)
    np.add.at(sums, a, points[b])
    count = np.bincount(a, minlength=len(points))[:, None]
    moved = np.where(count > 0, sums / np.maximum(count, 1), points)
    return moved[fixed:]
