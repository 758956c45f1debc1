"""Where parts move that were not found at rest: steps of time, each as long as its end can be followed.

    w + Gᵀ z(G u) = ε M (u − a)

is the end of an implicit step of time of parts that start without speed at displacements a; the smaller ε, the longer
the step. Its ends (u, ln ε) lie on a path that Newton's method follows by its length, past the kinks of Coulomb's law
(Keller 1977, "Numerical solution of bifurcation and nonlinear eigenvalue problems"). Where the path turns back to
shorter steps, or is lost, the next step of time begins.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.statics.solver import cone_kernels
from mocca_robot.statics.solver.compliant_cones import REGULAR, CompliantCones, solve
from mocca_robot.statics.solver.coulomb_newton import EXACT, CoulombPoint, at, newton
from mocca_robot.statics.solver.coulomb_rest import StepsSettled, approached
from mocca_robot.statics.solver.slopes import Slope

GIVES = 0.3
"""Share of the load that the first step of time leaves unbalanced where parts only give."""
PROGRAMS = 12
"""Cone programs that look for the end of the first step of time."""
BACK, TRIES = float(np.log(3.0)), 10
"""By how much ln ε grows where a step of time cannot be begun, and how often."""
FIRST_STRIDE, LEAST_STRIDE, RETRIED = 0.5, 0.1, 0.4
"""Strides along the path, in displacements that springs give and in e-folds of ε: the first, the shortest, and by how
much the next one is shorter where Newton's method fails."""
CORRECTIONS, MOST_CORRECTIONS = 8, 4000
"""Newton steps for one stride or the end of a first step, and for all."""
WINDOW, SHORTEST = 3, 1.0 / 8.0
"""Points that a Newton step is measured by, and its shortest length."""
EASY, FAIR = 4, 6
"""Newton steps up to which the next stride is twice as long, and a third longer."""
LESS = 0.8
"""Ratio of what two strides leave unbalanced below which rest may be near."""
FALLING, FAR, FARTHER = 0.95, 100.0, 5.0
"""Parts fall whose displacement in one step is `FAR` times what springs give, and `FARTHER` times what it was when
hardly more of the load was unbalanced."""
PRESSES, LIFTS = 1e-6, 0.02
"""Share of the largest force from which contacts press, and of the fastest motion up to which they do not open."""

Direction = tuple[Array, float]
"""(du, dtau)."""


@dataclass(frozen=True, eq=False)
class _End:
    """The end of a step of time: displacements, ln ε, what is left of its equation, and the Newton steps it took."""

    u: Array
    tau: float
    error: float
    work: int

    @property
    def found(self) -> bool:
        """Return whether it solves the equation."""
        return self.error <= EXACT


@dataclass(frozen=True, eq=False)
class _Step:
    """A step of time from displacements `start`; strides along the path of its ends are measured with `reach`."""

    problem: CompliantCones
    start: Array
    reach: float

    def with_inertia(self, tau: float) -> CompliantCones:
        """Return the problem that asks for the end of the step with ln ε = tau."""
        blocks = self.problem.blocks
        pull = self.problem.pull + np.exp(tau) * blocks.own_gram_times(self.start)
        return replace(self.problem, pull=pull, inertia=np.exp(tau) * blocks.own_gram)

    def begun(self, tau: float) -> _End:
        """Return the end of a step so short that it is found from where the step starts."""
        work = 0
        for _ in range(TRIES):
            point = newton(self.with_inertia(tau), self.start, CORRECTIONS)
            work += CORRECTIONS
            if point.error <= EXACT:
                break
            tau += BACK
        return _End(point.u, tau, point.error, work)

    def onward(self, end: _End) -> Direction:
        """Return the direction of the path towards longer steps."""
        point, held = self._at(end.u, end.tau)
        du = self._slope(point, end.tau).solve(held)
        return (np.zeros_like(end.u) if du is None else -du), -1.0

    def followed(self, end: _End, way: Direction, stride: float) -> _End:
        """Return the end a stride further along `way`, on the plane across it."""
        long = float(np.sqrt(self._dot(way, way)))
        du, dtau = way[0] / long, way[1] / long
        u0, tau0 = end.u + stride * du, end.tau + stride * dtau
        u, tau = u0, tau0
        point, held = self._at(u, tau)
        errors, work = [point.error], 0
        while errors[-1] > EXACT and work < CORRECTIONS:
            work += 1
            slope = self._slope(point, tau)
            off, along = slope.solve(point.residual), slope.solve(held)
            if off is None or along is None:
                break
            missed = self._dot((du, dtau), (u - u0 + off, tau - tau0)) / self._dot((du, dtau), (along, 1.0))
            length, worst = 1.0, max(errors[-WINDOW:])
            while length >= SHORTEST:
                nearer = u + length * (off - missed * along), tau - length * missed
                point, held = self._at(*nearer)
                if point.error < (1.0 - 0.1 * length) * worst:
                    break
                length *= 0.5
            else:
                break
            (u, tau), errors = nearer, [*errors, point.error]
        return _End(u, tau, errors[-1], work)

    def unbalanced(self, end: _End) -> float:
        """Return the share of the load that contacts leave to inertia."""
        return float(np.exp(end.tau) * np.linalg.norm(self.problem.blocks.own_gram_times(end.u - self.start)))

    def travelled(self, end: _End) -> float:
        """Return how far parts have come in this step, over what springs give."""
        return float(np.linalg.norm(self.problem.blocks.own_gram_times(end.u - self.start))) / self.reach

    def slides_along(self, end: _End) -> bool:
        """Return whether what presses has neither opened nor closed on the way here, as in a mechanism."""
        c, pressed = self.problem.compliance, at(self.problem, end.u).z[0]
        moved = self.problem.blocks.times(end.u - self.start).reshape(-1, 3).T
        opened = np.abs(moved[0]) * np.sqrt(c[1] / c[0])
        fastest = float(np.sqrt(opened**2 + moved[1] ** 2 + moved[2] ** 2).max(initial=0.0))
        return bool((opened[pressed > PRESSES * pressed.max(initial=0.0)] <= LIFTS * fastest).all())

    def _at(self, u: Array, tau: float) -> tuple[CoulombPoint, Array]:
        """Return the point with what is left of the equation, and how that changes with ln ε, (n,)."""
        held = -np.exp(tau) * self.problem.blocks.own_gram_times(u - self.start)
        point = at(self.problem, u)
        return replace(point, residual=point.residual + held), held

    def _slope(self, point: CoulombPoint, tau: float) -> Slope:
        """Return the factor of minus the derivative by u."""
        blocks = self.problem.blocks
        return Slope.of(blocks, (np.exp(tau) + REGULAR) * blocks.own_gram, point.grams)

    def _dot(self, a: Direction, b: Direction) -> float:
        return float(a[0] @ b[0]) / self.reach**2 + a[1] * b[1]


