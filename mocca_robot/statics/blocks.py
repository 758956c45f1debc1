"""The structure of Eq. 7's normal equations: every ray acts on the relative motion of one pair of parts.

With all motions u measured about one common point, B u is R_p (u_j − u_i) pair by pair, and BᵀDB is made of the
small matrices H_p = R_pᵀ D R_p: +H_p on the diagonal blocks of i and j, −H_p between them, whatever the number of
rays. Only the objective ½|v|², v = Y u about each part's own reference point, keeps a trace of those points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from mocca_robot.assembly import Array, IntArray
from mocca_robot.statics.banded import BandedLayout, Factor
from mocca_robot.statics.system import ContactSystem

ROWS_AT_ONCE = 12_000
"""Rows of one bucket: with ten numbers a row they fit a megabyte."""


@dataclass(frozen=True, eq=False)
class Bucket:
    """Pairs that are stored with the same number m of rays.

    Attributes:
        pairs: (P,) numbers of the pairs.
        rays: (P, dof, m) their rays, transposed, about the common point.
        rows: where their P·m rows lie among all rows.
    """

    pairs: IntArray
    rays: Array
    rows: slice

    def times(self, relative: Array, out: Array) -> None:
        """Set `out` (P·m,) to every ray times the relative motion of its pair, one of (all pairs, dof)."""
        np.matmul(relative[self.pairs][:, None, :], self.rays, out=out.reshape(len(self.pairs), 1, -1))

    def wrenches(self, y: Array) -> Array:
        """Return (P, dof) the sum of every pair's rays times y (P·m,)."""
        return np.asarray((self.rays @ y.reshape(len(self.pairs), -1, 1))[..., 0])

    def gram(self, d: Array, room: Array | None = None) -> Array:
        """Return (P, dof, dof) R_pᵀ diag(d) R_p for weights d (P·m,); `room` (dof·P·m or more,) is overwritten."""
        weighted = None if room is None else room[: self.rays.size].reshape(self.rays.shape)
        weighted = np.multiply(self.rays, d.reshape(len(self.pairs), 1, -1), out=weighted)
        return np.asarray(weighted @ self.rays.transpose(0, 2, 1))


