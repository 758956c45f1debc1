"""What factors of the normal matrix are: where its blocks lie, kept for many of them, and the solution of one."""

from __future__ import annotations

from typing import Protocol

from mocca_robot.arrays import Array
from mocca_robot.errors import MoccaError


class NotPositiveDefinite(MoccaError):
    """Rounding has made a normal matrix indefinite."""


class Factor(Protocol):
    """A Cholesky factor."""

    def solve(self, right: Array) -> Array:
        """Return the solution for one right-hand side (n,)."""


class FactorLayout(Protocol):
    """An order of the unknowns, and which entries the factor then has."""

    def room(self) -> Array:
        """Return memory for a factor."""

    def factor(self, diagonal: Array, gram: Array, room: Array | None = None) -> Factor:
        """Return the Cholesky factor of the matrix with +H_p on, and −H_p off the diagonal, plus `diagonal` on it.

        In `room` it lasts until the next one there; memory taken anew costs a tenth of the time. Raises
        NotPositiveDefinite.
        """


def require_positive(pivot: int, size: int) -> None:
    """Raise NotPositiveDefinite where a factorization of `size` unknowns names a pivot, counted from 1."""
    if pivot != 0:
        raise NotPositiveDefinite(f"The normal matrix of size {size} is not positive definite at pivot {pivot}.")
