"""Paths with times: minimum-jerk from rest to rest, as fast as the limits of joints and tool allow."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.plan.plan import Waypoint
from mocca_robot.plan.pose import six
from planners.robot.arm_poses import trace
from planners.robot.cell import RobotCell

JOINT_JERK_RAD_S3 = np.deg2rad(500.0)
"""No published figure; about six times the acceleration cap, reached in a sixth of a second."""
SHARE = 0.92
"""Of every limit that is used, so that sampling does not exceed it."""


def ease(count: int) -> Array:
    """Return (count,) shares of the way at even times: rest to rest with least jerk."""
    u = np.linspace(0.0, 1.0, count)
    return np.asarray(u**3 * (10 - 15 * u + 6 * u * u))


def timed(cell: RobotCell, joints: Sequence[Array], speed_m_s: float, acceleration_m_s2: float) -> list[Waypoint]:
    """Return waypoints for joint angles passed at even times, the duration the shortest that keeps all limits."""
    q = np.array(joints)
    model, offset = cell.model, cell.gripper.tcp_offset
    poses = [model.tcp_pose(x, offset) for x in q]
    tool = np.array([p[:3] for p in poses])
    limits = cell.limits
    caps = np.minimum(model.joint_speed_rad_s, limits.joint_speed_rad_s)
    n = len(q) - 1
    rate = np.abs(np.diff(q, axis=0) * n / caps).max()
    still = np.zeros((1, 6))
    change = np.diff(np.vstack([still, np.diff(q, axis=0), still]), axis=0) * n * n
    change[[0, -1]] *= 2.0  # the first and the last change take half a step
    jerk = np.diff(change, axis=0) * n
    moved = np.diff(tool, axis=0) * n
    turn = np.diff(np.vstack([np.zeros((1, 3)), moved / n, np.zeros((1, 3))]), axis=0) * n * n
    turn[[0, -1]] *= 2.0
    seconds = max(
        rate,
        np.sqrt(np.abs(change).max() / limits.joint_acceleration_rad_s2),
        np.cbrt(np.abs(jerk).max() / JOINT_JERK_RAD_S3),
        np.linalg.norm(moved, axis=1).max() / speed_m_s,
        np.sqrt(np.linalg.norm(turn, axis=1).max() / acceleration_m_s2),
        0.1,
    )
    times = np.linspace(0.0, float(seconds) / SHARE, len(q))
    return [Waypoint(float(t), six(x), p) for t, x, p in zip(times, q, poses, strict=True)]


def joint_motion(cell: RobotCell, corners: Sequence[Array]) -> tuple[Waypoint, ...]:
    """Return the timed path through joint-space corners, at rest at each."""
    out: list[Waypoint] = []
    for a, b in itertools.pairwise(corners):
        count = max(12, int(np.ceil(1.9 * np.abs(b - a).max() / 0.08)) + 1)
        share = ease(count)[:, None]
        piece = timed(
            cell,
            list(a + share * (b - a)),
            cell.limits.transfer_speed_m_s,
            cell.limits.transfer_acceleration_m_s2,
        )
        start = out[-1].t if out else 0.0
        out.extend(Waypoint(start + w.t, w.q, w.tcp) for w in (piece[1:] if out else piece))
    return tuple(out)


def line_motion(
    cell: RobotCell, start: Array, travel: Array, q_start: Array, speed_m_s: float, acceleration_m_s2: float
) -> tuple[tuple[Waypoint, ...], str]:
    """Return the timed straight motion of the tool from flange pose `start` (4, 4), which `q_start` reaches, by
    `travel` (3,); and '' or why the line cannot be followed.
    """
    length = float(np.linalg.norm(travel))
    flanges = line(start, travel, max(12, int(np.ceil(length / 0.004))))
    joints, reason = trace(cell.model, flanges, q_start)
    if reason:
        return (), reason
    return tuple(timed(cell, joints, speed_m_s, acceleration_m_s2)), ""


def line(start: Array, travel: Array, count: int) -> list[Array]:
    """Return poses (4, 4) along a straight line, eased."""
    out = []
    for share in ease(count):
        pose = start.copy()
        pose[:3, 3] += share * travel
        out.append(pose)
    return out


def reversed_motion(path: Sequence[Waypoint]) -> tuple[Waypoint, ...]:
    """Return the same path driven backwards."""
    end = path[-1].t
    return tuple(Waypoint(end - w.t, w.q, w.tcp) for w in reversed(path))
