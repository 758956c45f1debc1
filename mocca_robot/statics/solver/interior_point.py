"""Our own solver of Eq. 7 with a slack c ≥ 0: an interior point on the block normal equations.

    min ½|v|² − wᵀv  subject to  B v + c = s ≥ 0,   with multipliers z ≥ 0:   v − w − Bᵀz = 0,  s ∘ z = 0.

Every Newton step eliminates s and z and solves (I + BᵀDB) dv = r, D = z/s, by one Cholesky factorization, banded or
sparse (`blocks`). Predictor and second-order corrector follow Mehrotra (1992), a further corrector towards well centred
products s ∘ z Gondzio (1996). As soon as it is clear which rays press, one linear system gives the rest (`face`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.runtime.threads import on_all_cores, with_one_blas_thread
from mocca_robot.statics.solver.blocks import PairBlocks
from mocca_robot.statics.solver.face import on_face
from mocca_robot.statics.solver.factors import NotPositiveDefinite
from mocca_robot.statics.solver.newton import Iterate, PrimalDual, UnitLoad
from mocca_robot.statics.solver.solvers import SolverFailed
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.tolerances import TINY, TOLERANCES

MAX_ITERATIONS = 100
TOLERANCE = 2e-9
"""Gap to reach, relative to |w|²; stationarity and feasibility may be four times that. 1e-8 is what is promised."""
SMALL_GAP = 1e-13
"""Gap to reach when E itself is tiny, so that √(2E) ≤ 1e-6 can be told from zero."""
SHARE_OF_E = 1e-2
"""Gap to reach, relative to E, before 'not in equilibrium' is believed."""
NEARLY_BALANCED, TRY_AGAIN = 6e-4, 0.1
"""Unbalanced share of the load below which all rays are tried as pressing, and its fall after which again."""
CLEAR, AMBIGUOUS = 10.0, 0.002
"""Which rays press is clear when z and s differ by more than this ratio, but for this share of the rays."""
STALLED_AFTER, DIVERGED = 6, 1e4
"""Iterations without progress, or growth of the residual, after which the best iterate so far is the answer."""
KEEP_AT = 3e-8
"""Centre μ at which an iterate is kept for the next load: later ones are too near the boundary to move from."""
NEAR_LOAD = 0.2
"""Distance of two loads of unit norm up to which the second starts from where the first came past."""
GUESS_BELOW = 0.05
"""Gap below which pressing rays are guessed."""
A_FEW_RAYS = 8
"""Rays of a pair up to which the first slacks do not depend on their number."""
CHAIN, WORTH_THREADS = 16, 500
"""Loads that start from one another at most, and unknowns from which on: chains run side by side, where a step's
compiled passes are long beside the Python between them, of which only one thread runs at a time."""


@dataclass(frozen=True, eq=False)
class Kept:
    """What the load `pull` leaves for the next: a point near the central path, or multipliers z of a face.

    `before` is what the load before it left.
    """

    pull: Array
    point: PrimalDual | None
    z: Array | None = None
    pressing: BoolArray | None = None
    before: Kept | None = None

    def towards(self, pull: Array) -> PrimalDual | None:
        """Return where to start for another load: the kept point, carried on where three loads lie in a row."""
        if self.point is None or self.before is None or self.before.point is None:
            return self.point
        last, step = self.pull - self.before.pull, pull - self.pull
        ratio = float(last @ step) / max(float(last @ last), TINY)
        if not 0.0 < ratio < 1.5 or float(np.linalg.norm(step - ratio * last)) > 0.1 * float(np.linalg.norm(step)):
            return self.point
        new, old = self.point, self.before.point
        s, z = (x * np.clip(x / y, 0.5, 2.0) ** ratio for x, y in ((new.s, old.s), (new.z, old.z)))
        return PrimalDual(new.u + ratio * (new.u - old.u), s, z)


@with_one_blas_thread
def solve_interior_point(system: ContactSystem, w: Array, c: Array) -> tuple[Array, Array]:
    """Return (v, f): motion (n,) and forces (C,) of one load w (n,), or (K, n) and (K, C) of K loads; v = w + Bᵀf.

    What depends on the contacts only is kept with `system` and serves every load; each load starts from the one
    before where they are near. With many unknowns, chains of up to `CHAIN` loads run side by side; the answers are the
    same on any number of cores. Raises SolverFailed when rounding stops one at a relative residual above 1e-6.
    """
    loads = np.atleast_2d(w)
    motions, forces = np.empty(loads.shape), np.empty((len(loads), len(c)))
    blocks = system.blocks
    _ = blocks.layout, blocks.own_gram  # made once, before threads ask for them
    count = max(1, -(-len(loads) // CHAIN)) if blocks.size >= WORTH_THREADS else 1
    chains = list(zip(*(np.array_split(x, count) for x in (loads, motions, forces)), strict=True))
    on_all_cores(lambda chain: _solve_chain(blocks, c, *chain), chains)
    return motions.reshape(w.shape), forces.reshape(*w.shape[:-1], -1)


def _solve_chain(blocks: PairBlocks, c: Array, loads: Array, motions: Array, forces: Array) -> None:
    """Set `motions` (K, n) and `forces` (K, C) for loads that start from one another, in their order."""
    kept: Kept | None = None
    for k, load in enumerate(loads):
        scale = float(np.linalg.norm(load)) or 1.0
        problem = UnitLoad(blocks, blocks.own_transposed(load) / scale, c[blocks.source] / scale)
        if kept is not None and float(np.linalg.norm(problem.pull - kept.pull)) > NEAR_LOAD:
            kept = None
        z, residual, after = _solved(problem, kept)
        if kept is not None and residual > 4 * TOLERANCE:
            z, residual, after = _solved(problem, None)
        if residual > TOLERANCES.equilibrium_residual:
            raise SolverFailed(f"The interior point stopped at a relative residual of {residual:.1e}.")
        forces[k] = blocks.forces(z * scale)
        motions[k] = load + scale * blocks.own_wrenches(blocks.transposed_times(z))
        kept = replace(after, before=None if kept is None else replace(kept, before=None))


def _solved(problem: UnitLoad, kept: Kept | None) -> tuple[Array, float, Kept]:
    """Return multipliers of the rays, the residual reached, and what to keep for the next load."""
    if kept is not None and kept.z is not None and kept.pressing is not None:
        found = on_face(problem.blocks, problem.pull, problem.c, kept.z, kept.pressing)
        if found is not None:
            return found, 0.0, Kept(problem.pull, kept.point, found, kept.pressing)
    start = None if kept is None else kept.towards(problem.pull)
    recentred = None if start is None else _recentred(problem, start)
    if recentred is not None:
        return _iterated(problem, recentred, recentred.point())
    return _iterated(problem, Iterate(problem, _beginning(problem)), None)


def _iterated(problem: UnitLoad, x: Iterate, past: PrimalDual | None) -> tuple[Array, float, Kept]:
    """Iterate from x to the answer; results as of `_solved`. `past` is to be kept, if there is one already."""
    best, best_residual, stalled = np.empty_like(x.z), np.inf, 0
    try_below, guess_below = (0.0 if problem.c.any() else NEARLY_BALANCED), GUESS_BELOW
    for _ in range(MAX_ITERATIONS):
        error = max(float(np.linalg.norm(x.inertia - x.unbalanced)), x.primal)
        reached = max(error, x.gap)
        if reached < 0.9 * best_residual:
            best_residual, stalled = reached, 0
            best[:] = x.z
        else:
            stalled += 1
        # Near equilibrium a gap of the size of E says nothing yet: E has to be told from zero.
        enough = float(np.clip(SHARE_OF_E * 0.5 * (x.u @ x.inertia), SMALL_GAP, TOLERANCE))
        if error <= 4 * TOLERANCE and x.gap <= enough:
            break
        if stalled > STALLED_AFTER or reached > DIVERGED * best_residual:
            break
        if past is None and x.gap <= KEEP_AT * len(x.s):
            past = x.point()
        pressing: BoolArray | None = None
        left = float(np.linalg.norm(x.unbalanced))
        if left < try_below:
            try_below, pressing = TRY_AGAIN * left, np.ones(len(x.z), dtype=np.bool_)
        elif x.gap < guess_below and float(((x.weights > 1 / CLEAR) & (x.weights < CLEAR)).mean()) <= AMBIGUOUS:
            guess_below, pressing = 0.1 * x.gap, x.weights > 1.0
        if pressing is not None:
            found = on_face(problem.blocks, problem.pull, problem.c, x.z, pressing)
            if found is not None:
                return found, 0.0, Kept(problem.pull, past, found, pressing)
        try:
            x.step()
        except NotPositiveDefinite:
            break
    return best, best_residual, Kept(problem.pull, past)


def _beginning(problem: UnitLoad) -> PrimalDual:
    """Return forces of the order of a part's weight and slacks of its velocity per unit of mass, no motion.

    The more rays share a pair, the smaller their slacks: the gap sᵀz stays what one part is worth.
    """
    weight = 1.0 / np.sqrt(len(problem.blocks.to_own))
    rays = max(len(problem.c) / max(len(problem.blocks.first), 1), A_FEW_RAYS)
    slacks = np.maximum(problem.c, 0.03 * weight * A_FEW_RAYS / rays)
    return PrimalDual(np.zeros_like(problem.pull), slacks, np.full(len(slacks), weight))


def _recentred(problem: UnitLoad, point: PrimalDual) -> Iterate | None:
    """Return one step from `point`, on the central path of another load, to that of this one; None if it is far."""
    x = Iterate(problem, point)
    before = x.gap
    try:
        x.step(centre=KEEP_AT)
    except NotPositiveDefinite:
        return None
    return x if x.gap < 10.0 * before else None
