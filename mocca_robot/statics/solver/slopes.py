"""Linear systems of Newton's method where contacts slide: their slope is not symmetric, and LU factors solve for it.

    εM + sums of ±Gᵀ(−dz/dx)G, pair by pair

Parts lie in the order of `SparseLayout`, which holds for every load on the same contacts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.statics.solver import lu_kernels
from mocca_robot.statics.solver.blocks import PairBlocks


@dataclass(frozen=True, eq=False)
class Slope:
    """A factored matrix of blocks: `diagonal` (F, dof, dof) of the free parts, `grams` (P, dof, dof) of the pairs."""

    blocks: PairBlocks
    diagonal: Array
    grams: Array
    low: Array
    up: Array

    @classmethod
    def of(cls, blocks: PairBlocks, diagonal: Array, grams: Array) -> Slope:
        """Return the factor."""
        it = blocks.sparse
        low = np.empty((len(it.rows), it.dof, it.dof))
        up = np.empty_like(low)
        lu_kernels.assemble(diagonal, grams, it.first, it.second, it.place, it.starts, it.below, low, up)
        lu_kernels.factorize(it.starts, it.rows, low, up)
        return cls(blocks, diagonal, grams, low, up)

    def times(self, u: Array) -> Array:
        """Return the matrix times u, (n,)."""
        blocks = self.blocks
        pulled = (self.grams @ blocks.relative(u)[:, :, None])[:, :, 0]
        return blocks.gathered(pulled) + np.asarray((self.diagonal @ u.reshape(-1, blocks.dof, 1)).ravel())

    def solve(self, right: Array) -> Array | None:
        """Return the solution for one right-hand side (n,), refined once; None where the matrix is singular."""
        x = self._substituted(right)
        if not np.isfinite(x).all():
            return None
        x = x + self._substituted(right - self.times(x))
        return x if np.isfinite(x).all() else None

    def _substituted(self, right: Array) -> Array:
        it, out = self.blocks.sparse, np.empty(len(right))
        lu_kernels.substitute(it.starts, it.rows, self.low, self.up, it.place, np.ascontiguousarray(right), out)
        return out
