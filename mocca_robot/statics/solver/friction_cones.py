"""Our own solver of equilibrium with friction in 3D: an interior point with one second-order cone a contact.

    min ½|v|² − wᵀv  subject to  s = G v,  s_c ∈ Q,   with multipliers z_c ∈ Q:   v − w − Gᵀz = 0,  s_c ∘ z_c = 0.

G has three rows a contact, [n/μ; t₁; t₂] turned into generalized normals, so that z = (μ f_n, f_t) and the cone of
friction |f_t| ≤ μ f_n is Q, as is its dual for s. Newton steps use the Nesterov–Todd scaling W and the same block
normal equations as without friction: I + GᵀW⁻²G.
"""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.runtime.threads import with_one_blas_thread
from mocca_robot.statics.solver import kernels, lorentz
from mocca_robot.statics.solver.blocks import PairBlocks
from mocca_robot.statics.solver.factors import NotPositiveDefinite
from mocca_robot.statics.solver.interior_point import MAX_ITERATIONS, SMALL_GAP, STALLED_AFTER
from mocca_robot.statics.solver.solvers import SolverFailed
from mocca_robot.tolerances import TOLERANCES

GAP_SHARE = 1e-3
"""Of the energy: a duality gap below it changes no verdict."""
RIDGE = 1e-10
"""Share of the Gram matrix added to the system, so that parts without force do not make it singular."""

NEARLY_BALANCED, TRY_AGAIN = 0.05, 0.2
"""`_balanced` gets a try whenever the unbalanced share of the load falls to a fifth: below 0.01 for the first."""
BALANCED = 1e-9
"""Unbalanced share of the load that proves equilibrium: three orders below the verdict's tolerance."""
TOLERANCE = 1e-9
"""Gap to reach, relative to |w|²; stationarity and feasibility may be four times that."""


@with_one_blas_thread
def solve_friction_cones(blocks: PairBlocks, w: Array) -> Array:
    """Return z (3·contacts,), the forces along the rows of G.

    `blocks` come from a system with three rows [n/μ; t₁; t₂] a contact, one after the other; w (n,) is the
    scaled load of unit norm. Raises SolverFailed when rounding stops the iteration at a relative residual above 1e-6.
    """
    z, residual = _multipliers(blocks, blocks.own_transposed(w))
    if residual > TOLERANCES.equilibrium_residual:
        raise SolverFailed(f"The interior point with friction stopped at a relative residual of {residual:.1e}.")
    return blocks.forces(_flat(z))


def _multipliers(blocks: PairBlocks, pull: Array) -> tuple[Array, float]:
    """Return z (3, contacts) and the residual reached."""
    count = len(blocks.source) // 3
    weight = 1.0 / np.sqrt(max(1, len(blocks.to_own)))
    unit = np.zeros((3, count))
    unit[0] = 1.0
    u, s, z = np.zeros(blocks.size), 0.03 * weight * unit, weight * unit
    best, best_residual, stalled, last_try = z, np.inf, 0, NEARLY_BALANCED
    for _ in range(MAX_ITERATIONS):
        inertia = blocks.own_gram_times(u)
        unbalanced = pull + blocks.transposed_times(_flat(z))
        r_dual, r_primal = inertia - unbalanced, _columns(blocks.times(u)) - s
        gap = float((s * z).sum())
        error = max(float(np.linalg.norm(r_dual)), float(np.abs(r_primal).max(initial=0.0)))
        if max(error, gap) < 0.9 * best_residual:
            best, best_residual, stalled = z, max(error, gap), 0
        else:
            stalled += 1
        enough = max(SMALL_GAP, min(TOLERANCE, GAP_SHARE * 0.5 * float(u @ inertia)))
        if (error <= 4 * TOLERANCE and gap <= enough) or stalled > STALLED_AFTER:
            break
        left = float(np.linalg.norm(unbalanced))
        if left < TRY_AGAIN * last_try:
            last_try = left
            balanced = _balanced(blocks, z, unbalanced)
            if balanced is not None:
                return balanced, 0.0
        try:
            du, ds, dz = _newton_step(blocks, s, z, r_dual, r_primal)
        except NotPositiveDefinite:
            break
        length = min(1.0, 0.99 * lorentz.longest(s, ds), 0.99 * lorentz.longest(z, dz))
        u, s, z = u + length * du, s + length * ds, z + length * dz
        if not (lorentz.is_inside(s) and lorentz.is_inside(z)):
            break
    return best, best_residual


