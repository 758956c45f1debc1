"""Where a parallel gripper can hold a part: two opposite faces, near enough, with room for the hand.

Flat parts stand upright and are held across their thickness: the fingers pass in front of and behind the structure, so
neighbours in the plane are only in the way where a finger lies over them. Solid parts are held where two opposite
faces look away from each other. A grasp is the pose of the tool's centre point when the part is in its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.assembly import Array, Mesh, Polygon
from mocca_robot.contacts import to_shapely
from planners.cell import Gripper, RobotCell
from planners.site import Site

LEANS_RAD = tuple(np.deg2rad([0.0, 20.0, -20.0, 40.0, -40.0, 60.0, -60.0]))
"""How far the tool leans from pointing straight down, in the order tried."""
SAMPLES = 800
"""Points tried on the surface of a solid part."""
ANTIPODAL = float(np.cos(np.deg2rad(20.0)))
"""Faces whose normals differ by less from opposite can be held: well inside the friction of rubber pads."""


@dataclass(frozen=True, eq=False)
class GraspPose:
    """One way to hold a part: TCP pose (4, 4) in the base frame with the part in its place, and its width there."""

    tcp: Array
    width_m: float
    score: float


@dataclass(frozen=True)
class GraspSearch:
    """Grasps, best first, and why the others that were tried are none: reason → how many."""

    grasps: tuple[GraspPose, ...]
    rejected: dict[str, int]


def find_grasps(
    site: Site, part: int, cell: RobotCell, *, limit: int = 200, rng: np.random.Generator | None = None
) -> GraspSearch:
    """Return up to `limit` grasps of a part; `rng` chooses the points that are tried on solid parts."""
    shape = site.assembly.parts[part].shape
    if isinstance(shape, Polygon):
        found, rejected = _across_flat(site, shape, cell.gripper)
    else:
        found, rejected = _across_solid(site, shape, cell.gripper, rng or np.random.default_rng(0))
    return GraspSearch(tuple(sorted(found, key=lambda g: g.score)[:limit]), rejected)


def _too_wide(width: float, gripper: Gripper) -> str:
    low, high = gripper.stroke_m
    widest = high - gripper.opening_m
    if width > widest:
        return f"wider than the fingers open ({1e3 * widest:.0f} mm with {1e3 * gripper.opening_m:.0f} mm of room)"
    return "thinner than the fingers close" if width - 0.002 < low else ""


def _across_flat(site: Site, shape: Polygon, gripper: Gripper) -> tuple[list[GraspPose], dict[str, int]]:
    reason = _too_wide(shape.thickness, gripper)
    if reason:
        return [], {reason: 1}
    outline = to_shapely(shape)
    inner = outline.buffer(-gripper.pad_radius_m)
    if inner.is_empty:
        return [], {f"nowhere as wide as the pads ({2e3 * gripper.pad_radius_m:.0f} mm)": 1}
    across = np.cross(site.turn[:, 0], site.turn[:, 1])
    found: list[GraspPose] = []
    rejected: dict[str, int] = {}
    size = float(np.linalg.norm(shape.bounds[1] - shape.bounds[0]))
    room = gripper.tcp_offset[2] - gripper.palm_m[1, 2] - 0.003
    half = float(gripper.palm_m[1, 0]) + 0.003
    for point in _inner_points(inner, shape.centroid):
        for lean in LEANS_RAD:
            down = np.array([np.sin(lean), -np.cos(lean)])
            side = np.array([down[1], -down[0]])
            strip = shapely.Polygon(
                [
                    point - half * side,
                    point + half * side,
                    *(point + s * half * side - 2.0 * size * down for s in (1.0, -1.0)),
                ]
            )
            above = shapely.intersection(outline, strip)
            corners = shapely.get_coordinates(above)
            if len(corners) and float(((corners - point) @ -down).max()) > room:
                _count(rejected, "deeper inside the part than the fingers are long")
                continue
            away = float(np.linalg.norm(point - shape.centroid)) / size
            for sign in (1.0, -1.0):
                found.append(
                    GraspPose(
                        _frame(site.turn @ down, sign * across, site.point(point)),
                        shape.thickness,
                        away + 0.3 * abs(lean) + (0.01 if sign < 0 else 0.0),
                    )
                )
    return found, rejected


def _inner_points(inner: shapely.Geometry, centre: Array) -> list[Array]:
    """Return points of `inner`, spread over it, those nearest to `centre` first."""
    x0, y0, x1, y1 = inner.bounds
    xs, ys = (np.linspace(a, b, 9) for a, b in ((x0, x1), (y0, y1)))
    grid = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    inside = grid[shapely.contains_xy(inner, grid[:, 0], grid[:, 1])]
    nearest = shapely.get_coordinates(shapely.shortest_line(inner, shapely.Point(centre)))[0]
    points = np.concatenate([nearest[None], inside])
    order = np.argsort(np.linalg.norm(points - centre, axis=1), kind="stable")
    chosen: list[Array] = []
    apart = 0.12 * float(np.hypot(x1 - x0, y1 - y0))
    for k in order:
        if all(np.linalg.norm(points[k] - c) >= apart for c in chosen):
            chosen.append(points[k])
    return chosen[:14]


def _across_solid(
    site: Site, shape: Mesh, gripper: Gripper, rng: np.random.Generator
) -> tuple[list[GraspPose], dict[str, int]]:
    vertices = site.point(shape.vertices)
    corners = vertices[shape.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(area, 1e-300)[:, None]
    centre = vertices.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    found: list[GraspPose] = []
    rejected: dict[str, int] = {}
    for face in rng.choice(len(area), size=SAMPLES, p=area / area.sum()):
        weights = rng.dirichlet(np.ones(3))
        start, inward = weights @ corners[face], -normal[face]
        hit = _far_side(corners, start, inward)
        if hit is None:
            continue
        other, width = hit
        if normal[other] @ inward < ANTIPODAL:
            _count(rejected, "the opposite face is not parallel")
            continue
        reason = _too_wide(width, gripper)
        if reason:
            _count(rejected, reason)
            continue
        middle = start + 0.5 * width * inward
        for down in _perpendicular_downs(inward):
            frame = _frame(down, inward, middle)
            if _hand_meets(vertices, corners, frame, gripper, width):
                _count(rejected, "the hand would touch the part")
                continue
            away = float(np.linalg.norm(middle - centre)) / size
            found.append(GraspPose(frame, width, away + 0.3 * float(np.arccos(np.clip(-down[2], -1, 1)))))
    return found, rejected


def _far_side(corners: Array, start: Array, ray: Array) -> tuple[int, float] | None:
    """Return the first face that a ray from a face's inside meets, and how far away."""
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(ray, e2)
    det = np.einsum("ij,ij->i", e1, p)
    safe = np.where(np.abs(det) > 1e-15, det, np.inf)
    t = start - corners[:, 0]
    u = np.einsum("ij,ij->i", t, p) / safe
    q = np.cross(t, e1)
    v = q @ ray / safe
    distance = np.einsum("ij,ij->i", e2, q) / safe
    ok = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (distance > 1e-4)
    if not ok.any():
        return None
    k = int(np.argmin(np.where(ok, distance, np.inf)))
    return k, float(distance[k])


