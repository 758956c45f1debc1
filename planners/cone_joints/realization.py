"""Geometric realization of all joints together, from a start that `planners.cone_joints.catalogue` chose (Eq. 15).

`polish` improves the true geometry, with moving centroids, until every case holds, while the assemblability cone,
slopes and clearances are kept as constraints; `planners.cone_joints.descent` has the steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.tolerances import CASE_SOLVED, MARGIN_SOLVED, VIOLATED
from planners.cone_joints.descent import Descent, descend, evaluate, evaluate_built, violation_of
from planners.cone_joints.energy import EnergyResult
from planners.cone_joints.unknowns import JointParameters, JointProblem


@dataclass(frozen=True, eq=False)
class Polished:
    """Where polishing ended: parameters, E per case on the true geometry, largest constraint violation."""

    parameters: JointParameters
    infeasibility: Array
    violation: float
    evaluations: int


NEARLY_SOLVED = 1e-5
"""E/|w|² below which the facets that designing left out are asked before a case counts as failed."""


@dataclass(frozen=True, eq=False)
class Polishing:
    """Where polishing stands, between two steps: enough to go on exactly there.

    Attributes:
        parameters: at the beginning of the round of descent.
        working: (K,) the cases taken in so far.
        count: evaluations before this round.
        descent: the round under way; None between two rounds.
    """

    parameters: JointParameters
    working: BoolArray
    count: int = 0
    descent: Descent | None = None

    @property
    def reached(self) -> JointParameters:
        """Return the parameters where it stands."""
        return self.parameters if self.descent is None else self.descent.parameters

    @property
    def steps(self) -> int:
        """Return the evaluations so far."""
        return self.count + (0 if self.descent is None else len(self.descent.values))


Watch = Callable[[Polishing, float], None]
"""Shown where polishing stands before every step, and the largest E/|w|² there."""


def polish(
    problem: JointProblem,
    start: JointParameters | Polishing,
    *,
    evaluations: int = 60,
    watch: Watch | None = None,
) -> Polished:
    """Return parameters near `start` for which every case holds and every constraint is kept, if found.

    Works on the cases that fail only, and takes in others as they begin to. Stops as soon as the true geometry
    satisfies all required cases and, to `MARGIN_SOLVED`, the margin cases. A `Polishing` as start goes on there.
    """
    if isinstance(start, JointParameters):
        start = Polishing(start, np.zeros(len(problem.loads.gravity), dtype=np.bool_))
    count, parameters, descent = start.count, start.parameters, start.descent
    working = start.working.copy()
    while True:
        if descent is None:
            with_reserve = evaluate(problem, parameters, problem.shapes.options.inset)
            failing = with_reserve.infeasibility > MARGIN_SOLVED
            violation = violation_of(problem, parameters)
            true = evaluate(problem, parameters)
            solved = not failing.any() and true.infeasibility[: problem.required].max(initial=0.0) <= CASE_SOLVED
            if (solved and violation <= VIOLATED) or count >= evaluations or (count and not (failing & ~working).any()):
                return _judged(problem, parameters, true, violation, count)
            # A few of the worst newcomers at a time: neighbouring states fail for the same reason.
            newcomers = np.argsort(-np.where(working, -1.0, with_reserve.infeasibility))[:4]
            working[newcomers[failing[newcomers]]] = True
            if not working.any():
                working[0] = True
            descent = Descent(parameters)
        part = replace(problem, loads=problem.loads.only(np.flatnonzero(working)))
        before = Polishing(parameters, working.copy(), count)
        parameters, used = descend(part, descent, evaluations - count, _watching(before, watch))
        count, descent = count + used, None


def as_it_is(problem: JointProblem, parameters: JointParameters) -> Polished:
    """Return what `parameters` achieve without any step."""
    return _judged(problem, parameters, evaluate(problem, parameters), violation_of(problem, parameters), 0)


def _judged(
    problem: JointProblem, parameters: JointParameters, true: EnergyResult, violation: float, count: int
) -> Polished:
    """Return the result of polishing; required cases that nearly hold are judged by every facet."""
    left = true.infeasibility[: problem.required].max(initial=0.0)
    if CASE_SOLVED < left < NEARLY_SOLVED:
        true = evaluate_built(problem, parameters)
    return Polished(parameters, true.infeasibility, violation, count)


def _watching(round_: Polishing, watch: Watch | None) -> Callable[[Descent, EnergyResult], None] | None:
    if watch is None:
        return None
    return lambda descent, result: watch(replace(round_, descent=descent), float(result.infeasibility.max()))


__all__ = ["JointParameters", "JointProblem", "Polished", "Polishing", "evaluate", "polish", "violation_of"]
