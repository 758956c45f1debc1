"""The search for joints: starting points from the most promising to the most stubborn, each polished in turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial

import numpy as np

from mocca_robot.tolerances import ANGLE_ROUNDING_RAD, CASE_SOLVED, MARGIN_SOLVED, VIOLATED
from planners.cone_joints.catalogue import fit, select
from planners.cone_joints.descent import evaluate
from planners.cone_joints.kinematic import required_wrenches
from planners.cone_joints.realization import Polished, Polishing, polish
from planners.cone_joints.richer import beginnings, chosen_among_all, refinements
from planners.cone_joints.rubbing import pushes, repeated
from planners.cone_joints.shapes import Shapes
from planners.cone_joints.thinning import thin
from planners.cone_joints.unknowns import JointParameters, JointProblem, made_alike

MANY_JOINTS = 60
"""Joints above which descent starts from all joints curved and makes planar afterwards what it can: with so many
neighbours a choice of few joints made beforehand ends in a local rest."""
FEW_CASES = 5
"""Load cases up to which making joints planar afterwards takes seconds."""
Progress = Callable[[str, float], None]
"""Called with what is being done and the largest E/|w|² that is left."""


class Attempt(StrEnum):
    """Where an attempt starts from, as it is told."""

    SIMILAR = "similar joints"
    FEW = "few joints"
    SELECTED = "selected joints"
    UNIFORM_N = "uniform n"
    UNIFORM_Z = "uniform z"
    UNIFORM_FRUSTUM = "uniform frustum"
    UNIFORM_DRAWN = "uniform drawn"
    ALL = "all joints"
    MIXED = "mixed joints"
    FREE = "more heights"
    BEGUN = "richer joints"

    @property
    def early(self) -> bool:
        """Return whether another attempt follows when only the tilt margin is missed."""
        return self in (Attempt.SIMILAR, Attempt.FEW, Attempt.SELECTED)

    @property
    def refining(self) -> bool:
        """Return whether it goes on from the best joints so far, so that it is worth trying for the tilt margin too."""
        return self is Attempt.FREE


RICHER = 100
"""The number of the first attempt with richer families: states that are gone on with name attempts by number."""


class Stage(StrEnum):
    """What a search is at."""

    POLISHING = "polishing"
    THINNING = "thinning"
    FINISHED = "finished"


@dataclass(frozen=True, eq=False, kw_only=True)
class SearchState:
    """Where a search stands: enough to go on from there, with the same outcome as if it had never stopped.

    Attributes:
        stage: attempts being polished, curved joints being made planar again, or all done.
        attempt: number of the attempt under way: from 0, with richer families from `RICHER`.
        polishing: where its polishing stands; None before its first step.
        best_attempt, best: the attempt that came nearest of those finished, and where it ended.
        plain_attempt, plain: the same among plain families, once richer ones go on from there.
    """

    stage: Stage = Stage.POLISHING
    attempt: int = 0
    polishing: Polishing | None = None
    best_attempt: int = 0
    best: Polished | None = None
    plain_attempt: int = 0
    plain: Polished | None = None


Keep = Callable[[SearchState], None]
"""Shown every state that is worth keeping; the last one is where an interrupted search goes on."""


@dataclass(frozen=True, eq=False)
class FoundJoints:
    """The joints that a search found: all it asked for, or the nearest to it.

    Attributes:
        shapes, polished: the joints' families, and where polishing ended.
        interrupted: what was being done when Ctrl-C ended it; None when it ended by itself.
    """

    shapes: Shapes
    polished: Polished
    interrupted: str | None = None

    def all_curved(self) -> FoundJoints:
        """Return the same with every joint free to curve, from where it is, also those that the loads did not need."""
        parameters = replace(self.polished.parameters, curved=self.shapes.can_curve)
        return replace(self, polished=replace(self.polished, parameters=parameters))


def search(
    problem: JointProblem,
    start: JointParameters,
    progress: Progress | None = None,
    *,
    resume: SearchState | None = None,
    keep: Keep | None = None,
    near: FoundJoints | None = None,
    alone: bool = False,
) -> FoundJoints:
    """Return the first attempt that solves everything, or the one that came nearest.

    Ctrl-C ends it early with the nearest joints so far. `resume` is a state that `keep` was shown by an earlier
    search of the same problem. `near` holds joints that solve a similar problem, over the same contacts: they are
    tried first, and of large assemblies, or with `alone`, nothing else.
    """
    trail = _Trail(resume or SearchState(), progress, keep)
    families: dict[int, Shapes] = {}
    try:
        attempts = enumerate(_attempts(problem, start, near, alone))
        if not _tried(problem, attempts, trail, families):
            plain = trail.state.plain or trail.state.best
            many = len(problem.pairs) > MANY_JOINTS
            solved = plain is not None and _rank(problem, plain)[0] <= 1.0
            if not (solved and many):  # the margin of a large assembly is not worth it
                alone = alone or solved or (many and near is not None)
                further = _richer(problem, start, trail, families, alone=alone)
                _tried(problem, enumerate(further, RICHER), trail, families)
        assert trail.state.best is not None
        best = trail.state.best
        few = len(problem.loads.gravity) <= FEW_CASES and len(problem.pairs) > MANY_JOINTS
        if trail.state.stage is not Stage.FINISHED and few and _rank(problem, best)[0] <= 1.0:
            trail.doing = "fewer joints"
            part = replace(problem, shapes=families[trail.state.best_attempt])
            best = thin(part, best, trail.thinner)
        trail.reach(replace(trail.state, stage=Stage.FINISHED, best=best))
    except KeyboardInterrupt:
        return replace(_nearest(problem, start, families, trail.state), interrupted=trail.doing)
    return FoundJoints(families[trail.state.best_attempt], best)


class _Trail:
    """The latest state of a search, and who is shown it."""

    def __init__(self, state: SearchState, progress: Progress | None, keep: Keep | None) -> None:
        self.state = state
        self.doing = "starting points"
        self._progress, self._keep = progress, keep

    def reach(self, state: SearchState) -> None:
        self.state = state
        if self._keep is not None:
            self._keep(state)

    def step(self, attempt: int, polishing: Polishing, worst: float) -> None:
        if self._progress is not None:
            self._progress(f"{self.doing}, step {polishing.steps + 1}", worst)
        self.reach(replace(self.state, attempt=attempt, polishing=polishing))

    def thinner(self, polished: Polished) -> None:
        if self._progress is not None:
            curved = int(polished.parameters.curved.sum())
            self._progress(f"{self.doing}: {curved} are curved", float(polished.infeasibility.max()))
        self.reach(replace(self.state, stage=Stage.THINNING, best=polished))


def _tried(
    problem: JointProblem,
    attempts: Iterator[tuple[int, tuple[Attempt, Shapes, JointParameters]]],
    trail: _Trail,
    families: dict[int, Shapes],
) -> bool:
    """Return whether one of the numbered attempts, polished, solves everything; `trail` then knows the best.

    The first one that solves all but the tilt margin ends the trying as well, unless it is an early one. `families`
    receives the shapes of every attempt that was begun.
    """
    for number, (label, shapes, first) in attempts:
        families[number] = shapes
        state = trail.state
        if state.stage is not Stage.POLISHING and state.best is not None:  # an earlier run has got further
            if number == state.best_attempt:
                return True
            continue
        if number < state.attempt:
            continue
        trail.doing = label
        if problem.shapes.options.alike:
            first = made_alike(first, shapes.heights)
        begun = state.polishing or first
        polished = polish(replace(problem, shapes=shapes), begun, watch=partial(trail.step, number))
        rank = _rank(problem, polished)
        if state.best is None or rank < _rank(problem, state.best):
            state = replace(state, best_attempt=number, best=polished)
        # The tilt margin is a wish: it is worth a second attempt, not all of them.
        solved, margin = rank[0] <= 1.0, rank[1] <= MARGIN_SOLVED
        enough = solved and (margin or not label.early)
        stage = Stage.THINNING if enough and margin else Stage.POLISHING
        trail.reach(replace(state, stage=stage, attempt=number + 1, polishing=None))
        if enough:
            return margin
    return False


def _nearest(
    problem: JointProblem, start: JointParameters, families: dict[int, Shapes], state: SearchState
) -> FoundJoints:
    """Return the joints that an interrupted search came nearest with: a finished attempt's, or the current one's."""
    found: list[tuple[int, Polished]] = []
    # Families are missing when a search that went on from an earlier one ends before it has found its place again.
    if state.best is not None and state.best_attempt in families:
        found.append((state.best_attempt, state.best))
    if state.polishing is not None and state.attempt in families:
        attempt = replace(problem, shapes=families[state.attempt])
        found.append((state.attempt, polish(attempt, state.polishing.reached, evaluations=0)))
    if not found:
        return FoundJoints(problem.shapes, polish(problem, start, evaluations=0))
    number, polished = min(found, key=lambda f: _rank(problem, f[1]))
    return FoundJoints(families[number], polished)


def _rank(problem: JointProblem, polished: Polished) -> tuple[float, float]:
    """Return how far from solved: required cases and constraints first (1 = solved), then the tilt margins."""
    required = float(polished.infeasibility[: problem.required].max())
    hard = max(required / CASE_SOLVED, polished.violation / VIOLATED, 1.0)
    return hard, float(polished.infeasibility.max())


def _attempts(
    problem: JointProblem, start: JointParameters, near: FoundJoints | None, alone: bool
) -> Iterator[tuple[Attempt, Shapes, JointParameters]]:
    """Yield starting points from the most promising to the most stubborn.

    First the joints that kinematic design asks for; then shapes chosen for all joints together; then uniform bumps
    of either sign (at height h > 0 normals lean outwards, at h < 0 inwards, a choice the convex relaxation does not
    see); then every joint from where kinematic design left it. Large assemblies, and joints to look alike,
    start from uniform bumps.
    """
    shapes, loads = problem.shapes, problem.loads
    every = shapes.can_curve
    uniform = [
        (
            Attempt(f"uniform {kind}"),
            shapes.with_kinds([kind] * len(every)),
            JointParameters(bump, start.lean, start.axis, every),
        )
        for kind, bump in shapes.uniform_bumps()
    ]
    if near is not None:
        yield Attempt.SIMILAR, near.shapes, near.polished.parameters
        if alone:
            return
    if len(shapes.contacts) > MANY_JOINTS or shapes.options.alike:
        if near is None or shapes.options.alike:
            yield from uniform
        return
    points, normals, prices = shapes.candidate_rays()
    allowed = np.isfinite(prices)
    if problem.alpha_rad is not None:
        axis = start.axis[problem.pairs[:, 1]]
        allowed &= np.einsum("erd,ed->er", normals, axis) >= np.sin(problem.alpha_rad) - ANGLE_ROUNDING_RAD
    allowed |= prices == 0.0
    price = np.where(allowed, prices, 0.0)
    points, normals = pushes(shapes, points, normals)
    price, allowed = repeated(shapes, price), repeated(shapes, allowed)
    required = required_wrenches(shapes.contacts, points, normals, price, allowed, loads, _telling_cases(problem))
    fitted, first = fit(problem, required, start)
    yield Attempt.FEW, fitted, first
    hardest = np.sort(np.argsort(-evaluate(problem, start).infeasibility)[:8])
    yield Attempt.SELECTED, *select(problem, start, hardest)
    yield from uniform
    resting = np.where(first.curved[:, None], first.shape, shapes.rest)
    yield Attempt.ALL, fitted, JointParameters(resting, first.lean, first.axis, every)


def _richer(
    problem: JointProblem, start: JointParameters, trail: _Trail, families: dict[int, Shapes], *, alone: bool
) -> Iterator[tuple[Attempt, Shapes, JointParameters]]:
    """Yield starting points with richer families: first from the nearest plain joints, with more heights.

    With `alone` nothing else follows. Then shapes chosen among all families together, where joints are few, and at last
    one family on all contacts.
    """
    state = trail.state
    if state.plain is None:
        state = replace(state, plain_attempt=state.best_attempt, plain=state.best)
        trail.reach(state)
    assert state.plain is not None
    for _, shapes, first in refinements(families[state.plain_attempt], state.plain.parameters):
        yield Attempt.FREE, shapes, first
    if alone:
        return
    if len(problem.pairs) <= MANY_JOINTS and not problem.shapes.options.alike:
        hardest = np.sort(np.argsort(-evaluate(problem, start).infeasibility)[:8])
        mixed = chosen_among_all(problem, start, hardest)
        if mixed is not None:
            yield Attempt.MIXED, *mixed
    for _, shapes, first in beginnings(problem, start):
        yield Attempt.BEGUN, shapes, first


def _telling_cases(problem: JointProblem) -> list[int]:
    """Return the cases whose wrenches shape the joints: margins replace the cases they surround."""
    total = len(problem.loads.gravity)
    margins = list(range(problem.required, total))
    return (margins or list(range(problem.required)))[:24]
