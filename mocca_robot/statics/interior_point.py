"""Our own solver of Eq. 7 with a slack c ≥ 0: an interior point on the block normal equations.

    min ½|v|² − wᵀv  subject to  B v + c = s ≥ 0,   with multipliers z ≥ 0:   v − w − Bᵀz = 0,  s ∘ z = 0.

Every Newton step eliminates s and z and solves (I + BᵀDB) dv = r, D = z/s, by one banded Cholesky factorization
(`blocks`). Predictor, centring and corrector follow Mehrotra (1992). Towards the end D spans twenty orders of
magnitude; one step of iterative refinement per iteration keeps the stationarity at rounding level.
"""

from __future__ import annotations

import numpy as np

from mocca_robot.assembly import Array
from mocca_robot.statics.blocks import Factor, NotPositiveDefinite, PairBlocks
from mocca_robot.statics.solvers import SolverFailed
from mocca_robot.statics.system import ContactSystem

MAX_ITERATIONS = 60
TOLERANCE = 1e-9
"""Stationarity, feasibility and gap to reach, relative to |w|; a tenth of what the project promises."""
SMALL_GAP = 1e-13
"""Gap to reach when E itself is tiny, so that √(2E) ≤ 1e-6 can be told from zero."""
WEIGHT_LIMITS = (1e17, 1e13)
"""Largest z/s; the second one is tried where the first leaves the matrix indefinite in double precision."""
FEW = 24
"""Rows per pair that are looked at first, where there are more than twice as many."""
MANY = 400
ROUGH = 1e-3
"""Residual of the first look, which only has to tell the rays that may matter from the rest."""
NEARLY_BALANCED = 0.02
"""Twice the unbalanced share of the load below which `_balanced` gets its first try."""
BALANCED = 1e-9
"""Unbalanced share of the load that proves equilibrium: three orders below the verdict's tolerance."""
STALLED_AFTER = 6
"""Iterations without progress after which the best iterate so far is the answer."""


def solve_interior_point(system: ContactSystem, w: Array, c: Array) -> tuple[Array, Array]:
    """Return (v, f): motion (n,) and forces (C,) of one load case; v = w + Bᵀf exactly.

    What depends on the contacts only is kept with `system` and serves its next load too. Raises SolverFailed
    when rounding stops the iteration at a relative KKT residual above 1e-6.
    """
    blocks = system.blocks
    scale = float(np.linalg.norm(w)) or 1.0
    z, residual = _multipliers(blocks, blocks.own_transposed(w) / scale, c[blocks.source] / scale)
    if residual > 1e-6:
        raise SolverFailed(f"The interior point stopped at a relative residual of {residual:.1e}.")
    f = np.asarray(np.bincount(blocks.source, weights=z, minlength=blocks.n_rays) * scale, dtype=np.float64)
    return np.asarray(w + system.matrix.T @ f), f


def _multipliers(blocks: PairBlocks, pull: Array, c: Array) -> tuple[Array, float]:
    """Return multipliers (M,) and the residual reached, for a load of unit norm."""
    # Forces are of the order of a part's weight, slacks of its velocity per unit of mass; both start inside.
    weight = 1.0 / np.sqrt(max(1, len(blocks.to_own)))
    u, s, z = np.zeros(blocks.size), np.maximum(c, 0.03 * weight), np.full(len(c), weight)
    best, best_residual, stalled, last_try = z, np.inf, 0, NEARLY_BALANCED
    for _ in range(MAX_ITERATIONS):
        inertia = blocks.inertia_times(u)
        unbalanced = pull + blocks.transposed_times(z)  # Yᵀ(w + Bᵀz)
        r_primal = blocks.times(u) + c - s
        r_dual = inertia - unbalanced
        gap = float(s @ z)
        error = max(float(np.linalg.norm(r_dual)), float(np.abs(r_primal).max(initial=0.0)))
        if max(error, gap) < 0.9 * best_residual:
            best, best_residual, stalled = z, max(error, gap), 0
        else:
            stalled += 1
        # Near equilibrium a gap of the size of E says nothing yet: E has to be told from zero.
        enough = max(SMALL_GAP, min(TOLERANCE, 1e-3 * 0.5 * float(u @ inertia)))
        if (error <= 4 * TOLERANCE and gap <= enough) or stalled > STALLED_AFTER:
            break
        left = float(np.linalg.norm(unbalanced))
        if left < 0.5 * last_try and not c.any():
            last_try = left
            balanced = _balanced(blocks, z, unbalanced)
            if balanced is not None:
                return balanced, 0.0
        step = _newton_step(blocks, s, z, r_dual, r_primal)
        if step is None:
            break
        du, ds, dz = step
        length = min(1.0, 0.995 * _longest(s, ds), 0.995 * _longest(z, dz))
        u, s, z = u + length * du, s + length * ds, z + length * dz
    return best, best_residual


