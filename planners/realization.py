"""Geometric realization of all joints together, from a start that `planners.catalogue` chose (Eq. 15, 18).

`polish` improves the true geometry, with moving centroids, until every case holds, while the assemblability cone,
slopes and clearances are kept as constraints; `planners.descent` has the steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.assembly import Array
from planners.descent import (
    MARGIN_SOLVED,
    VIOLATED,
    Parameters,
    Problem,
    descend,
    evaluate,
    evaluate_built,
    violation_of,
)


@dataclass(frozen=True, eq=False)
class Polished:
    """Where polishing ended: parameters, E per case on the true geometry, largest constraint violation."""

    parameters: Parameters
    infeasibility: Array
    violation: float
    evaluations: int


SOLVED = 1e-13
"""E/|w|² of a required case that counts as zero: |s|/|w| below half of the verdict's tolerance."""


NEARLY_SOLVED = 1e-5
"""E/|w|² below which the facets that designing left out are asked before a case counts as failed."""


def polish(
    problem: Problem,
    start: Parameters,
    *,
    evaluations: int = 60,
    progress: Callable[[int, float], None] | None = None,
) -> Polished:
    """Return parameters near `start` for which every case holds and every constraint is kept, if found.

    Works on the cases that fail only, and takes in others as they begin to. Stops as soon as the true geometry
    satisfies all required cases and, to `MARGIN_SOLVED`, the margin cases.
    """
    count, parameters = 0, start
    working = np.zeros(len(problem.loads.gravity), dtype=np.bool_)
    while True:
        with_reserve = evaluate(problem, parameters, problem.shapes.options.inset)
        failing = with_reserve.infeasibility > MARGIN_SOLVED
        violation = violation_of(problem, parameters)
        true = evaluate(problem, parameters)
        solved = not failing.any() and true.infeasibility[: problem.required].max(initial=0.0) <= SOLVED
        if (solved and violation <= VIOLATED) or count >= evaluations or (count and not (failing & ~working).any()):
            left = true.infeasibility[: problem.required].max(initial=0.0)
            if SOLVED < left < NEARLY_SOLVED:
                true = evaluate_built(problem, parameters)
            return Polished(parameters, true.infeasibility, violation, count)
        # A few of the worst newcomers at a time: neighbouring states fail for the same reason.
        newcomers = np.argsort(-np.where(working, -1.0, with_reserve.infeasibility))[:4]
        working[newcomers[failing[newcomers]]] = True
        if not working.any():
            working[0] = True
        part = replace(problem, loads=problem.loads.only(np.flatnonzero(working)))
        parameters, used = descend(part, parameters, evaluations - count, progress)
        count += used


__all__ = ["Parameters", "Polished", "Problem", "evaluate", "polish", "violation_of"]
