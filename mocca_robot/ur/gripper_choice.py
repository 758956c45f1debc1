"""From the gripper that a plan names to the one that is driven."""

from __future__ import annotations

from mocca_robot.errors import InputError
from mocca_robot.ur.gripper import Gripper, NoGripper, RobotiqSocket
from mocca_robot.ur.plan import Plan
from mocca_robot.ur.suction import SuctionCup


def undrivable(plan: Plan) -> str:
    """Return '' or why this package cannot drive the plan's gripper, and what to do."""
    if plan.gripper == "suction" and plan.cell.vacuum is None:
        return (
            f"The cell '{plan.cell.name}' does not say how its suction cup is wired. Add 'vacuum_output: standard_0' "
            "(its valve's output) and, with a vacuum switch, 'vacuum_input' to the cell's gripper, then plan again."
        )
    return ""


def require_drivable(plan: Plan) -> None:
    """Return if this package can drive the plan's gripper; InputError says what to do otherwise."""
    if words := undrivable(plan):
        raise InputError(words)


def connect(plan: Plan, host: str) -> Gripper:
    """Return the plan's gripper, connected; InputError for one that cannot be driven."""
    require_drivable(plan)
    if plan.cell.vacuum is not None and plan.gripper == "suction":
        return SuctionCup(host, plan.cell.vacuum, 0.5 * sum(plan.cell.gripper_stroke_m))
    return NoGripper() if plan.gripper == "none" else RobotiqSocket(host)
