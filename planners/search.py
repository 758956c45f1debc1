"""The search for joints: starting points from the most promising to the most stubborn, each polished in turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from planners.catalogue import fit, select
from planners.descent import MARGIN_SOLVED, VIOLATED, Parameters, Problem, evaluate
from planners.kinematic import required_wrenches
from planners.realization import SOLVED, Polished, polish
from planners.shapes import Shapes
from planners.thinning import thinned

MANY_JOINTS = 60
"""Joints above which descent starts from all joints curved and makes planar afterwards what it can: with so many
neighbours a choice of few joints made beforehand ends in a local rest."""
FEW_CASES = 5
"""Load cases up to which making joints planar afterwards takes seconds."""

Progress = Callable[[str, float], None]
"""Called with what is being done and the largest E/|w|² that is left."""


def search(problem: Problem, start: Parameters, progress: Progress | None) -> tuple[Shapes, Polished]:
    """Return the first attempt that solves everything, or the one that came nearest."""
    best: tuple[tuple[float, float], Shapes, Polished] | None = None
    for label, shapes, first in _attempts(problem, start):
        attempt = replace(problem, shapes=shapes)
        step = None if progress is None else (lambda _, worst, what=label: progress(what, worst))
        polished = polish(attempt, first, progress=step)
        hard = max(float(polished.infeasibility[: problem.required].max()) / SOLVED, polished.violation / VIOLATED, 1.0)
        rank = (hard, float(polished.infeasibility.max()))
        if best is None or rank < best[0]:
            best = (rank, shapes, polished)
        # The tilt margin is a wish: it is worth a second attempt, not all of them.
        if rank[0] <= 1.0 and (rank[1] <= 1e-9 or label not in ("few joints", "selected joints")):
            break
    assert best is not None
    few = len(problem.loads.gravity) <= FEW_CASES and len(problem.pairs) > MANY_JOINTS
    if few and best[0][0] <= 1.0:
        return best[1], _thinned(replace(problem, shapes=best[1]), best[2])
    return best[1], best[2]


def _thinned(problem: Problem, found: Polished) -> Polished:
    """Return a design with fewer curved joints that holds as well as the one found, or that one."""
    fewer = polish(problem, thinned(problem, found.parameters), evaluations=12)
    required = slice(0, problem.required)
    holds = fewer.infeasibility[required].max() <= SOLVED and fewer.violation <= VIOLATED
    worse = fewer.infeasibility.max() > max(float(found.infeasibility.max()), 0.1 * MARGIN_SOLVED)
    total = found.evaluations + fewer.evaluations
    return replace(found if worse or not holds else fewer, evaluations=total)


def _attempts(problem: Problem, start: Parameters) -> Iterator[tuple[str, Shapes, Parameters]]:
    """Yield starting points from the most promising to the most stubborn.

    First the joints that kinematic design asks for; then shapes chosen for all joints together; then uniform bumps
    of either sign (at height h > 0 normals lean outwards, at h < 0 inwards, a choice the convex relaxation does not
    see); then every joint from where kinematic design left it. Large assemblies start from uniform bumps.
    """
    shapes, loads = problem.shapes, problem.loads
    every = shapes.can_curve
    uniform = [
        (f"uniform {kind}", shapes.with_kinds([kind] * len(every)), Parameters(bump, start.lean, start.axis, every))
        for kind, bump in shapes.uniform_bumps()
    ]
    if len(shapes.contacts) > MANY_JOINTS:
        yield from uniform
        return
    points, normals, prices = shapes.candidate_rays()
    allowed = np.isfinite(prices)
    if problem.alpha_rad is not None:
        axis = start.axis[problem.pairs[:, 1]]
        allowed &= np.einsum("erd,ed->er", normals, axis) >= np.sin(problem.alpha_rad) - 1e-9
    allowed |= prices == 0.0
    price = np.where(allowed, prices, 0.0)
    required = required_wrenches(shapes.contacts, points, normals, price, allowed, loads, _telling_cases(problem))
    fitted, first = fit(problem, required, start)
    yield "few joints", fitted, first
    hardest = np.sort(np.argsort(-evaluate(problem, start).infeasibility)[:8])
    yield "selected joints", *select(problem, start, hardest)
    yield from uniform
    resting = np.where(first.curved[:, None], first.shape, shapes.rest)
    yield "all joints", fitted, Parameters(resting, first.lean, first.axis, every)


def _telling_cases(problem: Problem) -> list[int]:
    """Return the cases whose wrenches shape the joints: margins replace the cases they surround."""
    total = len(problem.loads.gravity)
    margins = list(range(problem.required, total))
    return (margins or list(range(problem.required)))[:24]
