"""Newton steps of the interior point (`interior_point`), in place.

A step passes over all rows some thirty times. Arrays of a hundred thousand rows, taken from the system and given
back at every pass, cost ten times as much as filling them, so an `Iterate` owns all that it needs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.assembly import Array
from mocca_robot.statics.banded import Factor, NotPositiveDefinite
from mocca_robot.statics.blocks import PairBlocks

WEIGHT_LIMITS = (1e17, 1e13)
"""Largest z/s; the second one is tried where the first leaves the matrix indefinite in double precision."""
STEP = 0.995
"""Share of the way to the boundary that a step goes."""
LONG_ENOUGH = 0.9
"""Steps that are longer need no second corrector."""
CROWDED = 25
"""Rows per unknown from which on passes over the rows cost more than a second corrector saves."""
NOTHING_MISSING = 1e-14
"""Violation of B u + c = s that is rounding."""
REFINE_FROM = 1e9
"""Largest z/s from which a step is refined once, which keeps the stationarity at rounding level."""


@dataclass(frozen=True, eq=False)
class Problem:
    """One load of unit norm: pull (n,) about the common point, c (M,) the slack of every row of `blocks`."""

    blocks: PairBlocks
    pull: Array
    c: Array


@dataclass(frozen=True, eq=False)
class Point:
    """Motion u (n,) about the common point, slacks s and multipliers z (M,) of the rows."""

    u: Array
    s: Array
    z: Array


class Iterate:
    """A point on its way, with its residuals and the weights of the next step.

    Attributes:
        u, s, z: as in `Point`; changed in place.
        inertia: (n,) YᵀYu.
        unbalanced: (n,) Yᵀ(w + Bᵀz).
        gap: sᵀz.
        primal: largest |B u + c − s|.
    """

    def __init__(self, problem: Problem, point: Point) -> None:
        self.problem, self.blocks = problem, problem.blocks
        self.u, self.s, self.z = point.u, point.s.copy(), point.z.copy()
        rows, pairs, dof = len(self.s), len(self.blocks.first), self.blocks.dof
        self._d, self._ds, self._dz, self._target, self._a = np.empty((5, rows))
        self._room = np.empty(dof * max((b.rows.stop - b.rows.start for b in self.blocks.buckets), default=0))
        self._wrenches, self._gram = np.empty((pairs, dof)), np.empty((pairs, dof, dof))
        self._missing = self.blocks.times(self.u) + problem.c - self.s
        self.primal = float(np.abs(self._missing).max(initial=0.0))
        self._largest = 0.0
        self._look()

    def point(self) -> Point:
        """Return a copy of where it stands."""
        return Point(self.u, self.s.copy(), self.z.copy())

    def step(self, centre: float | None = None) -> None:
        """Go one predictor–corrector step, or, `centre` given, back to the point of the central path with that μ.

        A direction solves YᵀY du − Bᵀdz = inertia − unbalanced, ds = B du + missing, dz = −target − D ds.
        Raises NotPositiveDefinite when rounding leaves no factor.
        """
        factor = self._factor()
        base = self.unbalanced - self.inertia
        if self.primal > 0.0:
            base -= self.blocks.transposed_times(np.multiply(self._d, self._missing, out=self._a))
        if centre is None:
            # Predictor, straight for s∘z = 0; the corrector goes as far towards the path as the predictor got along.
            du = factor.solve(base - (self.unbalanced - self.problem.pull))
            reach = min(1.0, self._direction(du, self.z))
            mu = self.gap / len(self.s)
            mu *= ((1.0 - reach) + reach**2 * float(self._ds @ self._dz) / self.gap) ** 3
        else:
            mu = centre
            self._ds.fill(0.0)
        du = factor.solve(base - self._corrector(mu))
        length = STEP * self._direction(du, self._target)
        if length < LONG_ENOUGH and len(self.s) <= CROWDED * len(du):
            du, length = self._centred(factor, du, length, mu)
        if self._largest > REFINE_FROM:
            rest = self.inertia - self.unbalanced
            rest += self.blocks.inertia_times(du) - self.blocks.transposed_times(self._dz)
            more = factor.solve(-rest)
            change = self.blocks.times(more)  # added, not computed anew: D would blow up its rounding
            du, self._ds, self._dz = du + more, self._ds + change, self._dz - self._d * change
            length = STEP * min(_longest(self.s, self._ds), _longest(self.z, self._dz))
        self._go(du, min(1.0, length))

    def _corrector(self, mu: float) -> Array:
        """Set the target z + (ds∘dz − μ)/s from the direction at hand and return Bᵀ of it."""
        for b in self.blocks.buckets:
            target = self._target[b.rows]
            np.multiply(self._ds[b.rows], self._dz[b.rows], out=target)
            target -= mu
            target /= self.s[b.rows]
            target += self.z[b.rows]
            self._wrenches[b.pairs] = b.wrenches(target)
        return self.blocks.gathered(self._wrenches)

    def _direction(self, du: Array, target: Array) -> float:
        """Set ds and dz for du and a target; return the longest step that keeps s and z ≥ 0."""
        relative, steepest = self.blocks.relative(du), 0.0
        for b in self.blocks.buckets:
            ds, dz, a = self._ds[b.rows], self._dz[b.rows], self._a[b.rows]
            b.times(relative, ds)
            if self.primal > 0.0:
                ds += self._missing[b.rows]
            np.multiply(self._d[b.rows], ds, out=dz)
            dz += target[b.rows]
            np.negative(dz, out=dz)
            for x, dx in ((self.s[b.rows], ds), (self.z[b.rows], dz)):
                steepest = min(steepest, float(np.divide(dx, x, out=a).min()))
        return -1.0 / steepest if steepest < 0.0 else np.inf

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
        longer = STEP * self._direction(du + more, self._target)
        if longer >= min(1.0, length + 0.01):
            return du + more, longer
        self._ds, self._dz = before
        self._target += back
        return du, length

    def _factor(self) -> Factor:
        """Return the factor for the weights d, which are limited where need be."""
        for limit in WEIGHT_LIMITS:
            if self._largest > limit:
                np.minimum(self._d, limit, out=self._d)
                self._gram = self.blocks.gram(self._d)
                self._largest = limit
            try:
                return self.blocks.factor(self._gram)
            except NotPositiveDefinite:
                continue
        raise NotPositiveDefinite("Weights of all sizes leave the normal matrix indefinite.")

    def _go(self, du: Array, length: float) -> None:
        self.u = self.u + length * du
        self._ds *= length
        self._dz *= length
        self.s += self._ds
        self.z += self._dz
        if self.primal > 0.0:  # every step shortens what is missing by its own length
            self.primal *= 1.0 - length
            self._missing *= 1.0 - length
            if self.primal < NOTHING_MISSING:
                self.primal = 0.0
        self._look()

    def _look(self) -> None:
        self.gap, self._largest = 0.0, 0.0
        for b in self.blocks.buckets:
            s, z, d = self.s[b.rows], self.z[b.rows], self._d[b.rows]
            self.gap += float(s @ z)
            self._largest = max(self._largest, float(np.divide(z, s, out=d).max()))
            self._wrenches[b.pairs] = b.wrenches(z)
            self._gram[b.pairs] = b.gram(d, self._room)
        self.inertia = self.blocks.inertia_times(self.u)
        self.unbalanced = self.problem.pull + self.blocks.gathered(self._wrenches)


def _longest(x: Array, dx: Array) -> float:
    """Return the largest step with x + step·dx ≥ 0."""
    steepest = float((dx / x).min(initial=0.0))
    return -1.0 / steepest if steepest < 0.0 else np.inf
