"""What a way costs the arm besides its time: the elbow's flips, turns of a joint, and hoses wound about the wrist."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import Array
from planners.robot.cell import RobotCell

WOUND_RAD = np.pi
"""A joint that is turned farther than this from where it is at home winds hoses and cables about the arm."""
LONG_RAD = np.deg2rad(270.0)
"""A joint that turns farther in one transit makes it a long one: another way is looked for."""


def flips(a: Array, b: Array) -> bool:
    """Return whether the elbow is on another side at joint angles `b` (6,) than at `a`: between, the arm stretches."""
    return bool(a[2] * b[2] < 0.0)


def effort(cell: RobotCell, q: Array, near: Array) -> float:
    """Return the largest turn of a joint from `near` (6,) to `q`, and how far `q` is wound, radians."""
    return float(np.abs(q - near).max() + wound(cell, q))


def wound(cell: RobotCell, q: Array) -> float:
    """Return how much farther than half a turn from home the joints `q` (6,) are, all together, radians."""
    return float(np.maximum(np.abs(q - cell.home) - WOUND_RAD, 0.0).sum())


def strain(cell: RobotCell, ways: Sequence[Sequence[Array]]) -> tuple[int, float]:
    """Return what is wrong with ways, each as legs (n, 6): flips and long turns, and then the length: the sum over all
    pieces of the largest turn of a joint, with how far the ends are wound, radians. Less is better.
    """
    bad, length = 0, 0.0
    for legs in ways:
        q = np.concatenate(list(legs))
        steps = np.abs(np.diff(q, axis=0))
        bad += int((q[:-1, 2] * q[1:, 2] < 0.0).sum()) + int(steps.sum(axis=0).max() > LONG_RAD)
        length += float(steps.max(axis=1).sum()) + wound(cell, q[-1])
    return bad, length
