"""A way for the arm from one configuration to another past everything: straight if possible, else OMPL's RRT-Connect.

OMPL checks edges at a resolution relative to the extent of the space, and accepts colliding ones at its default; here
it is given in radians. Its time limits would make the result depend on the machine: a budget of collision checks ends
the search instead, and the same seed gives the same way.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.tolerances import EXACT, ROUNDING

EDGE_STEP_RAD = 0.007
"""Largest turn of a joint between two checks of an edge: 7 mm for a part one metre from the axis."""
SEARCH_STEP_RAD = 0.02
"""The same in the search, Euclidean over all joints; what it finds is checked again at `EDGE_STEP_RAD`."""
MARGINS_RAD = (1.3, 3.0)
"""How far beyond the two ends, joint by joint, the search may go, and may go when that led nowhere."""
CHECKS = 4000
"""Collision checks after which each search gives up."""

ARCS_RAD = (0.8, 0.5, 0.3, 0.2, 0.1, 0.05)
"""How far before a corner its curve may begin, widest first."""
KNOT_RAD = 0.05
"""Distance of the places that a smooth way is drawn through."""

Free = Callable[[Array], bool]


def edge_free(a: Array, b: Array, free: Free) -> bool:
    """Return whether the straight joint motion from `a` to `b` is free, coarse checks first."""
    count = int(np.ceil(np.abs(b - a).max() / EDGE_STEP_RAD))
    if count == 0:
        return free(b)
    # Bit-reversed order finds a collision sooner than going along.
    order = sorted(range(1, count + 1), key=lambda k: int(f"{k:016b}"[::-1], 2))
    return all(free(a + (k / count) * (b - a)) for k in order)


def way(start: Array, goal: Array, free: Free, limit: Array, seed: int) -> list[Array] | None:
    """Return a free way as smooth legs (n, 6), see `rounded`; None when none was found. Arguments as of `connect`."""
    corners = connect(start, goal, free, limit, seed)
    return None if corners is None else rounded(corners, free)


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


def rounded(corners: Sequence[Array], free: Free) -> list[Array]:
    """Return the way through `corners` as smooth legs of joint angles (n, 6), at most `KNOT_RAD` apart; the arm stops
    between them.

    A corner is cut by a curve inside the triangle of its two sides, without a jump in curvature, as wide as is free;
    where not even the narrowest is, the arm stops there.
    """
    legs: list[list[Array]] = [[corners[0]]]
    for before, corner, after in zip(corners, corners[1:], corners[2:]):
        arc = _arc(before, corner, after, free)
        if arc is None:
            legs[-1].extend(_straight(legs[-1][-1], corner))
            legs.append([corner])
        else:
            legs[-1].extend([*_straight(legs[-1][-1], arc[0]), *arc[1:]])
    legs[-1].extend(_straight(legs[-1][-1], corners[-1]))
    return [np.array(leg) for leg in legs]


def _arc(before: Array, corner: Array, after: Array, free: Free) -> list[Array] | None:
    sides = corner - before, after - corner
    longest = 0.5 * min(float(np.linalg.norm(s)) for s in sides)
    into, out = (s / max(float(np.linalg.norm(s)), EXACT) for s in sides)
    for reach in dict.fromkeys(min(r, longest) for r in ARCS_RAD):
        ends = [corner - reach * into, corner - 0.5 * reach * into, corner, corner + 0.5 * reach * out]
        bend = bezier(np.array([*ends, corner + reach * out]), max(8, int(np.ceil(2.0 * reach / KNOT_RAD))))
        if all(edge_free(a, b, free) for a, b in itertools.pairwise(bend)):
            return bend
    return None


def bezier(control: Array, count: int) -> list[Array]:
    """Return `count` + 1 points of the Bézier curve with five control points (5, k)."""
    u = np.linspace(0.0, 1.0, count + 1)[:, None]
    weights = (1, 4, 6, 4, 1)
    return list(sum(w * (1 - u) ** (4 - k) * u**k * p for k, (w, p) in enumerate(zip(weights, control, strict=True))))


def _straight(start: Array, goal: Array) -> list[Array]:
    """Return points after `start` up to `goal`, evenly spaced; none when it is there already."""
    far = float(np.linalg.norm(goal - start))
    count = int(np.ceil(far / KNOT_RAD))
    return [start + k / count * (goal - start) for k in range(1, count + 1)] if far > ROUNDING else []


def _ompl() -> tuple[Any, Any, Any]:
    try:
        from ompl import base, geometric, util
    except ImportError as error:
        raise InputError(
            f"Ways between tray and structure are searched with OMPL, which is not installed ({error}): "
            "pip install 'ompl>=2.0,<3' (it has wheels for CPython 3.11 to 3.13 on Linux and macOS)."
        ) from error
    return base, geometric, util
