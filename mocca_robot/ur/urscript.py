"""A plan as one URScript program, for a controller that is loaded from a file instead of steered over RTDE.

What is lost against `execute`: no journal, no resume, no retries elsewhere in the cone, no supervision from outside,
no averaged bias, no fit to the arm's calibration. What remains: a force guard, compliant insertion by depth, with the
executor's limits on jams, stalls, sideways and back travel and tilt, openings and widths read back, and a halt with a
message to the operator on anything unexpected. Unproven on hardware.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources

import numpy as np

from mocca_robot.errors import InputError
from mocca_robot.plan.gripper import require_drivable
from mocca_robot.plan.guards import (
    BEYOND_M,
    LATERAL_M,
    PUSH_GRACE_S,
    RESISTS,
    SEATED_SHARE,
    SEATING_M,
    SEATING_PACE,
    STALL_S,
)
from mocca_robot.plan.hand import hands, to_open
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Move, MoveKind, Plan, Step, Waypoint, insertion_axis
from mocca_robot.plan.pose import distance_m
from mocca_robot.plan.push_frame import frame_along
from mocca_robot.plan.safety import require_sound
from mocca_robot.ur.grippers import ROBOTIQ
from mocca_robot.ur.urscript_hand import finger_helpers, grip, open_hand, vacuum_helpers
from mocca_robot.ur.urscript_text import number, numbers, plain, pose

LEAST_RAD_S = 1e-3
"""Speed of the leading joint that a move has at least: a controller refuses zero."""

BLEND_M = 0.002
GUARD_CYCLES = 20
"""Of 2 ms: a force above the limit that lasts for less is noise."""


def urscript(plan: Plan) -> str:
    """Return the program; InputError when the plan is not sound (`safety.require_sound`) or a number is not usable."""
    require_sound(plan)
    require_drivable(plan)
    written = (*ROBOTIQ, "suction", "none")
    if plan.gripper not in written:
        raise InputError(
            f"No URScript is written for the gripper '{plan.gripper}', only for {', '.join(written)}: run the plan "
            "with `mocca-robot execute`."
        )
    cell = plan.cell
    first = plan.first_waypoint
    out = [
        "def mocca_build():",
        f"  # plan {plan.sha256[:16]}: {plan.robot}, {len(plan.steps)} parts, cell {plain(cell.name)}",
        "  # generated; unproven on hardware: run at reduced speed first, with a hand on the emergency stop",
        *_helpers(cell.limits).splitlines(),
        f"  set_tcp({pose(cell.tcp_offset)})",
        f"  set_payload({number(cell.tool_mass_kg)}, {numbers(cell.tool_cog_m)})",
    ]
    if plan.gripper in ROBOTIQ:
        out += finger_helpers()
    if plan.cell.vacuum is not None and plan.gripper == "suction":
        out += vacuum_helpers(plan.cell.vacuum)
    out += [
        f"  goal = {numbers(first.q)}",
        "  here = get_actual_joint_positions()",
        "  j = 0",
        "  while j < 6:",
        f"    if norm(here[j] - goal[j]) > {number(cell.limits.start_joint_rad)}:",
        '      fail("The arm does not stand at the first waypoint. Move it there, then start again.")',
        "    end",
        "    j = j + 1",
        "  end",
        f'  popup("{len(plan.steps)} parts will be built. Keep clear of the arm.", title="mocca-robot", blocking=True)',
        "  guard = run force_guard()",
    ]
    if plan.cell.vacuum is not None and plan.cell.vacuum.input and plan.gripper == "suction":
        out.append("  keeper = run part_guard()")
    for i, step in enumerate(plan.steps):
        out.append(f'  textmsg("step {i}: {plain(step.part)}")')
        opened: float | None = None
        for hand, move in zip(hands(step), step.moves, strict=False):
            out.append(f"  # {move.kind}")
            if to_open(hand, move, opened):
                out += open_hand(plan, move.gripper_m)
                opened = move.gripper_m
            out += _move(plan, step, move)
    out += ["  watching = False", f'  popup("{len(plan.steps)} parts are placed.", title="mocca-robot")', "end", ""]
    return "\n".join(out)


def _helpers(limits: MotionLimits) -> str:
    out = (resources.files("mocca_robot.ur") / "helpers.script").read_text(encoding="utf-8")
    for name, value in (
        ("TILT", limits.abort_tilt_rad),
        ("SEATED", SEATED_SHARE),
        ("SEATING", SEATING_M),
        ("PACE", SEATING_PACE),
        ("BEYOND", BEYOND_M),
        ("LATERAL", LATERAL_M),
        ("GRACE", PUSH_GRACE_S),
        ("STALL", STALL_S),
        ("DAMPING", limits.force_damping),
        ("GAIN", limits.force_gain),
        ("ASIDE", limits.sideways_tolerance_m),
        ("ASLANT", limits.tilt_tolerance_rad),
    ):
        out = out.replace(f"@{name}@", number(value))
    return out.replace("@LASTS@", str(GUARD_CYCLES))


def _move(plan: Plan, step: Step, move: Move) -> list[str]:
    limits = plan.cell.limits
    if move.kind is MoveKind.INSERT:
        return ["  zero()", _insert(move, limits)]
    out = []
    if len(move.path) > 1:
        if move.kind in (MoveKind.TRANSIT, MoveKind.APPROACH, MoveKind.PICK):
            out.append("  zero()")
        contact = move.kind in (MoveKind.APPROACH, MoveKind.PICK)
        guard = min(limits.contact_force_n, move.force_limit_n) if contact else move.force_limit_n
        out += [f"  guard_n = {number(guard)}", "  watching = True"]
        if move.kind is MoveKind.TRANSIT:
            out += _joint_path(move.path, limits)
        else:
            acceleration = limits.transfer_acceleration_m_s2
            out.append(f"  movel({numbers(move.path[-1].q)}, a={number(acceleration)}, v={number(move.speed_m_s)})")
        out.append("  watching = False")
    if move.kind in (MoveKind.PICK, MoveKind.RELEASE):
        out += grip(plan, step, move)
    return out


def _joint_path(path: Sequence[Waypoint], limits: MotionLimits) -> list[str]:
    """Return blended joint moves whose leading joint has the planned speed of each segment."""
    out = []
    for w in range(1, len(path)):
        a, b = path[w - 1], path[w]
        rate = float(np.abs(np.subtract(b.q, a.q)).max()) / (b.t - a.t)
        length = distance_m(a.tcp, b.tcp)
        following = distance_m(b.tcp, path[w + 1].tcp) if w + 1 < len(path) else 0.0
        blend = min(BLEND_M, 0.4 * min(length, following))
        speed = min(max(rate, LEAST_RAD_S), limits.joint_speed_rad_s)
        a_max = number(limits.joint_acceleration_rad_s2)
        out.append(f"  movej({numbers(b.q)}, a={a_max}, v={number(speed)}, r={number(blend)})")
    return out


def _insert(move: Move, limits: MotionLimits) -> str:
    axis, depth = insertion_axis(move.path)
    rotation = frame_along(axis, move.path[0].tcp)[3:]
    figures = (
        depth,
        limits.depth_tolerance_m,
        limits.push_force_n,
        limits.insert_speed_m_s,
        move.force_limit_n,
        min(limits.jam_force_n, RESISTS * limits.push_force_n),
        limits.jam_time_s,
        min(limits.jam_speed_m_s, 0.5 * SEATING_PACE * limits.insert_speed_m_s),
    )
    planned = pose(move.path[0].tcp)
    return f"  insert({numbers(rotation)}, {planned}, {numbers(axis)}, {', '.join(number(n) for n in figures)})"
