"""One load on contacts with springs and Coulomb friction that does not lift what slides: where parts come to rest.

A fixed point of second-order cone programs (Acary and Cadoux 2013, "Applications of an existence result for the
Coulomb friction problem"): with the offsets s = μ |slip| of the last answer the dilation of the cone program cancels.
Anderson acceleration takes longer steps; as soon as one answer is near enough, Newton's method on Coulomb's law itself
(`coulomb_newton`) finishes, and what it returns obeys the law exactly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.statics.solver.compliant_cones import CompliantCones, ConeForces, solve
from mocca_robot.statics.solver.coulomb_newton import EXACT, CoulombPoint, at, newton

DEPENDENT = 1e-8
"""Relative singular value of a step that says nothing new."""
MEMORY = 4
LONGEST_JUMP = 30.0
"""How far an accelerated step may go, in plain steps."""
PROGRAMS = 40
"""Cone programs until the search for rest is given up."""
TRIED_AT_ONCE, PATIENCE, NEARER = 2, 6, 0.7
"""Programs after each of which Newton's method is tried, later after every other; programs that must bring the answer
nearer, and how much nearer."""
SOLVABLE = 1e-7
"""Residual of the first cone program above which no forces may hold the load."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StepsSettled:
    """What one load brings about.

    Attributes:
        point: at rest, or at the end of the last step of time that was solved; None if none was.
        rests, falls: what is proved; neither, where nothing was found.
        programs: cone programs that it took.
        shares: what steps of time left unbalanced, relative to the load, ever longer ones.
    """

    point: CoulombPoint | None
    rests: bool = False
    falls: bool = False
    programs: int = 0
    shares: tuple[float, ...] = ()


def rest(problem: CompliantCones, start: Array | None = None) -> StepsSettled:
    """Return how parts come to rest under a load of unit norm, or that rest was not found in a few cone programs.

    `problem` has no inertia; `start` (n,) are displacements under a similar load. Where it does not rest, `point` is
    None, or the elastic answer of the first cone program if there is one.
    """
    if start is not None:
        point = newton(problem, start)
        if point.error <= EXACT:
            return StepsSettled(point=point, rests=True)
    first = solve(problem, np.zeros(problem.compliance.shape[1]))
    if first.residual > SOLVABLE:
        return StepsSettled(point=None, programs=1)
    programs = 1
    for point, programs in approached(problem, first, PROGRAMS):
        if point.error <= EXACT:
            return StepsSettled(point=point, rests=True, programs=programs)
    return StepsSettled(point=at(problem, first.u), programs=programs)


def approached(problem: CompliantCones, first: ConeForces, most_programs: int) -> Iterator[tuple[CoulombPoint, int]]:
    """Yield where Newton's method gets to from the answers of cone programs, until they stop getting nearer.

    `first` is that of the program without offsets; the number of programs solved comes with every point.
    """
    yield newton(problem, first.u), 1
    slip = np.hypot(first.s[1], first.s[2])
    past: list[tuple[Array, Array]] = []
    misses: list[float] = []
    for k in range(most_programs):
        found = solve(problem, slip)
        past = [*past[-MEMORY:], (slip, np.hypot(found.s[1], found.s[2]) - slip)]
        misses.append(float(np.abs(past[-1][1]).max()))
        if k < TRIED_AT_ONCE or k % 2 == 1:
            yield newton(problem, found.u), k + 2
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
