"""The tray's side of placing a part: how the tool comes down to it, and lifts it out of its nest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.tolerances import ROUNDING
from planners.robot.arm_poses import all_branches, nearest_turn
from planners.robot.bench import Bench
from planners.robot.effort import effort, flips
from planners.robot.grasp_pose import GraspPose, count
from planners.robot.seat import Seat

ABOVES_M = (0.07, 0.05, 0.1)
"""How far from a part the tool's straight way to it begins."""
LIFTS_M = (0.06, 0.1, 0.04)
UPRIGHT_RAD = np.deg2rad(25.0)
"""A tool that leans less from straight down needs no turned part in the tray."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pick:
    """One way to take a part: the flange's pose and joints at the part, the way to it and the lift."""

    flange: Array
    q: Array
    above_m: float
    q_above: Array
    lift: Array
    q_lifted: Array


def tool_down(seat: Seat) -> Array:
    """Return the rotation (3, 3) of the part in the tray that lets the tool, which holds it as in its seat, point
    straight down; identity when it nearly does. The shortest such turn.
    """
    tool = seat.flange[:3, 2]
    down = np.array([0.0, 0.0, -1.0])
    if float(np.arccos(np.clip(tool @ down, -1.0, 1.0))) <= UPRIGHT_RAD:
        return np.eye(3)
    axis = np.cross(tool, down)
    sine, cosine = float(np.linalg.norm(axis)), float(tool @ down)
    if sine < ROUNDING:
        return np.diag([1.0, -1.0, -1.0])
    from mocca_robot.plan.pose import rotation_matrix

    return rotation_matrix(axis / sine * np.arctan2(sine, cosine))


def reachable(bench: Bench, name: str, grasps: Sequence[GraspPose]) -> BoolArray:
    """Return which grasps (n,) the arm reaches in the tray, whatever stands around."""
    flanges = bench.waiting(name) @ np.array([g.tcp for g in grasps]).reshape(-1, 4, 4) @ bench.to_flange
    return np.asarray(all_branches(bench.cell.model, flanges)[1].any(axis=1))


def picks(bench: Bench, name: str, seat: Seat, reasons: dict[str, int]) -> Iterator[Pick]:
    """Yield ways to take a part as `seat` holds it, those first that keep the elbow's side and turn least to the seat;
    `reasons` counts failures.
    """
    model, scene = bench.cell.model, bench.scene
    motion = bench.waiting(name)
    flange = motion @ seat.flange
    opened, closed = bench.cell.gripper.opened_m(seat.grasp.width_m), seat.grasp.width_m
    grip = np.asarray(np.linalg.inv(seat.flange), dtype=np.float64)
    options, there = all_branches(model, flange[None])
    if not there.any():
        count(reasons, "pick: out of the arm's reach")
        return
    near = nearest_turn(model, options[0][there[0]], seat.q_before)
    for q in sorted(near, key=lambda q: (flips(q, seat.q_before), effort(bench.cell, q, seat.q_before))):
        scene.place(name, motion)
        scene.assign(grasped=name)
        reason = bench.free(q, opened)
        q_above = q
        for above in ABOVES_M if not reason else ():
            q_above, reason = bench.along(flange, -above * flange[:3, 2], q, opened)
            if not reason:
                break
        if reason:
            count(reasons, f"pick: {reason}")
            continue
        scene.assign(carried=name)
        for height in LIFTS_M:
            lift = np.array([0.0, 0.0, height])
            q_lifted, reason = bench.along(flange, lift, q, closed, grip)
            if not reason:
                break
        scene.place(name, motion)
        if reason:
            count(reasons, f"lift: {reason}")
            continue
        yield Pick(flange=flange, q=q, above_m=above, q_above=q_above, lift=lift, q_lifted=q_lifted)
