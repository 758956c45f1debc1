"""What an arm can do, for the executor: the UR arm behind ur-rtde is one implementation, the simulated cell another.

No method raises for what a robot may do to you (stops, forces, lost connections): it returns an Outcome.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from mocca_robot.arrays import Array
from mocca_robot.plan.gripper import Grip
from mocca_robot.plan.plan import Plan, Waypoint
from mocca_robot.plan.pose import Three
from mocca_robot.plan.status import Outcome


class Arm(Protocol):
    """An arm with a gripper, owned by one thread of one process. Poses in the base frame, SI units."""

    @property
    def name(self) -> str:
        """Which arm this is, for the journal: serial number, or the simulation's name."""
        ...

    def preflight(self, plan: Plan, first_step: int) -> Outcome:
        """Return SUCCEEDED if the plan may start at `first_step` right now, else REFUSED with value, limit, remedy."""
        ...

    def set_payload(self, mass_kg: float, cog_m: Three) -> Outcome:
        """Tell the arm what it carries (flange frame), and read it back."""
        ...

    def zero_force(self) -> Outcome:
        """Pause, then take the present force as zero."""
        ...

    def follow(self, path: Sequence[Waypoint], *, force_limit_n: float, contact_force_n: float | None) -> Outcome:
        """Follow a timed path; CONTACT above `contact_force_n` (if any), FORCE_LIMIT above `force_limit_n`."""
        ...

    def push(self, axis: Array, depth_m: float, *, force_limit_n: float) -> Outcome:
        """Push compliantly along `axis` (3,), unit, until `depth_m` is measured; JAMMED when it does not get there."""
        ...

    def grip(self, width_m: float, force_n: float) -> tuple[Outcome, Grip]:
        """Move the fingers to an opening, and return what they really did."""
        ...

    def stop(self) -> bool:
        """Stop; return whether the arm was measured to stand still."""
        ...
