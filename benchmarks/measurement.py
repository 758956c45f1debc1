"""One measurement: a tool on a case, in a process of its own, with a time limit."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import statistics
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection

import numpy as np


@dataclass(frozen=True)
class ToolAnswer:
    """What a tool answered: a verdict, and the relative KKT residual computed outside it (nan: not applicable)."""

    verdict: str
    kkt: float = float("nan")


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """One row of a benchmark: `seconds` is the median over `repeats` of CPU time, or by the clock (`side_by_side`)."""

    bench: str
    case: str
    tool: str
    seconds: float
    repeats: int
    verdict: str
    kkt: float
    memory_mb: float

    def json(self) -> str:
        """Return the row as one line of JSON; numbers that do not exist are null."""
        row = {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in asdict(self).items()}
        return json.dumps(row)


def measure(
    bench: str,
    case: str,
    tool: str,
    run: Callable[[], ToolAnswer],
    *,
    limit_s: float = 60.0,
    repeats: int = 5,
    spawns: bool = False,
) -> Measurement:
    """Return the measurement of `run`; see `side_by_side`."""
    (row,) = side_by_side(bench, case, {tool: run}, limit_s=limit_s, repeats=repeats, spawns=spawns)
    return row


def side_by_side(
    bench: str,
    case: str,
    runs: Mapping[str, Callable[[], ToolAnswer]],
    *,
    limit_s: float = 60.0,
    repeats: int = 5,
    spawns: bool = False,
    threads: bool = False,
) -> list[Measurement]:
    """Return the measurements of several tools, which take turns: what slows the machine slows all of them.

    Each is repeated while its runs stay under a tenth of `limit_s` together. It runs in a forked process: memory is
    that process's peak, and one that exceeds `limit_s` is ended and comes back with the verdict 'timeout'. A tool that
    raises comes back as 'failed: …'.

    Time is that of the processor, which other programs on the machine disturb least; by the clock where a tool
    `spawns` processes or uses `threads`.
    """
    tools = {name: _Tool(run, spawns, by_clock=spawns or threads) for name, run in runs.items()}
    for _ in range(repeats):
        for tool in tools.values():
            if not tool.over and sum(tool.times) < limit_s / 10:
                tool.turn(limit_s)
    return [tool.ended(bench, case, name) for name, tool in tools.items()]


class _Tool:
    """A tool in its process, which waits for its turns."""

    def __init__(self, run: Callable[[], ToolAnswer], spawns: bool, by_clock: bool) -> None:
        context = multiprocessing.get_context("fork")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_child, args=(theirs, run, by_clock), daemon=not spawns)
        self._process.start()
        theirs.close()
        self.times: list[float] = []
        self.over = False
        self._outcome, self._memory = ToolAnswer("failed: never ran"), float("nan")

    def turn(self, limit_s: float) -> None:
        """Let it run once."""
        try:
            self._pipe.send(True)
            if self._pipe.poll(limit_s):
                seconds, self._outcome, self._memory = self._pipe.recv()
                self.times.append(seconds)
            else:
                self._process.kill()
                self.times, self._outcome, self.over = [limit_s], ToolAnswer("timeout"), True
        except (EOFError, BrokenPipeError):
            self.times, self._outcome, self.over = [], ToolAnswer("failed: the process ended"), True
        if self._outcome.verdict.startswith("failed"):
            self.times, self.over = [], True

    def ended(self, bench: str, case: str, name: str) -> Measurement:
        """Return its row, and end its process."""
        with contextlib.suppress(BrokenPipeError):
            self._pipe.send(False)
        self._process.join()
        self._pipe.close()
        seconds = statistics.median(self.times) if self.times else float("nan")
        found = self._outcome
        return Measurement(
            bench=bench,
            case=case,
            tool=name,
            seconds=seconds,
            repeats=len(self.times),
            verdict=found.verdict,
            kkt=found.kkt,
            memory_mb=self._memory,
        )


def peak_memory_mb() -> float:
    """Return the most memory that this process ever had, in MB; not a number where the system does not tell."""
    try:
        import resource
    except ModuleNotFoundError:  # Windows
        return float("nan")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # bytes on macOS, kilobytes elsewhere
    return peak / (2.0**20 if sys.platform == "darwin" else 1024.0)


def _child(pipe: Connection, run: Callable[[], ToolAnswer], by_clock: bool) -> None:
    clock = time.perf_counter if by_clock else time.process_time
    while pipe.recv():
        begin = clock()
        try:
            outcome = run()
        except Exception as error:  # whatever a peer raises is its result
            outcome = ToolAnswer(f"failed: {type(error).__name__}: {str(error)[:80]}")
        memory = peak_memory_mb()
        pipe.send((clock() - begin, outcome, memory))
