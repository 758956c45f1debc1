"""One load on contacts with springs and Coulomb friction that does not lift what slides: how the parts settle, or fall.

A fixed point of second-order cone programs (Acary and Cadoux 2013, "Applications of an existence result for the
Coulomb friction problem"): with the offsets s = μ |slip| of the last answer the dilation of the cone program cancels.
Anderson acceleration takes longer steps; as soon as one answer is near enough, Newton's method on Coulomb's law itself
(`coulomb_newton`) finishes, and what it returns obeys the law exactly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.statics.solver.compliant_cones import CompliantCones, ConeForces, solve
from mocca_robot.statics.solver.coulomb_newton import EXACT, CoulombPoint, at, newton

DEPENDENT = 1e-8
"""Relative singular value of a step that says nothing new."""

MEMORY = 4
LONGEST_JUMP = 30.0
"""How far an accelerated step may go, in plain steps."""
PROGRAMS, PROGRAMS_AT_REST = 12, 40
"""Cone programs until a step of time, or the search for rest, is given up."""
TRIED_AT_ONCE, PATIENCE, NEARER = 2, 6, 0.7
"""Programs after each of which Newton's method is tried, later after every other; programs that must bring the answer
nearer, and how much nearer."""
FEWEST_PROGRAMS, MOST_WORK = 30, 60_000
"""Cone programs, and their number times that of unknowns and contacts, until the search for where parts move ends."""
SOLVABLE = 1e-7
"""Residual of the first cone program above which no forces may hold the load."""
GIVES = 0.3
"""Share of the load that the first step of time leaves unbalanced where parts only give."""
SHORTER = 10.0
"""Ratio of the inertia of two steps of time."""
MOST_STEPS = 80
FALLING, RESTING = 0.95, 0.5
"""Ratio of what two steps of time leave unbalanced from which on parts fall, and below which they may come to rest."""
FAR = 100.0
"""Displacement of parts that fall, over what springs give."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StepsSettled:
    """What one load brings about.

    Attributes:
        point: at rest, or at the end of the last step of time that was solved; None if none was.
        rests, falls: what is proved; neither, where the steps did not tell.
        speed: (n,) how they move about the common point, per unit of what is left unbalanced; None at rest.
        programs: cone programs that it took.
        shares: what each step of time left unbalanced, relative to the load.
    """

    point: CoulombPoint | None
    rests: bool
    falls: bool
    speed: Array | None
    programs: int
    shares: tuple[float, ...]


@dataclass
class _Counter:
    programs: int = 0


def rest(problem: CompliantCones, start: Array | None = None) -> StepsSettled:
    """Return how parts come to rest under a load of unit norm, or that rest was not found in a few cone programs.

    `problem` has no inertia; `start` (n,) are displacements under a similar load. Where it does not rest, `point` is
    None, or the elastic answer of the first cone program if there is one.
    """
    count = _Counter()
    if start is not None:
        point = newton(problem, start)
        if point.error <= EXACT:
            return _settled(point, count, rests=True)
    first = solve(problem, np.zeros(problem.compliance.shape[1]))
    count.programs += 1
    if first.residual > SOLVABLE:
        return _settled(None, count)
    slip = np.hypot(first.s[1], first.s[2])
    for point in _approached(problem, first, slip, PROGRAMS_AT_REST, count):
        if point.error <= EXACT:
            return _settled(point, count, rests=True)
    return _settled(at(problem, first.u), count)


