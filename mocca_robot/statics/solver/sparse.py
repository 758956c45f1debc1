"""Sparse Cholesky of the normal equations, for structures whose band is wide: large domes and shells.

A dome of N parts has a band of √N parts, and its factor in the order of minimum degree has N log N blocks: with 2,000
parts a seventh of the multiplications, in runs so short that they take half the time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from mocca_robot.arrays import Array, IntArray
from mocca_robot.statics.solver import sparse_kernels
from mocca_robot.statics.solver.banded import adjacency
from mocca_robot.statics.solver.factors import require_positive


@dataclass(frozen=True, eq=False, kw_only=True)
class SparseLayout:
    """Order of the free parts by minimum degree, and which blocks the factor has; see `sparse_kernels`.

    Attributes:
        first, second: (P,) as in `PairBlocks`.
        place: (F,) of every free part in that order.
        starts, rows: (F + 1,), (blocks,) of the columns of blocks.
        below: (P,) which block of its column a pair's is.
        dof: 3 or 6.
    """

    first: IntArray
    second: IntArray
    place: IntArray
    starts: IntArray
    rows: IntArray
    below: IntArray
    dof: int

    @classmethod
    def of(cls, first: IntArray, second: IntArray, n_free: int, dof: int) -> SparseLayout:
        """Return the order of `n_free` parts with pairs of neighbours (P,), (P,); other numbers stand for ground."""
        inner = (first < n_free) & (second < n_free)
        i, j = first[inner], second[inner]
        place = minimum_degree(i, j, n_free)
        low, high = np.minimum(place[i], place[j]), np.maximum(place[i], place[j])
        columns = _filled_in(low, high, n_free)
        starts = np.cumsum([0, *map(len, columns)])
        below = np.zeros(len(first), dtype=np.int64)
        below[inner] = [int(np.searchsorted(columns[c], r)) for c, r in zip(low, high, strict=True)]
        return cls(
            first=first, second=second, place=place, starts=starts, rows=np.concatenate(columns), below=below, dof=dof
        )

    @property
    def multiplications(self) -> float:
        """Return about how many a factorization takes."""
        return float((np.diff(self.starts) ** 2.0).sum()) * self.dof**3

    def room(self) -> Array:
        """Return memory for a factor."""
        return np.empty(self.dof**2 * len(self.rows))

    def factor(self, diagonal: Array, gram: Array, room: Array | None = None) -> SparseFactor:
        """Return the factor; see `factors.Layout`."""
        values = self.room() if room is None else room
        sparse_kernels.assemble(diagonal, gram, self.first, self.second, self.place, self.starts, self.below, values)
        pivot = sparse_kernels.factorize(self.starts, self.rows, self.dof, values)
        require_positive(pivot, self.dof * len(self.place))
        return SparseFactor(self, values)


@dataclass(frozen=True, eq=False)
class SparseFactor:
    """A Cholesky factor: its numbers as `sparse_kernels.factorize` leaves them."""

    layout: SparseLayout
    values: Array

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side (n,)."""
        out = np.empty(len(right))
        it = self.layout
        sparse_kernels.substitute(it.starts, it.rows, it.dof, self.values, it.place, np.ascontiguousarray(right), out)
        return out


def minimum_degree(i: IntArray, j: IntArray, count: int) -> IntArray:
    """Return (count,) the place of every part in the order that SuperLU takes for a symmetric matrix of its graph."""
    links = adjacency(i, j, count)
    laplacian = sp.csc_array(sp.diags_array(1.0 + links.sum(axis=0)) - links)
    mode = {"SymmetricMode": True}
    found = splu(laplacian, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=mode)
    return np.asarray(found.perm_c, dtype=np.int64)


def _filled_in(low: IntArray, high: IntArray, count: int) -> list[IntArray]:
    """Return for every column the rows of its blocks, from the diagonal down, in the factor.

    A column has what its own links and those columns reach whose first block below the diagonal is in its row.
    """
    reached: list[set[int]] = [set() for _ in range(count)]
    for column, row in zip(low.tolist(), high.tolist(), strict=True):
        reached[column].add(row)
    columns = []
    for column, rows in enumerate(reached):
        below = sorted(rows)
        columns.append(np.array([column, *below], dtype=np.int64))
        if below:
            reached[below[0]].update(below[1:])
    return columns
