"""Newton's method on the equilibrium of parts whose contacts follow Coulomb's law with springs, slip without lift.

    w + Gᵀ z(G u) = ε M u

The law z(x) is explicit, so that what solves this *is* elastic contact with Coulomb friction, whatever found it.
Its slope is not symmetric where contacts slide; a sparse LU solves for each step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.statics.solver import cone_kernels
from mocca_robot.statics.solver.compliant_cones import CompliantCones

EXACT = 1e-10
"""Unbalanced share of the load at which the equations count as solved."""
MOST_STEPS, SHORTEST, WINDOW, STALLED_AFTER = 25, 1.0 / 64.0, 6, 8
"""Newton steps, their shortest length, the points that a step is measured by, and steps without progress."""
DENSE = 150
"""Unknowns up to which a dense factor is faster."""


@dataclass(frozen=True, eq=False)
class CoulombPoint:
    """Displacements and what Coulomb's law makes of them.

    Attributes:
        u: (n,) about the blocks' common point.
        x, z: (3, contacts) relative motions less overlaps, and forces in their cones.
        residual: (n,) what is left unbalanced.
        grams: (P, dof, dof) Gᵀ(−dz/dx)G of every pair.
    """

    u: Array
    x: Array
    z: Array
    residual: Array
    grams: Array

    @property
    def error(self) -> float:
        """Return the norm of what is left."""
        return float(np.linalg.norm(self.residual))


def at(problem: CompliantCones, u: Array) -> CoulombPoint:
    """Return the forces that displacements u (n,) bring about, and what they leave unbalanced."""
    blocks = problem.blocks
    x, z = np.empty_like(problem.compliance), np.empty_like(problem.compliance)
    grams = np.empty((len(blocks.first), blocks.dof, blocks.dof))
    relative = blocks.relative(u)
    cone_kernels.coulomb(blocks.rays, blocks.starts, relative, problem.compliance, problem.overlap, x, z, grams)
    flat = np.ascontiguousarray(z.T).ravel()
    return CoulombPoint(u, x, z, problem.pull + blocks.transposed_times(flat) - problem.moved(u), grams)


def newton(problem: CompliantCones, u: Array) -> CoulombPoint:
    """Return the best point that Newton's method gets to from u; its `error` tells whether it solves the equations.

    A step need only improve on the worst of the last few points: the law has kinks, and the way past one may go up.
    """
    point = best = at(problem, u)
    slopes, errors, stalled = Slopes.of(problem), [point.error], 0
    for _ in range(MOST_STEPS):
        if point.error <= EXACT or stalled > STALLED_AFTER:
            break
        du = slopes.solve(point)
        new = None if du is None else _shortened(problem, point.u, du, max(errors[-WINDOW:]))
        if new is None:
            break
        point = new
        errors.append(point.error)
        stalled = 0 if point.error < 0.9 * best.error else stalled + 1
        best = min(best, point, key=lambda p: p.error)
    return best


def _shortened(problem: CompliantCones, u: Array, du: Array, worst: float) -> CoulombPoint | None:
    """Return the point after the longest step along du, halved as often as it takes, that improves on `worst`."""
    length = 1.0
    while length >= SHORTEST:
        new = at(problem, u + length * du)
        if new.error < (1.0 - 0.1 * length) * worst:
            return new
        length *= 0.5
    return None


@dataclass(frozen=True, eq=False)
class Slopes:
    """Where the numbers of −dR/du lie, R what is left unbalanced: εM and, pair by pair, ±Gᵀ(−dz/dx)G.

    Attributes:
        problem: whose contacts they are.
        rows, columns: of every number that belongs to a free part.
        inside: which of all numbers those are.
    """

    problem: CompliantCones
    rows: IntArray
    columns: IntArray
    inside: BoolArray

    @classmethod
    def of(cls, problem: CompliantCones) -> Slopes:
        """Return the places for `problem`."""
        b = problem.blocks
        own, within = np.arange(len(b.to_own)), np.arange(b.dof)
        rows = np.concatenate([own, b.first, b.second, b.first, b.second])
        columns = np.concatenate([own, b.first, b.second, b.second, b.first])
        shape = (len(rows), b.dof, b.dof)
        r = np.broadcast_to(rows[:, None, None] * b.dof + within[:, None], shape).ravel()
        c = np.broadcast_to(columns[:, None, None] * b.dof + within, shape).ravel()
        inside = (r < b.size) & (c < b.size)
        return cls(problem, r[inside], c[inside], inside)

    def solve(self, point: CoulombPoint) -> Array | None:
        """Return the Newton step from `point`, or None where the slope is singular."""
        p, n, grams = self.problem, self.problem.blocks.size, point.grams
        values = np.concatenate([p.mass, grams, grams, -grams, -grams]).ravel()[self.inside]
        try:
            if n <= DENSE:
                dense = np.bincount(self.rows * n + self.columns, weights=values, minlength=n * n).reshape(n, n)
                du = np.linalg.solve(dense, point.residual)
            else:
                matrix = sp.csc_array(sp.coo_array((values, (self.rows, self.columns)), shape=(n, n)))
                order = {"SymmetricMode": True}
                du = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options=order).solve(
                    point.residual
                )
        except (np.linalg.LinAlgError, RuntimeError):
            return None
        return np.asarray(du) if np.isfinite(du).all() else None
