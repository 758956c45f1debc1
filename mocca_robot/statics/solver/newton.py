"""Newton steps of the interior point (`interior_point`), in place: three passes over the rays a step (`kernels`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.statics.solver import kernels
from mocca_robot.statics.solver.blocks import PairBlocks
from mocca_robot.statics.solver.factors import Factor, NotPositiveDefinite

WEIGHT_LIMITS = (1e17, 1e13)
"""Largest z/s; the second one is tried where the first leaves the matrix indefinite in double precision."""
STEP = 0.995
"""Share of the way to the boundary that a step goes."""
LONG_ENOUGH = 0.9
"""Steps that are longer need no second corrector."""
CROWDED = 25
"""Rays per unknown from which on passes over the rays cost more than a second corrector saves."""
NOTHING_MISSING = 1e-14
"""Violation of B u + c = s that is rounding."""
REFINE_FROM = 1e9
"""Largest z/s from which a step is refined once, which keeps the stationarity at rounding level."""


@dataclass(frozen=True, eq=False)
class UnitLoad:
    """One load of unit norm: pull (n,) about the common point, c (M,) the slack of every ray of `blocks`."""

    blocks: PairBlocks
    pull: Array
    c: Array


@dataclass(frozen=True, eq=False)
class PrimalDual:
    """Motion u (n,) about the common point, slacks s and multipliers z (M,) of the rays."""

    u: Array
    s: Array
    z: Array


class Iterate:
    """A point on its way, with its residuals and the weights of the next step.

    Attributes:
        u, s, z: as in `PrimalDual`; changed in place.
        weights: (M,) z/s.
        inertia: (n,) YᵀYu.
        unbalanced: (n,) Yᵀ(w + Bᵀz).
        gap: sᵀz.
        primal: largest |B u + c − s|.
    """

    def __init__(self, problem: UnitLoad, point: PrimalDual) -> None:
        self.problem, self.blocks = problem, problem.blocks
        self.u, self.s, self.z = point.u, point.s.copy(), point.z.copy()
        pairs, dof = len(self.blocks.first), self.blocks.dof
        self.weights, self._target = np.empty((2, len(self.s)))
        self._ds, self._dz = np.zeros((2, len(self.s)))
        self._wrenches, self._inverse_wrenches, self._target_wrenches = np.empty((3, pairs, dof))
        self._gram, self._room = np.empty((pairs, dof, dof)), self.blocks.layout.room()
        self._missing = self.blocks.times(self.u) + problem.c - self.s
        self._largest: float
        self.primal = float(np.abs(self._missing).max(initial=0.0))
        self._advance(0.0)

    def point(self) -> PrimalDual:
        """Return a copy of where it stands."""
        return PrimalDual(self.u, self.s.copy(), self.z.copy())

    def step(self, centre: float | None = None) -> None:
        """Go one predictor–corrector step, or, `centre` given, back to the point of the central path with that μ.

        A direction solves YᵀY du − Bᵀdz = inertia − unbalanced, ds = B du + missing, dz = −target − D ds.
        Raises NotPositiveDefinite when rounding leaves no factor.
        """
        factor, gather = self._factor(), self.blocks.gathered
        base = self.unbalanced - self.inertia
        if self.primal > 0.0:
            base -= self.blocks.transposed_times(np.multiply(self.weights, self._missing, out=self._target))
        if centre is None:
            # Predictor, straight for s∘z = 0; the corrector goes as far towards the path as the predictor got along.
            reach, product = self._predicted(factor.solve(base - gather(self._wrenches)))
            mu = self.gap / len(self.s)
            mu *= ((1.0 - reach) + reach**2 * product / self.gap) ** 3
        else:
            mu = centre
            self._target[:], self._target_wrenches[:] = self.z, self._wrenches
            kernels.wrenches(self.blocks.rays, self.blocks.starts, 1.0 / self.s, self._inverse_wrenches)
        du = factor.solve(base - gather(self._target_wrenches - mu * self._inverse_wrenches))
        length = STEP * self._direction(du, mu)
        if length < LONG_ENOUGH and len(self.s) <= CROWDED * len(du):
            du, length = self._centred(factor, du, length, mu)
        if self._largest > REFINE_FROM:
            rest = self.inertia - self.unbalanced
            rest += self.blocks.own_gram_times(du) - self.blocks.transposed_times(self._dz)
            more = factor.solve(-rest)
            du = du + more
            length = STEP * self._refined(more)
        self._go(du, min(1.0, length))

    def _predicted(self, du: Array) -> tuple[float, float]:
        """Return how much of the step du can be gone, at most 1, and dsᵀdz; set the corrector's target but for −μ/s."""
        b = self.blocks
        steepest, product = kernels.predict(
            *(b.rays, b.starts, b.relative(du), self.s, self.z, self._missing),
            *(self._target, self._target_wrenches, self._inverse_wrenches),
        )
        return min(1.0, _longest(steepest)), product

    def _direction(self, du: Array, mu: float) -> float:
        """Take μ/s off the target, set ds and dz for du; return the longest step that keeps s and z ≥ 0."""
        b = self.blocks
        steepest = kernels.direction(
            *(b.rays, b.starts, b.relative(du), self.s, self.z, self.weights, self._missing),
            *(self._target, mu, self._ds, self._dz),
        )
        return _longest(steepest)

    def _refined(self, more: Array) -> float:
        """Add B·more to ds, and to dz what that asks for: computed anew D would blow up its rounding; then as above."""
        b = self.blocks
        return _longest(
            kernels.refine(b.rays, b.starts, b.relative(more), self.s, self.z, self.weights, self._ds, self._dz)
        )

    def _centred(self, factor: Factor, du: Array, length: float, mu: float) -> tuple[Array, float]:
        """Return du and the step with one of Gondzio's correctors, if that makes the step longer.

        Where a longer step would leave the products s∘z far from μ, it brings them back.
        """
        ahead = min(1.0, 1.3 * length + 0.1)
        products = (self.s + ahead * self._ds) * (self.z + ahead * self._dz)
        back = np.maximum(np.clip(products, 0.1 * mu, 10.0 * mu) - products, -10.0 * mu) / self.s
        before = self._ds.copy(), self._dz.copy()
        self._target -= back
        more = factor.solve(self.blocks.transposed_times(back))
        longer = STEP * self._direction(du + more, 0.0)
        if longer >= min(1.0, length + 0.01):
            return du + more, longer
        self._ds[:], self._dz[:] = before
        self._target += back
        return du, length

    def _factor(self) -> Factor:
        """Return the factor for the weights d, which are limited where need be."""
        for limit in WEIGHT_LIMITS:
            if self._largest > limit:
                np.minimum(self.weights, limit, out=self.weights)
                self._gram = self.blocks.gram(self.weights)
                self._largest = limit
            try:
                return self.blocks.factor(self._gram, self._room)
            except NotPositiveDefinite:
                continue
        raise NotPositiveDefinite("Weights of all sizes leave the normal matrix indefinite.")

    def _go(self, du: Array, length: float) -> None:
        self.u = self.u + length * du
        if self.primal > 0.0:  # every step shortens what is missing by its own length
            self.primal *= 1.0 - length
            self._missing *= 1.0 - length
            if self.primal < NOTHING_MISSING:
                self.primal = 0.0
                self._missing.fill(0.0)
        self._advance(length)

    def _advance(self, length: float) -> None:
        b = self.blocks
        self.gap, self._largest = kernels.advance(
            *(b.rays, b.starts, self.s, self.z, self._ds, self._dz, length, self.weights, self._wrenches, self._gram)
        )
        self.inertia = b.own_gram_times(self.u)
        self.unbalanced = self.problem.pull + b.gathered(self._wrenches)


def _longest(steepest: float) -> float:
    """Return the largest step that keeps all numbers ≥ 0 whose smallest relative change is `steepest`."""
    return -1.0 / steepest if steepest < 0.0 else np.inf
