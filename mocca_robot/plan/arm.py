"""What an arm can do, as far as supervision needs it: be read, be led, push, grip, stop.

The UR arm behind ur-rtde is one implementation, the simulated cell another; `motions` makes supervised motions of both.
For what a robot may do to you (stops, forces, lost connections) a method raises Stopped and nothing else; `preflight`,
`halt` and `stop`, which end a motion or come before any, do not even raise that.
"""

from __future__ import annotations

from typing import Protocol

from mocca_robot.arrays import Array
from mocca_robot.plan.gripper import Grip
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Plan
from mocca_robot.plan.pose import Six, Three
from mocca_robot.plan.status import ArmState, MotionOutcome
from mocca_robot.plan.supervision import Stopped


class Arm(Protocol):
    """An arm with a gripper, owned by one thread of one process. Poses in the base frame, SI units."""

    @property
    def name(self) -> str:
        """Which arm this is, for the journal: serial number, or the simulation's name."""
        ...

    @property
    def limits(self) -> MotionLimits:
        """What no motion may exceed."""
        ...

    def now(self) -> float:
        """Return the seconds on the clock that deadlines are kept by."""
        ...

    def preflight(self, plan: Plan, first_step: int) -> MotionOutcome:
        """Return SUCCEEDED if the plan may start at `first_step` right now, else REFUSED with value, limit, remedy."""
        ...

    def watch(self) -> ArmState:
        """Return a fresh state in which the arm may move; Stopped when there is none, or when the user cancelled."""
        ...

    def attend(self) -> ArmState:
        """Let one cycle pass under the present command, and `watch`; Stopped also when the part in hand got lost."""
        ...

    def servo(self, q: Array) -> None:
        """Have the joints (6,) follow to these angles until `end_servo`; to be called in every cycle."""
        ...

    def end_servo(self) -> None:
        """Come to rest and stay there."""
        ...

    def push_along(self, frame: Six, force_n: float, speed_m_s: float) -> None:
        """Push with a force along z of `frame` until `end_push`, no faster than asked, giving way sideways without
        turning. May be called again, to go on at another speed.
        """
        ...

    def end_push(self) -> None:
        """Stop pushing, and hold the place."""
        ...

    def zero_force(self) -> None:
        """Tell the controller that nothing but its payload hangs on the hand now."""
        ...

    def set_payload(self, mass_kg: float, cog_m: Three) -> None:
        """Tell the controller what it carries (flange frame); the state then says what it calculates with."""
        ...

    def grip(self, width_m: float, force_n: float) -> Grip:
        """Move the fingers to an opening, or switch the vacuum, and return what they really did."""
        ...

    def show(self, text: str) -> None:
        """Show a text to whoever stands at the arm, if it has something to show it on; '' takes it away."""
        ...

    def halt(self, stop: Stopped) -> MotionOutcome:
        """Stop the arm for the reason in `stop`, and return that with its evidence: was standstill measured?"""
        ...

    def stop(self) -> bool:
        """Stop the arm by whatever way is left; return whether it was measured to stand still."""
        ...
