"""The answer of Eq. 7 once it is known which rays press: on a face of the cone everything is linear."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.statics.solver.blocks import PairBlocks
from mocca_robot.statics.solver.factors import NotPositiveDefinite
from mocca_robot.tolerances import TINY

PENALTY = 1e9
"""Weight of B v + c = 0 against ½|v|² in one solve; a few rounds make both exact."""
LEAST_WEIGHT = 0.01
"""Rays that press least get this share of the largest force as a measure of how far they may change."""
ROUNDS = 6
EXACT = 1e-10
"""Residual to reach, relative to |w|; an order below what the interior point promises."""

DOUBTFUL = (1e-7, 1e-4)
"""Motions, relative to |w|, of which rounding leaves open whether they are none: E is too near to `EXACT`."""


def on_face(blocks: PairBlocks, pull: Array, c: Array, z: Array, pressing: BoolArray) -> Array | None:
    """Return multipliers z (M,) when exactly the rays `pressing` (M,) may press; None if that guess is wrong.

    B u + c = 0 on those rays, YᵀYu = pull + Bᵀz, and of all such multipliers those that change least from the given
    z, relative to its own size: the method of multipliers in the metric Z². The guess is wrong when it makes a
    multiplier negative or lets another ray penetrate. With everything pressing, u = 0 proves equilibrium. Without
    slacks a motion that is nearly none is no answer either.
    """
    weight = np.where(pressing, np.maximum(z / z.max(initial=TINY), LEAST_WEIGHT) ** 2, 0.0)
    try:
        factor = blocks.layout.factor(blocks.own_gram / PENALTY, blocks.gram(weight))
    except NotPositiveDefinite:
        return None
    z, u = np.where(pressing, z, 0.0), np.zeros_like(pull)
    left, open_gap = pull + blocks.transposed_times(z), np.where(pressing, c, 0.0)
    for _ in range(ROUNDS):
        step = factor.solve(left / PENALTY - blocks.transposed_times(weight * open_gap))
        z = z - PENALTY * weight * (blocks.times(step) + open_gap)
        if (z < 0.0).any():
            return None
        u = u + step
        slack = blocks.times(u) + c
        open_gap = np.where(pressing, slack, 0.0)
        left = pull + blocks.transposed_times(z) - blocks.own_gram_times(u)
        if float(np.linalg.norm(left)) <= EXACT and float(np.abs(open_gap).max(initial=0.0)) <= EXACT:
            doubtful = not c.any() and DOUBTFUL[0] < float(np.sqrt(u @ blocks.own_gram_times(u))) < DOUBTFUL[1]
            return None if doubtful or float(slack.min(initial=0.0)) < -EXACT else z
        open_gap[np.abs(open_gap) < 0.01 * EXACT] = 0.0  # rounding, which the penalty would blow up
    return None
