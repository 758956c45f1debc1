"""Where MuJoCo first sees an assembly fall along a line of tilts or of loads, beside a guess that statics makes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mocca_robot.verdicts.physics import Verdict
from sim.bracket import bracket
from sim.disagreement import cause
from sim.scene import Compiled
from sim.stability import LIMITS, StabilityLimits, StabilityReport, at_once, confirmed


@dataclass(frozen=True, kw_only=True)
class Search:
    """How a line is searched, in its own unit: radians, or shares of a load.

    Attributes:
        guess: where statics says that it falls.
        agreement: how far from there physics may fall.
        resolution: width at which the search ends.
        doubtful: the same where every fall is confirmed by the finest step, which takes seconds.
        end: nothing from there on is tried.
    """

    guess: float
    agreement: float
    resolution: float
    doubtful: float
    end: float = np.pi / 2


@dataclass(frozen=True, kw_only=True)
class LastStand:
    """Between which places of the line it stops standing.

    Attributes:
        low: the last that stood; both 0 where none does.
        high: the first that fell, or the line's end.
        moved: parts that moved there.
        failed: places whose runs gave no verdict; they count as not standing.
        cause: what experiments say where it falls too early for statics; else ''.
    """

    low: float
    high: float
    moved: tuple[str, ...]
    failed: tuple[float, ...]
    cause: str = ""


def critical(scene_at: Callable[[float], Compiled], search: Search, limits: StabilityLimits = LIMITS) -> LastStand:
    """Return where the scenes along a line stop standing, each from a fresh start.

    Falls are believed without finer steps first and only the first place that fell is confirmed; when finer steps
    hold it, the search goes on beyond it with every fall confirmed. A fall earlier than statics' by more than the two
    may differ has to survive all finer steps and the finest; where it does not, the search goes on with falls that do,
    from the first place that agrees, in steps of `search.doubtful`. What then disagrees is told with its cause.
    """
    guess, resolution, end = search.guess, search.resolution, search.end
    quick: dict[float, StabilityReport] = {}
    sure: dict[float, StabilityReport] = {}
    doubted: dict[float, StabilityReport] = {}

    def stands_at_once(place: float) -> bool:
        if place not in quick:
            quick[place] = at_once(scene_at(place), limits)
        return quick[place].stands

    def stands(place: float) -> bool:
        if not stands_at_once(place) and place not in sure:
            sure[place] = confirmed(scene_at(place), quick[place], limits)
        return sure.get(place, quick[place]).stands

    def stands_after_all(place: float) -> bool:
        if not stands_at_once(place) and place not in doubted:
            doubted[place] = sure[place] = confirmed(scene_at(place), quick[place], limits, doubted=True)
        return doubted.get(place, quick[place]).stands

    def early(place: float) -> bool:
        return guess - place > search.agreement - resolution

    low, high = bracket(stands_at_once, guess, resolution, end=end)
    if early(high) and stands_after_all(high):
        as_late_as_agrees = guess - search.agreement
        low, high = bracket(stands_after_all, as_late_as_agrees, max(resolution, search.doubtful), high, end)
    if not early(high) and high < end:
        if stands(high):
            low, high = bracket(stands, guess, resolution, high, end)
        elif high - low > resolution:
            low, high = bracket(stands, guess, resolution, low, end)
    why = ""
    if high < end and early(high) and sure[high].verdict is Verdict.FELL:
        why = cause(scene_at(high), sure[high])
    failed = tuple(a for a, found in sure.items() if found.verdict is Verdict.FAILED)
    return LastStand(low=low, high=high, moved=sure[high].moved if high in sure else (), failed=failed, cause=why)
