"""What planning a build comes to: a plan, or why there is none, with what was found for every part."""

from __future__ import annotations

from dataclasses import dataclass

from mocca_robot.plan.plan import Plan
from planners.robot.cell import RobotCell
from planners.robot.falling_states import FallingState
from planners.robot.site import Site
from planners.robot.tray import Tray


@dataclass(frozen=True, kw_only=True)
class PartReport:
    """How planning one part went.

    Attributes:
        placed: whether a way was found.
        seconds: wall time.
        attempts: grasps times arm branches tried.
        reasons: why attempts failed, with their counts.
        grasp_width_m: of the grasp used.
        cone_rad, usable_rad: the part's cone, and how far from its axis the arm could insert instead: its tolerance.
        out_of_reach: no grasp brings it to its place with any branch of the arm, whatever stands around.
    """

    part: str
    placed: bool
    seconds: float
    attempts: int
    reasons: str
    grasp_width_m: float = 0.0
    cone_rad: float = 0.0
    usable_rad: float = 0.0
    out_of_reach: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class BuildPlan:
    """A plan, or why there is none.

    Attributes:
        plan: None when a state falls or a part cannot be placed; with `partial` the steps before that part.
        reports: one per part that was planned.
        falls: states that fall without declared supports.
        cell: with the place, turn and tray that were chosen.
        site, tray: where everything stands.
    """

    plan: Plan | None
    reports: tuple[PartReport, ...]
    falls: tuple[FallingState, ...]
    cell: RobotCell
    site: Site
    tray: Tray

    @property
    def out_of_reach(self) -> tuple[str, ...]:
        """Return the parts that no grasp brings to their place with any arm branch, whatever stands around."""
        return tuple(r.part for r in self.reports if r.out_of_reach)
