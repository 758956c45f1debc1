"""One way to hold a part, and what every search for them needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.arrays import Array, IntArray
from planners.robot.tool import ParallelGripper


@dataclass(frozen=True, eq=False)
class GraspPose:
    """One way to hold a part: TCP pose (4, 4) in the base frame with the part in its place, and its width there."""

    tcp: Array
    width_m: float
    score: float


def too_wide(width: float, gripper: ParallelGripper) -> str:
    """Return '' or why the fingers cannot hold a part of this width."""
    low, high = gripper.stroke_m
    widest = high - gripper.opening_m
    if width > widest:
        return f"wider than the fingers open ({1e3 * widest:.0f} mm with {1e3 * gripper.opening_m:.0f} mm of room)"
    return "thinner than the fingers close" if width - 0.002 < low else ""


def frame(z: Array, y: Array, origin: Array) -> Array:
    """Return the pose (4, 4) with these unit axes."""
    out = np.eye(4)
    out[:3, :3] = np.stack([np.cross(y, z), y, z], axis=1)
    out[:3, 3] = origin
    return out


def count(reasons: dict[str, int], reason: str, times: int = 1) -> None:
    """Add to the number of times that something was the reason."""
    if times:
        reasons[reason] = reasons.get(reason, 0) + times


def summary(reasons: dict[str, int]) -> str:
    """Return reasons with their counts, the most frequent first."""
    return "; ".join(f"{r} ({n}×)" for r, n in sorted(reasons.items(), key=lambda i: -i[1]))


def inner_points(inner: shapely.Geometry, centre: Array) -> list[Array]:
    """Return points of `inner`, spread over it, those nearest to `centre` first."""
    x0, y0, x1, y1 = inner.bounds
    xs, ys = (np.linspace(a, b, 9) for a, b in ((x0, x1), (y0, y1)))
    grid = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    inside = grid[shapely.contains_xy(inner, grid[:, 0], grid[:, 1])]
    nearest = shapely.get_coordinates(shapely.shortest_line(inner, shapely.Point(centre)))[0]
    points = np.concatenate([nearest[None], inside])
    order = np.argsort(np.linalg.norm(points - centre, axis=1), kind="stable")
    apart = 0.12 * float(np.hypot(x1 - x0, y1 - y0))
    return [points[k] for k in spread(points[order], apart, order)[:14]]


def spread(points: Array, apart: float, numbers: IntArray | None = None) -> list[int]:
    """Return which of `points` (n, d) to keep so that none lies nearer than `apart` to one kept before it; their
    indices, or their `numbers`.
    """
    kept: list[int] = []
    for k, point in enumerate(points):
        if not kept or np.linalg.norm(points[kept] - point, axis=1).min() >= apart:
            kept.append(k)
    return kept if numbers is None else [int(numbers[k]) for k in kept]
