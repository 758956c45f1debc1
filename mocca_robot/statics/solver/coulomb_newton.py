"""Newton's method on the equilibrium of parts whose contacts follow Coulomb's law with springs, slip without lift.

    w + Gᵀ z(G u) = ε M u

The law z(x) is explicit, so that what solves this *is* elastic contact with Coulomb friction, whatever found it.
Its slope is not symmetric where contacts slide (`slopes`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.statics.solver import cone_kernels
from mocca_robot.statics.solver.compliant_cones import CompliantCones
from mocca_robot.statics.solver.slopes import Slope

EXACT = 1e-10
"""Unbalanced share of the load at which the equations count as solved."""
MOST_STEPS, SHORTEST, WINDOW, STALLED_AFTER = 25, 1.0 / 64.0, 6, 8
"""Newton steps, their shortest length, the points that a step is measured by, and steps without progress."""


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


def newton(problem: CompliantCones, u: Array, most_steps: int = MOST_STEPS) -> CoulombPoint:
    """Return the best point that Newton's method gets to from u; its `error` tells whether it solves the equations.

    A step need only improve on the worst of the last few points: the law has kinks, and the way past one may go up.
    """
    point = best = at(problem, u)
    errors, stalled = [point.error], 0
    for _ in range(most_steps):
        if point.error <= EXACT or stalled > STALLED_AFTER:
            break
        du = Slope.of(problem.blocks, problem.diagonal, point.grams).solve(point.residual)
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
