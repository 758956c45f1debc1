"""The Gauss–Newton matrix of the descent, which damped steps are solved with: written out, or as products only.

H = Σ_c Bᵀ_c M_c⁻¹ B_c + SᵀS, where a column of B_c is the wrench balance that a parameter upsets in load case c (on
two parts: sparse), M_c = I + BᵀFB what active contact forces take up of it, and S the slopes of violated constraints.
Up to `LARGE` unknowns H is a matrix. Beyond, M_c is factorised in a band and H is only ever multiplied with: the
steps are then those of truncated conjugate gradients, and time and memory grow with the number of joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.sparse.linalg import LinearOperator, cg

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.tolerances import TINY

if TYPE_CHECKING:
    from mocca_robot.statics.solver.factors import Factor

LARGE = 1200
"""Unknowns up to which the matrix is written out."""
STIFF = 1e-6
"""Force per unit of slack, both relative to |w|, below which an active ray yields."""
IN_CONTACT = 1e-9
"""Force, as a share of the largest, from which a ray counts as active."""
PROBES = 16
"""Random signs from which the diagonal of H is estimated where H is not written out."""
PRODUCTS = 250
"""Products with H in one step at most: a step need not be exact, the next one starts from true geometry."""
ACCURATE = 1e-3
"""Residual of a step, relative to the gradient, that ends it earlier."""


class Curvature(Protocol):
    """What a step needs to know of H."""

    @property
    def diagonal(self) -> Array:
        """Return the diagonal of H, (n,), positive; an estimate where H is not written out."""

    def solve(self, right: Array, movable: BoolArray, damping: Array) -> Array:
        """Return x (n,) with (H + diag(damping)) x = right among `movable` unknowns, zero elsewhere."""


@dataclass(frozen=True, eq=False)
class Written:
    """H as a matrix (n, n)."""

    matrix: Array

    @property
    def diagonal(self) -> Array:
        """Return the diagonal."""
        return np.diag(self.matrix)

    def solve(self, right: Array, movable: BoolArray, damping: Array) -> Array:
        """Return the solution by Cholesky's factorisation."""
        damped = self.matrix[np.ix_(movable, movable)] + np.diag(damping[movable])
        solution = np.zeros(len(movable))
        solution[movable] = cho_solve(cho_factor(damped, lower=True), right[movable])
        return solution


@dataclass(frozen=True, eq=False)
class Answer:
    """Mᵤ of one load case, factorised: what its active forces leave of a change of balance (n,)."""

    factor: Factor
    balance: sp.csr_array


@dataclass(frozen=True, eq=False)
class Products:
    """H by its factors; see the module. `weight` multiplies the load cases, `slopes` (m, n) come weighted."""

    answers: tuple[Answer, ...]
    slopes: sp.csr_array
    weight: float
    diagonal: Array

    @classmethod
    def of(cls, answers: Sequence[Answer], slopes: sp.csr_array, weight: float) -> Products:
        """Return the products with their diagonal estimated: the mean of z ∘ Hz over random signs z."""
        size = slopes.shape[1]
        bare = cls(tuple(answers), slopes, weight, np.ones(size))
        rng = np.random.default_rng(0)
        total = np.zeros(size)
        for _ in range(PROBES):
            signs = rng.choice([-1.0, 1.0], size)
            total += signs * bare.times(signs)
        found = total / PROBES
        # The estimate scatters, and H is positive semidefinite: no entry is far below the common size.
        return cls(bare.answers, slopes, weight, np.maximum(found, 0.05 * max(float(found.mean()), 0.0)))

    def times(self, x: Array) -> Array:
        """Return H x, (n,)."""
        out = self.slopes.T @ (self.slopes @ x)
        for one in self.answers:
            out += self.weight * (one.balance.T @ one.factor.solve(one.balance @ x))
        return np.asarray(out)

    def solve(self, right: Array, movable: BoolArray, damping: Array) -> Array:
        """Return the solution as far as `PRODUCTS` conjugate gradients reach."""
        scale = np.where(movable, self.diagonal + damping, 1.0)

        def damped(x: Array) -> Array:
            return np.where(movable, self.times(np.where(movable, x, 0.0)) + damping * x, x)

        n = len(right)
        operator = LinearOperator((n, n), matvec=damped, dtype=np.float64)
        jacobi = LinearOperator((n, n), matvec=lambda x: x / scale, dtype=np.float64)
        found, _ = cg(operator, np.where(movable, right, 0.0), rtol=ACCURATE, maxiter=PRODUCTS, M=jacobi)
        return np.where(movable, found, 0.0)


def unanswered(system: ContactSystem, forces: Array, free: BoolArray, balance: Array) -> Array:
    """Return R⁻ᵀb with RᵀR = M: what the active forces (C,) of a case cannot take up of balance changes b (n, m)."""
    active = np.flatnonzero(forces > IN_CONTACT * max(float(forces.max(initial=0.0)), TINY))
    rows = system.matrix[active].toarray()[:, np.repeat(free[system.free], system.dof)]
    matrix = np.eye(rows.shape[1]) + rows.T @ (rows * (forces[active] / STIFF)[:, None])
    factor = cholesky(matrix, lower=True, overwrite_a=True, check_finite=False)
    return np.asarray(solve_triangular(factor, balance, lower=True, check_finite=False))


def answered(system: ContactSystem, forces: Array, free: BoolArray, balance: sp.csr_array) -> Answer:
    """Return the same as a factor of M and the balance changes (n, m), both about the blocks' common point."""
    same = bool((free == system.free).all())
    blocks = system.blocks if same else system.holding(free).blocks
    active = forces > IN_CONTACT * max(float(forces.max(initial=0.0)), TINY)
    stiffness = np.where(active, forces / STIFF, 0.0)
    shift = sp.block_diag([y.T for y in blocks.to_own], format="csr")
    return Answer(blocks.factor(blocks.gram(stiffness[blocks.source])), sp.csr_array(shift @ balance))