def _perpendicular_downs(closing: Array) -> list[Array]:
    """Return tool directions across `closing`, the one that points down most first; none points up."""
    down = np.array([0.0, 0.0, -1.0])
    first = down - (down @ closing) * closing
    if np.linalg.norm(first) < 0.2:
        return []
    first /= np.linalg.norm(first)
    second = np.cross(closing, first)
    ways = [np.cos(a) * first + np.sin(a) * second for a in LEANS_RAD]
    return [w for w in ways if w[2] < -0.3]


def _hand_meets(vertices: Array, corners: Array, frame: Array, gripper: Gripper, width: float) -> bool:
    """Return whether corners or face centres of the part lie in the palm or in a finger, fingers open."""
    points = np.concatenate([vertices, corners.mean(axis=1)])
    local = (points - frame[:3, 3]) @ frame[:3, :3] + np.asarray(gripper.tcp_offset[:3])
    palm = (local > gripper.palm_m[0] - 0.003).all(axis=1) & (local < gripper.palm_m[1] + 0.003).all(axis=1)
    opened = 0.5 * (width + gripper.opening_m)
    outward = np.stack([local[:, 0], np.abs(local[:, 1]) - opened, local[:, 2]], axis=1)
    finger = (outward > gripper.finger_m[0]).all(axis=1) & (outward < gripper.finger_m[1]).all(axis=1)
    return bool(palm.any() or finger.any())


def _frame(z: Array, y: Array, origin: Array) -> Array:
    out = np.eye(4)
    out[:3, :3] = np.stack([np.cross(y, z), y, z], axis=1)
    out[:3, 3] = origin
    return out


def _count(reasons: dict[str, int], reason: str) -> None:
    reasons[reason] = reasons.get(reason, 0) + 1


def summary(reasons: dict[str, int] | Sequence[str]) -> str:
    """Return reasons with their counts, the most frequent first."""
    counts: dict[str, int] = dict(reasons) if isinstance(reasons, dict) else {}
    if not isinstance(reasons, dict):
        for r in reasons:
            _count(counts, r)
    return "; ".join(f"{r} ({n}×)" for r, n in sorted(counts.items(), key=lambda i: -i[1]))
