"""All points of a study on an executor: finished ones are kept at once, and are not computed a second time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

from mocca_robot.config.config import Config
from mocca_robot.errors import MoccaError
from mocca_robot.runtime.content_hash import assembly_hash, content_hash
from mocca_robot.runtime.executors import WorkerLost, completed
from sim.studies.point import FAILED, UNUSABLE, Row, Task, evaluate
from sim.studies.study import Point, Study
from sim.trial_store import TrialStore

METHOD = 1
"""Raise it when a row means something else than before: rows kept from then are computed again."""


@dataclass(frozen=True)
class StudyResult:
    """What a study found.

    Attributes:
        study: what was asked.
        rows: one per point, in the study's order; None for points that an interruption left undone.
        kept: how many rows were there from an earlier run.
        interrupted: Ctrl-C came before all points were done.
    """

    study: Study
    rows: tuple[Row | None, ...]
    kept: int
    interrupted: bool

    @property
    def unfinished(self) -> tuple[Point, ...]:
        """Return the points that have no verdict: not computed, unusable or failed."""
        missing = (UNUSABLE, FAILED)
        return tuple(p for p, r in zip(self.study.points, self.rows) if r is None or r["status"] in missing)


def run_study(
    study: Study,
    pool: Executor,
    store: TrialStore | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> StudyResult:
    """Return a row per point, computed on `pool`, which is any executor.

    A point whose values cannot be used, that raises an error or whose worker dies is a row that says so. `store`
    keeps finished rows by the hash of all that decides them: assembly, goals, bounds, what is asked, the version of
    the programme. `progress` is called with (label, done, total). Ctrl-C ends the study early; see `StudyResult`.
    """
    store = TrialStore() if store is None else store
    points = study.points
    rows: list[Row | None] = [None] * len(points)
    keys: dict[int, str] = {}
    handed_out: list[int] = []
    total = len(points)

    def told(index: int, row: Row) -> None:
        rows[index] = row
        if progress is not None:
            progress(points[index].label, sum(r is not None for r in rows), total)

    def tasks() -> Iterator[Task]:
        """Yield what has to be computed; a point is read just before it is handed out, and may be known already."""
        for index, point in enumerate(points):
            try:
                config = study.config(point)
            except MoccaError as error:
                told(index, {"status": UNUSABLE, "reason": str(error), "seconds": 0.0})
                continue
            keys[index] = point_key(config, study.stages)
            if (known := store.get(keys[index])) is not None:
                kept.append(index)
                told(index, known)
                continue
            handed_out.append(index)
            yield Task(config, study.stages)

    kept: list[int] = []
    interrupted = False
    try:
        for place, result in completed(pool, evaluate, tasks()):
            index = handed_out[place]
            if isinstance(result, Exception):
                told(index, {"status": FAILED, "reason": _lost(result), "seconds": None})
                continue
            if result["status"] not in (UNUSABLE, FAILED):
                store.put(keys[index], result)
            told(index, result)
    except KeyboardInterrupt:
        interrupted = True
    return StudyResult(study, tuple(rows), len(kept), interrupted)


def point_key(config: Config, stages: tuple[str, ...]) -> str:
    """Return the hash of everything that decides a point's row."""
    assembly = config.assembly
    goals = [[type(g).__name__, asdict(g)] for g in assembly.goals]
    ways: Mapping[str, Any] = {name: config.insertion[name] for name in sorted(config.insertion)}
    asked = (config.friction, config.joints, config.simulate if set(stages) - {"design"} else None, stages)
    return content_hash(
        (METHOD, version("mocca-robot"), assembly_hash(assembly), goals, assembly.alpha_rad, ways, *asked)
    )


def _lost(error: Exception) -> str:
    if isinstance(error, WorkerLost):
        return str(error)
    return f"the worker did not return: {type(error).__name__}: {error}"
