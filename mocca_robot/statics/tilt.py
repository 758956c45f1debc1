"""The critical tilt as one parametric problem: every collapse motion bounds it, and the bounds converge in a few steps.

Under gravity g(θ) = cos θ·g₀ + sin θ·g₁ a structure that falls shows a motion v that no contact resists, and
that gains power: P(θ) = Σ m_i g(θ)·v_i > 0. The same motion stays possible at every other tilt, so no structure
stands where its P is positive: not beyond tan θ' = −(g₀·v̄)/(g₁·v̄), v̄ = Σ m_i v_i. The next problem is solved
there (Newton's method on the support function of a convex cone: it approaches from above and never passes). Forces
that stay while the ground tilts add a constant power c: P(θ) = cos θ·a + sin θ·b + c is positive beyond
θ' = φ − arccos(−c/R), with R and φ the length and the angle of (a, b).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.statics.solution import EquilibriumResult, Status

RESOLUTION_RAD = 1e-5
"""Steps shorter than this end the search; about 0.0006°."""
AT_THE_BORDER = 1e-7
"""E / |w|² below which 'inaccurate' means that the structure is about to fall: 0.03 % of its weight is unbalanced."""
MAX_STEPS = 40


def critical_angle(
    solve: Callable[[float], EquilibriumResult],
    masses: Array,
    down: Array,
    side: Array,
    *,
    start_rad: float = np.pi / 2,
    applied: Callable[[Array], float] | None = None,
) -> tuple[float, int]:
    """Return the largest tilt (radians, at most `start_rad`) that is in equilibrium, and how many problems were solved.

    Args:
        solve: tilt in radians → equilibrium under gravity cos θ·down + sin θ·side, with motions measured at the
            centres of mass.
        masses: (N,) kilograms; only of parts that move.
        down, side: (d,) gravity upright and at 90°.
        start_rad: the tilt from which the search comes down.
        applied: the power, in motions (N, dof), of forces that stay as they are while the ground tilts.

    The structure must stand upright. Where a solver gives no verdict far from the border, bisection goes on
    below the bound reached.
    """
    angle = start_rad
    for step in range(1, MAX_STEPS + 1):
        result = solve(angle)
        if result.stands or (result.status is Status.INACCURATE and result.infeasibility <= AT_THE_BORDER):
            return angle, step
        if result.status is Status.INACCURATE:
            return _bisected(solve, angle, step)
        drift = masses @ result.motions[:, : len(down)]
        steady = 0.0 if applied is None else applied(result.motions)
        bound = _powerless(float(down @ drift), float(side @ drift), steady)
        if bound > angle - RESOLUTION_RAD:
            return min(angle, bound), step
        if bound <= RESOLUTION_RAD:
            return 0.0, step
        angle = bound
    return angle, MAX_STEPS


def _powerless(down: float, side: float, steady: float) -> float:
    """Return the tilt from which a motion gains power: `down` and `side` are gravity's powers upright and at 90°."""
    if down + steady >= 0.0:
        return 0.0
    reach = float(np.hypot(down, side))
    if reach <= abs(steady):
        return float(np.pi / 2)
    return max(0.0, float(np.arctan2(side, down)) % (2 * np.pi) - float(np.arccos(-steady / reach)))


def _bisected(solve: Callable[[float], EquilibriumResult], high: float, steps: int) -> tuple[float, int]:
    low = 0.0
    while high - low > 10 * RESOLUTION_RAD:
        middle, steps = 0.5 * (low + high), steps + 1
        low, high = (middle, high) if solve(middle).stands else (low, middle)
    return low, steps
