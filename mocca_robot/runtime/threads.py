"""Tasks side by side on the machine's cores, and one thread for the linear algebra inside each.

Blocks of a task are too small to share, and waiting for one another burns time.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import scipy.linalg  # its BLAS is another than numpy's, and has to be there before the pools are counted
from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")


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


def on_all_cores(task: Callable[[T], None], items: Sequence[T]) -> None:
    """Run `task` on every item, in threads where there are several of both; raise the first error."""
    threads = min(os.cpu_count() or 1, len(items))
    if threads > 1:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(task, items))
    else:
        for item in items:
            task(item)