@np.errstate(all="ignore")
def move(problem: CompliantCones, elastic: StepsSettled) -> StepsSettled:
    """Return where parts move that were not found at rest: to rest after all, or on and on.

    Where ever less stays unbalanced, rest is near. Parts fall that go in one step far beyond what springs give, with as
    much left unbalanced and along what presses.
    """
    reach = _reach(problem, elastic)
    step = _Step(problem, np.zeros(problem.blocks.size), reach)
    end, programs = _touched(step, float(np.log(GIVES / reach)))
    path: list[tuple[float, float]] = []
    shares: list[float] = []
    way, stride, work = None, FIRST_STRIDE, 0
    while end.found and work < MOST_CORRECTIONS:
        way = step.onward(end) if way is None else way
        new = step.followed(end, way, stride)
        work += new.work
        turned = False
        if new.found:
            last, end = end, new
            way = end.u - last.u, end.tau - last.tau
            turned = way[1] > 0.0
            stride *= 2.0 if new.work <= EASY else 4.0 / 3.0 if new.work <= FAIR else 1.0
            path.append((step.travelled(end), step.unbalanced(end)))
            shares.append(path[-1][1])
            turned = turned or _goes_on(path)
            if _goes_on(path) and step.slides_along(end):
                return StepsSettled(point=at(problem, end.u), falls=True, programs=programs, shares=tuple(shares))
            if not turned and shares[-1] < LESS * max(shares[-3:]):
                ahead = end.u + (end.u - last.u) / (np.exp(last.tau - end.tau) - 1.0)
                still = newton(problem, ahead, CORRECTIONS)
                work += CORRECTIONS
                if still.error <= EXACT:
                    return StepsSettled(point=still, rests=True, programs=programs, shares=tuple(shares))
        else:
            stride *= RETRIED
        if turned or stride < LEAST_STRIDE:
            step, way, stride, path = replace(step, start=end.u), None, FIRST_STRIDE, []
            begun = step.begun(end.tau)
            work += begun.work
            if not begun.found:
                break
            end = begun
    point = at(problem, end.u) if end.found else None
    return StepsSettled(point=point, programs=programs, shares=tuple(shares))


def _reach(problem: CompliantCones, elastic: StepsSettled) -> float:
    """Return how far springs give: with contacts that neither part nor slide, or, if less, in the elastic answer."""
    blocks = problem.blocks
    stuck = np.zeros((6, problem.compliance.shape[1]))
    stuck[[0, 3, 5]] = 1.0 / problem.compliance
    grams = np.empty((len(blocks.first), blocks.dof, blocks.dof))
    cone_kernels.gram_of_stiffness(blocks.rays, blocks.starts, stuck, grams)
    u = Slope.of(blocks, REGULAR * blocks.own_gram, grams).solve(problem.pull)
    given = [x for x in (u, None if elastic.point is None else elastic.point.u) if x is not None and x.any()]
    return min((float(np.linalg.norm(blocks.own_gram_times(x))) for x in given), default=1.0)


def _touched(step: _Step, tau: float) -> tuple[_End, int]:
    """Return the end of the first step of time, found by cone programs, and their number."""
    programs = 0
    for _ in range(TRIES):
        shorter = step.with_inertia(tau)
        for point, used in approached(shorter, solve(shorter, np.zeros(shorter.compliance.shape[1])), PROGRAMS):
            programs += used
            if point.error <= EXACT:
                return _End(point.u, tau, point.error, 0), programs
        tau += BACK
    return _End(point.u, tau, point.error, 0), programs


def _goes_on(path: list[tuple[float, float]]) -> bool:
    """Return whether displacements, relative to what springs give, grow and grow with as much unbalanced."""
    far, share = path[-1]
    return far >= FAR and any(f <= far / FARTHER and share >= FALLING * s for f, s in path[:-1])
