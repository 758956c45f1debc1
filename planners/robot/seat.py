"""The structure's side of placing a part: how it is held in its place, slid in along its cone's axis, and let go."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from planners.robot.arm_poses import all_branches, nearest_turn, trace
from planners.robot.bench import Bench
from planners.robot.effort import effort, flips
from planners.robot.grasp_pose import GraspPose, count
from planners.robot.grasp_suction import pull
from planners.robot.tool import SuctionGripper
from planners.robot.trajectory import line

STANDOFFS_M = (0.045, 0.07, 0.1, 0.14, 0.2)
"""How far from its place a part may begin its straight way in: the first that is clear of everything."""
RETREATS_M = (0.08, 0.06, 0.04, 0.1, 0.14)
LOOKED_AT = 1500
"""Grasps times arm branches that are looked at for one part."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Seat:
    """One way to put a part in: flange pose and joints there, where the way in begins, and how the tool leaves."""

    grasp: GraspPose
    flange: Array
    q: Array
    standoff_m: float
    q_before: Array
    retreat: Array


def seats(
    bench: Bench,
    name: str,
    grasps: Sequence[GraspPose],
    direction: Array,
    at: Array,
    reasons: dict[str, int],
    usable: BoolArray | None = None,
    *,
    flipped: bool | None = None,
) -> Iterator[Seat]:
    """Yield ways to put a part in along `direction` (3,): those that keep the elbow's side first, of these best grasps
    first, of these with the least turn from `at` (6,) first.

    `flipped` leaves only those that turn the elbow to its other side, or only those that do not. `usable` (n,) leaves
    grasps out; `reasons` counts why others fail. Whenever this returns or yields, the part is back
    where it waits.
    """
    model = bench.cell.model
    if not grasps:
        return
    flanges = np.array([g.tcp for g in grasps]) @ bench.to_flange
    options, there = all_branches(model, flanges)
    ways: list[tuple[bool, int, float, Array]] = []
    for k, grasp in enumerate(grasps):
        if usable is not None and not usable[k]:
            count(reasons, "pick: out of the arm's reach")
            continue
        if isinstance(bench.cell.gripper, SuctionGripper):
            slips = pull(bench.cell.gripper, grasp.tcp, direction, bench.cell.limits.push_force_n)
            if slips:
                count(reasons, f"insertion: {slips}")
                continue
        if not there[k].any():
            count(reasons, "seat: out of the arm's reach")
            continue
        near = nearest_turn(model, options[k][there[k]], at)
        ways.extend((flips(q, at), k, effort(bench.cell, q, at), q) for q in near)
    ways = [w for w in ways if flipped is None or w[0] is flipped]
    for _, k, _, q in sorted(ways, key=lambda w: w[:3])[:LOOKED_AT]:
        for seat in _seated(bench, name, grasps[k], flanges[k], q, direction, reasons):
            bench.scene.place(name, bench.waiting(name))
            yield seat
        bench.scene.place(name, bench.waiting(name))


def _seated(
    bench: Bench, name: str, grasp: GraspPose, flange: Array, q: Array, direction: Array, reasons: dict[str, int]
) -> Iterator[Seat]:
    """Yield the seat with the shortest way in that begins clear of everything, and then, should no transit lead there,
    the one with the longest.
    """
    opened, closed = bench.cell.gripper.opened_m(grasp.width_m), grasp.width_m
    scene = bench.scene
    scene.place(name, np.eye(4))
    scene.assign(grasped=name)
    for opening in (opened, closed):
        reason = bench.free(q, opening)
        if reason:
            count(reasons, f"seat: {reason}")
            return
    tool = flange[:3, 2]
    retreat = None
    for distance in RETREATS_M:
        _, reason = bench.along(flange, -distance * tool, q, opened)
        if not reason:
            retreat = -distance * tool
            break
    if retreat is None:
        count(reasons, f"retreat: {reason}")
        return
    shortest = 0.0
    for distance in STANDOFFS_M:
        q_before, reason = _way_in(bench, name, flange, q, distance * direction, closed)
        if not reason:
            shortest = distance
            yield Seat(grasp=grasp, flange=flange, q=q, standoff_m=distance, q_before=q_before, retreat=retreat)
            break
    else:
        count(reasons, f"insertion: {reason}")
        return
    for distance in reversed(STANDOFFS_M):
        if distance <= shortest:
            return
        q_before, reason = _way_in(bench, name, flange, q, distance * direction, closed)
        if not reason:
            yield Seat(grasp=grasp, flange=flange, q=q, standoff_m=distance, q_before=q_before, retreat=retreat)
            return


def _way_in(bench: Bench, name: str, flange: Array, q: Array, travel: Array, closed: float) -> tuple[Array, str]:
    """Return the joints where the way in of length `travel` begins, and '' or what is wrong with it."""
    grip = np.asarray(np.linalg.inv(flange), dtype=np.float64)
    joints, reason = trace(bench.cell.model, line(flange, -travel, 30), q)
    if not reason:
        bench.scene.assign(carried=name)
        reason = bench.free(joints[-1], closed, grip)
    if not reason:
        # On the way in the part's own fit is judged by its exact sweep: here it is left out.
        bench.scene.assign(absent=(name,))
        reason = next((r for x in joints if (r := bench.free(x, closed))), "")
    return joints[-1], reason
