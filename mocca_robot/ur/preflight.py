"""Before anything moves: is this the right robot, in the right state, at the right place, for this plan?"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from mocca_robot.errors import InputError
from mocca_robot.plan.arm_models import robot_model
from mocca_robot.plan.plan import Plan, Waypoint
from mocca_robot.plan.pose import angle_rad, distance_m
from mocca_robot.plan.status import ArmState
from mocca_robot.tolerances import SAME_KG
from mocca_robot.ur.dashboard import Identity, identify

SAME_TCP_M, SAME_TCP_RAD = 1e-4, 1e-3
"""How much the tool's offset may read back from what was sent: controllers round it."""

SAFETY_SPACING_M = 0.05
"""The controller is asked about waypoints at least this far apart, and about every end."""
QUESTION_S = 0.04
"""What a question takes, a few cycles of the controller's: a plan of forty parts has three thousand."""


def require_robot(host: str, plan: Plan, confirm: str) -> Identity:
    """Return who answers at `host`, if it is the robot that the user named and if it is free to be moved.

    `confirm` must be the controller's serial number, or the cell's name when the plan's cell records that serial
    number: so a mistyped address never moves the robot next door. InputError says what does not fit.
    """
    identity = identify(host)
    cell = plan.cell
    named = confirm == identity.serial or (confirm == cell.name and cell.serial == identity.serial)
    if not named:
        hint = (
            "the cell's name counts only when the plan's cell records the serial number; "
            if confirm == cell.name
            else ""
        )
        raise InputError(
            f"--confirm names '{confirm}', but the robot at {host} has serial number {identity.serial}: {hint}"
            "check that this is the robot you mean, then confirm its serial number."
        )
    if cell.serial is not None and cell.serial != identity.serial:
        raise InputError(
            f"The plan is for the cell '{cell.name}' with robot {cell.serial}; {host} is robot {identity.serial}. "
            "Plan for this cell, or connect to the other robot."
        )
    model = robot_model(plan.robot)
    if identity.model.upper().removesuffix("E") != model.dashboard_name:
        raise InputError(f"The plan is for a {plan.robot}; the robot at {host} is a {identity.model}. Plan for that.")
    checks = (
        (identity.robot_mode == "RUNNING", f"robot mode {identity.robot_mode}", "power it on and release its brakes"),
        (
            identity.safety_status in ("NORMAL", "REDUCED"),
            f"safety status {identity.safety_status}",
            "have a person find the cause and clear it at the pendant; this program never unlocks a stop",
        ),
        (identity.remote_control, "local control", "switch the pendant to remote control"),
        (
            not identity.program_running,
            "running another program",
            "stop it at the pendant, or wait: two programs never share an arm",
        ),
    )
    for good, what, remedy in checks:
        if not good:
            raise InputError(f"The robot at {host} is in {what}: {remedy}. Nothing was moved.")
    return identity


def blocking_findings(
    plan: Plan, first_step: int, state: ArmState, tcp_offset: object, safe: Callable[[Waypoint], bool]
) -> Iterator[str]:
    """Yield what forbids to start `plan` at `first_step`, as sentences with value, limit and remedy."""
    limits = plan.cell.limits
    read = np.asarray(tcp_offset, dtype=np.float64)
    if (
        read.shape != (6,)
        or distance_m(read, plan.cell.tcp_offset) > SAME_TCP_M
        or angle_rad(read, plan.cell.tcp_offset) > SAME_TCP_RAD
    ):
        yield f"the TCP offset reads back as {np.round(read, 4).tolist()}, the plan has {list(plan.cell.tcp_offset)}"
    first = plan.steps[first_step].moves[0].path[0]
    gap, far = float(np.abs(np.subtract(state.q, first.q)).max()), distance_m(state.tcp, first.tcp)
    if gap > limits.start_joint_rad or far > limits.start_distance_m:
        if gap <= limits.start_joint_rad:
            yield (
                f"at the joint angles of step {first_step}'s first waypoint the tool is {1e3 * far:.1f} mm from where "
                f"the plan has it, limit {1e3 * limits.start_distance_m:g} mm: this arm's calibration is not the "
                "plan's. Let its primary interface (port 30001) be read, then start again"
            )
            return
        yield (
            f"step {first_step} ({plan.steps[first_step].part}), move 0, waypoint 0: the arm stands {gap:.4f} rad and "
            f"{1e3 * far:.1f} mm away, limit {limits.start_joint_rad:g} rad and {1e3 * limits.start_distance_m:g} mm; "
            f"move it to joint angles {', '.join(f'{a:.2f}°' for a in np.rad2deg(first.q))} with the pendant"
        )
    for i, k, w, place in questions(plan, first_step):
        if not safe(place):
            step, move = plan.steps[i], plan.steps[i].moves[k]
            yield (
                f"step {i} ({step.part}), move {k} ({move.kind}), waypoint {w}: outside the controller's safety "
                f"limits: {np.round(place.tcp[:3], 3).tolist()} m; plan inside them, or have the "
                "safety configuration reviewed"
            )


def wrong_payload(plan: Plan, state: ArmState) -> str:
    """Return '' or that the controller does not calculate with the empty gripper, as it was told to."""
    if abs(state.payload_kg - plan.cell.tool_mass_kg) <= SAME_KG:
        return ""
    return f"the payload reads back as {state.payload_kg:.3f} kg, the gripper weighs {plan.cell.tool_mass_kg:.3f} kg"


def questions(plan: Plan, first_step: int) -> Iterator[tuple[int, int, int, Waypoint]]:
    """Yield the places that the controller is asked about, each once, with their step, move and waypoint."""
    asked: set[Waypoint] = set()
    for i in range(first_step, len(plan.steps)):
        for k, move in enumerate(plan.steps[i].moves):
            for path in (move.path, *move.alternatives):
                for w in spaced(path):
                    place = replace(path[w], t=0.0)
                    if place not in asked:
                        asked.add(place)
                        yield i, k, w, place


def spaced(path: tuple[Waypoint, ...]) -> list[int]:
    """Return the indices of the ends of a path and of waypoints at least 50 mm apart in between."""
    out = [0]
    for w in range(1, len(path) - 1):
        if distance_m(path[w].tcp, path[out[-1]].tcp) >= SAFETY_SPACING_M:
            out.append(w)
    return out if len(path) == 1 else [*out, len(path) - 1]
