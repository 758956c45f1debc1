"""One measurement: a tool on a case, in a process of its own, with a time limit."""

from __future__ import annotations

import json
import multiprocessing
import resource
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection

import numpy as np


@dataclass(frozen=True)
class Outcome:
    """What a tool answered: a verdict, and the relative KKT residual computed outside it (nan: not applicable)."""

    verdict: str
    kkt: float = float("nan")


@dataclass(frozen=True)
class Measurement:
    """One row of a benchmark: `seconds` is the median over `repeats` of one thread's CPU time."""

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
    bench: str, case: str, tool: str, run: Callable[[], Outcome], *, limit_s: float = 60.0, repeats: int = 5
) -> Measurement:
    """Return the measurement of `run`, repeated while it stays under a tenth of `limit_s` together.

    It runs in a forked process: memory is that process's peak, and one that exceeds `limit_s` is ended and comes
    back with the verdict 'timeout'. A tool that raises comes back as 'failed: …'.
    """
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_child, args=(sender, run, repeats, limit_s / 10), daemon=True)
    child.start()
    sender.close()
    answer: tuple[list[float], Outcome, float]
    if receiver.poll(limit_s):
        try:
            answer = receiver.recv()
        except EOFError:
            answer = ([], Outcome("failed: the process ended"), float("nan"))
    else:
        child.kill()
        answer = ([limit_s], Outcome("timeout"), float("nan"))
    child.join()
    times, outcome, memory = answer
    seconds = statistics.median(times) if times else float("nan")
    return Measurement(bench, case, tool, seconds, len(times), outcome.verdict, outcome.kkt, memory)


def _child(sender: Connection, run: Callable[[], Outcome], repeats: int, budget_s: float) -> None:
    times: list[float] = []
    outcome = Outcome("failed: never ran")
    try:
        while len(times) < repeats and (not times or sum(times) < budget_s):
            begin = time.process_time()
            outcome = run()
            times.append(time.process_time() - begin)
    except Exception as error:  # whatever a peer raises is its result
        outcome, times = Outcome(f"failed: {type(error).__name__}: {str(error)[:80]}"), []
    sender.send((times, outcome, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0))
    sender.close()
