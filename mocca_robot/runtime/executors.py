"""Where independent work runs: here, on the processes of this machine, or on a Dask cluster; the answers are the same.

Whatever takes an `Executor` here takes any object with the interface of `concurrent.futures.Executor`. Tasks are
functions of a module with arguments that can be pickled, and name every random seed, so that no result depends on
where or in which order it was computed.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, ParamSpec, TypeVar

from mocca_robot.errors import EnvironmentNeeded, MoccaError

P = ParamSpec("P")
T = TypeVar("T")
Item = TypeVar("Item")

ATTEMPTS = 2
"""How often a task runs whose process dies under it, before it counts as the cause."""
ORPHAN_WATCH_S = 1.0
"""How often a process looks whether the one that started it is still there."""
CONNECT_S = 10.0
"""Seconds to wait for a scheduler to answer."""


class WorkerLost(MoccaError):
    """The process that worked on a task has died, every time; out of memory is the usual reason."""


class LocalProcesses(Executor):
    """An executor over `jobs` processes of this machine, in which a process that dies costs only its own task.

    That task is tried once more in a fresh process and then ends with `WorkerLost`; a plain process pool would
    break, with all its tasks. Processes start when they are first needed, do not hear Ctrl-C themselves, and end with
    the process that they work for.
    """

    def __init__(self, jobs: int) -> None:
        self._threads = ThreadPoolExecutor(jobs, thread_name_prefix="process")
        self._here = threading.local()
        self._pools: set[ProcessPoolExecutor] = set()
        self._closing = False

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Return the future of `fn(*args, **kwargs)` in one of the processes."""
        return self._threads.submit(self._attempt, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Close; without `wait` running tasks are abandoned and their processes ended at once."""
        self._closing = not wait
        if not wait:
            for pool in list(self._pools):
                _end(pool)
        self._threads.shutdown(wait=True, cancel_futures=cancel_futures or not wait)
        for pool in list(self._pools):
            pool.shutdown()
        self._pools.clear()

    def _attempt(self, fn: Callable[..., T], args: tuple[Any, ...], kwargs: dict[str, Any]) -> T:
        for _ in range(ATTEMPTS):
            if self._closing:
                raise CancelledError
            pool: ProcessPoolExecutor | None = getattr(self._here, "pool", None)
            if pool is None:
                pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _begin)
                self._here.pool = pool
                self._pools.add(pool)
            try:
                return pool.submit(fn, *args, **kwargs).result()
            except BrokenProcessPool:
                pool.shutdown()  # the system forgets a process that ended only when somebody asks how
                self._pools.discard(pool)
                self._here.pool = None
        raise WorkerLost(
            f"The process that worked on this died {ATTEMPTS} times. Out of memory is the usual reason: "
            "use fewer jobs, or a smaller problem."
        )


def _begin() -> None:
    """Leave Ctrl-C to the process that asked for this one, and end with it, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True, name="orphan watch").start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(ORPHAN_WATCH_S)
    os._exit(1)


def _end(pool: ProcessPoolExecutor) -> None:
    for process in list((getattr(pool, "_processes", None) or {}).values()):
        process.terminate()


@contextmanager
def executor(jobs: int | None = None, scheduler: str | None = None) -> Iterator[Executor]:
    """Yield an executor: `jobs` local processes (default: one per core), or the Dask cluster behind `scheduler`.

    `scheduler` is the address of a running one, such as 'tcp://10.0.0.5:8786'; its workers need this version of
    mocca-robot installed. On the way out, running tasks are finished; after an error or Ctrl-C they are dropped.

    Raises EnvironmentNeeded when Dask is not installed or the scheduler does not answer.
    """
    found = LocalProcesses(jobs or os.cpu_count() or 1) if scheduler is None else _dask(scheduler)
    try:
        yield found
    except BaseException:
        found.shutdown(wait=False)
        raise
    else:
        found.shutdown(wait=True)
    finally:
        client = getattr(found, "_client", None)
        if client is not None:
            client.close()


def _dask(address: str) -> Executor:
    try:
        from distributed import Client
    except ImportError:
        raise EnvironmentNeeded(
            "A scheduler needs the package 'distributed'; install it with: pip install 'mocca-robot[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise EnvironmentNeeded(
            f"No scheduler answers at '{address}' ({type(error).__name__}); start one with `dask scheduler` and give "
            "the address it prints, such as tcp://10.0.0.5:8786."
        ) from None
    # Pure tasks would share results between runs; a task whose worker dies goes to another one by itself.
    found: Executor = client.get_executor(pure=False)
    return found


def completed(
    pool: Executor, function: Callable[[Item], T], items: Iterable[Item], in_flight: int | None = None
) -> Iterator[tuple[int, T | Exception]]:
    """Yield (index, result or the error it ended with) of `function(item)` for every item, as they are finished.

    At most `in_flight` items (default: four per core here, at least 16) are handed out at a time; `items` may be a
    generator. Closing the iterator early, or Ctrl-C, withdraws what has not begun.
    """
    limit = in_flight or max(4 * (os.cpu_count() or 1), 16)
    queue = iter(enumerate(items))
    under_way: dict[Future[T], int] = {}
    try:
        while True:
            while len(under_way) < limit and (entry := next(queue, None)) is not None:
                under_way[pool.submit(function, entry[1])] = entry[0]
            if not under_way:
                return
            for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                index = under_way.pop(future)
                error = future.exception()
                if error is not None and not isinstance(error, Exception):
                    raise error
                yield index, future.result() if error is None else error
    finally:
        for future in under_way:
            future.cancel()


def mapped(pool: Executor | None, function: Callable[[Item], T], items: Iterable[Item]) -> list[T]:
    """Return `function(item)` for every item, in order; computed here when there is no executor.

    The first error is raised, as without an executor.
    """
    if pool is None:
        return [function(item) for item in items]
    results: dict[int, T] = {}
    for index, result in completed(pool, function, items):
        if isinstance(result, Exception):
            raise result
        results[index] = result
    return [results[k] for k in range(len(results))]


__all__ = ["LocalProcesses", "WorkerLost", "completed", "executor", "mapped"]