def _balanced(blocks: PairBlocks, z: Array, unbalanced: Array) -> Array | None:
    """Return forces near z that leave nothing unbalanced, or None when such a small change does not keep them ≥ 0.

    Inside the cone of equilibrium forces the last digits need no Newton steps: the change with the smallest
    |dz / z| solves one linear system, and its result proves equilibrium by itself.
    """
    weights = (z / z.max()) ** 2
    try:
        factor = blocks.band.factor(1e-10 * blocks.mass, blocks.gram(weights))
    except NotPositiveDefinite:
        return None
    change, left = np.zeros(len(z)), unbalanced
    for _ in range(5):
        change = change - weights * blocks.times(factor.solve(left))
        if (change < -0.99 * z).any():
            return None
        left = unbalanced + blocks.transposed_times(change)
        if float(np.linalg.norm(left)) <= BALANCED:
            return np.asarray(z + change)
    return None


def _newton_step(
    blocks: PairBlocks, s: Array, z: Array, r_dual: Array, r_primal: Array
) -> tuple[Array, Array, Array] | None:
    """Return (du, ds, dz) of one predictor–corrector step; None where no factorization succeeds."""
    for limit in WEIGHT_LIMITS:
        d = np.minimum(z / s, limit)
        try:
            factor = blocks.factor(blocks.gram(d))
            break
        except NotPositiveDefinite:
            continue
    else:
        return None
    mu = float(s @ z) / len(s)
    # Predictor: straight for s∘z = 0. Corrector: towards the central path, with the predictor's second order.
    _, ds, dz = _direction(blocks, factor, d, z, r_dual, r_primal)
    reach = min(1.0, _longest(s, ds), _longest(z, dz))
    predicted = float((s + reach * ds) @ (z + reach * dz)) / len(s)
    centre = (ds * dz - (predicted / mu) ** 3 * mu) / s
    return _direction(blocks, factor, d, z + centre, r_dual, r_primal, refine=bool(d.max(initial=0.0) > 1e7))


def _direction(
    blocks: PairBlocks, factor: Factor, d: Array, target: Array, r_dual: Array, r_primal: Array, refine: bool = False
) -> tuple[Array, Array, Array]:
    """Return the solution of YᵀY du − Bᵀdz = −r_dual, ds = B du + r_primal, dz = −target − D ds."""
    du = factor.solve(-r_dual - blocks.transposed_times(target + d * r_primal))
    ds = blocks.times(du) + r_primal
    dz = -target - d * ds
    if refine:
        missing = blocks.inertia_times(du) - blocks.transposed_times(dz) + r_dual
        more = factor.solve(-missing)
        slack = blocks.times(more)
        du, ds, dz = du + more, ds + slack, dz - d * slack
    return du, ds, dz


def _longest(x: Array, dx: Array) -> float:
    """Return the largest step with x + step·dx ≥ 0."""
    worst = float((dx / x).min(initial=0.0))
    return np.inf if worst >= 0.0 else -1.0 / worst
