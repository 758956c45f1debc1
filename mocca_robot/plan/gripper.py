"""Grippers: open, close, and the width that was really reached. A width is evidence: it says whether a part is held."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

from mocca_robot.errors import InputError
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Plan
from mocca_robot.plan.status import ArmState


@dataclass(frozen=True)
class Fingers:
    """What a maker publishes about two fingers: largest opening, and the smallest and largest force that they take."""

    stroke_m: float
    force_n: tuple[float, float]


FINGERS: Mapping[str, Fingers] = MappingProxyType(
    {
        "2f85": Fingers(0.085, (20.0, 235.0)),
        "hande": Fingers(0.050, (20.0, 130.0)),
        "rg2": Fingers(0.110, (3.0, 40.0)),
        "rg6": Fingers(0.160, (25.0, 120.0)),
    }
)
"""The grippers that are told an opening, by the name that a plan gives them: Robotiq's and OnRobot's data sheets and
manuals. Of the Hand-E they give different forces; with these it never grips with less than it was asked for."""


COMPUTE_BOX = "192.168.1.1"
"""Where OnRobot's Compute Box listens as it comes out of its box."""


class GripperLost(Exception):
    """The gripper did not answer in time or reports a fault."""


@dataclass(frozen=True)
class Grip:
    """What was measured of a grip; None is what has no sensor.

    Attributes:
        width_m, blocked: of fingers: their opening, and whether something stopped them.
        vacuum: of a suction cup: whether there is vacuum under it.
        held: of fingers that are only open or closed: whether a switch shows something between them.
    """

    width_m: float | None
    blocked: bool | None
    vacuum: bool | None = None
    held: bool | None = None


class Gripper(Protocol):
    """Fingers or a cup. `tick` is called while waiting, so that the arm stays supervised, and returns its state."""

    def move(self, width_m: float, force_n: float, tick: Callable[[], ArmState]) -> Grip:
        """Return what was reached after moving to an opening of `width_m`; GripperLost when nothing answers."""
        ...

    def lost(self, state: ArmState) -> str:
        """Return '' or how the part that was held got lost on the way, as far as the arm's state shows it."""
        ...

    def unready(self, state: ArmState) -> str:
        """Return '' or why no step can begin, as far as the arm's state shows it."""
        ...

    def close(self) -> None:
        """Release the connection; what is held stays held."""
        ...


def holds(grip: Grip, width_m: float, limits: MotionLimits) -> bool | None:
    """Return whether a part of `width_m` is held: vacuum, or fingers stopped by it; None when nothing was measured."""
    if grip.width_m is None:
        return grip.vacuum if grip.held is None else grip.held
    return bool(grip.blocked) and abs(grip.width_m - width_m) <= limits.grip_tolerance_m


def undrivable(plan: Plan) -> str:
    """Return '' or why this package cannot drive the plan's gripper, and what to do."""
    if plan.gripper == "suction" and plan.cell.vacuum is None:
        return (
            f"The cell '{plan.cell.name}' does not say how its suction cup is wired. Add 'vacuum_output: standard_0' "
            "(its valve's output) and, with a vacuum switch, 'vacuum_input' to the cell's gripper, then plan again."
        )
    if plan.gripper == "digital" and plan.cell.fingers is None:
        return (
            f"The cell '{plan.cell.name}' does not say how its fingers are wired. Add 'close_output: standard_0' (the "
            "output that closes them) to the cell's gripper, then plan again."
        )
    return ""


def require_drivable(plan: Plan) -> None:
    """Return if this package can drive the plan's gripper; InputError says what to do otherwise."""
    if words := undrivable(plan):
        raise InputError(words)
