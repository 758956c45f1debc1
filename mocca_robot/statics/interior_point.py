"""Our own solver of Eq. 7 with a slack c ≥ 0: an interior point on the block normal equations.

    min ½|v|² − wᵀv  subject to  B v + c = s ≥ 0,   with multipliers z ≥ 0:   v − w − Bᵀz = 0,  s ∘ z = 0.

Every Newton step eliminates s and z and solves (I + BᵀDB) dv = r, D = z/s, by one banded Cholesky factorization
(`blocks`). Predictor, centring and corrector follow Mehrotra (1992). Towards the end D spans twenty orders of
magnitude; one step of iterative refinement per iteration keeps the stationarity at rounding level.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.assembly import Array, BoolArray
from mocca_robot.statics.blocks import Factor, NotPositiveDefinite, PairBlocks
from mocca_robot.statics.solvers import SolverFailed
from mocca_robot.statics.system import ContactSystem

MAX_ITERATIONS = 60
TOLERANCE = 2e-9
"""Gap to reach, relative to |w|²; stationarity and feasibility may be four times that. 1e-8 is what is promised."""
SMALL_GAP = 1e-13
"""Gap to reach when E itself is tiny, so that √(2E) ≤ 1e-6 can be told from zero."""
WEIGHT_LIMITS = (1e17, 1e13)
"""Largest z/s; the second one is tried where the first leaves the matrix indefinite in double precision."""
FEW = 24
"""Rows per pair that are looked at first, where there are more than twice as many."""
MANY = 400
ROUGH = 1e-3
"""Residual of the first look, which only has to tell the rays that may matter from the rest."""
NEARLY_BALANCED, TRY_AGAIN = 0.05, 0.2
"""`_balanced` gets a try whenever the unbalanced share of the load falls to a fifth: below 0.01 for the first."""
BALANCED = 1e-9
"""Unbalanced share of the load that proves equilibrium: three orders below the verdict's tolerance."""
DIVERGED = 1e4
"""Growth of the residual above the best one after which nothing better will come."""
STALLED_AFTER = 6
"""Iterations without progress after which the best iterate so far is the answer."""


ROWS_AT_ONCE = 80_000
"""Rows of all load cases solved together: more no longer fit the processor's cache."""
LOADS_AT_ONCE = 8
"""Loads solved together at most: the next ones start better from the last of these."""
HALFWAY = 1e-2
"""Gap and residual at which an iterate is kept for the next loads; later ones are too near the boundary."""
NEAR_LOAD = 0.2
"""Distance of two loads of unit norm up to which the second starts where the first came past halfway."""


