"""Our own solver of contact forces between parts that give a little where they touch: one second-order cone a contact.

    min ½ zᵀCz + qᵀz + 1/(2ε) |w + Gᵀz|²   over z_c ∈ Q

with the displacements u and the slacks s = G u + C z + q ∈ Q, s_c ∘ z_c = 0, ε M u = w + Gᵀz. ε = 0 asks for
equilibrium; ε > 0 lets parts move by what is left unbalanced, as in one step of time from rest. G has three rows a
contact, [n/μ; t₁; t₂], so that z = (μ f_n, f_t); C is the diagonal of compliances in these units. With Nesterov–Todd
scaling W the compliances only add to the diagonal blocks: the normal matrix is εM + Gᵀ(W² + C)⁻¹G.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.statics.solver import cone_kernels, lorentz
from mocca_robot.statics.solver.blocks import PairBlocks
from mocca_robot.statics.solver.factors import NotPositiveDefinite

INSIDE = 1e-290
"""Lorentz product of a point strictly inside its cone: below it, numbers have lost their last digits."""

MAX_ITERATIONS = 60
REGULAR = 1e-13
"""Inertia that keeps the normal matrix definite where parts can move without touching."""
TOLERANCE = 1e-9
"""Gap to reach, relative to load and compliance: Newton's method on Coulomb's law takes it from there."""
STATIONARY = 1e-9
STALLED_AFTER = 5


@dataclass(frozen=True, eq=False)
class CompliantCones:
    """Contacts with compliance under one load.

    Attributes:
        blocks: of a system with three rows a contact, one after the other.
        pull: (n,) the load about the blocks' common point; of unit norm.
        compliance: (3, contacts) diagonal of C; of the order of 1.
        inertia: (F, dof, dof) ε M; zero for equilibrium.
        overlap: (contacts,) by how much parts overlap along x₀ before they give: what was driven in presses at once.
    """

    blocks: PairBlocks
    pull: Array
    compliance: Array
    inertia: Array
    overlap: Array

    @cached_property
    def diagonal(self) -> Array:
        """Return (F, dof, dof) the diagonal of the normal matrix without grams: inertia, never quite nothing."""
        return np.asarray(self.inertia + REGULAR * self.blocks.own_gram)

    def moved(self, u: Array) -> Array:
        """Return ε M u, (n,)."""
        return np.asarray((self.inertia @ u.reshape(-1, self.blocks.dof, 1)).ravel())


@dataclass(frozen=True, eq=False)
class ConeForces:
    """What `solve` found.

    Attributes:
        u: (n,) displacements about the blocks' common point.
        z: (3, contacts) forces in their cones.
        s: (3, contacts) slacks G u + C z + q.
        residual: largest of what is left of equilibrium, of slacks and of complementarity.
        iterations: Newton steps taken.
    """

    u: Array
    z: Array
    s: Array
    residual: float
    iterations: int


@np.errstate(all="ignore")
def solve(problem: CompliantCones, offset: Array, start: ConeForces | None = None) -> ConeForces:
    """Return the forces for offsets q = (offset, 0, 0), (contacts,).

    Where the answer has a large residual there may be none: no forces hold the load, or rounding came first.
    """
    blocks, c = problem.blocks, problem.compliance
    count = c.shape[1]
    weight = 1.0 / np.sqrt(max(1, len(blocks.to_own)))
    u, s, z = np.zeros(blocks.size), np.zeros((3, count)), np.zeros((3, count))
    z[0], s[0] = weight, weight * c[0] + np.maximum(offset, 0.0)
    shift = offset - problem.overlap
    scale = 1.0 + float(np.abs(shift).max(initial=0.0))
    best: ConeForces | None = None
    stalled = 0
    for iteration in range(MAX_ITERATIONS):
        r_dual = problem.moved(u) - problem.pull - blocks.transposed_times(_flat(z))
        r_primal = _columns(blocks.times(u)) + c * z - s
        r_primal[0] += shift
        gap = float((s * z).sum())
        error = max(float(np.linalg.norm(r_dual)), float(np.abs(r_primal).max(initial=0.0)) / scale)
        reached = max(error, gap / scale)
        if best is None or reached < 0.9 * best.residual:
            best, stalled = ConeForces(u, z, s, reached, iteration), 0
        else:
            stalled += 1
        if (error <= STATIONARY and gap <= TOLERANCE * scale) or stalled > STALLED_AFTER:
            break
        try:
            du, ds, dz = _step(problem, s, z, r_dual, r_primal)
        except NotPositiveDefinite:
            break
        length = min(1.0, 0.995 * lorentz.longest(s, ds), 0.995 * lorentz.longest(z, dz))
        u, s, z = u + length * du, s + length * ds, z + length * dz
        if not np.isfinite(length) or not (_is_clear_of_boundary(s) and _is_clear_of_boundary(z)):
            break
    assert best is not None
    return best


def _step(problem: CompliantCones, s: Array, z: Array, r_dual: Array, r_primal: Array) -> tuple[Array, Array, Array]:
    """Return (du, ds, dz) of one predictor–corrector step in Nesterov–Todd scaling."""
    blocks, c = problem.blocks, problem.compliance
    scaling = lorentz.Scaling.of(s, z)
    scaled = scaling.times(z)
    stiff = np.empty((6, s.shape[1]))
    cone_kernels.stiffness(scaling.b, scaling.eta, c, stiff)
    gram = np.empty((len(blocks.first), blocks.dof, blocks.dof))
    cone_kernels.gram_of_stiffness(blocks.rays, blocks.starts, stiff, gram)
    if not np.isfinite(gram).all():
        raise NotPositiveDefinite("Rounding has left no scaling of the cones.")
    factor = blocks.layout.factor(problem.diagonal, gram)
    mu = float((s * z).sum()) / s.shape[1]

    def direction(q: Array) -> tuple[Array, Array, Array]:
        wanted = r_primal + scaling.times(q)
        right = -r_dual - blocks.transposed_times(_flat(cone_kernels.apply(stiff, wanted)))
        du = factor.solve(right)
        dz = -cone_kernels.apply(stiff, _columns(blocks.times(du)) + wanted)
        du = du + factor.solve(-r_dual - problem.moved(du) + blocks.transposed_times(_flat(dz)))
        dz = -cone_kernels.apply(stiff, _columns(blocks.times(du)) + wanted)
        ds = _columns(blocks.times(du)) + c * dz + r_primal
        return du, ds, dz

    _, ds, dz = direction(scaled)
    reach = min(1.0, lorentz.longest(s, ds), lorentz.longest(z, dz))
    sigma = (1.0 - reach) ** 3
    second = lorentz.product(scaling.divide(ds), scaling.times(dz))
    second[0] -= sigma * mu
    return direction(scaled + lorentz.quotient(scaled, second))


def _columns(x: Array) -> Array:
    return np.ascontiguousarray(x.reshape(-1, 3).T)


def _flat(x: Array) -> Array:
    return np.ascontiguousarray(x.T).ravel()


def _is_clear_of_boundary(x: Array) -> bool:
    """Return whether every column lies inside its cone in double precision."""
    return bool((x[0] > 0.0).all() and (lorentz.inner(x, x) > INSIDE).all())
