"""Joint angles for tool poses: all branches of a UR arm in closed form, and straight lines that stay on one branch.

With the last three axes of a UR arm the wrist's side is fixed first (shoulder, then wrist flip), which leaves a planar
two-link arm for shoulder lift and elbow: 2 × 2 × 2 branches. Everything is computed for many poses at once.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.plan.arm_models import RobotModel
from mocca_robot.tolerances import COARSE, ROUNDING

BRANCH_STEP_RAD = 0.12
"""A joint that turns farther between two poses of a finely sampled line has changed its branch or is near a
singularity."""
SINGULAR = 0.02
"""Smallest singular value of the Jacobian (metres and radians) that a line may pass."""
SIGNS = np.array([1.0, -1.0])


def all_branches(model: RobotModel, flanges: Array) -> tuple[Array, BoolArray]:
    """Return joint angles (n, 8, 6), each in (−π, π], that put the flange at each of `flanges` (n, 4, 4), and which of
    them exist (n, 8). Where the wrist is singular (axes 4 and 6 parallel) there is no single answer, and so none.
    """
    d1, _, _, d4, d5, d6 = model.d
    a2, a3 = model.a[1], model.a[2]
    flanges = np.asarray(flanges, dtype=np.float64)
    p, x, y, z = flanges[:, :3, 3], flanges[:, :3, 0], flanges[:, :3, 1], flanges[:, :3, 2]
    wrist = p - d6 * z
    reach = np.hypot(wrist[:, 0], wrist[:, 1])
    with np.errstate(invalid="ignore", divide="ignore"):
        lean = np.arccos(np.where(reach > abs(d4), d4 / reach, np.nan))
        q1 = (np.arctan2(wrist[:, 1], wrist[:, 0]) + np.pi / 2)[:, None] + SIGNS * lean[:, None]  # (n, 2)
        s1, c1 = np.sin(q1), np.cos(q1)
        cosine = (p[:, :1] * s1 - p[:, 1:2] * c1 - d4) / d6
        cosine = np.where(np.abs(cosine) <= 1.0 + ROUNDING, np.clip(cosine, -1.0, 1.0), np.nan)
        q5 = SIGNS * np.arccos(cosine)[..., None]  # (n, 2, 2)
        s5, c5 = np.sin(q5), np.cos(q5)
        s5 = np.where(np.abs(s5) < COARSE, np.nan, s5)
        xs = (x[:, :1] * s1 - x[:, 1:2] * c1)[..., None]
        ys = (y[:, :1] * s1 - y[:, 1:2] * c1)[..., None]
        q6 = np.arctan2(-ys / s5, xs / s5)
        s6, c6 = np.sin(q6), np.cos(q6)
        # The wrist seen in the plane of the two links: rotated by q1 about the base, its two axes here and up.
        here = np.stack([c1, s1], axis=-1)  # (n, 2, 2): horizontal axis of the plane in x, y
        flat = np.einsum("nsk,nik->nsi", here, flanges[:, :2, :3].transpose(0, 2, 1))  # its share of x, y, z
        up = flanges[:, None, 2, :3]
        # x axis of joint 4's frame: the flange's axes turned back by q6 and q5.
        back = np.stack([c5 * c6, -c5 * s6, -s5], axis=-1)  # (n, 2, 2, 3)
        turn = np.arctan2((back * up[:, :, None]).sum(-1), (back * flat[:, :, None]).sum(-1))
        # From the wrist's centre back by d5 along joint 5's axis, which lies in the plane.
        axis = -np.stack([s6, c6, np.zeros_like(s6)], axis=-1)
        px = (here * wrist[:, None, :2]).sum(-1)[..., None] - d5 * (axis * flat[:, :, None]).sum(-1)
        py = (wrist[:, 2] - d1)[:, None, None] - d5 * (axis * up[:, :, None]).sum(-1)
        bend = (px * px + py * py - a2 * a2 - a3 * a3) / (2 * a2 * a3)
        q3 = SIGNS * np.arccos(np.where(np.abs(bend) <= 1.0, bend, np.nan))[..., None]  # (n, 2, 2, 2)
        q2 = np.arctan2(py, px)[..., None] - np.arctan2(a3 * np.sin(q3), a2 + a3 * np.cos(q3))
        q4 = turn[..., None] - q2 - q3
        shape = q3.shape
        wide = (q1[..., None, None], q2, q3, q4, q5[..., None], q6[..., None])
        q = np.stack([np.broadcast_to(v, shape) for v in wide], axis=-1).reshape(-1, 8, 6)
    there = np.isfinite(q).all(axis=-1)
    return np.arctan2(np.sin(q), np.cos(q)), there


def branches(model: RobotModel, flange: Array) -> list[Array]:
    """Return all joint angles (6,), each in (−π, π], that put the flange at `flange` (4, 4); none when out of reach."""
    q, there = all_branches(model, np.asarray(flange)[None])
    return list(q[0][there[0]])


def nearest_turn(model: RobotModel, q: Array, near: Array) -> Array:
    """Return `q` (…, 6) with full turns added so that every joint lies as near to `near` as its limits allow.

    The elbow stays in (−π, π]: beyond, the forearm would have passed through the upper arm.
    """
    turns = np.round((near - q) / (2 * np.pi))
    turns[..., 2] = 0.0
    limit = np.asarray(model.joint_limit_rad)
    out = q + 2 * np.pi * turns
    out = np.where(out > limit, out - 2 * np.pi, out)
    return np.asarray(np.where(out < -limit, out + 2 * np.pi, out))


def trace(model: RobotModel, flanges: Sequence[Array] | Array, start: Array) -> tuple[list[Array], str]:
    """Return joint angles along flange poses, on the branch of `start` (which reaches the first), and '' or the reason
    why the line ends early.
    """
    path, reason = [start], ""
    options, there = all_branches(model, np.asarray(flanges)[1:])
    for q, exists in zip(options, there, strict=True):
        if not exists.any():
            reason = "the line leaves the arm's reach"
            break
        near = nearest_turn(model, q[exists], path[-1])
        jump = np.abs(near - path[-1]).max(axis=1)
        best = int(np.argmin(jump))
        if jump[best] > BRANCH_STEP_RAD:
            reason = "the line would need another arm configuration half way"
            break
        path.append(near[best])
    if len(path) > 1:
        narrow = np.linalg.svd(jacobians(model, np.array(path[1:])), compute_uv=False)[:, -1] < SINGULAR
        if narrow.any():
            return path[: 1 + int(np.argmax(narrow))], "the line passes a singularity of the arm"
    return path, reason


def jacobians(model: RobotModel, q: Array) -> Array:
    """Return the Jacobians (n, 6, 6) of the flange for joint angles (n, 6), as `RobotModel.jacobian` does for one."""
    frames = model.frames(q)
    tip = frames[-1][:, :3, 3]
    columns = []
    for frame in frames[:6]:
        axis = np.broadcast_to(frame[..., :3, 2], tip.shape)
        columns.append(np.concatenate([np.cross(axis, tip - frame[..., :3, 3]), axis], axis=-1))
    return np.stack(columns, axis=-1)