@dataclass(frozen=True, eq=False)
class PairBlocks:
    """Rays of a `ContactSystem` sorted by pair, for fast products with B, and the order of its banded Cholesky.

    Rows are rays, some of them repeated so that many pairs share a row count; `source` says which ray a row is.

    Attributes:
        dof: 3 or 6.
        first, second: (P,) which free part is i and j of every pair; the number of free parts stands for ground.
        buckets: the rays.
        source: (M,) ray of every row; rays between fixed parts have no row.
        n_rays: C.
        to_own: (F, dof, dof) Y: u of every free part → its motion about its own reference point.
    """

    dof: int
    first: IntArray
    second: IntArray
    buckets: tuple[Bucket, ...]
    source: IntArray
    n_rays: int
    to_own: Array

    @classmethod
    def of(cls, system: ContactSystem, together: int = 1) -> PairBlocks:
        """Return the blocks of `system`, motions about the mean reference point.

        `together` rays of a pair that follow each other stay together and are only repeated together.
        """
        n_parts = len(system.free)
        centre = system.about[system.free].mean(axis=0)
        number = np.full(n_parts, int(system.free.sum()))
        number[system.free] = np.arange(int(system.free.sum()))
        keys = system.pairs[:, 0] * n_parts + system.pairs[:, 1]
        order = np.arange(len(keys))
        if (np.diff(keys) < 0).any():
            order = np.argsort(keys, kind="stable")
        moved = np.asarray(system.free[system.pairs].any(axis=1))
        if not moved.all():
            order = order[moved[order]]
        keys = keys[order]
        new = np.flatnonzero(np.diff(keys, prepend=-1))
        first, second = number[keys[new] // n_parts], number[keys[new] % n_parts]
        offset = (system.about - centre)[system.pairs[order, 1]]
        rays = _about(system.rays_j[order], offset, system.length)
        counts = np.diff(np.r_[new, len(keys)])
        stored = _round_up(counts // together) * together
        buckets, sources, used = [], [], 0
        for mine in _groups(stored):
            m = int(stored[mine[0]])
            # A pair with fewer rays repeats some of them: a repeated constraint changes nothing.
            take = new[mine, None] + np.arange(m) % counts[mine, None]
            transposed = np.ascontiguousarray(rays[take].transpose(0, 2, 1))
            buckets.append(Bucket(mine, transposed, slice(used, used + take.size)))
            sources.append(order[take.ravel()])
            used += take.size
        source = np.concatenate(sources) if sources else np.zeros(0, dtype=np.int64)
        to_own = _shift(system.about[system.free] - centre, system.length)
        return cls(system.dof, first, second, tuple(buckets), source, len(system.pairs), to_own)

    @property
    def size(self) -> int:
        """Return the number of unknowns."""
        return len(self.to_own) * self.dof

    @cached_property
    def incidence(self) -> sp.csr_array:
        """Return (F, P): +1 where a free part is j of a pair, −1 where it is i."""
        pair = np.arange(len(self.first))
        n_free = len(self.to_own)
        rows, columns = np.r_[self.second, self.first], np.r_[pair, pair]
        signs = np.r_[np.ones(len(pair)), -np.ones(len(pair))]
        keep = rows < n_free
        return sp.csr_array((signs[keep], (rows[keep], columns[keep])), shape=(n_free, len(pair)))

    def relative(self, u: Array) -> Array:
        """Return (P, dof) the relative motion u_j − u_i of every pair, for motions u (n,) about the common point."""
        motions = np.zeros((len(self.to_own) + 1, self.dof))
        motions[:-1] = u.reshape(-1, self.dof)
        return np.asarray(motions[self.second] - motions[self.first])

    def times(self, u: Array) -> Array:
        """Return B u, (M,), for motions u (n,) about the common point."""
        out, relative = np.empty(len(self.source)), self.relative(u)
        for b in self.buckets:
            b.times(relative, out[b.rows])
        return out

    def transposed_times(self, y: Array) -> Array:
        """Return Bᵀ y, (n,), for one number y (M,) a row."""
        wrenches = np.empty((len(self.first), self.dof))
        for b in self.buckets:
            wrenches[b.pairs] = b.wrenches(y[b.rows])
        return self.gathered(wrenches)

    def gathered(self, wrenches: Array) -> Array:
        """Return (n,) the sum on every part of its pairs' wrenches (P, dof)."""
        return np.asarray((self.incidence @ wrenches).ravel())

    def forces(self, z: Array) -> Array:
        """Return (C,) the force along every ray of the system from multipliers z (M,) of the rows."""
        return np.asarray(np.bincount(self.source, weights=z, minlength=self.n_rays), dtype=np.float64)

    def gram(self, d: Array) -> Array:
        """Return (P, dof, dof) H_p = R_pᵀ diag(d) R_p for weights d (M,)."""
        out = np.empty((len(self.first), self.dof, self.dof))
        for b in self.buckets:
            out[b.pairs] = b.gram(d[b.rows])
        return out

    def own_transposed(self, w: Array) -> Array:
        """Return Yᵀ w, wrenches (n,) about the common point."""
        return np.asarray((self.to_own.transpose(0, 2, 1) @ w.reshape(-1, self.dof, 1)).ravel())

    def inertia_times(self, u: Array) -> Array:
        """Return YᵀY u, (n,)."""
        return np.asarray((self.mass @ u.reshape(-1, self.dof, 1)).ravel())

    @cached_property
    def mass(self) -> Array:
        """Return (F, dof, dof) YᵀY, the Hessian of ½|v|² in u."""
        return np.asarray(self.to_own.transpose(0, 2, 1) @ self.to_own)

    @cached_property
    def band(self) -> BandedLayout:
        """Return where the blocks lie in the banded normal matrix."""
        return BandedLayout.of(self)

    def factor(self, gram: Array) -> Factor:
        """Return the Cholesky factor of YᵀY + BᵀDB from the H_p of `gram`. Raises NotPositiveDefinite."""
        return self.band.factor(self.mass, gram)


def _round_up(counts: IntArray) -> IntArray:
    """Return counts rounded up to 1, 2, 3, 4, 6, 8, 12, 16, 24, …, or kept when all are the same."""
    if len(counts) and (counts == counts[0]).all():
        return counts
    sizes = np.unique([(2 + odd) << k for k in range(40) for odd in (0, 1)] + [1])
    return np.asarray(sizes[np.searchsorted(sizes, counts)])


def _groups(stored: IntArray) -> list[IntArray]:
    """Return the pairs of every row count, in groups of few enough rows for the processor's nearer caches."""
    groups = []
    for m in np.unique(stored):
        mine = np.flatnonzero(stored == m)
        groups += np.array_split(mine, max(1, -(-len(mine) * int(m) // ROWS_AT_ONCE)))
    return groups


def _about(rays: Array, offset: Array, length: float) -> Array:
    """Return rays [n; (r − a) × n / L] moved to a point that lies −offset from their a: r − a + offset."""
    d = offset.shape[1]
    n, x = rays[:, :d], offset / length
    moved = rays.copy()
    if d == 2:
        moved[:, 2] += x[:, 0] * n[:, 1] - x[:, 1] * n[:, 0]
    else:
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            moved[:, 3 + k] += x[:, i] * n[:, j] - x[:, j] * n[:, i]
    return moved


def _shift(offset: Array, length: float) -> Array:
    """Return (F, dof, dof) Y with [velocity at offset; ω] = Y [velocity at the common point; ω], ω scaled by L."""
    count, d = offset.shape
    dof = 3 if d == 2 else 6
    y = np.tile(np.eye(dof), (count, 1, 1))
    if d == 2:
        y[:, 0, 2], y[:, 1, 2] = -offset[:, 1] / length, offset[:, 0] / length
    else:
        x = offset / length
        y[:, 0, 4], y[:, 0, 5] = x[:, 2], -x[:, 1]
        y[:, 1, 3], y[:, 1, 5] = -x[:, 2], x[:, 0]
        y[:, 2, 3], y[:, 2, 4] = x[:, 1], -x[:, 0]
    return y
