"""Motion space of a joint: generalized normals, their conic hull, its dual, and finite pictures of both.

Eq. 1: V = {v : n·v ≥ 0 for all n in N} with n = [n̂; r × n̂]. V is the dual of cone(N) (Theorem 3.1), so only
the extreme rays of cone(N) matter (Lemma 3.3), and everything that asks about motion asks them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog, nnls
from scipy.spatial import ConvexHull, QhullError

from mocca_robot.arrays import Array, IntArray, read_only
from mocca_robot.tolerances import COARSE, EXACT, ROUNDING, TINY

WELL_INSIDE = 1e-3
"""Cosine that the mean of rays has to every one of them to be a cut plane without further search."""


def cross(r: Array, n: Array) -> Array:
    """Return r × n rowwise: (m,) → (m, 1) in 2D, (m, 3) in 3D."""
    if r.shape[-1] == 2:
        return np.asarray((r[..., 0] * n[..., 1] - r[..., 1] * n[..., 0])[..., None])
    return np.cross(r, n)


def generalized_normals(points: Array, normals: Array, about: Array | None = None, length: float = 1.0) -> Array:
    """Return (m, 3) or (m, 6) rows [n̂; (r − about) × n̂ / length] (Eq. 1).

    `length` makes the rotational part dimensionless; with 1 it is in metres.
    """
    r = points if about is None else points - about
    return np.concatenate([normals, cross(r, normals) / length], axis=-1)


def extreme_rays(rays: Array, tolerance: float = 1e-9) -> IntArray:
    """Return the indices of rays that generate the same cone as all of `rays` (m, d); sorted.

    Works on the conic section: for a pointed cone a cut plane exists whose slice is a polytope, and the
    slice's vertices are the extreme rays. A cone that is not pointed keeps all rays but exact repeats.
    """
    scale = np.linalg.norm(rays, axis=1)
    unit = rays / np.maximum(scale, TINY)[:, None]
    _, first = np.unique(np.round(unit / EXACT), axis=0, return_index=True)
    first = np.sort(first[scale[first] > 0]).astype(np.int64)
    plane = cut_plane(unit[first])
    if plane is None:
        return first
    section = unit[first] / (unit[first] @ plane)[:, None]
    centred = section - section.mean(axis=0)
    _, spread, axes = np.linalg.svd(centred, full_matrices=False)
    rank = int((spread > tolerance * max(spread[0], TINY)).sum()) if spread.size and spread[0] > tolerance else 0
    if rank == 0:
        return first[:1]
    flat = centred @ axes[:rank].T
    if rank == 1:
        ends = np.array([np.argmin(flat[:, 0]), np.argmax(flat[:, 0])])
        return np.sort(first[ends])
    if len(flat) <= rank + 1:
        return first
    try:
        return np.sort(first[ConvexHull(flat).vertices])
    except QhullError:
        return first


def cut_plane(rays: Array) -> Array | None:
    """Return a unit vector c with c·r > 0 for all rays (m, d), far from the rim; None if the cone is not pointed.

    A linear program maximises the smallest c·r over the box |c| ≤ 1.
    """
    mean = rays.mean(axis=0)
    norm = np.linalg.norm(mean)
    if norm > 0 and (rays @ mean).min() > WELL_INSIDE * norm:
        return np.asarray(mean / norm)
    m, d = rays.shape
    result = linprog(
        np.r_[np.zeros(d), -1.0],
        A_ub=np.c_[-rays, np.ones(m)],
        b_ub=np.zeros(m),
        bounds=[(-1, 1)] * d + [(None, 1)],
        method="highs",
    )
    if not result.success or result.x is None or result.x[-1] <= ROUNDING:
        return None
    return np.asarray(result.x[:d] / np.linalg.norm(result.x[:d]))


@dataclass(frozen=True, eq=False)
class MotionCone:
    """The cone V of infinitesimal motions that generalized normals (m, d) leave open: {v : normals·v ≥ 0}."""

    normals: Array

    def contains(self, motion: Array, tolerance: float = 1e-9) -> bool:
        """Return whether `motion` (d,) does not penetrate."""
        return bool((self.normals @ motion).min(initial=np.inf) >= -tolerance * np.linalg.norm(motion))

    def translational(self) -> MotionCone:
        """Return the cone of pure translations, T(V) in Eq. 11."""
        d = 2 if self.normals.shape[1] <= 3 else 3
        return MotionCone(read_only(self.normals[:, :d]))


def distance_to_cone(rays: Array, target: Array) -> tuple[float, Array]:
    """Return |target − Σ λ_l rays_l| minimised over λ ≥ 0, and λ (Eq. 19, not squared)."""
    weights, distance = nnls(rays.T, target)
    return float(distance), weights


def largest_cone(normals: Array) -> tuple[float, Array]:
    """Return (α, a): the widest circular cone K(a, α) of translations with n̂·x ≥ 0, radians and unit axis.

    `normals` is (m, 2 | 3). α is negative when no direction is free: then −α says how deep the best one is
    blocked. With no normals every direction is free, α = π/2 about the last axis.
    """
    d = normals.shape[1] if normals.ndim == 2 else 2
    if len(normals) == 0:
        axis = np.zeros(d)
        axis[-1] = 1.0
        return float(np.pi / 2), axis
    centre, radius = _smallest_cap(normals)
    return float(np.pi / 2 - radius), centre


def _smallest_cap(normals: Array) -> tuple[Array, float]:
    """Return axis and angular radius of the smallest spherical cap that holds all unit `normals`."""
    if normals.shape[1] == 2:
        angles = np.sort(np.arctan2(normals[:, 1], normals[:, 0]))
        gaps = np.diff(np.r_[angles, angles[0] + 2 * np.pi])
        widest = int(np.argmax(gaps))
        span = 2 * np.pi - gaps[widest]
        middle = angles[(widest + 1) % len(angles)] + span / 2
        return np.array([np.cos(middle), np.sin(middle)]), float(span / 2)
    return _smallest_cap_3d(normals)


def _smallest_cap_3d(normals: Array) -> tuple[Array, float]:
    """The axis that maximises min n̂·a is the nearest hull point when the normals fit in an open half sphere;
    otherwise a linear program over the box gives the least blocked direction.
    """
    candidates = normals[extreme_rays(normals)] if len(normals) > 8 else normals
    plane = cut_plane(candidates)
    if plane is None:
        result = linprog(
            np.r_[np.zeros(3), -1.0],
            A_ub=np.c_[-candidates, np.ones(len(candidates))],
            b_ub=np.zeros(len(candidates)),
            bounds=[(-1, 1)] * 3 + [(None, None)],
            method="highs",
        )
        axis = np.zeros(3) if result.x is None else result.x[:3]
        if np.linalg.norm(axis) <= ROUNDING:
            axis = _sliding_direction(candidates)
        axis = axis / np.linalg.norm(axis)
        return np.asarray(axis), float(np.arccos(np.clip((candidates @ axis).min(), -1, 1)))
    axis = _nearest_hull_point(candidates)
    axis = axis / np.linalg.norm(axis)
    return axis, float(np.arccos(np.clip((candidates @ axis).min(), -1, 1)))


def _sliding_direction(normals: Array) -> Array:
    """Return a direction (3,) that slides along walls on all sides, as out of a mortise; up when nothing is free."""
    opening = linprog(
        -normals.sum(axis=0), A_ub=-normals, b_ub=np.full(len(normals), EXACT), bounds=[(-1, 1)] * 3, method="highs"
    )
    if opening.success and opening.x is not None and np.linalg.norm(opening.x) > COARSE:
        return np.asarray(opening.x)
    _, spread, axes = np.linalg.svd(normals, full_matrices=True)
    if len(spread) < 3 or spread[-1] <= ROUNDING * spread[0]:
        return np.asarray(axes[-1])
    return np.array([0.0, 0.0, 1.0])


def _nearest_hull_point(points: Array) -> Array:
    """Return the point of the convex hull of unit `points` (m, 3) nearest the origin; it points along the axis.

    With λ = t·μ, Σμ = 1, the NNLS objective |Pλ|² + (Σλ − 1)² minimised over t is |Pμ|²/(1 + |Pμ|²), so its μ is
    that of the nearest point.
    """
    rows = np.vstack([points.T, np.ones(len(points))])
    weights, _ = nnls(rows, np.r_[np.zeros(3), 1.0])
    return np.asarray(points.T @ weights / weights.sum())
