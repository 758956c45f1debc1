"""The fastest way along a given path within caps of speed and acceleration: reachability analysis on a grid.

After Pham and Pham, "A new approach to time-optimal path parameterization based on reachability analysis", IEEE
Transactions on Robotics 34 (2018): going back from the end, the largest speed from which the rest can still be driven;
then from the start as fast as that allows. `toppra` does the same for linear constraints; the tool's acceleration is a
norm, which is kept exactly here.
"""

from __future__ import annotations

import math

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.runtime.compiled import compiled

UNMOVED = 1e-9
"""Per unit of path: what moves less is at rest, and its acceleration has no cap to meet."""
HALVINGS = 48
"""Of the interval in which the largest speed lies."""


@compiled
def reachable_speeds(
    cap: Array, dq: Array, ddq: Array, joint_cap: float, dp: Array, ddp: Array, tool_cap: float, step: float
) -> Array:
    """Return the largest squared speeds ṡ² (n,) along a path, at rest at both ends.

    On an even grid of `step`: `cap` (n,) bounds ṡ²; `dq`, `ddq` (n, j) are derivatives of the joints and `dp`, `ddp`
    (n, 3) those of the tool's place by the path's parameter; every joint's acceleration stays within `joint_cap`, the
    length of the tool's within `tool_cap`.
    """
    n = len(cap)
    best = np.zeros(n)
    for i in range(n - 2, -1, -1):
        low, high = 0.0, cap[i]
        for k in range(HALVINGS + 1):
            b = high if k == 0 else 0.5 * (low + high)
            least, most = _accelerations(b, dq[i], ddq[i], joint_cap, dp[i], ddp[i], tool_cap)
            if least <= most and b + 2.0 * step * least <= best[i + 1] and b + 2.0 * step * most >= 0.0:
                low = b
                if k == 0:
                    break
            elif k > 0:
                high = b
        best[i] = low
    out = np.zeros(n)
    for i in range(n - 1):
        _, most = _accelerations(out[i], dq[i], ddq[i], joint_cap, dp[i], ddp[i], tool_cap)
        out[i + 1] = max(0.0, min(best[i + 1], out[i] + 2.0 * step * most))
    return out


@compiled
def _accelerations(
    b: float, dq: Array, ddq: Array, joint_cap: float, dp: Array, ddp: Array, tool_cap: float
) -> tuple[float, float]:
    """Return the smallest and the largest s̈ at ṡ² = b; the smallest above the largest when there is none."""
    least, most = -1e30, 1e30
    for j in range(len(dq)):
        turn = ddq[j] * b
        if abs(dq[j]) > UNMOVED:
            one, other = (-joint_cap - turn) / dq[j], (joint_cap - turn) / dq[j]
            least, most = max(least, min(one, other)), min(most, max(one, other))
        elif abs(turn) > joint_cap:
            return 1.0, -1.0
    pp = dp[0] * dp[0] + dp[1] * dp[1] + dp[2] * dp[2]
    pc = (dp[0] * ddp[0] + dp[1] * ddp[1] + dp[2] * ddp[2]) * b
    cc = (ddp[0] * ddp[0] + ddp[1] * ddp[1] + ddp[2] * ddp[2]) * b * b
    if pp > UNMOVED * UNMOVED:
        under = pc * pc - pp * (cc - tool_cap * tool_cap)
        if under < 0.0:
            return 1.0, -1.0
        root = math.sqrt(under)
        least, most = max(least, (-pc - root) / pp), min(most, (-pc + root) / pp)
    elif cc > tool_cap * tool_cap:
        return 1.0, -1.0
    return least, most


def passing_times(squared: Array, step: float) -> Array:
    """Return the times (n,) at which a grid of `step` is passed with squared speeds (n,), accelerating evenly between.

    Every second place at most may have no speed.
    """
    speed = np.sqrt(squared)
    return np.concatenate([[0.0], np.cumsum(2.0 * step / (speed[:-1] + speed[1:]))])
