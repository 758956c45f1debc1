"""Our own solver of Eq. 7 with a slack c ≥ 0: an interior point on the block normal equations.

    min ½|v|² − wᵀv  subject to  B v + c = s ≥ 0,   with multipliers z ≥ 0:   v − w − Bᵀz = 0,  s ∘ z = 0.

Every Newton step eliminates s and z and solves (I + BᵀDB) dv = r, D = z/s, by one banded Cholesky factorization
(`blocks`). Predictor, centring and corrector follow Mehrotra (1992). Towards the end D spans twenty orders of
magnitude; one step of iterative refinement per iteration keeps the stationarity at rounding level.
"""

from __future__ import annotations

import numpy as np

from mocca_robot.assembly import Array, BoolArray
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


ROWS_AT_ONCE = 80_000
"""Rows of all load cases solved together: more no longer fit the processor's cache."""


def solve_interior_point(system: ContactSystem, w: Array, c: Array) -> tuple[Array, Array]:
    """Return (v, f): motion (n,) and forces (C,) of one load w (n,), or (K, n) and (K, C) of K loads; v = w + Bᵀf.

    What depends on the contacts only is kept with `system` and serves every load. Small systems gain from many
    loads at once. Raises SolverFailed when rounding stops one at a relative KKT residual above 1e-6.
    """
    blocks = system.blocks
    loads = np.atleast_2d(w)
    forces = np.empty((len(loads), len(c)))
    together = max(1, ROWS_AT_ONCE // max(1, len(blocks.source)))
    for first in range(0, len(loads), together):
        some = loads[first : first + together]
        scale = np.linalg.norm(some, axis=1)[:, None]
        scale[scale == 0.0] = 1.0
        z, residual = _multipliers(blocks, blocks.own_transposed(some) / scale, c[blocks.source] / scale)
        if residual.max() > 1e-6:
            raise SolverFailed(f"The interior point stopped at a relative residual of {residual.max():.1e}.")
        for k, row in enumerate(z * scale):
            forces[first + k] = np.bincount(blocks.source, weights=row, minlength=blocks.n_rays)
    motions = loads + (system.matrix.T @ forces.T).T
    return motions.reshape(w.shape), forces.reshape(*w.shape[:-1], -1)


def _multipliers(blocks: PairBlocks, pull: Array, c: Array) -> tuple[Array, Array]:
    """Return multipliers (K, M) and the residuals reached (K,), for loads of unit norm and slacks c (K, M)."""
    # Forces are of the order of a part's weight, slacks of its velocity per unit of mass; both start inside.
    weight = 1.0 / np.sqrt(max(1, len(blocks.to_own)))
    u, s, z = np.zeros_like(pull), np.maximum(c, 0.03 * weight), np.full(c.shape, weight)
    best, best_residual = z.copy(), np.full(len(c), np.inf)
    stalled, last_try = np.zeros(len(c), dtype=np.int64), np.where(c.any(axis=1), 0.0, NEARLY_BALANCED)
    alive = np.arange(len(c))
    for _ in range(MAX_ITERATIONS):
        inertia = blocks.inertia_times(u)
        unbalanced = pull[alive] + blocks.transposed_times(z)  # Yᵀ(w + Bᵀz)
        r_primal = blocks.times(u) + c[alive] - s
        r_dual = inertia - unbalanced
        gap = (s * z).sum(axis=1)
        error = np.maximum(np.linalg.norm(r_dual, axis=1), np.abs(r_primal).max(axis=1))
        reached = np.maximum(error, gap)
        better = reached < 0.9 * best_residual[alive]
        best[alive[better]], best_residual[alive[better]] = z[better], reached[better]
        stalled[alive] = np.where(better, 0, stalled[alive] + 1)
        # Near equilibrium a gap of the size of E says nothing yet: E has to be told from zero.
        enough = np.clip(1e-3 * 0.5 * (u * inertia).sum(axis=1), SMALL_GAP, TOLERANCE)
        done = ((error <= 4 * TOLERANCE) & (gap <= enough)) | (stalled[alive] > STALLED_AFTER)
        left = np.linalg.norm(unbalanced, axis=1)
        for k in np.flatnonzero(~done & (left < 0.5 * last_try[alive])):
            last_try[alive[k]] = left[k]
            balanced = _balanced(blocks, z[k], unbalanced[k])
            if balanced is not None:
                best[alive[k]], best_residual[alive[k]], done[k] = balanced, 0.0, True
        d, factors = _factors(blocks, z / s, done)
        if done.any():
            keep = ~done
            alive, u, s, z, d = alive[keep], u[keep], s[keep], z[keep], d[keep]
            r_dual, r_primal = r_dual[keep], r_primal[keep]
        if not len(alive):
            break
        du, ds, dz = _newton_step(blocks, factors, d, s, z, r_dual, r_primal)
        length = np.minimum(1.0, 0.995 * np.minimum(_longest(s, ds), _longest(z, dz)))[:, None]
        u, s, z = u + length * du, s + length * ds, z + length * dz
    return best, best_residual


def _factors(blocks: PairBlocks, d: Array, done: BoolArray) -> tuple[Array, list[Factor]]:
    """Return the weights (K, M), limited where need be, and a factor for each load that is not done.

    Loads whose matrix is indefinite whatever the limit become done.
    """
    factors = []
    d = np.minimum(d, WEIGHT_LIMITS[0])
    for k in np.flatnonzero(~done):
        for limit in WEIGHT_LIMITS:
            d[k] = np.minimum(d[k], limit)
            try:
                factors.append(blocks.factor(blocks.gram(d[k])))
                break
            except NotPositiveDefinite:
                continue
        else:
            done[k] = True
    return d, factors


def _newton_step(
    blocks: PairBlocks, factors: list[Factor], d: Array, s: Array, z: Array, r_dual: Array, r_primal: Array
) -> tuple[Array, Array, Array]:
    """Return (du, ds, dz) of one predictor–corrector step."""
    count = s.shape[1]
    mu = (s * z).sum(axis=1) / count
    # Predictor: straight for s∘z = 0. Corrector: towards the central path, with the predictor's second order.
    _, ds, dz = _direction(blocks, factors, d, z, r_dual, r_primal)
    reach = np.minimum(1.0, np.minimum(_longest(s, ds), _longest(z, dz)))[:, None]
    predicted = ((s + reach * ds) * (z + reach * dz)).sum(axis=1) / count
    centre = (ds * dz - ((predicted / mu) ** 3 * mu)[:, None]) / s
    return _direction(blocks, factors, d, z + centre, r_dual, r_primal, refine=bool(d.max() > 1e7))


def _direction(
    blocks: PairBlocks,
    factors: list[Factor],
    d: Array,
    target: Array,
    r_dual: Array,
    r_primal: Array,
    refine: bool = False,
) -> tuple[Array, Array, Array]:
    """Return the solution of YᵀY du − Bᵀdz = −r_dual, ds = B du + r_primal, dz = −target − D ds."""
    du = _solve(factors, -r_dual - blocks.transposed_times(target + d * r_primal))
    ds = blocks.times(du) + r_primal
    dz = -target - d * ds
    if refine:
        missing = blocks.inertia_times(du) - blocks.transposed_times(dz) + r_dual
        more = _solve(factors, -missing)
        slack = blocks.times(more)
        du, ds, dz = du + more, ds + slack, dz - d * slack
    return du, ds, dz


def _solve(factors: list[Factor], right: Array) -> Array:
    return np.stack([factor.solve(row) for factor, row in zip(factors, right, strict=True)])


def _longest(x: Array, dx: Array) -> Array:
    """Return (K,) the largest steps with x + step·dx ≥ 0."""
    worst = (dx / x).min(axis=1)
    return np.where(worst < 0.0, -1.0 / np.minimum(worst, -1e-300), np.inf)


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
