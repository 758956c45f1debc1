"""A way for the arm from one configuration to another past everything: straight if possible, else two random trees.

RRT-Connect in joint space with edges checked every `EDGE_STEP_RAD`, then shortened; the same random generator gives the
same way.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mocca_robot.assembly import Array

EDGE_STEP_RAD = 0.007
"""Largest turn of a joint between two checks of an edge: 7 mm for a part one metre from the axis."""
GROW_RAD = 0.35
MARGIN_RAD = 1.3
"""How far beyond the two ends, joint by joint, the trees may grow."""

Free = Callable[[Array], bool]


def edge_free(a: Array, b: Array, free: Free) -> bool:
    """Return whether the straight joint motion from `a` to `b` is free, coarse checks first."""
    count = int(np.ceil(np.abs(b - a).max() / EDGE_STEP_RAD))
    if count == 0:
        return free(b)
    # Bit-reversed order finds a collision sooner than going along.
    order = sorted(range(1, count + 1), key=lambda k: int(f"{k:016b}"[::-1], 2))
    return all(free(a + (k / count) * (b - a)) for k in order)


def connect(
    start: Array, goal: Array, free: Free, limit: Array, rng: np.random.Generator, tries: int = 300
) -> list[Array] | None:
    """Return corners of a free path from `start` to `goal` in joint space, or None after `tries` samples.

    `limit` (6,) is the largest |q|.
    """
    if not free(start) or not free(goal):
        return None
    if edge_free(start, goal, free):
        return [start, goal]
    low = np.maximum(np.minimum(start, goal) - MARGIN_RAD, -limit)
    high = np.minimum(np.maximum(start, goal) + MARGIN_RAD, limit)
    trees: list[tuple[list[Array], list[int]]] = [([start], [-1]), ([goal], [-1])]
    a, b = 0, 1
    for _ in range(tries):
        sample = rng.uniform(low, high)
        grown = _grow(trees[a], sample, free)
        if grown is not None:
            target = trees[a][0][grown]
            while True:
                met = _grow(trees[b], target, free)
                if met is None:
                    break
                if np.array_equal(trees[b][0][met], target):
                    first, second = _branch(trees[a], grown), _branch(trees[b], met)
                    path = first[::-1] + second[1:] if a == 0 else second[::-1] + first[1:]
                    return shortened(path, free, rng)
        a, b = b, a
    return None


def _grow(tree: tuple[list[Array], list[int]], target: Array, free: Free) -> int | None:
    nodes, parents = tree
    distance = np.abs(np.array(nodes) - target).max(axis=1)
    near = int(np.argmin(distance))
    if distance[near] == 0.0:
        return near
    share = min(1.0, GROW_RAD / float(distance[near]))
    new = target if share == 1.0 else nodes[near] + share * (target - nodes[near])
    if not edge_free(nodes[near], new, free):
        return None
    nodes.append(new)
    parents.append(near)
    return len(nodes) - 1


def _branch(tree: tuple[list[Array], list[int]], node: int) -> list[Array]:
    nodes, parents = tree
    out = []
    while node >= 0:
        out.append(nodes[node])
        node = parents[node]
    return out


def shortened(path: list[Array], free: Free, rng: np.random.Generator, tries: int = 60) -> list[Array]:
    """Return a path with corners left out, and cut, where the way straight across is free."""
    for _ in range(tries):
        if len(path) <= 2:
            break
        i, j = sorted(rng.choice(len(path), size=2, replace=False).tolist())
        if j - i > 1 and edge_free(path[i], path[j], free):
            path = path[: i + 1] + path[j:]
            continue
        k = int(rng.integers(1, len(path) - 1))
        cut = 0.5 * (path[k - 1] + path[k]), 0.5 * (path[k] + path[k + 1])
        if edge_free(cut[0], cut[1], free):
            path = [*path[:k], *cut, *path[k + 1 :]] if len(path) < 6 else path
    return path
