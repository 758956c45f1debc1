"""How long a build takes, part by part, and which caps make it so: from a plan's waypoints alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.plan.arm_models import robot_model
from mocca_robot.plan.executor import ZEROED
from mocca_robot.plan.motions import AVERAGE_S
from mocca_robot.plan.plan import Move, MoveKind, Plan, Step, Waypoint
from mocca_robot.plan.safety import speed_cap

AT_CAP = 0.9
"""Of a cap: a motion this close to it is limited by it."""
ZEROING_S = 0.3 + AVERAGE_S
"""Before the force sensor is read for a bias, the arm rests."""
GRIP_S = 1.0
"""Fingers take about a second; vacuum what the cell gives it."""
RAMPS = "ramps (jerk)"


@dataclass(frozen=True, kw_only=True)
class CycleTime:
    """What one part takes.

    Attributes:
        moving_s: of motion, as planned; a speed slider or `--speed` below 1 makes it longer.
        standing_s: an estimate of the rest: zeroing the force sensor, gripping and letting go; questions not counted.
        limits: seconds of motion by the cap that is reached then, most first; `RAMPS` where none is.
    """

    part: str
    moving_s: float
    standing_s: float
    limits: Mapping[str, float]

    def words(self) -> str:
        """Return that as a few words."""
        shown = [f"{name} {100 * s / self.moving_s:.0f} %" for name, s in list(self.limits.items())[:3] if s > 0]
        return f"{self.moving_s + self.standing_s:.1f} s a cycle ({self.moving_s:.1f} s of motion: {', '.join(shown)})"


def cycle_times(plan: Plan) -> tuple[CycleTime, ...]:
    """Return what every step of a sound plan takes."""
    return tuple(_cycle(step, plan) for step in plan.steps)


def _cycle(step: Step, plan: Plan) -> CycleTime:
    spent: dict[str, float] = {}
    for move in step.moves:
        for name, seconds in _reached(move, plan):
            spent[name] = spent.get(name, 0.0) + seconds
    wait = plan.cell.vacuum.wait_s if plan.cell.vacuum is not None else GRIP_S
    grips = sum(m.kind in (MoveKind.PICK, MoveKind.RELEASE) for m in step.moves)
    zeroed = sum(m.kind in ZEROED for m in step.moves)
    ordered = dict(sorted(spent.items(), key=lambda entry: -entry[1]))
    moving = sum(m.path[-1].t for m in step.moves)
    return CycleTime(part=step.part, moving_s=moving, standing_s=grips * wait + zeroed * ZEROING_S, limits=ordered)


def _reached(move: Move, plan: Plan) -> list[tuple[str, float]]:
    """Return stretches of a move: the cap that is reached there, and how long it lasts."""
    if len(move.path) < 2:
        return []
    limits = plan.cell.limits
    steps, shares = _shares(move.path, move, plan)
    fast = {MoveKind.TRANSIT: "transfer", MoveKind.INSERT: "insert", MoveKind.LIFT: "lift", MoveKind.RETREAT: "retreat"}
    kind = fast.get(move.kind, "approach")
    ramp = "insert" if move.kind is MoveKind.INSERT else "transfer"
    names = [f"{kind}_speed_m_s", "joint_speed_rad_s", f"{ramp}_acceleration_m_s2", "joint_acceleration_rad_s2"]
    if move.speed_m_s < AT_CAP * speed_cap(move.kind, limits):
        names[0] = "the move's own speed"
    best = shares.argmax(axis=0)
    capped = shares.max(axis=0) >= AT_CAP
    return [(names[b] if c else RAMPS, float(s)) for b, c, s in zip(best, capped, steps, strict=True)]


def _shares(path: Sequence[Waypoint], move: Move, plan: Plan) -> tuple[Array, Array]:
    """Return the durations (n,) between waypoints and how much of each of four caps is used there, (4, n)."""
    limits = plan.cell.limits
    steps = np.diff([w.t for w in path])
    joint_caps = np.minimum(robot_model(plan.robot).joint_speed_rad_s, limits.joint_speed_rad_s)
    linear = limits.insert_acceleration_m_s2 if move.kind is MoveKind.INSERT else limits.transfer_acceleration_m_s2
    out = []
    turns, moved = (np.diff(np.array(v), axis=0) for v in ([w.q for w in path], [w.tcp[:3] for w in path]))
    for change, cap in ((moved, move.speed_m_s), (turns, joint_caps)):
        rate = change / steps[:, None]
        out.append(np.linalg.norm(rate, axis=1) / cap if change is moved else np.abs(rate / cap).max(axis=1))
    spans = np.concatenate([[steps[0]], steps[:-1] + steps[1:], [steps[-1]]]) / 2.0
    for change, cap in ((moved, linear), (turns, limits.joint_acceleration_rad_s2)):
        still = np.zeros((1, change.shape[1]))
        rate = np.vstack([still, change / steps[:, None], still])
        size = np.diff(rate, axis=0) / spans[:, None]
        share = (np.linalg.norm(size, axis=1) if change is moved else np.abs(size).max(axis=1)) / cap
        out.append(np.maximum(share[:-1], share[1:]))
    return steps, np.array(out)
