"""Our own solver of Eq. 7 with a slack c ≥ 0: an interior point on the block normal equations.

    min ½|v|² − wᵀv  subject to  B v + c = s ≥ 0,   with multipliers z ≥ 0:   v − w − Bᵀz = 0,  s ∘ z = 0.

Every Newton step eliminates s and z and solves (I + BᵀDB) dv = r, D = z/s, by one banded Cholesky factorization
(`blocks`). Predictor and second-order corrector follow Mehrotra (1992), a further corrector towards well centred
products s ∘ z Gondzio (1996). As soon as it is clear which rays press, one linear system gives the rest (`face`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.assembly import Array, BoolArray
from mocca_robot.statics.blocks import Factor, NotPositiveDefinite, PairBlocks
from mocca_robot.statics.face import on_face
from mocca_robot.statics.solvers import SolverFailed
from mocca_robot.statics.system import ContactSystem

MAX_ITERATIONS = 100
TOLERANCE = 2e-9
"""Gap to reach, relative to |w|²; stationarity and feasibility may be four times that. 1e-8 is what is promised."""
SMALL_GAP = 1e-13
"""Gap to reach when E itself is tiny, so that √(2E) ≤ 1e-6 can be told from zero."""
SHARE_OF_E = 1e-2
"""Gap to reach, relative to E, before 'not in equilibrium' is believed."""
WEIGHT_LIMITS = (1e17, 1e13)
"""Largest z/s; the second one is tried where the first leaves the matrix indefinite in double precision."""
STEP = 0.995
"""Share of the way to the boundary that a step goes."""
NEARLY_BALANCED, TRY_AGAIN = 0.05, 0.2
"""All rays are tried as pressing whenever the unbalanced share of the load falls to a fifth: below 0.01 first."""
CLEAR, AMBIGUOUS = 10.0, 0.002
"""Which rays press is clear when z and s differ by more than this ratio, but for this share of the rays."""
STALLED_AFTER, DIVERGED = 6, 1e4
"""Iterations without progress, or growth of the residual, after which the best iterate so far is the answer."""
KEEP_AT = 1e-7
"""Centre μ at which an iterate is kept for the next load: later ones are too near the boundary to move from."""
NEAR_LOAD = 0.2
"""Distance of two loads of unit norm up to which the second starts from where the first came past."""
GUESS_BELOW = 0.05
"""Gap below which pressing rays are guessed."""


@dataclass(frozen=True, eq=False)
class Problem:
    """One load of unit norm: pull (n,) about the common point, c (M,) the slack of every row of `blocks`."""

    blocks: PairBlocks
    pull: Array
    c: Array


@dataclass(frozen=True, eq=False)
class Point:
    """Motion u (n,) about the common point, slacks s and multipliers z (M,) of the rows."""

    u: Array
    s: Array
    z: Array

    @property
    def centre(self) -> float:
        """Return μ, the mean of s ∘ z."""
        return float(self.s @ self.z) / max(1, len(self.s))


@dataclass(frozen=True, eq=False)
class Kept:
    """What the load `pull` leaves for the next: a point near the central path, or multipliers z of a face.

    `before` is what the load before it left.
    """

    pull: Array
    point: Point | None
    z: Array | None = None
    pressing: BoolArray | None = None
    before: Kept | None = None

    def towards(self, pull: Array) -> Point | None:
        """Return where to start for another load: the kept point, carried on where three loads lie in a row."""
        if self.point is None or self.before is None or self.before.point is None:
            return self.point
        last, step = self.pull - self.before.pull, pull - self.pull
        ratio = float(last @ step) / max(float(last @ last), 1e-300)
        if not 0.0 < ratio < 1.5 or float(np.linalg.norm(step - ratio * last)) > 0.1 * float(np.linalg.norm(step)):
            return self.point
        new, old = self.point, self.before.point
        s, z = (x * np.clip(x / y, 0.5, 2.0) ** ratio for x, y in ((new.s, old.s), (new.z, old.z)))
        return Point(new.u + ratio * (new.u - old.u), s, z)


def solve_interior_point(system: ContactSystem, w: Array, c: Array) -> tuple[Array, Array]:
    """Return (v, f): motion (n,) and forces (C,) of one load w (n,), or (K, n) and (K, C) of K loads; v = w + Bᵀf.

    What depends on the contacts only is kept with `system` and serves every load; each load starts from the one
    before where they are near. Raises SolverFailed when rounding stops one at a relative residual above 1e-6.
    """
    blocks, loads = system.blocks, np.atleast_2d(w)
    forces = np.empty((len(loads), len(c)))
    kept: Kept | None = None
    for k, load in enumerate(loads):
        scale = float(np.linalg.norm(load)) or 1.0
        problem = Problem(blocks, blocks.own_transposed(load) / scale, c[blocks.source] / scale)
        if kept is not None and float(np.linalg.norm(problem.pull - kept.pull)) > NEAR_LOAD:
            kept = None
        z, residual, after = _solved(problem, kept)
        if kept is not None and residual > 4 * TOLERANCE:
            z, residual, after = _solved(problem, None)
        if residual > 1e-6:
            raise SolverFailed(f"The interior point stopped at a relative residual of {residual:.1e}.")
        forces[k] = blocks.forces(z * scale)
        kept = replace(after, before=None if kept is None else replace(kept, before=None))
    motions = loads + (system.matrix.T @ forces.T).T
    return motions.reshape(w.shape), forces.reshape(*w.shape[:-1], -1)


def _solved(problem: Problem, kept: Kept | None) -> tuple[Array, float, Kept]:
    """Return multipliers of the rows, the residual reached, and what to keep for the next load."""
    if kept is not None and kept.z is not None and kept.pressing is not None:
        found = on_face(problem.blocks, problem.pull, problem.c, kept.z, kept.pressing)
        if found is not None:
            return found, 0.0, Kept(problem.pull, kept.point, found, kept.pressing)
    start = None if kept is None else kept.towards(problem.pull)
    recentred = None if start is None else _recentred(problem, start)
    return _iterated(problem, recentred or _beginning(problem), recentred)


def _iterated(problem: Problem, point: Point, past: Point | None) -> tuple[Array, float, Kept]:
    """Iterate from `point` to the answer; results as of `_solved`. `past` is to be kept, if there is one already."""
    blocks = problem.blocks
    best, best_residual, stalled = point.z, np.inf, 0
    last_try, guess_below = (0.0 if problem.c.any() else NEARLY_BALANCED), GUESS_BELOW
    for _ in range(MAX_ITERATIONS):
        inertia = blocks.inertia_times(point.u)
        unbalanced = problem.pull + blocks.transposed_times(point.z)  # Yᵀ(w + Bᵀz)
        r_dual = inertia - unbalanced
        r_primal = blocks.times(point.u) + problem.c - point.s
        gap = float(point.s @ point.z)
        error = max(float(np.linalg.norm(r_dual)), float(np.abs(r_primal).max(initial=0.0)))
        reached = max(error, gap)
        if reached < 0.9 * best_residual:
            best, best_residual, stalled = point.z, reached, 0
        else:
            stalled += 1
        # Near equilibrium a gap of the size of E says nothing yet: E has to be told from zero.
        enough = float(np.clip(SHARE_OF_E * 0.5 * (point.u @ inertia), SMALL_GAP, TOLERANCE))
        if (error <= 4 * TOLERANCE and gap <= enough) or stalled > STALLED_AFTER or reached > DIVERGED * best_residual:
            break
        if past is None and gap <= KEEP_AT * len(point.s):
            past = point
        pressing: BoolArray | None = None
        left = float(np.linalg.norm(unbalanced))
        if left < TRY_AGAIN * last_try:
            last_try, pressing = left, np.ones(len(point.z), dtype=np.bool_)
        elif gap < guess_below:
            ratio = point.z / point.s
            if float(((ratio > 1.0 / CLEAR) & (ratio < CLEAR)).mean()) <= AMBIGUOUS:
                guess_below, pressing = 0.1 * gap, ratio > 1.0
        if pressing is not None:
            found = on_face(blocks, problem.pull, problem.c, point.z, pressing)
            if found is not None:
                return found, 0.0, Kept(problem.pull, past, found, pressing)
        try:
            point = _newton_step(problem, point, r_dual, r_primal)
        except NotPositiveDefinite:
            break
    return best, best_residual, Kept(problem.pull, past)


def _beginning(problem: Problem) -> Point:
    """Return forces of the order of a part's weight and slacks of its velocity per unit of mass, no motion."""
    weight = 1.0 / np.sqrt(len(problem.blocks.to_own))
    slacks = np.maximum(problem.c, 0.03 * weight)
    return Point(np.zeros_like(problem.pull), slacks, np.full(len(slacks), weight))


