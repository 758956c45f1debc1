"""Where a part can be held: tool poses with the part in its place, best first, and why the others are none.

Flat parts stand upright and are held across their thickness: the fingers pass in front of and behind the structure, so
neighbours in the plane are only in the way where a finger lies over them. Solid parts are held where two faces look
away from each other (`grasp_solid`). A suction cup needs an even place (`grasp_suction`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Polygon
from mocca_robot.geometry.polygons import to_shapely
from planners.robot.cell import RobotCell
from planners.robot.grasp_pose import GraspPose, count, frame, inner_points, too_wide
from planners.robot.grasp_solid import across_solid
from planners.robot.grasp_suction import on_flat, on_solid
from planners.robot.site import Site
from planners.robot.tool import ParallelGripper, SuctionGripper

LEANS_RAD = tuple(np.deg2rad([0.0, 20.0, -20.0, 40.0, -40.0, 60.0, -60.0]))
"""How far the tool leans from pointing straight down, in the order tried on flat parts."""


@dataclass(frozen=True)
class GraspSearch:
    """Grasps, best first, and why the others that were tried are none: reason → how many."""

    grasps: tuple[GraspPose, ...]
    rejected: dict[str, int]


def find_grasps(
    site: Site, part: int, cell: RobotCell, *, limit: int = 240, rng: np.random.Generator | None = None
) -> GraspSearch:
    """Return up to `limit` grasps of a part; `rng` chooses the points that are tried on solid parts."""
    shape, gripper = site.assembly.parts[part].shape, cell.gripper
    mass = site.bodies[part].mass_kg
    heavy = gripper.too_heavy(mass)
    room = cell.model.payload_kg - gripper.mass_kg
    if not heavy and mass > room:
        heavy = f"heavier than the arm carries beside the gripper ({mass:.2f} kg, at most {room:.2f} kg)"
    if heavy:
        return GraspSearch((), {heavy: 1})
    rng = rng or np.random.default_rng(0)
    rejected: dict[str, int] = {}
    if isinstance(shape, Polygon):
        if isinstance(gripper, SuctionGripper):
            found = on_flat(site, shape, gripper, rejected)
        else:
            found = _across_flat(site, shape, gripper, rejected)
    elif isinstance(gripper, SuctionGripper):
        found = on_solid(site, shape, gripper, rng, rejected)
    else:
        found = across_solid(site, shape, gripper, rng, rejected)
    if isinstance(gripper, SuctionGripper):
        found = _balanced(found, gripper, mass, site.bodies[part].centroid, rejected)
    return GraspSearch(tuple(sorted(found, key=lambda g: g.score)[:limit]), rejected)


def _balanced(
    grasps: list[GraspPose], gripper: SuctionGripper, mass_kg: float, centroid: Array, rejected: dict[str, int]
) -> list[GraspPose]:
    """Return the grasps that keep a part whichever way the arm turns it."""
    kept = []
    for grasp in grasps:
        tips = gripper.tips(mass_kg, float(np.linalg.norm(centroid - grasp.tcp[:3, 3])))
        if tips:
            count(rejected, tips)
        else:
            kept.append(grasp)
    return kept


def _across_flat(site: Site, shape: Polygon, gripper: ParallelGripper, rejected: dict[str, int]) -> list[GraspPose]:
    reason = too_wide(shape.thickness, gripper)
    if reason:
        count(rejected, reason)
        return []
    outline = to_shapely(shape)
    inner = outline.buffer(-gripper.pad_radius_m)
    if inner.is_empty:
        count(rejected, f"nowhere as wide as the pads ({2e3 * gripper.pad_radius_m:.0f} mm)")
        return []
    across = np.cross(site.turn[:, 0], site.turn[:, 1])
    found: list[GraspPose] = []
    size = float(np.linalg.norm(shape.bounds[1] - shape.bounds[0]))
    room = gripper.tcp_offset[2] - gripper.palm_m[1, 2] - 0.003
    half = float(gripper.palm_m[1, 0]) + 0.003
    for point in inner_points(inner, shape.centroid):
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
                count(rejected, "deeper inside the part than the fingers are long")
                continue
            away = float(np.linalg.norm(point - shape.centroid)) / size
            for sign in (1.0, -1.0):
                found.append(
                    GraspPose(
                        frame(site.turn @ down, sign * across, site.point(point)),
                        shape.thickness,
                        away + 0.3 * abs(lean) + (0.01 if sign < 0 else 0.0),
                    )
                )
    return found