def move(problem: CompliantCones, elastic: StepsSettled) -> StepsSettled:
    """Return where parts move that were not found at rest: to rest after all, or on and on.

    One step of time follows the other, each from where the last ended but without its speed, and, while they can be
    solved, each with a tenth of the inertia of the last. Where ever less stays unbalanced, rest is near. Parts whose
    displacement has grown tenfold and again, far beyond what springs give, with as much left unbalanced, fall.
    """
    count = _Counter()
    blocks = problem.blocks
    reach = 1.0 if elastic.point is None else float(np.linalg.norm(blocks.own_gram_times(elastic.point.u)))
    inertia, travelled = GIVES / reach, np.zeros(blocks.size)
    point: CoulombPoint | None = None
    shares: list[float] = []
    path: list[tuple[float, float]] = []
    speed = np.zeros(blocks.size)
    faster, size = SHORTER, blocks.size + problem.compliance.shape[1]
    for _ in range(MOST_STEPS):
        if count.programs >= max(FEWEST_PROGRAMS, MOST_WORK / size):
            break
        pull = problem.pull + inertia * blocks.own_gram_times(travelled)
        step = replace(problem, pull=pull, inertia=inertia * blocks.own_gram)
        after = _step_of_time(step, travelled, travelled + speed / inertia, count)
        if after is None:
            faster = np.sqrt(SHORTER)
            inertia *= faster
            continue
        point, speed, travelled = after, inertia * (after.u - travelled), after.u
        shares.append(float(np.linalg.norm(blocks.own_gram_times(speed))))
        path.append((float(np.linalg.norm(blocks.own_gram_times(travelled))) / reach, shares[-1]))
        if _goes_on(path):
            return _settled(point, count, falls=True, speed=speed, shares=tuple(shares))
        if len(shares) > 1 and shares[-1] <= RESTING * shares[-2]:
            still = newton(problem, travelled + speed / (inertia * (SHORTER - 1.0)))
            if still.error <= EXACT:
                return _settled(still, count, rests=True, shares=tuple(shares))
        inertia, faster = inertia / faster, SHORTER
    return _settled(point, count, speed=speed, shares=tuple(shares))


def _goes_on(path: list[tuple[float, float]]) -> bool:
    """Return whether displacements, relative to what springs give, grow and grow with as much unbalanced."""
    far, share = path[-1]
    return far >= FAR and any(f <= far / SHORTER * 2.0 and share >= FALLING * s for f, s in path[-3:-1])


def _settled(
    point: CoulombPoint | None,
    count: _Counter,
    *,
    rests: bool = False,
    falls: bool = False,
    speed: Array | None = None,
    shares: tuple[float, ...] = (),
) -> StepsSettled:
    return StepsSettled(point=point, rests=rests, falls=falls, speed=speed, programs=count.programs, shares=shares)


def _step_of_time(step: CompliantCones, here: Array, guess: Array, count: _Counter) -> CoulombPoint | None:
    """Return the end of one step of time from displacements `here`, or None if it was not found."""
    moving = bool(here.any())
    for u in (guess, here) if moving else ():
        point = newton(step, u)
        if point.error <= EXACT:
            return point
    slip = _slip(step, at(step, here)) if moving else np.zeros(step.compliance.shape[1])
    for point in _approached(step, None, slip, PROGRAMS, count):
        if point.error <= EXACT:
            return point
    return None


def _slip(step: CompliantCones, point: CoulombPoint) -> Array:
    """Return (contacts,) how far contacts slide: what of their motion their springs do not take up."""
    along, across = point.x[1:] + step.compliance[1:] * point.z[1:]
    return np.asarray(np.hypot(along, across))


def _approached(
    problem: CompliantCones, first: ConeForces | None, slip: Array, programs: int, count: _Counter
) -> Iterator[CoulombPoint]:
    """Yield where Newton's method gets to from the answers of cone programs, until they stop getting nearer.

    `first` is that of the program without offsets, if it is there, and `slip` what the next ones start from.
    """
    if first is not None:
        yield newton(problem, first.u)
    past: list[tuple[Array, Array]] = []
    misses: list[float] = []
    for k in range(programs):
        found = solve(problem, slip)
        count.programs += 1
        past = [*past[-MEMORY:], (slip, np.hypot(found.s[1], found.s[2]) - slip)]
        misses.append(float(np.abs(past[-1][1]).max()))
        if k < TRIED_AT_ONCE or k % 2 == 1:
            yield newton(problem, found.u)
        if k >= PATIENCE and min(misses[-PATIENCE:]) > NEARER * min(misses[:-PATIENCE]):
            return
        slip = _accelerated(past)


def _accelerated(past: list[tuple[Array, Array]]) -> Array:
    """Return the next offsets after `past` pairs of offsets and their changes: Anderson's, or the plain step."""
    s, g = past[-1]
    if len(past) > 1:
        ds, dg = (np.diff(np.array(x), axis=0).T for x in zip(*past, strict=True))
        step = g - (ds + dg) @ np.linalg.lstsq(dg, g, rcond=DEPENDENT)[0]
        if step @ g > 0.0:
            longest = LONGEST_JUMP * float(np.linalg.norm(g))
            return np.asarray(np.maximum(s + min(1.0, longest / float(np.linalg.norm(step))) * step, 0.0))
    return np.asarray(np.maximum(s + g, 0.0))
