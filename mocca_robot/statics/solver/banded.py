"""Banded Cholesky of the normal equations: where the pairs' blocks lie, and the factor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import reverse_cuthill_mckee

from mocca_robot.arrays import Array, IntArray
from mocca_robot.statics.solver import band_kernels
from mocca_robot.statics.solver.factors import require_positive


@dataclass(frozen=True, eq=False)
class BandedLayout:
    """Order of the free parts that keeps neighbours close: reverse Cuthill–McKee, its reverse, or as given.

    Attributes:
        first, second: (P,) as in `PairBlocks`.
        place: (F,) of every free part in that order.
        position: (n,) the same of every unknown.
        ends: (F,) behind which row the columns of the part at every place are empty, also in the factor.
    """

    first: IntArray
    second: IntArray
    place: IntArray
    position: IntArray
    ends: IntArray

    @classmethod
    def of(cls, first: IntArray, second: IntArray, n_free: int, dof: int) -> BandedLayout:
        """Return the order of `n_free` parts with pairs of neighbours (P,), (P,); other numbers stand for ground."""
        inner = (first < n_free) & (second < n_free)
        i, j = first[inner], second[inner]
        near, here = np.asarray(reverse_cuthill_mckee(adjacency(i, j, n_free), symmetric_mode=True)), np.arange(n_free)

        def ends(place: IntArray) -> IntArray:
            last = here.copy()
            np.maximum.at(last, np.minimum(place[i], place[j]), np.maximum(place[i], place[j]))
            return np.maximum.accumulate(last) + 1  # with what is filled in while columns are eliminated

        places = [np.argsort(order) for order in (near, near[::-1], here)]
        place = min(places, key=lambda p: int(((ends(p) - here) ** 2).sum()))
        position = (place[:, None] * dof + np.arange(dof)).ravel()
        return cls(first, second, place, position, ends(place) * dof)

    @property
    def width(self) -> int:
        """Return how many rows of the lower band the widest column has."""
        return int(self._rows.max(initial=1))

    @property
    def multiplications(self) -> float:
        """Return about how many a factorization takes."""
        return float((self._rows**2.0).sum()) * len(self.position) / max(len(self.ends), 1)

    @property
    def _rows(self) -> IntArray:
        """Return (F,) how many rows the first column of the part at every place has."""
        count = len(self.ends)
        return np.asarray(self.ends - len(self.position) // max(count, 1) * np.arange(count))

    def room(self) -> Array:
        """Return memory for a factor, (n, width): one column of the lower band a row."""
        return np.empty((len(self.position), self.width))

    def factor(self, diagonal: Array, gram: Array, room: Array | None = None) -> BandedFactor:
        """Return the factor; see `factors.Layout`."""
        band = self.room() if room is None else room
        band_kernels.assemble(diagonal, gram, self.first, self.second, self.place, band)
        require_positive(band_kernels.factorize(band, self.ends), len(self.position))
        return BandedFactor(band, self.ends, self.position)


def adjacency(i: IntArray, j: IntArray, count: int) -> sp.csr_array:
    """Return the adjacency of neighbours (P,), (P,), each pair of which is there once."""
    one, other = np.r_[i, j], np.r_[j, i]
    order = np.lexsort((other, one))
    starts = np.r_[0, np.cumsum(np.bincount(one, minlength=count))]
    return sp.csr_array((np.ones(len(order)), other[order], starts), shape=(count, count))


@dataclass(frozen=True, eq=False)
class BandedFactor:
    """A Cholesky factor: its band and ends as `band_kernels.factorize` has them, and the order of its unknowns."""

    band: Array
    ends: IntArray
    position: IntArray

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side (n,)."""
        out = np.empty(len(right))
        band_kernels.substitute(self.band, self.ends, self.position, np.ascontiguousarray(right), out)
        return out
