"""The structure of Eq. 7's normal equations: every ray acts on the relative motion of one pair of parts.

With all motions u measured about one common point, B u is R_p (u_j − u_i) pair by pair, and BᵀDB is made of the
small matrices H_p = R_pᵀ D R_p: +H_p on the diagonal blocks of i and j, −H_p between them, whatever the number of
rays. Only the objective ½|v|², v = Y u about each part's own reference point, keeps a trace of those points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.statics.solver import kernels
from mocca_robot.statics.solver.banded import BandedLayout
from mocca_robot.statics.solver.factors import Factor, FactorLayout
from mocca_robot.statics.solver.sparse import SparseLayout

NARROW = 100
"""Width up to which a band is faster than a sparse factor: the columns of a part stay in the nearest cache."""
SPARSE_COSTS = 3.0
"""Time of a sparse factor's multiplication, over that of a band's: 2 on domes, 3 on flat walls."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PairBlocks:
    """Rays of a `ContactSystem` sorted by pair, for fast products with B, and the order of its Cholesky factors.

    Attributes:
        dof: 3 or 6.
        first, second: (P,) which free part is i and j of every pair; the number of free parts stands for ground.
        rays: (dof, M) about the common point, one a column, sorted by pair; those between fixed parts are left out.
        starts: (P + 1,) where the columns of every pair begin, and M.
        source: (M,) which ray of the system a column is.
        n_rays: C.
        to_own: (F, dof, dof) Y: u of every free part → its motion about its own reference point.
    """

    dof: int
    first: IntArray
    second: IntArray
    rays: Array
    starts: IntArray
    source: IntArray
    n_rays: int
    to_own: Array

    @classmethod
    def of(cls, pairs: IntArray, rays_j: Array, free: BoolArray, about: Array, length: float) -> PairBlocks:
        """Return the blocks of a `ContactSystem` by its fields, motions about the mean reference point.

        Rays of a pair keep their order.
        """
        n_parts, n_free = len(free), int(free.sum())
        offset = (about - about[free].mean(axis=0)) / length
        number = np.full(n_parts, n_free)
        number[free] = np.arange(n_free)
        keys = pairs[:, 0] * n_parts + pairs[:, 1]
        order = np.arange(len(keys))
        if (np.diff(keys) < 0).any():
            order = np.argsort(keys, kind="stable")
            keys = keys[order]
        starts = np.flatnonzero(np.diff(keys, prepend=-1))
        i, j = np.divmod(keys[starts], n_parts)
        moves = free[i] | free[j]
        if not moves.all():
            stays = np.repeat(moves, np.diff(starts, append=len(keys)))
            order, counts = order[stays], np.diff(starts, append=len(keys))[moves]
            i, j, starts = i[moves], j[moves], np.cumsum(counts) - counts
        starts = np.append(starts, len(order))
        rays = np.empty((rays_j.shape[1], len(order)))
        kernels.columns(rays_j, order, starts, offset[j], rays)
        to_own = _shift(offset[free])
        return cls(
            dof=rays_j.shape[1],
            first=number[i],
            second=number[j],
            rays=rays,
            starts=starts,
            source=order,
            n_rays=len(pairs),
            to_own=to_own,
        )

    @property
    def size(self) -> int:
        """Return the number of unknowns."""
        return len(self.to_own) * self.dof

    def relative(self, u: Array) -> Array:
        """Return (P, dof) the relative motion u_j − u_i of every pair, for motions u (n,) about the common point."""
        out = np.empty((len(self.first), self.dof))
        kernels.relative(u, self.first, self.second, out)
        return out

    def times(self, u: Array) -> Array:
        """Return B u, (M,), for motions u (n,) about the common point."""
        out = np.empty(len(self.source))
        kernels.times(self.rays, self.starts, self.relative(u), out)
        return out

    def transposed_times(self, y: Array) -> Array:
        """Return Bᵀ y, (n,), for one number y (M,) a column."""
        out = np.empty((len(self.first), self.dof))
        kernels.wrenches(self.rays, self.starts, y, out)
        return self.gathered(out)

    def gathered(self, wrenches: Array) -> Array:
        """Return (n,) the sum on every part of its pairs' wrenches (P, dof)."""
        out = np.empty(self.size)
        kernels.gather(wrenches, self.first, self.second, out)
        return out

    def forces(self, z: Array) -> Array:
        """Return (C,) the force along every ray of the system from multipliers z (M,)."""
        out = np.zeros(self.n_rays)
        out[self.source] = z
        return out

    def gram(self, d: Array) -> Array:
        """Return (P, dof, dof) H_p = R_pᵀ diag(d) R_p for weights d (M,)."""
        out = np.empty((len(self.first), self.dof, self.dof))
        kernels.gram(self.rays, self.starts, d, out)
        return out

    def own_wrenches(self, w: Array) -> Array:
        """Return Y⁻ᵀ w, wrenches (n,) about the parts' own reference points from those about the common point."""
        to_common = 2.0 * np.eye(self.dof) - self.to_own  # Y⁻¹: the same shift the other way
        return np.asarray((to_common.transpose(0, 2, 1) @ w.reshape(-1, self.dof, 1)).ravel())

    def own_transposed(self, w: Array) -> Array:
        """Return Yᵀ w, wrenches (n,) about the common point."""
        return np.asarray((self.to_own.transpose(0, 2, 1) @ w.reshape(-1, self.dof, 1)).ravel())

    def own_gram_times(self, u: Array) -> Array:
        """Return YᵀY u, (n,)."""
        return np.asarray((self.own_gram @ u.reshape(-1, self.dof, 1)).ravel())

    @cached_property
    def own_gram(self) -> Array:
        """Return (F, dof, dof) YᵀY, the Hessian of ½|v|² in u."""
        return np.asarray(self.to_own.transpose(0, 2, 1) @ self.to_own)

    @cached_property
    def layout(self) -> FactorLayout:
        """Return where the blocks lie in the normal matrix: in a band, or, where that is faster, in sparse columns."""
        graph = self.first, self.second, len(self.to_own)
        banded = BandedLayout.of(*graph, self.dof)
        if banded.width <= NARROW:
            return banded
        sparse = self.sparse
        return sparse if SPARSE_COSTS * sparse.multiplications < banded.multiplications else banded

    @cached_property
    def sparse(self) -> SparseLayout:
        """Return where the blocks lie in sparse columns, whatever is faster."""
        return SparseLayout.of(self.first, self.second, len(self.to_own), self.dof)

    def factor(self, gram: Array, room: Array | None = None) -> Factor:
        """Return the Cholesky factor of YᵀY + BᵀDB from the H_p of `gram`. Raises NotPositiveDefinite."""
        return self.layout.factor(self.own_gram, gram, room)


def _shift(x: Array) -> Array:
    """Return (F, dof, dof) Y with [velocity at x; ω] = Y [velocity at the common point; ω]; ω scaled by L, x over L."""
    count, d = x.shape
    dof = 3 if d == 2 else 6
    y = np.tile(np.eye(dof), (count, 1, 1))
    if d == 2:
        y[:, 0, 2], y[:, 1, 2] = -x[:, 1], x[:, 0]
    else:
        y[:, 0, 4], y[:, 0, 5] = x[:, 2], -x[:, 1]
        y[:, 1, 3], y[:, 1, 5] = -x[:, 2], x[:, 0]
        y[:, 2, 3], y[:, 2, 4] = x[:, 1], -x[:, 0]
    return y
