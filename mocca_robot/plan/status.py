"""What became of a motion: a status, and the evidence that was measured when it was given."""

from __future__ import annotations

from dataclasses import KW_ONLY, asdict, dataclass
from enum import StrEnum
from typing import Any

from mocca_robot.plan.pose import Six


class ExecutionStatus(StrEnum):
    """Why a motion ended. Only SUCCEEDED lets a plan go on by itself."""

    SUCCEEDED = "succeeded"
    CONTACT = "contact"
    FORCE_LIMIT = "force_limit"
    JAMMED = "jammed"
    TRAVEL_LIMIT = "travel_limit"
    TIMED_OUT = "timed_out"
    DEVIATED = "deviated"
    PROTECTIVE_STOP = "protective_stop"
    EMERGENCY_STOP = "emergency_stop"
    SAFEGUARD_STOP = "safeguard_stop"
    CONNECTION_LOST = "connection_lost"
    PROGRAM_STOPPED = "program_stopped"
    REFUSED = "refused"
    CANCELLED = "cancelled"
    UNRECORDED = "unrecorded"
    """The journal could not be written: nothing moves that it does not announce."""


@dataclass(frozen=True, kw_only=True)
class ArmState:
    """One measured state of the arm.

    Attributes:
        time_s: the controller's own clock.
        q, qd: joint angles and speeds, rad and rad/s.
        tcp: pose of the tool's centre point, base frame.
        force: wrench at the tool's centre point, base frame, N and Nm, as the controller reports it.
        speed_scaling: share of the programmed speed at which the controller runs, 0–1.
        robot_mode, safety_mode, runtime_state: the controller's codes; 7, 1 and 2 while a program plays normally.
        status_bits, safety_bits: the controller's flags.
        payload_kg: the payload the controller calculates with.
        digital_inputs, digital_outputs: one bit per signal, in the order of `wiring.SIGNALS`.
    """

    time_s: float
    q: Six
    qd: Six
    tcp: Six
    force: Six
    speed_scaling: float
    robot_mode: int
    safety_mode: int
    runtime_state: int
    status_bits: int
    safety_bits: int
    payload_kg: float
    digital_inputs: int = 0
    digital_outputs: int = 0


@dataclass(frozen=True)
class MotionOutcome:
    """How one motion of the arm ended: status, last measured state (None if nothing was measured) and a sentence.

    `stop_observed` says whether the arm was *measured* to stand still afterwards; None where it was not needed
    (nothing had moved) and False where a stop was ordered but could not be seen.
    """

    status: ExecutionStatus
    detail: str = ""
    state: ArmState | None = None
    _: KW_ONLY
    waypoint: int | None = None
    depth_m: float | None = None
    stop_observed: bool | None = None

    @property
    def succeeded(self) -> bool:
        """Return whether the plan may go on."""
        return self.status is ExecutionStatus.SUCCEEDED


@dataclass(frozen=True, kw_only=True)
class ExecutionEvent:
    """One line of an execution: where in the plan, what happened, what was measured, when (UTC)."""

    time_utc: str
    event: str
    step: int | None = None
    part: str | None = None
    move: int | None = None
    kind: str | None = None
    attempt: int | None = None
    waypoint: int | None = None
    status: ExecutionStatus | None = None
    detail: str = ""
    q: Six | None = None
    tcp: Six | None = None
    force: Six | None = None
    robot_time_s: float | None = None
    depth_m: float | None = None
    width_m: float | None = None
    vacuum: bool | None = None
    held: bool | None = None
    stop_observed: bool | None = None

    def document(self) -> dict[str, Any]:
        """Return the event as JSON-ready values, without the fields that say nothing."""
        return {k: v for k, v in asdict(self).items() if v is not None and v != ""}
