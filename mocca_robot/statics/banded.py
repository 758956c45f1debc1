"""Banded Cholesky of the normal equations: where the pairs' blocks lie, and the factor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack
from scipy.sparse.csgraph import reverse_cuthill_mckee

from mocca_robot.assembly import Array, IntArray
from mocca_robot.errors import MoccaError

if TYPE_CHECKING:
    from mocca_robot.statics.blocks import PairBlocks


class NotPositiveDefinite(MoccaError):
    """Rounding has made a normal matrix indefinite."""


@dataclass(frozen=True, eq=False)
class BandedLayout:
    """Order of the free parts that keeps neighbours close (reverse Cuthill–McKee), and the places of all blocks.

    Attributes:
        position: (n,) place of every unknown in that order.
        width: number of subdiagonals.
        diagonal: (F, dof²) flat places of the diagonal blocks' entries in LAPACK's lower banded storage; an
            entry above the diagonal goes to a spare place behind the matrix.
        between: (Q, dof²) the same for the blocks between two free parts, `pairs` (Q,) in number.
        share: (F, P) which pairs touch which free part.
    """

    position: IntArray
    width: int
    diagonal: IntArray
    between: IntArray
    pairs: IntArray
    share: sp.csr_array

    @classmethod
    def of(cls, blocks: PairBlocks) -> BandedLayout:
        n_free, dof = len(blocks.to_own), blocks.dof
        inner = np.flatnonzero((blocks.first < n_free) & (blocks.second < n_free))
        i, j = blocks.first[inner], blocks.second[inner]
        graph = sp.csr_array((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), shape=(n_free, n_free))
        candidates = (np.asarray(reverse_cuthill_mckee(graph, symmetric_mode=True)), np.arange(n_free))
        places = [np.argsort(order) for order in candidates]
        place = min(places, key=lambda p: int(np.abs(p[i] - p[j]).max(initial=0)))
        width = (int(np.abs(place[i] - place[j]).max(initial=0)) + 1) * dof - 1
        spare = (width + 1) * n_free * dof
        local = np.arange(dof)

        def flat(row: IntArray, column: IntArray) -> IntArray:
            r = place[row][:, None, None] * dof + local[:, None]
            c = place[column][:, None, None] * dof + local
            return np.where(r >= c, (r - c) + c * (width + 1), spare).reshape(len(row), dof * dof)

        low, high = np.where(place[i] > place[j], i, j), np.where(place[i] > place[j], j, i)
        position = (place[:, None] * dof + local).ravel()
        share = sp.csr_array(abs(blocks.incidence))
        return cls(position, width, flat(np.arange(n_free), np.arange(n_free)), flat(low, high), inner, share)

    def factor(self, mass: Array, gram: Array) -> Factor:
        """Return the Cholesky factor of the matrix with +H_p on, and −H_p off the diagonal, plus `mass`."""
        n, dof = len(self.position), mass.shape[1]
        storage = np.zeros((self.width + 1) * n + 1)
        on = self.share @ gram.reshape(len(gram), -1) + mass.reshape(len(mass), -1)
        storage[self.diagonal] = on
        storage[self.between] = -gram[self.pairs].reshape(-1, dof * dof)
        banded = storage[:-1].reshape(n, self.width + 1).T  # Fortran order, as LAPACK wants it
        cholesky, info = lapack.dpbtrf(banded, lower=1, overwrite_ab=1)
        if info != 0:
            raise NotPositiveDefinite(f"The normal matrix of size {n} is not positive definite at pivot {info}.")
        return Factor(cholesky, self.position)


@dataclass(frozen=True, eq=False)
class Factor:
    """A banded Cholesky factor with the order of its unknowns."""

    cholesky: Array
    position: IntArray

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side (n,)."""
        ordered = np.empty((len(right), 1), order="F")
        ordered[self.position, 0] = right
        solution, _ = lapack.dpbtrs(self.cholesky, ordered, lower=1, overwrite_b=1)
        return np.asarray(solution[self.position, 0])
