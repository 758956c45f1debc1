"""The closed surface of any part, for everything that draws it in space or writes it to a file of meshes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Mesh, Part, Polygon
from mocca_robot.geometry.triangulation import triangulate_loops


def surface(part: Part) -> Mesh:
    """Return the part's own mesh, or a flat part as a plate standing in the x–z plane, half on either side of it."""
    if not isinstance(part.shape, Polygon):
        return part.shape
    rings = part.shape.rings
    points = np.concatenate(rings)
    first = np.cumsum([0, *(len(r) for r in rings)])
    faces = triangulate_loops(points, [np.arange(a, b) for a, b in pairwise(first)])
    n, half = len(points), 0.5 * part.shape.thickness
    # Counter-clockwise in the drawing is counter-clockwise seen from −y, where the front is.
    front = np.stack([points[:, 0], np.full(n, -half), points[:, 1]], axis=1)
    back = front * np.array([1.0, -1.0, 1.0])
    walls = []
    for start, ring in zip(first, rings):
        a = start + np.arange(len(ring))
        b = start + (np.arange(len(ring)) + 1) % len(ring)
        walls += [np.stack([a, a + n, b], axis=1), np.stack([b, a + n, b + n], axis=1)]
    return Mesh(np.concatenate([front, back]), np.concatenate([faces, faces[:, ::-1] + n, *walls]))


def standing(points: Array) -> Array:
    """Return flat points or vectors (…, 2) in the x–z plane, (…, 3); solid ones as they are."""
    if points.shape[-1] == 3:
        return points
    return np.stack([points[..., 0], np.zeros_like(points[..., 0]), points[..., 1]], axis=-1)
