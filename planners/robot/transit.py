"""A way for the arm from one configuration to another past everything: straight if possible, else OMPL's RRT-Connect.

OMPL checks edges at a resolution relative to the extent of the space, and accepts colliding ones at its default; here
it is given in radians. Its time limits would make the result depend on the machine: a budget of collision checks ends
the search instead, and the same seed gives the same way.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.tolerances import ROUNDING

EDGE_STEP_RAD = 0.007
"""Largest turn of a joint between two checks of an edge: 7 mm for a part one metre from the axis."""
SEARCH_STEP_RAD = 0.02
"""The same in the search, Euclidean over all joints; what it finds is checked again at `EDGE_STEP_RAD`."""
MARGINS_RAD = (1.3, 3.0)
"""How far beyond the two ends, joint by joint, the search may go, and may go when that led nowhere."""
CHECKS = 4000
"""Collision checks after which each search gives up."""

Free = Callable[[Array], bool]


def edge_free(a: Array, b: Array, free: Free) -> bool:
    """Return whether the straight joint motion from `a` to `b` is free, coarse checks first."""
    count = int(np.ceil(np.abs(b - a).max() / EDGE_STEP_RAD))
    if count == 0:
        return free(b)
    # Bit-reversed order finds a collision sooner than going along.
    order = sorted(range(1, count + 1), key=lambda k: int(f"{k:016b}"[::-1], 2))
    return all(free(a + (k / count) * (b - a)) for k in order)


def connect(start: Array, goal: Array, free: Free, limit: Array, seed: int, checks: int = CHECKS) -> list[Array] | None:
    """Return corners of a free path from `start` to `goal` in joint space, or None when two searches of
    `checks` collision checks found none.

    `limit` (6,) is the largest |q|; `seed` decides the samples. InputError when OMPL is not installed.
    """
    if not free(start) or not free(goal):
        return None
    if edge_free(start, goal, free):
        return [start, goal]
    for attempt, margin in enumerate(MARGINS_RAD):
        low = np.maximum(np.minimum(start, goal) - margin, -limit)
        high = np.minimum(np.maximum(start, goal) + margin, limit)
        found = _search(start, goal, free, (low, high), seed + attempt, checks)
        if found is not None:
            corners = shortened(found, free)
            if all(edge_free(a, b, free) for a, b in itertools.pairwise(corners)):
                return corners
    return None


def _search(
    start: Array, goal: Array, free: Free, box: tuple[Array, Array], seed: int, checks: int
) -> list[Array] | None:
    base, geometric, util = _ompl()
    util.noOutputHandler()  # it reports to the terminal that the seed of earlier searches is being replaced
    util.RNG.setSeed(seed % 2**31 + 1)
    space = base.RealVectorStateSpace(6)
    bounds = base.RealVectorBounds(6)
    for j in range(6):
        bounds.setLow(j, float(box[0][j]) - ROUNDING)
        bounds.setHigh(j, float(box[1][j]) + ROUNDING)
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    used = 0

    def valid(state: Any) -> bool:
        nonlocal used
        used += 1
        return bool(free(np.array([state[j] for j in range(6)])))

    setup.setStateValidityChecker(valid)
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(SEARCH_STEP_RAD / space.getMaximumExtent())
    planner = geometric.RRTConnect(information)
    planner.setRange(0.8)
    setup.setPlanner(planner)
    ends = space.allocState(), space.allocState()
    for state, values in zip(ends, (start, goal), strict=True):
        for j in range(6):
            state[j] = float(values[j])
    setup.setStartAndGoalStates(*ends)
    setup.solve(base.PlannerTerminationCondition(lambda: used > checks))
    if not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath()
    corners = [np.array([path.getState(k)[j] for j in range(6)]) for k in range(path.getStateCount())]
    return [start, *corners[1:-1], goal]


def shortened(path: list[Array], free: Free) -> list[Array]:
    """Return a path in which no corner can be left out: from each the farthest that is reached straight is next."""
    out, at = [path[0]], 0
    while at < len(path) - 1:
        ahead = next((k for k in range(len(path) - 1, at + 1, -1) if edge_free(path[at], path[k], free)), at + 1)
        out.append(path[ahead])
        at = ahead
    return out


def _ompl() -> tuple[Any, Any, Any]:
    try:
        from ompl import base, geometric, util
    except ImportError as error:
        raise InputError(
            f"Ways between tray and structure are searched with OMPL, which is not installed ({error}): "
            "pip install 'ompl>=2.0,<3' (it has wheels for CPython 3.11 to 3.13 on Linux and macOS)."
        ) from error
    return base, geometric, util
