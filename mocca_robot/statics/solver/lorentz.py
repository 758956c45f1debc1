"""Algebra of many second-order cones at once: x = (x₀, x₁) with x₀ ≥ |x₁|, one column a cone, arrays (3, C).

Products and the Nesterov–Todd scaling as in L. Vandenberghe, "The CVXOPT linear and quadratic cone program
solvers" (2010); for the cones of one contact force each.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mocca_robot.arrays import Array


def inner(x: Array, y: Array) -> Array:
    """Return x₀y₀ − x₁·y₁, (C,)."""
    return np.asarray(x[0] * y[0] - x[1] * y[1] - x[2] * y[2])


def product(x: Array, y: Array) -> Array:
    """Return the Jordan product x ∘ y = (x·y, x₀y₁ + y₀x₁)."""
    out = x[0] * y + y[0] * x
    out[0] = (x * y).sum(axis=0)
    return np.asarray(out)


def quotient(x: Array, r: Array) -> Array:
    """Return the solution y of x ∘ y = r."""
    first = inner(x, r) / inner(x, x)
    out = (r - first * x) / x[0]
    out[0] = first
    return np.asarray(out)


def longest(x: Array, dx: Array) -> float:
    """Return the largest step with x + step·dx in all cones, for x inside them."""
    a, b, c = inner(dx, dx), inner(x, dx), inner(x, x)
    # The first positive root of c + 2bt + at², written so that nothing cancels.
    root = np.sqrt(np.maximum(b * b - a * c, 0.0)) - b
    leaves = (a < 0.0) | ((b < 0.0) & (b * b > a * c))
    steps = np.where(leaves & (root > 0.0), c / np.where(root > 0.0, root, 1.0), np.inf)
    # Straight towards the tip both roots are one, and rounding may lose it.
    down = dx[0] < 0.0
    tip = np.where(down, x[0] / np.where(down, -dx[0], 1.0), np.inf)
    return float(np.minimum(steps, tip).min(initial=np.inf))


def is_inside(x: Array) -> bool:
    """Return whether every column lies strictly inside its cone."""
    return bool((x[0] > np.hypot(x[1], x[2])).all())


@dataclass(frozen=True, eq=False)
class Scaling:
    """The symmetric W with W z = W⁻¹ s for given s and z inside the cones.

    W = η (2 b bᵀ − J)^{1/2} with b of hyperbolic length one; W⁻² = η⁻² (2 (Jb)(Jb)ᵀ − J).
    """

    b: Array
    eta: Array

    @classmethod
    def of(cls, s: Array, z: Array) -> Scaling:
        """Return the scaling of s and z, (3, C) each."""
        ss, zz = inner(s, s), inner(z, z)
        s_unit, z_unit = s / np.sqrt(ss), z / np.sqrt(zz)
        b = s_unit - z_unit
        b[0] += 2.0 * z_unit[0]
        gamma = np.sqrt(0.5 * (1.0 + (s_unit * z_unit).sum(axis=0)))
        return cls(b / (2.0 * gamma), (ss / zz) ** 0.25)

    @cached_property
    def mirrored(self) -> Array:
        """Return J b, (3, C)."""
        return np.stack([self.b[0], -self.b[1], -self.b[2]])

    def times(self, x: Array) -> Array:
        """Return W x."""
        return self._apply(self.b, self.eta, x)

    def divide(self, x: Array) -> Array:
        """Return W⁻¹ x."""
        return self._apply(self.mirrored, 1.0 / self.eta, x)

    def divide_twice(self, x: Array) -> Array:
        """Return W⁻² x."""
        y = self.mirrored
        out = 2.0 * (y[0] * x[0] + y[1] * x[1] + y[2] * x[2]) * y + x
        out[0] -= 2.0 * x[0]
        out /= self.eta**2
        return np.asarray(out)

    @staticmethod
    def _apply(b: Array, eta: Array, x: Array) -> Array:
        along = b[1] * x[1] + b[2] * x[2]
        out = x + (x[0] + along / (1.0 + b[0])) * b
        out[0] = b[0] * x[0] + along
        return np.asarray(eta * out)
