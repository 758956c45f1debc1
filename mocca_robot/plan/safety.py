"""Is a plan safe to run? Every figure of it against the arm, the cell and the driver's caps, before anything moves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.errors import InputError
from mocca_robot.plan.arm_models import RobotModel, robot_model
from mocca_robot.plan.hand import disorder, wrong_openings
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Cell, Move, MoveKind, Plan, Step, Waypoint, insertion_axis
from mocca_robot.plan.pose import angle_rad, distance_m
from mocca_robot.tolerances import COARSE

SHORTEST_PUSH_M = 1e-3
"""An insertion shorter than this has no middle that could be looked at."""

FK_DISTANCE_M = 2e-3
"""TCP and joint angles of a waypoint must describe the same place: twice the rounding of published arm dimensions."""
FK_ANGLE_RAD = 1e-2
SPEED_SLACK = 1.05
"""Finite differences of a sampled path overestimate its speed by a few per cent where it turns."""
ACCELERATION_SLACK = 1.25
"""The same for second differences."""
STRAIGHT_M = 1e-3
"""How far an insertion line may bend: less than the play of a joint that is cut for assembly by hand."""
CONE_SLACK_RAD = math.radians(0.1)
FARTHEST_COG_M = 0.5
"""The hand holds a part near its middle, and no arm here builds with parts of a metre."""
STRONGEST_GRIP_N = 235.0
"""No gripper that is driven here closes with more."""
MILLIMETRES = 10.0
"""No arm here reaches 10 m: larger coordinates are millimetres."""


@dataclass(frozen=True)
class PlanFinding:
    """One reason not to run a plan: where, which quantity, its value, the limit it breaks, and what to do."""

    where: str
    quantity: str
    value: str
    limit: str
    remedy: str

    def __str__(self) -> str:
        """Return the finding as one sentence."""
        return f"{self.where}: {self.quantity} is {self.value}, limit {self.limit}. {self.remedy}"


def require_sound(plan: Plan, arm: RobotModel | None = None) -> None:
    """Return if `plan` may run; InputError with the first findings, each naming place, value, limit and remedy.

    `arm` is the calibrated one that the plan was fitted to; None for one that is as its model.
    """
    found = findings(plan, arm)
    if found:
        more = f"\n… and {len(found) - 5} more." if len(found) > 5 else ""
        raise InputError("The plan is refused:\n" + "\n".join(str(f) for f in found[:5]) + more)


def findings(plan: Plan, arm: RobotModel | None = None) -> list[PlanFinding]:
    """Return everything that forbids running `plan`, in the order of the plan; empty means sound."""
    model = arm or robot_model(plan.robot)
    out = list(_cell_findings(plan.cell, model))
    previous: Waypoint | None = None
    for i, step in enumerate(plan.steps):
        here = f"step {i} ({step.part})"
        out.extend(_step_findings(step, plan, model, here))
        for k, move in enumerate(step.moves):
            there = f"{here}, move {k} ({move.kind})"
            out.extend(_move_findings(move, step, plan.cell, model, there))
            if previous is not None:
                out.extend(_seam(previous, move.path[0], f"{there}, waypoint 0", plan.cell.limits))
            previous = move.path[-1]
    return out


def speed_cap(kind: MoveKind, limits: MotionLimits) -> float:
    """Return the fastest that a move of this kind may be, m/s."""
    by_kind = {
        MoveKind.TRANSIT: limits.transfer_speed_m_s,
        MoveKind.LIFT: limits.lift_speed_m_s,
        MoveKind.RETREAT: limits.retreat_speed_m_s,
        MoveKind.INSERT: limits.insert_speed_m_s,
    }
    return by_kind.get(kind, limits.approach_speed_m_s)


def _cell_findings(cell: Cell, model: RobotModel) -> Iterator[PlanFinding]:
    if cell.tool_mass_kg < 0 or cell.tool_mass_kg > model.payload_kg:
        yield PlanFinding(
            "cell",
            "tool_mass_kg",
            f"{cell.tool_mass_kg:g}",
            f"0 to {model.payload_kg:g} kg ({model.name})",
            "Use a lighter gripper or a stronger arm.",
        )
    if any(low >= high for low, high in zip(*cell.workspace_m, strict=True)):
        yield PlanFinding(
            "cell", "workspace_m", f"{cell.workspace_m}", "low below high on every axis", "Swap the corners."
        )
    if not math.hypot(*cell.tool_cog_m) <= FARTHEST_COG_M:
        far = f"{math.hypot(*cell.tool_cog_m):.3g} m"
        yield PlanFinding("cell", "tool_cog_m", far, f"{FARTHEST_COG_M:g} m from the flange", "Write it in metres.")
    if max(abs(v) for v in cell.tcp_offset[:3]) > 1.0:
        yield PlanFinding(
            "cell", "tcp_offset", f"{cell.tcp_offset[:3]}", "1 m", "Write it in metres: divide by 1000 if it is in mm."
        )


def _step_findings(step: Step, plan: Plan, model: RobotModel, where: str) -> Iterator[PlanFinding]:
    carried = step.grasp.mass_kg + plan.cell.tool_mass_kg
    if step.grasp.mass_kg <= 0:
        yield PlanFinding(
            where, "mass_kg", f"{step.grasp.mass_kg:g}", "above 0", "Give the part's mass: plan it again."
        )
    far = math.dist(step.grasp.cog_m, plan.cell.tcp_offset[:3])
    if not far <= FARTHEST_COG_M:
        limit = f"{FARTHEST_COG_M:g} m from the tool's centre point"
        yield PlanFinding(where, "cog_m", f"{far:.3g} m", limit, "Write it in metres, in the flange's frame.")
    if not 0 < step.grasp.force_n <= STRONGEST_GRIP_N:
        limit = f"0 to {STRONGEST_GRIP_N:g} N"
        yield PlanFinding(where, "force_n", f"{step.grasp.force_n:g}", limit, "Grip with what the part bears.")
    if carried > model.payload_kg:
        yield PlanFinding(
            where,
            "payload (part and gripper)",
            f"{carried:.3g} kg",
            f"0 to {model.payload_kg:g} kg ({model.name})",
            "Make the part lighter, or use a stronger arm.",
        )
    low, high = plan.cell.gripper_stroke_m
    if plan.gripper != "none" and not low <= step.grasp.width_m <= high:
        yield PlanFinding(
            where,
            "grasp width",
            f"{1e3 * step.grasp.width_m:.1f} mm",
            f"{1e3 * low:.0f} to {1e3 * high:.0f} mm",
            "Grasp the part elsewhere, or use a gripper that opens wide enough.",
        )
    if words := disorder(step):
        kinds = ", ".join(m.kind for m in step.moves)
        yield PlanFinding(where, "order of moves", kinds, f"empty → held → seated → let go: {words}", "Plan again.")
    else:
        for k, opening, limit in wrong_openings(step, plan):
            yield PlanFinding(f"{where}, move {k} ({step.moves[k].kind})", "gripper_m", opening, limit, "Plan again.")
    if step.direction is not None and abs(math.hypot(*step.direction) - 1.0) > COARSE:
        length = math.hypot(*step.direction)
        yield PlanFinding(where, "length of the insertion direction", f"{length:.6g}", "1", "Normalise it.")


def _move_findings(move: Move, step: Step, cell: Cell, model: RobotModel, where: str) -> Iterator[PlanFinding]:
    limits = cell.limits
    cap = speed_cap(move.kind, limits)
    if not 0 < move.speed_m_s <= cap:
        yield PlanFinding(where, "speed_m_s", f"{move.speed_m_s:g}", f"0 to {cap:g} m/s", "Slow the move down.")
    if not 0 < move.force_limit_n <= limits.abort_force_n:
        yield PlanFinding(
            where,
            "force_limit_n",
            f"{move.force_limit_n:g}",
            f"0 to {limits.abort_force_n:g} N",
            "Lower the force limit.",
        )
    low, high = cell.gripper_stroke_m
    if not low <= move.gripper_m <= high:
        yield PlanFinding(
            where,
            "gripper_m",
            f"{move.gripper_m:g}",
            f"{low:g} to {high:g} m",
            "Grasp the part elsewhere, or use a gripper that opens wide enough.",
        )
    for name, path in (
        (where, move.path),
        *((f"{where}, alternative {a}", p) for a, p in enumerate(move.alternatives)),
    ):
        yield from _path_findings(path, move, cell, model, name)
        if move.kind is MoveKind.INSERT:
            yield from _line_findings(path, step, name)
            yield from _joint_gap(move.path[0], path[0], f"{name}, waypoint 0 against the move's own", limits)
            if distance_m(path[-1].tcp, move.path[-1].tcp) > STRAIGHT_M:
                gap = distance_m(path[-1].tcp, move.path[-1].tcp)
                yield PlanFinding(
                    name,
                    "end",
                    f"{1e3 * gap:.1f} mm from the move's end",
                    f"{1e3 * STRAIGHT_M:.0f} mm",
                    "Every alternative must end where the part belongs.",
                )


def _path_findings(
    path: Sequence[Waypoint], move: Move, cell: Cell, model: RobotModel, where: str
) -> Iterator[PlanFinding]:
    limits = cell.limits
    for w, point in enumerate(path):
        here = f"{where}, waypoint {w}"
        yield from _waypoint_findings(point, cell, model, here)
        if w == 0:
            continue
        before = path[w - 1]
        seconds = point.t - before.t
        if seconds <= 0:
            yield PlanFinding(here, "t", f"{point.t:g} s", f"above {before.t:g} s", "Times must increase: plan again.")
            continue
        yield from _joint_gap(before, point, here, limits)
        rates = np.abs(np.subtract(point.q, before.q)) / seconds
        caps = np.minimum(model.joint_speed_rad_s, limits.joint_speed_rad_s)
        worst = int(np.argmax(rates / caps))
        if rates[worst] > caps[worst] * SPEED_SLACK:
            yield PlanFinding(
                here, f"speed of joint {worst}", f"{rates[worst]:.3g} rad/s", f"{caps[worst]:.3g} rad/s", "Slow down."
            )
        speed, cap = distance_m(point.tcp, before.tcp) / seconds, min(move.speed_m_s, speed_cap(move.kind, limits))
        if speed > cap * SPEED_SLACK:
            yield PlanFinding(here, "speed of the tool", f"{speed:.3g} m/s", f"{cap:.3g} m/s", "Slow the move down.")
    yield from _acceleration_findings(path, move, limits, where)


def _waypoint_findings(point: Waypoint, cell: Cell, model: RobotModel, here: str) -> Iterator[PlanFinding]:
    joints, pose = list(point.q), list(point.tcp)
    if len(joints) != 6 or len(pose) != 6:
        yield PlanFinding(here, "size", f"{len(joints)} joints, {len(pose)} pose values", "6 and 6", "Plan again.")
        return
    broken = [v for v in (point.t, *joints, *pose) if not math.isfinite(v)]
    if broken:
        yield PlanFinding(here, "a value", f"{broken[0]}", "finite", "Plan again.")
        return
    largest = max(abs(v) for v in point.tcp[:3])
    if largest > MILLIMETRES:
        yield PlanFinding(
            here,
            "tcp",
            f"{largest:g} m from the base",
            f"{model.reach_m:g} m ({model.name})",
            "The pose looks like millimetres: divide by 1000.",
        )
        return
    for j, (angle, limit) in enumerate(zip(point.q, model.joint_limit_rad, strict=True)):
        if abs(angle) > limit:
            yield PlanFinding(
                here, f"joint {j}", f"{angle:.4g} rad", f"±{limit:.4g} rad", "Use another arm configuration."
            )
    tool = math.hypot(*cell.tcp_offset[:3])
    if math.hypot(point.tcp[0], point.tcp[1], point.tcp[2] - model.d[0]) > model.reach_m + model.d[5] + tool:
        yield PlanFinding(
            here,
            "tcp",
            f"{np.round(point.tcp[:3], 3).tolist()} m",
            f"reach {model.reach_m:g} m ({model.name})",
            "Move the part or the base closer together.",
        )
    actual = model.tcp_pose(point.q, cell.tcp_offset)
    gap, turn = distance_m(actual, point.tcp), angle_rad(actual, point.tcp)
    if gap > FK_DISTANCE_M or turn > FK_ANGLE_RAD:
        yield PlanFinding(
            here,
            "tcp against joint angles",
            f"{1e3 * gap:.1f} mm and {math.degrees(turn):.2f}° apart",
            f"{1e3 * FK_DISTANCE_M:g} mm and {math.degrees(FK_ANGLE_RAD):.2f}°",
            "Pose and joints describe different places: check robot model and tcp_offset, plan again.",
        )
    low, high = cell.workspace_m
    for axis, value, a, b in zip("xyz", point.tcp[:3], low, high, strict=True):
        if not a <= value <= b:
            yield PlanFinding(
                here, f"tcp {axis}", f"{value:.4g} m", f"{a:g} to {b:g} m (workspace)", "Plan inside the workspace box."
            )


def _joint_gap(before: Waypoint, after: Waypoint, here: str, limits: MotionLimits) -> Iterator[PlanFinding]:
    jumps = np.abs(np.subtract(after.q, before.q))
    worst = int(np.argmax(jumps))
    if not jumps[worst] <= limits.joint_step_rad:
        yield PlanFinding(
            here,
            f"jump of joint {worst}",
            f"{jumps[worst]:.3g} rad",
            f"{limits.joint_step_rad:g} rad",
            "Sample the path more finely; a branch change needs a transit of its own.",
        )


def _seam(before: Waypoint, after: Waypoint, here: str, limits: MotionLimits) -> Iterator[PlanFinding]:
    """Yield when a move does not begin where the one before it ended: the arm would go there unplanned."""
    gap = float(np.abs(np.subtract(after.q, before.q)).max())
    if not gap <= limits.start_joint_rad:
        yield PlanFinding(
            here,
            "distance from the end of the move before",
            f"{gap:.3g} rad",
            f"{limits.start_joint_rad:g} rad",
            "Begin every move where the last one ended: plan this part again.",
        )


def _acceleration_findings(
    path: Sequence[Waypoint], move: Move, limits: MotionLimits, where: str
) -> Iterator[PlanFinding]:
    """Yield where second differences exceed the caps; the arm stands still before and after every path."""
    times = np.array([w.t for w in path])
    steps = np.diff(times)
    if len(path) < 2 or np.any(steps <= 0):
        return
    cap = limits.insert_acceleration_m_s2 if move.kind is MoveKind.INSERT else limits.transfer_acceleration_m_s2
    spans = np.concatenate([[steps[0]], steps[:-1] + steps[1:], [steps[-1]]]) / 2.0
    for values, limit, quantity, unit in (
        (np.array([w.tcp[:3] for w in path]), cap, "acceleration of the tool", "m/s²"),
        (np.array([w.q for w in path]), limits.joint_acceleration_rad_s2, "acceleration of a joint", "rad/s²"),
    ):
        rates = np.vstack(
            [np.zeros(values.shape[1]), np.diff(values, axis=0) / steps[:, None], np.zeros(values.shape[1])]
        )
        change = np.diff(rates, axis=0) / spans[:, None]
        size = np.linalg.norm(change, axis=1) if unit == "m/s²" else np.abs(change).max(axis=1)
        worst = int(np.argmax(size))
        if size[worst] > limit * ACCELERATION_SLACK:
            yield PlanFinding(
                f"{where}, waypoint {worst}",
                quantity,
                f"{size[worst]:.3g} {unit}",
                f"{limit:.3g} {unit}",
                "Ramp the speed up and down more gently.",
            )


def _line_findings(path: Sequence[Waypoint], step: Step, where: str) -> Iterator[PlanFinding]:
    axis, depth = insertion_axis(path)
    if len(path) < 2 or depth < SHORTEST_PUSH_M:
        yield PlanFinding(
            where, "insertion depth", f"{1e3 * depth:.2f} mm", "at least 1 mm", "Start the insertion farther out."
        )
        return
    offsets = np.array([w.tcp[:3] for w in path]) - np.array(path[0].tcp[:3])
    bend = float(np.linalg.norm(offsets - np.outer(offsets @ axis, axis), axis=1).max())
    if bend > STRAIGHT_M:
        yield PlanFinding(
            where,
            "bend of the insertion line",
            f"{1e3 * bend:.2f} mm",
            f"{1e3 * STRAIGHT_M:g} mm",
            "Insert along a line.",
        )
    turn = max(angle_rad(path[0].tcp, w.tcp) for w in path)
    if turn > FK_ANGLE_RAD:
        yield PlanFinding(
            where,
            "turn of the part on the line",
            f"{math.degrees(turn):.2f}°",
            f"{math.degrees(FK_ANGLE_RAD):.2f}°",
            "Insert without turning: compliant pushing keeps the orientation.",
        )
    if step.direction is not None:
        angle = math.acos(max(-1.0, min(1.0, float(axis @ np.asarray(step.direction)))))
        if angle > step.alpha_rad + CONE_SLACK_RAD:
            yield PlanFinding(
                where,
                "angle to the insertion direction",
                f"{math.degrees(angle):.2f}°",
                f"{math.degrees(step.alpha_rad):.2f}° (the part's cone)",
                "Insert inside the cone.",
            )
