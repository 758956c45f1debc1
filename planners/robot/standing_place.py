"""Where in the cell the structure should stand, and turned how: where the arm reaches most parts in most ways."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planners.robot.arm_poses import all_branches
from planners.robot.bench import Bench
from planners.robot.cell import RobotCell
from planners.robot.grasp_pose import GraspPose
from planners.robot.site import Site, motion_between, moved

LOOKED_AT = 60
"""Grasps of a part that the ranking of places looks at."""
ENOUGH = 8
"""Ways to reach a part that count: more of them are no better."""


@dataclass(frozen=True, eq=False)
class RobotPlace:
    """One place: the cell with it, the structure there, and how well the arm reaches it (larger is better)."""

    cell: RobotCell
    site: Site
    score: float


def standings(where: Site, cell: RobotCell, grasps: Sequence[Sequence[GraspPose]]) -> list[RobotPlace]:
    """Return the places that the cell allows, best first; `grasps` of every part, for the structure as in `where`."""
    if len(cell.places_m) * len(cell.yaws_rad) <= 1:
        return [RobotPlace(cell, where, 0.0)]
    out = []
    for place, yaw in itertools.product(cell.places_m, cell.yaws_rad):
        there = replace(cell, build_origin_m=place, build_yaw_rad=yaw)
        structure = moved(where, there)
        out.append(RobotPlace(there, structure, _reached(where, structure, there, grasps)))
    return sorted(out, key=lambda s: -s.score)


def carried_over(grasps: Sequence[GraspPose], before: Site, after: Site) -> list[GraspPose]:
    """Return the same grasps where the structure stands now."""
    motion = motion_between(before, after.turn, after.shift)
    return [replace(g, tcp=motion @ g.tcp) for g in grasps]


def _reached(before: Site, after: Site, cell: RobotCell, grasps: Sequence[Sequence[GraspPose]]) -> float:
    """Return the sum over parts of the share of `ENOUGH` ways that reach it, a part that none reaches costing ten."""
    motion = motion_between(before, after.turn, after.shift)
    to_flange = Bench.flange_offset(cell)
    low, high = cell.workspace_m
    chosen = [g.tcp for of_part in grasps for g in of_part[:: max(1, len(of_part) // LOOKED_AT)]]
    owner = np.repeat(np.arange(len(grasps)), [len(p[:: max(1, len(p) // LOOKED_AT)]) for p in grasps])
    if not chosen:
        return 0.0
    tcps = motion @ np.array(chosen)
    ways = all_branches(cell.model, tcps @ to_flange)[1].sum(axis=1)
    ways = np.where(((tcps[:, :3, 3] > low) & (tcps[:, :3, 3] < high)).all(axis=1), ways, 0)
    per_part = np.bincount(owner, ways, minlength=len(grasps))
    some = np.array([len(p) > 0 for p in grasps])
    return float((np.minimum(per_part, ENOUGH) / ENOUGH - 10.0 * (per_part == 0))[some].sum())
