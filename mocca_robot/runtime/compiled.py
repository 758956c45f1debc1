"""Functions as machine code, by numba. It is kept on disk (`__pycache__`, or the user's cache folder): made once."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")

ORDER_IS_FREE = {"reassoc", "contract", "arcp", "nsz", "nnan"}
"""Sums may be taken in the order that suits the processor; numbers are finite."""


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Return `function` as machine code that lets other threads run; not kept where no folder can be written."""
    options = {"nogil": True, "fastmath": ORDER_IS_FREE}
    try:
        return cast(Callable[P, R], numba.njit(cache=True, **options)(function))
    except RuntimeError:  # no place to cache in: a read-only container without a home
        return cast(Callable[P, R], numba.njit(**options)(function))