def solve_interior_point(system: ContactSystem, w: Array, c: Array) -> tuple[Array, Array]:
    """Return (v, f): motion (n,) and forces (C,) of one load w (n,), or (K, n) and (K, C) of K loads; v = w + Bᵀf.

    What depends on the contacts only is kept with `system` and serves every load. Small systems gain from many
    loads at once. Raises SolverFailed when rounding stops one at a relative KKT residual above 1e-6.
    """
    blocks = system.blocks
    loads = np.atleast_2d(w)
    forces = np.empty((len(loads), len(c)))
    together = max(1, min(LOADS_AT_ONCE, ROWS_AT_ONCE // max(1, len(blocks.source))))
    halfway = None
    for first in range(0, len(loads), together):
        some = loads[first : first + together]
        scale = np.linalg.norm(some, axis=1)[:, None]
        scale[scale == 0.0] = 1.0
        z, residual, halfway = _multipliers(
            blocks, blocks.own_transposed(some) / scale, c[blocks.source] / scale, halfway
        )
        if residual.max() > 1e-6:
            raise SolverFailed(f"The interior point stopped at a relative residual of {residual.max():.1e}.")
        for k, row in enumerate(z * scale):
            forces[first + k] = np.bincount(blocks.source, weights=row, minlength=blocks.n_rays)
    motions = loads + (system.matrix.T @ forces.T).T
    return motions.reshape(w.shape), forces.reshape(*w.shape[:-1], -1)


@dataclass(frozen=True, eq=False)
class _Halfway:
    """An iterate in the middle of the way under the load `pull`: a good start for a load that is much the same."""

    pull: Array
    u: Array
    s: Array
    z: Array


def _multipliers(
    blocks: PairBlocks, pull: Array, c: Array, begin: _Halfway | None = None
) -> tuple[Array, Array, _Halfway | None]:
    """Return multipliers (K, M) and the residuals reached (K,), for loads of unit norm and slacks c (K, M).

    Loads that are near to that of `begin` start from there, and once more from the beginning should that fail.
    The third result is where the last load came past halfway.
    """
    # Forces are of the order of a part's weight, slacks of its velocity per unit of mass; both start inside.
    weight = 1.0 / np.sqrt(max(1, len(blocks.to_own)))
    u, s, z = np.zeros_like(pull), np.maximum(c, 0.03 * weight), np.full(c.shape, weight)
    warm = np.zeros(len(c), dtype=np.bool_)
    if begin is not None:
        warm = np.linalg.norm(pull - begin.pull, axis=1) < NEAR_LOAD
        u[warm], s[warm], z[warm] = begin.u, begin.s, begin.z
    halfway = None
    best, best_residual = z.copy(), np.full(len(c), np.inf)
    stalled, last_try = np.zeros(len(c), dtype=np.int64), np.where(c.any(axis=1), 0.0, NEARLY_BALANCED)
    alive = np.arange(len(c))
    r_primal = blocks.times(u) + c - s  # every step shortens it by its own length
    for _ in range(MAX_ITERATIONS):
        inertia = blocks.inertia_times(u)
        unbalanced = pull[alive] + blocks.transposed_times(z)  # Yᵀ(w + Bᵀz)
        r_dual = inertia - unbalanced
        gap = np.einsum("km,km->k", s, z)
        error = np.maximum(np.linalg.norm(r_dual, axis=1), np.abs(r_primal).max(axis=1))
        reached = np.maximum(error, gap)
        better = reached < 0.9 * best_residual[alive]
        best[alive[better]], best_residual[alive[better]] = z[better], reached[better]
        stalled[alive] = np.where(better, 0, stalled[alive] + 1)
        # Near equilibrium a gap of the size of E says nothing yet: E has to be told from zero.
        enough = np.clip(1e-3 * 0.5 * (u * inertia).sum(axis=1), SMALL_GAP, TOLERANCE)
        done = ((error <= 4 * TOLERANCE) & (gap <= enough)) | (stalled[alive] > STALLED_AFTER)
        done |= reached > DIVERGED * best_residual[alive]
        left = np.linalg.norm(unbalanced, axis=1)
        for k in np.flatnonzero(~done & (left < TRY_AGAIN * last_try[alive])):
            last_try[alive[k]] = left[k]
            balanced = _balanced(blocks, z[k], unbalanced[k])
            if balanced is not None:
                best[alive[k]], best_residual[alive[k]], done[k] = balanced, 0.0, True
        if halfway is None and alive[-1] == len(c) - 1 and HALFWAY / 30 < gap[-1] <= HALFWAY >= error[-1]:
            halfway = _Halfway(pull[-1], u[-1], s[-1], z[-1])
        d = z / s
        factors = _factors(blocks, d, done)
        if done.any():
            keep = ~done
            alive, u, s, z, d, gap = alive[keep], u[keep], s[keep], z[keep], d[keep], gap[keep]
            r_dual, r_primal, inertia = r_dual[keep], r_primal[keep], inertia[keep]
        if not len(alive):
            break
        du, ds, dz = _newton_step(blocks, factors, d, s, z, gap, r_dual, r_primal, inertia - pull[alive])
        length = 0.995 * np.minimum(_longest((ds / s).min(axis=1)), _longest((dz / z).min(axis=1)))
        length = np.minimum(1.0, length)[:, None]
        u, s, z = u + length * du, s + length * ds, z + length * dz
        r_primal = (1.0 - length) * r_primal if length.min() < 1.0 else np.zeros_like(s)
    again = np.flatnonzero(warm & (best_residual > 4 * TOLERANCE))
    if len(again):
        best[again], best_residual[again], _ = _multipliers(blocks, pull[again], c[again])
    return best, best_residual, halfway or begin


def _factors(blocks: PairBlocks, d: Array, done: BoolArray) -> list[Factor]:
    """Return a factor for each load that is not done; its weights d (K, M) are limited in place where need be.

    Loads whose matrix is indefinite all the same become done.
    """
    factors = []
    for k in np.flatnonzero(~done):
        for limit in WEIGHT_LIMITS:
            np.minimum(d[k], limit, out=d[k])
            try:
                factors.append(blocks.factor(blocks.gram(d[k])))
                break
            except NotPositiveDefinite:
                continue
        else:
            done[k] = True
    return factors


def _newton_step(
    blocks: PairBlocks,
    factors: list[Factor],
    d: Array,
    s: Array,
    z: Array,
    gap: Array,
    r_dual: Array,
    r_primal: Array,
    pulled: Array,
) -> tuple[Array, Array, Array]:
    """Return (du, ds, dz) of one predictor–corrector step; `pulled` is YᵀYu − Yᵀw.

    A direction solves YᵀY du − Bᵀdz = −r_dual, ds = B du + r_primal, dz = −target − D ds.
    """
    # Predictor, straight for s∘z = 0: its target is z. With q = ds/s it has dz = −z (1 + q).
    feasible = not r_primal.any()
    right = -pulled if feasible else -pulled - blocks.transposed_times(d * r_primal)
    q = blocks.times(_solve(factors, right))
    if not feasible:
        q += r_primal
    q /= s
    reach = np.minimum(1.0, np.minimum(_longest(q.min(axis=1)), _longest(-1.0 - q.max(axis=1))))
    second = (1.0 + q) * q
    second *= z
    predicted = (1.0 - reach) * gap - reach**2 * np.einsum("km,km->k", s, second)
    # Corrector, towards the central path and with the predictor's second order: ds∘dz/s = −second.
    centre = ((predicted / gap) ** 3 * gap / s.shape[1])[:, None] / s
    centre += second
    du = _solve(factors, right + blocks.transposed_times(centre))
    ds = blocks.times(du)
    if not feasible:
        ds += r_primal
    dz = centre - z
    dz -= d * ds
    if d.max() > 1e7:
        missing = blocks.inertia_times(du) - blocks.transposed_times(dz) + r_dual
        more = _solve(factors, -missing)
        slack = blocks.times(more)
        du, ds = du + more, ds + slack
        slack *= d
        dz -= slack
    return du, ds, dz


def _solve(factors: list[Factor], right: Array) -> Array:
    return np.stack([factor.solve(row) for factor, row in zip(factors, right, strict=True)])


def _longest(slope: Array) -> Array:
    """Return (K,) the largest steps with 1 + step·slope ≥ 0 for the smallest relative change of each load."""
    return np.where(slope < 0.0, -1.0 / np.minimum(slope, -1e-300), np.inf)


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
