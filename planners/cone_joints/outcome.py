"""What a design run comes to: joints that hold, or the evidence that there are none."""

from __future__ import annotations

from dataclasses import dataclass, field

from mocca_robot.design import Design
from mocca_robot.joints.bounds import TightJoint
from mocca_robot.statics.loads import LoadCase
from planners.cone_joints.kinematic import Impossible
from planners.cone_joints.search import FoundJoints


@dataclass(frozen=True, eq=False)
class NarrowPart:
    """A part whose earlier planar contacts leave a cone narrower than α: no joint can widen it (design bound)."""

    part: str
    alpha_rad: float
    required_rad: float
    blockers: tuple[str, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Designed:
    """The outcome of a design run.

    Attributes:
        design: what was built; with joints where the search ended even when it failed, so that it can be looked at.
        achieved: every required case holds and every part has its insertion cone, past all parts placed before it.
        impossible: proof that no joint within the bounds holds the named case, if there is one.
        narrow: parts that no joint can give the α that is asked for.
        margin_rad: tilt that every required state survives on top of its load, as far as designed for.
        evaluations: how often E was evaluated.
        interrupted: what Ctrl-C cut short; the joints are then the nearest found so far. None: it ran to its end.
        searched: the joints as the search left them, from which a similar design can start; None without a search.
        tight: the bounds that every joint has reached, one entry per joint; empty without a search.
    """

    design: Design
    achieved: bool
    impossible: tuple[str, Impossible] | None = None
    narrow: tuple[NarrowPart, ...] = ()
    margin_rad: float = 0.0
    evaluations: int = 0
    interrupted: str | None = None
    searched: FoundJoints | None = None
    cases: tuple[LoadCase, ...] = field(default=())
    tight: tuple[TightJoint, ...] = ()

    def __repr__(self) -> str:
        verdict = "achieved" if self.achieved else "not achieved"
        if self.interrupted is not None:
            verdict += ", interrupted"
        built = self.design.assembly
        return f"<Designed {built.name!r}: {built.said}, {len(self.design.joints)} joints, {verdict}>"
