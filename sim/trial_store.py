"""Trials in parallel, each finished one kept at once, so that an interrupted simulation resumes where it was."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from mocca_robot.runtime.content_hash import content_hash
from sim.motion import abandoned

GRACE_S = 0.8
"""After Ctrl-C, trials that have begun may take so long to finish; then they are abandoned. People wait for it."""
Row: TypeAlias = dict[str, Any]
"""A finished trial as plain JSON values."""


@dataclass(frozen=True)
class Trial:
    """Something to find out.

    Attributes:
        label: what progress shows.
        content: everything that decides the outcome, as plain values; its hash is the trial's name in the store.
        find_out: returns the row; runs in a thread, MuJoCo releases Python's lock. It can be pickled, for other
            processes and machines.
        takes_long: it begins before others, so that it does not end alone.
    """

    label: str
    content: tuple[Any, ...]
    find_out: Callable[[], Row]
    takes_long: bool = False


class TrialStore:
    """Rows by content hash in one file of JSON lines; without a path they are forgotten with the object.

    A line that was cut off while being written is skipped, so that its trial runs again.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._rows: dict[str, Row] = {}
        if path is not None and path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                try:
                    entry = json.loads(line)
                    self._rows[entry["key"]] = entry["row"]
                except (json.JSONDecodeError, KeyError, TypeError):
                    continue

    def __len__(self) -> int:
        return len(self._rows)

    def get(self, key: str) -> Row | None:
        """Return the row of an earlier run, or None."""
        return self._rows.get(key)

    def put(self, key: str, row: Row) -> None:
        """Keep a row, on disk before this returns."""
        self._rows[key] = row
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"key": key, "row": row}) + "\n")
                file.flush()


def run_trials(
    trials: Sequence[Trial],
    store: TrialStore,
    threads: int | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    executor: Executor | None = None,
) -> list[Row | None]:
    """Return one row per trial, in order; None for those that an interruption (Ctrl-C) left undone.

    Trials run on `executor`, which stays open unless Ctrl-C ends it; by default on `threads` threads, one per core.

    `progress` is called in this thread with (label, done, total). An error in one trial stops the rest and is
    raised; finished trials stay in the store.
    """
    keys = [content_hash(t.content) for t in trials]
    rows = [store.get(key) for key in keys]
    todo = sorted((k for k, row in enumerate(rows) if row is None), key=lambda k: not trials[k].takes_long)
    done = len(trials) - len(todo)
    workers = threads or os.cpu_count() or 1
    pool = ThreadPoolExecutor(max_workers=workers) if executor is None else executor
    abandoned.clear()
    queue, waiting = iter(todo), dict[Future[Row], int]()
    try:
        while True:
            while len(waiting) < 2 * workers and (k := next(queue, None)) is not None:
                waiting[pool.submit(trials[k].find_out)] = k
            if not waiting:
                break
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                k = waiting.pop(future)
                rows[k] = future.result()
                store.put(keys[k], rows[k] or {})
                done += 1
                if progress is not None:
                    progress(trials[k].label, done, len(trials))
    except KeyboardInterrupt:
        begun = [future for future in waiting if not future.cancel()]
        for future in wait(begun, timeout=GRACE_S).done:
            if future.exception() is None:
                rows[waiting[future]] = future.result()
                store.put(keys[waiting[future]], future.result())
        abandoned.set()  # heard by threads; processes are ended
        if executor is not None:
            executor.shutdown(wait=False, cancel_futures=True)
    finally:
        for future in waiting:
            future.cancel()
        if executor is None:
            pool.shutdown(wait=True, cancel_futures=True)
    return rows
