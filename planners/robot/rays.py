"""Rays against a triangle mesh, many at once: which triangle is met first, and how far away."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.tolerances import ROUNDING

ALONG = 1e-15
"""Determinant (m²) below which a ray runs along its triangle."""

CHUNK = 400_000
"""Ray–triangle pairs looked at together: what fits the processor's cache."""
NEAR_M = 1e-5
"""A ray that starts on a triangle does not meet it."""


def first_hits(corners: Array, starts: Array, rays: Array) -> tuple[IntArray, Array]:
    """Return the first triangle of `corners` (f, 3, 3) that each ray from `starts` (n, 3) along `rays` (n, 3) meets,
    −1 for none, and the distance in lengths of the ray, inf for none. (Möller and Trumbore's intersection.)
    """
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(e1, e2)  # (f, 3)
    found, distance = np.full(len(rays), -1), np.full(len(rays), np.inf)
    step = max(1, CHUNK // len(corners))
    for k in range(0, len(rays), step):
        ray, start = rays[k : k + step], starts[k : k + step]
        det = -ray @ normal.T  # (n, f)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.where(np.abs(det) > ALONG, 1.0 / det, np.nan)
            # (start − a) · normal and the two edge coordinates, from products of small matrices.
            height = (start @ normal.T - (corners[:, 0] * normal).sum(axis=1)) * inverse
            moment = np.cross(start, ray)  # start × ray
            offset = corners[:, 0]
            u = (moment @ e2.T - ray @ np.cross(e2, offset).T) * inverse
            v = -(moment @ e1.T - ray @ np.cross(e1, offset).T) * inverse
            ok = (u >= -ROUNDING) & (v >= -ROUNDING) & (u + v <= 1 + ROUNDING) & (height > NEAR_M)
        height = np.where(ok, height, np.inf)
        best = np.argmin(height, axis=1)
        rows = np.arange(len(ray))
        distance[k : k + step] = height[rows, best]
        found[k : k + step] = np.where(np.isfinite(height[rows, best]), best, -1)
    return found, distance