def _recentred(problem: Problem, point: Point) -> Point | None:
    """Return one step from `point`, on the central path of another load, to that of this one; None if it is far."""
    r_dual = problem.blocks.inertia_times(point.u) - problem.pull - problem.blocks.transposed_times(point.z)
    r_primal = problem.blocks.times(point.u) + problem.c - point.s
    try:
        centred = _newton_step(problem, point, r_dual, r_primal, along=False)
    except NotPositiveDefinite:
        return None
    return centred if centred.centre < 10.0 * point.centre else None


def _newton_step(problem: Problem, point: Point, r_dual: Array, r_primal: Array, along: bool = True) -> Point:
    """Return the next point: one predictor–corrector step, or only back to the central path unless `along`.

    A direction solves YᵀY du − Bᵀdz = −r_dual, ds = B du + r_primal, dz = −target − D ds. Raises
    NotPositiveDefinite when rounding leaves no factor.
    """
    blocks, s, z = problem.blocks, point.s, point.z
    d = z / s
    mu = point.centre if along else KEEP_AT
    factor = _factor(blocks, d)
    base = -r_dual - blocks.transposed_times(d * r_primal)

    def direction(target: Array) -> tuple[Array, Array, Array]:
        du = factor.solve(base - blocks.transposed_times(target))
        ds = blocks.times(du) + r_primal
        return du, ds, -target - d * ds

    if along:
        # Predictor, straight for s∘z = 0; the corrector goes as far towards the path as the predictor got along it.
        _, ds, dz = direction(z)
        reach = min(1.0, _longest(s, ds), _longest(z, dz))
        mu *= (1.0 - reach + reach**2 * float(ds @ dz) / (mu * len(s))) ** 3
        du, ds, dz = direction(z - (mu - ds * dz) / s)
    else:
        du, ds, dz = direction(z - mu / s)
    length = STEP * min(_longest(s, ds), _longest(z, dz))
    if length < 1.0:
        # Gondzio: where a longer step would leave the products s∘z far from μ, bring them back; once.
        ahead = min(1.0, 1.3 * length + 0.1)
        products = (s + ahead * ds) * (z + ahead * dz)
        missing = np.maximum(np.clip(products, 0.1 * mu, 10.0 * mu) - products, -10.0 * mu) / s
        more = factor.solve(blocks.transposed_times(missing))
        change = blocks.times(more)
        ds_more, dz_more = ds + change, dz + missing - d * change
        longer = STEP * min(_longest(s, ds_more), _longest(z, dz_more))
        if longer >= min(1.0, length + 0.01):
            du, ds, dz, length = du + more, ds_more, dz_more, longer
    if d.max() > 1e7:
        # D spans twenty orders of magnitude: one step of refinement keeps the stationarity at rounding level.
        rest = blocks.inertia_times(du) - blocks.transposed_times(dz) + r_dual
        more = factor.solve(-rest)
        change = blocks.times(more)
        du, ds, dz = du + more, ds + change, dz - d * change
        length = STEP * min(_longest(s, ds), _longest(z, dz))
    length = min(1.0, length)
    return Point(point.u + length * du, s + length * ds, z + length * dz)


def _factor(blocks: PairBlocks, d: Array) -> Factor:
    """Return the factor for weights d, which are limited in place where need be."""
    for limit in WEIGHT_LIMITS:
        np.minimum(d, limit, out=d)
        try:
            return blocks.factor(blocks.gram(d))
        except NotPositiveDefinite:
            continue
    raise NotPositiveDefinite("Weights of all sizes leave the normal matrix indefinite.")


def _longest(x: Array, dx: Array) -> float:
    """Return the largest step with x + step·dx ≥ 0."""
    steepest = float((dx / x).min(initial=0.0))
    return -1.0 / steepest if steepest < 0.0 else np.inf
