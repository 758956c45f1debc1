"""Where a suction cup can hold a part: the surface under its lip is even, and the vacuum holds what pulls there."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.assembly import Mesh, Polygon
from mocca_robot.geometry.frames import tangents
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.tolerances import TINY
from planners.robot.grasp_pose import GraspPose, count, frame, inner_points, spread
from planners.robot.rays import first_hits
from planners.robot.site import Site
from planners.robot.tool import SuctionGripper

SAMPLES = 160
"""Points tried on the surface of a solid part at once."""
ROUNDS = 5
"""How often as many are tried again while few of them are even."""
RIM = 8
"""Points of the lip that are looked at."""
STEEPEST = 0.35
"""Largest slope between a face and the plane that fits the lip around it."""
RISE_M = 0.01
"""Rays towards the surface start this far above it."""
NOT_BELOW = 0.35
"""Largest upward component of the tool's direction: a little more than pointing sideways."""
ROLLS_RAD = (0.0, np.pi / 2, np.pi, -np.pi / 2)
"""Turns of the hand about the cup, which itself does not care."""


def on_solid(
    site: Site, shape: Mesh, gripper: SuctionGripper, rng: np.random.Generator, rejected: dict[str, int]
) -> list[GraspPose]:
    """Return the grasps of a solid part; why other places are none is added to `rejected`."""
    vertices = site.point(shape.vertices)
    corners = vertices[shape.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(area, TINY)[:, None]
    above = normal[:, 2] > -NOT_BELOW
    if not above.any():
        count(rejected, "every face looks down")
        return []
    weight = np.where(above, area, 0.0)
    points, normals = [], []
    for _ in range(ROUNDS):
        face = rng.choice(len(area), size=SAMPLES, p=weight / weight.sum())
        drawn = np.einsum("nk,nkd->nd", rng.dirichlet(np.ones(3), SAMPLES), corners[face])
        first = _supported(corners, drawn, normal[face], gripper)
        drawn, face = drawn[first], face[first]
        good, mean, height = _even(corners, drawn, normal[face], gripper)
        count(rejected, "uneven under the cup", SAMPLES - int(good.sum()))
        points.append(drawn[good] + height[good, None] * mean[good])
        normals.append(mean[good])
        if sum(map(len, points)) >= SAMPLES // 2:
            break
    point, outward = np.concatenate(points), np.concatenate(normals)
    centre = vertices.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    # How far beside the line through the middle of the part the cup pulls, and how far from straight down it points.
    off = np.linalg.norm(np.cross(point - centre, outward), axis=1) / size
    order = np.argsort(off, kind="stable")
    kept = spread(np.hstack([point, 0.3 * size * outward])[order], 0.1 * size, order)[:40]
    return [
        GraspPose(pose, 0.0, float(off[k]) + 0.1 * float(np.arccos(np.clip(outward[k, 2], -1.0, 1.0))) + 0.005 * r)
        for k in kept
        for r, pose in enumerate(_poses(outward[k], point[k]))
    ]


def on_flat(site: Site, shape: Polygon, gripper: SuctionGripper, rejected: dict[str, int]) -> list[GraspPose]:
    """Return the grasps of a flat part: on its front and its back."""
    inner = to_shapely(shape).buffer(-gripper.cup_radius_m)
    if inner.is_empty:
        count(rejected, f"nowhere as wide as the cup ({2e3 * gripper.cup_radius_m:.0f} mm)")
        return []
    across = np.cross(site.turn[:, 0], site.turn[:, 1])
    size = float(np.linalg.norm(shape.bounds[1] - shape.bounds[0]))
    return [
        GraspPose(pose, 0.0, float(np.linalg.norm(point - shape.centroid)) / size + 0.005 * r)
        for point in inner_points(inner, shape.centroid)
        for side in (1.0, -1.0)
        for r, pose in enumerate(_poses(side * across, site.point(point) + side * 0.5 * shape.thickness * across))
    ]


def pull(gripper: SuctionGripper, tcp: Array, direction: Array, push_n: float) -> str:
    """Return '' or why the cup cannot push a part along `direction` (3,) with `push_n`: it pulls no harder than its
    vacuum, and across its axis friction holds it.
    """
    along = float(tcp[:3, 2] @ direction)
    across = float(np.sqrt(max(0.0, 1.0 - along * along)))
    if -along * push_n > gripper.force_n:
        return f"the cup holds {gripper.force_n:.0f} N, inserting may pull with {-along * push_n:.0f} N"
    holds = gripper.friction * (gripper.force_n + along * push_n)
    if across * push_n > holds:
        return f"the cup slips at {holds:.0f} N, inserting may push it sideways with {across * push_n:.0f} N"
    return ""


def _supported(corners: Array, point: Array, outward: Array, gripper: SuctionGripper) -> BoolArray:
    """Return where a surface lies under four points of the lip (n,): what is over an edge needs no closer look."""
    good = np.ones(len(point), dtype=bool)
    first, second = np.moveaxis(tangents(outward), 1, 0)
    for beside in (first, -first, second, -second):
        there = np.flatnonzero(good)
        start = point[there] + gripper.cup_radius_m * beside[there] + RISE_M * outward[there]
        _, distance = first_hits(corners, start, -outward[there])
        good[there] = np.abs(RISE_M - distance) < STEEPEST * gripper.cup_radius_m + gripper.bellows_m
    return good


def _even(corners: Array, point: Array, outward: Array, gripper: SuctionGripper) -> tuple[BoolArray, Array, Array]:
    """Return where the surface under the lip is even (n,), its mean normal there (n, 3), and how far the lip's highest
    point lies above the middle (n,).
    """
    first, second = np.moveaxis(tangents(outward), 1, 0)
    heights = []
    angles = np.arange(RIM) * 2 * np.pi / RIM
    for radius in (gripper.cup_radius_m, 0.5 * gripper.cup_radius_m):
        for angle in angles:
            beside = radius * (np.cos(angle) * first + np.sin(angle) * second)
            _, distance = first_hits(corners, point + beside + RISE_M * outward, -outward)
            heights.append(RISE_M - distance)
    rim = np.array(heights)  # (2 RIM, n): height of the surface above the plane through the middle
    rim = np.where(np.isfinite(rim), rim, -1.0)
    # The plane that fits the lip: its tilt turns the cup, what is left is for the bellows.
    cosines, sines = np.cos(angles), np.sin(angles)
    tilt_a = 2.0 / RIM * (cosines @ rim[:RIM]) / gripper.cup_radius_m
    tilt_b = 2.0 / RIM * (sines @ rim[:RIM]) / gripper.cup_radius_m
    fitted = gripper.cup_radius_m * (np.outer(cosines, tilt_a) + np.outer(sines, tilt_b))
    rest = np.concatenate([rim[:RIM] - fitted, rim[RIM:] - 0.5 * fitted, np.zeros((1, len(point)))])
    good = (np.ptp(rest, axis=0) < gripper.bellows_m) & (np.hypot(tilt_a, tilt_b) < STEEPEST)
    mean = outward - tilt_a[:, None] * first - tilt_b[:, None] * second
    return good, mean / np.linalg.norm(mean, axis=1)[:, None], np.maximum(rest.max(axis=0), 0.0)


def _poses(outward: Array, point: Array) -> list[Array]:
    """Return the TCP poses of a cup at `point`, the hand turned about it."""
    z = -outward
    helper = np.array([0.0, 0.0, 1.0]) if abs(z[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    y = np.cross(z, helper)
    y /= np.linalg.norm(y)
    x = np.cross(y, z)
    return [frame(z, np.cos(a) * y + np.sin(a) * x, point) for a in ROLLS_RAD]
