"""One thread for the linear algebra inside a task: its blocks are too small to share, and waiting burns time."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import scipy.linalg  # its BLAS is another than numpy's, and has to be there before the pools are counted
from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")


@cache
def _pools() -> ThreadpoolController:
    scipy.linalg.get_blas_funcs("gemm")
    return ThreadpoolController()


def with_one_blas_thread(task: Callable[P, R]) -> Callable[P, R]:
    """Return `task` running with one BLAS thread; what was set before is set again afterwards."""

    @wraps(task)
    def alone(*args: P.args, **kwargs: P.kwargs) -> R:
        with _pools().limit(limits=1, user_api="blas"):
            return task(*args, **kwargs)

    return alone
