"""Reading a controller's state with suspicion: what in it forbids to go on, and under which status."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from mocca_robot.plan.pose import six
from mocca_robot.plan.status import ArmState, ExecutionStatus

RUNNING_MODE = 7
NORMAL_SAFETY = (1, 2)
"""Normal and reduced: both are the safety system's undisturbed operation."""
PLAYING = 2
_SAFETY = {
    3: (ExecutionStatus.PROTECTIVE_STOP, "protective stop"),
    4: (ExecutionStatus.PROTECTIVE_STOP, "recovery mode"),
    5: (ExecutionStatus.SAFEGUARD_STOP, "safeguard stop"),
    6: (ExecutionStatus.EMERGENCY_STOP, "system emergency stop"),
    7: (ExecutionStatus.EMERGENCY_STOP, "robot emergency stop"),
    8: (ExecutionStatus.PROTECTIVE_STOP, "safety violation"),
    9: (ExecutionStatus.PROTECTIVE_STOP, "safety fault"),
    12: (ExecutionStatus.SAFEGUARD_STOP, "safeguard stop of the automatic mode"),
    13: (ExecutionStatus.SAFEGUARD_STOP, "three-position enabling device"),
}
_BITS = (
    (1 << 7 | 1 << 6 | 1 << 5, ExecutionStatus.EMERGENCY_STOP, "emergency stop (safety bits)"),
    (1 << 4, ExecutionStatus.SAFEGUARD_STOP, "safeguard stop (safety bits)"),
    (1 << 2 | 1 << 8 | 1 << 9, ExecutionStatus.PROTECTIVE_STOP, "protective stop (safety bits)"),
)
_RUNTIME = {0: "stopping", 1: "stopped", 3: "pausing", 4: "paused", 5: "resuming"}


class Stopped(Exception):
    """A motion must end now: the status to report, and the last state that was measured."""

    def __init__(self, status: ExecutionStatus, detail: str, state: ArmState | None = None) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.state = state


def parse_state(raw: Mapping[str, Any]) -> ArmState:
    """Return the state in what the eyes report; Stopped(CONNECTION_LOST) if it has holes or is not finite."""
    try:
        state = ArmState(
            time_s=float(raw["time_s"]),
            q=six(raw["q"]),
            qd=six(raw["qd"]),
            tcp=six(raw["tcp"]),
            force=six(raw["force"]),
            speed_scaling=float(raw["speed_scaling"]),
            robot_mode=int(raw["robot_mode"]),
            safety_mode=int(raw["safety_mode"]),
            runtime_state=int(raw["runtime_state"]),
            status_bits=int(raw["status_bits"]),
            safety_bits=int(raw["safety_bits"]),
            payload_kg=float(raw["payload_kg"]),
            digital_inputs=int(raw["digital_inputs"]),
            digital_outputs=int(raw["digital_outputs"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise Stopped(ExecutionStatus.CONNECTION_LOST, f"the controller's state is incomplete ({error})") from error
    numbers = (state.time_s, *state.q, *state.qd, *state.tcp, *state.force, state.speed_scaling, state.payload_kg)
    if not all(math.isfinite(v) for v in numbers):
        raise Stopped(ExecutionStatus.CONNECTION_LOST, "the controller's state holds numbers that are not finite")
    return state


def safety_stop(state: ArmState) -> tuple[ExecutionStatus, str] | None:
    """Return why the safety system has stopped the arm, or None."""
    if state.safety_mode in _SAFETY:
        return _SAFETY[state.safety_mode]
    if state.safety_mode not in NORMAL_SAFETY:
        return ExecutionStatus.PROTECTIVE_STOP, f"unknown safety mode {state.safety_mode}"
    for bits, status, words in _BITS:
        if state.safety_bits & bits:
            return status, words
    if state.robot_mode != RUNNING_MODE:
        return ExecutionStatus.PROGRAM_STOPPED, f"robot mode {state.robot_mode}, not {RUNNING_MODE} (running)"
    return None


def program_stop(state: ArmState) -> tuple[ExecutionStatus, str] | None:
    """Return why our program does not move the arm, or None: the pendant stopped it, or holds its speed at zero."""
    if state.runtime_state != PLAYING:
        words = _RUNTIME.get(state.runtime_state, f"in state {state.runtime_state}")
        return ExecutionStatus.PROGRAM_STOPPED, f"the program is {words}"
    if state.speed_scaling <= 0.0:
        return ExecutionStatus.PROGRAM_STOPPED, "the speed slider is at 0 %"
    return None