def _newton_step(blocks: PairBlocks, s: Array, z: Array, r_dual: Array, r_primal: Array) -> tuple[Array, Array, Array]:
    """Return (du, ds, dz) of one predictor–corrector step in Nesterov–Todd scaling."""
    scaling = lorentz.Scaling.of(s, z)
    scaled = scaling.times(z)  # λ = W z = W⁻¹ s
    factor = blocks.factor(_gram(blocks, scaling.mirrored, scaling.eta**-2))
    mu = float((s * z).sum()) / s.shape[1]

    def direction(q: Array, refine: bool) -> tuple[Array, Array, Array]:
        target = scaling.divide(q)
        du = factor.solve(-r_dual - blocks.transposed_times(_flat(target + scaling.divide_twice(r_primal))))
        ds = _columns(blocks.times(du)) + r_primal
        dz = -target - scaling.divide_twice(ds)
        if refine:
            missing = blocks.own_gram_times(du) - blocks.transposed_times(_flat(dz)) + r_dual
            more = factor.solve(-missing)
            slack = _columns(blocks.times(more))
            du, ds, dz = du + more, ds + slack, dz - scaling.divide_twice(slack)
        return du, ds, dz

    _, ds, dz = direction(scaled, False)
    reach = min(1.0, lorentz.longest(s, ds), lorentz.longest(z, dz))
    sigma = (1.0 - reach) ** 3
    second = lorentz.product(scaling.divide(ds), scaling.times(dz))
    second[0] -= sigma * mu
    return direction(scaled + lorentz.quotient(scaled, second), True)


def _balanced(blocks: PairBlocks, z: Array, unbalanced: Array) -> Array | None:
    """Return forces near z inside their cones that leave nothing unbalanced, or None; see `interior_point`.

    The metric is that of the cones' barrier: the change is P(z) Gᵀ… with P(z) = 2 z zᵀ − (z₀² − |z₁|²) J.
    """
    size = float(z[0].max())
    y, depth = z / size, lorentz.inner(z, z) / size**2

    def metric(x: Array) -> Array:
        out = 2.0 * (y * x).sum(axis=0) * y + depth * x
        out[0] -= 2.0 * depth * x[0]
        return np.asarray(out)

    # 2 y yᵀ − depth·J = depth (2 b bᵀ − J) with b = y / √depth.
    try:
        factor = blocks.layout.factor(RIDGE * blocks.own_gram, _gram(blocks, y / np.sqrt(depth), depth))
    except NotPositiveDefinite:
        return None
    change, left = np.zeros_like(z), unbalanced
    for _ in range(5):
        change = change - metric(_columns(blocks.times(factor.solve(left))))
        if not lorentz.is_inside(z + change):
            return None
        left = unbalanced + blocks.transposed_times(_flat(change))
        if float(np.linalg.norm(left)) <= BALANCED:
            return np.asarray(z + change)
    return None


def _gram(blocks: PairBlocks, b: Array, size: Array) -> Array:
    """Return (P, dof, dof) the sums over each pair's contacts of Gᵀ size (2 b bᵀ − J) G."""
    out = np.empty((len(blocks.first), blocks.dof, blocks.dof))
    kernels.gram_of_cones(blocks.rays, blocks.starts, b, size, out)
    return out


def _columns(x: Array) -> Array:
    """Return rows (3·C,) as (3, C)."""
    return np.ascontiguousarray(x.reshape(-1, 3).T)


def _flat(x: Array) -> Array:
    """Return (3, C) as rows (3·C,)."""
    return np.ascontiguousarray(x.T).ravel()
