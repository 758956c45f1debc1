"""Paths with times: as fast as the caps of joints and tool allow, with limited jerk, at rest at both ends.

The fastest way within speed and acceleration caps (`time_optimal`) switches its acceleration in no time. Its speed over
time is therefore averaged over a short window: the path stays the same, the jerk becomes the change of acceleration
over the window's length, and the motion lasts longer by just that. Where averaging across a bend would exceed a cap,
the motion is slowed down around there, and what is still missing then all along.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.ndimage import maximum_filter1d

from mocca_robot.arrays import Array
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Waypoint
from mocca_robot.plan.pose import six
from mocca_robot.tolerances import ROUNDING
from planners.robot.arm_poses import trace
from planners.robot.cell import RobotCell
from planners.robot.time_optimal import passing_times, reachable_speeds

JOINT_JERK_RAD_S3, RAMP_S = np.deg2rad(500.0), 0.16
"""No published figure: the driver's own acceleration cap is reached in a sixth of a second, higher ones as well."""
TOOL_JERK_M_S3 = 10.0
"""The same for the tool: what hangs on a cup swings less."""
SHARE = 0.97
"""Of every cap that is used, so that sampling does not exceed it."""
GRID = 240
"""Places of a path at which caps are looked at."""
WINDOWS_S = (0.04, 0.06, 0.08, 0.12, 0.16, 0.24, 0.32)
"""Lengths of the window that are tried; the one with the shortest motion is taken."""
ROUNDS, NEARLY = 5, 1.01
"""How often a motion is slowed down where caps are exceeded by more than a hundredth."""
OFF_M, OFF_RAD = 1e-4, 2e-4
"""How far the tool and a joint may be off their path half way between two waypoints;"""
WAYPOINT_S, WAYPOINT_RAD, FEWEST = (0.05, 0.25), 0.08, 12
"""but waypoints are this far apart in time, and no joint turns farther from one to the next."""
EVEN_S = 0.3
"""Their distances change gradually, over this time."""
LINE_M = 0.004


@dataclass(frozen=True, kw_only=True)
class Caps:
    """What one motion may not exceed: of the tool and of each joint (6,), (); SI units."""

    tool_speed: float
    tool_acceleration: float
    joint_speed: Array
    joint_acceleration: float
    joint_jerk: float

    def shared(self, share: float) -> Caps:
        """Return a share of these caps."""
        return replace(
            self,
            tool_speed=share * self.tool_speed,
            tool_acceleration=share * self.tool_acceleration,
            joint_speed=share * self.joint_speed,
            joint_acceleration=share * self.joint_acceleration,
        )


def jerk_cap(limits: MotionLimits) -> float:
    """Return the largest jerk of a joint, rad/s³."""
    return max(float(JOINT_JERK_RAD_S3), limits.joint_acceleration_rad_s2 / RAMP_S)


def caps_of(cell: RobotCell, speed_m_s: float, acceleration_m_s2: float) -> Caps:
    """Return the caps of a motion of the cell's arm whose tool may be this fast."""
    return Caps(
        tool_speed=speed_m_s,
        tool_acceleration=acceleration_m_s2,
        joint_speed=np.minimum(cell.model.joint_speed_rad_s, cell.limits.joint_speed_rad_s),
        joint_acceleration=cell.limits.joint_acceleration_rad_s2,
        joint_jerk=jerk_cap(cell.limits),
    )


@dataclass(frozen=True, eq=False)
class _Pace:
    """Where on its path a motion is at a time: the fastest way, its speed averaged over `window_s`."""

    place: CubicHermiteSpline
    whole: CubicHermiteSpline
    seconds: float
    window_s: float

    @property
    def lasts_s(self) -> float:
        """Return how long the motion lasts."""
        return self.seconds + self.window_s

    def samples(self) -> Array:
        """Return times (n,) at which the motion is looked at."""
        return np.linspace(0.0, self.lasts_s, max(GRID, int(np.ceil(self.lasts_s / 0.01))) + 1)

    def at(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Return the path's parameter (n,) at times (n,) and its first three derivatives by time."""
        ends = np.clip(t, 0.0, self.seconds), np.clip(t - self.window_s, 0.0, self.seconds)
        over = np.maximum(t - self.seconds, 0.0) * self.place(self.seconds)
        area = self.whole(ends[0]) + over - self.whole(ends[1])
        out = [area / self.window_s]
        for order in (0, 1, 2):
            one, other = (self.place(e, order) for e in ends)
            if order == 2:
                one, other = np.where(t < self.seconds, one, 0.0), np.where(t > self.window_s, other, 0.0)
            out.append((one - other) / self.window_s)
        return out[0], out[1], out[2], out[3]


def timed(cell: RobotCell, knots: Array, speed_m_s: float, acceleration_m_s2: float) -> list[Waypoint]:
    """Return waypoints of the smooth path through joint angles `knots` (n, 6), driven as fast as the caps allow."""
    knots = np.asarray(knots, dtype=np.float64)
    lengths = np.linalg.norm(np.diff(knots, axis=0), axis=1)
    keep = np.concatenate([[True], lengths > ROUNDING])
    knots, at = knots[keep], np.concatenate([[0.0], np.cumsum(lengths[lengths > ROUNDING])])
    if len(knots) < 2:
        return [_waypoint(cell, 0.0, knots[0])]
    caps = caps_of(cell, speed_m_s, acceleration_m_s2)
    joints = CubicSpline(at, knots)
    s = np.linspace(0.0, at[-1], GRID + 1)
    tool = CubicSpline(s, (cell.model.frames(joints(s))[-1] @ _tip(cell))[:, :3])
    profile, slower = _quickest(joints, tool, s, caps)
    t = _passed_at(profile, joints, tool, slower)
    q = joints(np.clip(profile.at(t)[0], 0.0, at[-1]))
    q[0], q[-1] = knots[0], knots[-1]
    return [_waypoint(cell, float(slower * a), b) for a, b in zip(t, q, strict=True)]


def _quickest(joints: CubicSpline, tool: CubicSpline, s: Array, caps: Caps) -> tuple[_Pace, float]:
    """Return the profile of the shortest motion, and the factor by which it has to be slowed down all along."""
    slowed = np.ones(len(s))
    tried = [(p, *_missing(p, joints, tool, caps)) for p in _profiles(joints, tool, s, caps, slowed, WINDOWS_S)]
    for _ in range(ROUNDS):
        profile, t, missing = min(tried, key=lambda p: float(p[2].max()) * p[0].lasts_s)
        if missing.max() <= NEARLY:
            break
        # Around where a cap is exceeded, as far as the window reaches.
        reach = int(np.ceil(profile.window_s / (t[1] - t[0])))
        around = maximum_filter1d(missing, 2 * reach + 1, mode="nearest")
        slowed = slowed * np.interp(s, profile.at(t)[0], around)
        once_more = _profiles(joints, tool, s, caps, slowed, (profile.window_s,))
        tried.extend((p, *_missing(p, joints, tool, caps)) for p in once_more)
    profile, _, missing = min(tried, key=lambda p: float(p[2].max()) * p[0].lasts_s)
    return profile, float(missing.max())


def _passed_at(profile: _Pace, joints: CubicSpline, tool: CubicSpline, slower: float) -> Array:
    """Return the times on the profile's clock of waypoints: dense where speeds change, wide apart where they do not."""
    t = profile.samples()
    turns, turning, _ = _rates(joints, profile, t)
    changing = _rates(tool, profile, t)[1]
    off = np.maximum(np.abs(turning).max(axis=1) / OFF_RAD, np.linalg.norm(changing, axis=1) / OFF_M)
    density = np.clip(np.sqrt(off / 8.0) / slower, 1.0 / WAYPOINT_S[1], 1.0 / WAYPOINT_S[0])
    density = np.maximum(density, np.abs(turns).max(axis=1) / slower / WAYPOINT_RAD)
    width = int(EVEN_S / slower / (t[1] - t[0])) // 2 * 2 + 1
    density = np.convolve(np.pad(density, width // 2, mode="edge"), np.full(width, 1.0 / width), "valid")
    passed = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(t) * slower)])
    count = max(FEWEST, int(np.ceil(passed[-1])))
    return np.asarray(np.interp(np.linspace(0.0, passed[-1], count + 1), passed, t))


def _tip(cell: RobotCell) -> Array:
    return np.append(np.asarray(cell.gripper.tcp_offset[:3]), 1.0)


def _waypoint(cell: RobotCell, t: float, q: Array) -> Waypoint:
    return Waypoint(t, six(q), cell.model.tcp_pose(q, cell.gripper.tcp_offset))


def fastest_s(cell: RobotCell, knots: Array, speed_m_s: float, acceleration_m_s2: float) -> float:
    """Return the time-optimal bound of a path at caps of speed and acceleration alone, seconds."""
    lengths = np.linalg.norm(np.diff(knots, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    joints = CubicSpline(at, knots)
    s = np.linspace(0.0, at[-1], 4 * GRID + 1)
    tool = CubicSpline(s, (cell.model.frames(joints(s))[-1] @ _tip(cell))[:, :3])
    caps = caps_of(cell, speed_m_s, acceleration_m_s2)
    return float(passing_times(_speeds(joints, tool, s, caps, np.ones(len(s))), s[1])[-1])


def _speeds(joints: CubicSpline, tool: CubicSpline, s: Array, caps: Caps, slowed: Array) -> Array:
    """Return squared speeds at the places `s` (n,), where time goes `slowed` (n,) times as slowly as caps allow."""
    one, two = slowed[:, None], slowed[:, None] ** 2
    dq, ddq = joints(s, 1) * one, joints(s, 2) * two
    dp, ddp = tool(s, 1) * one, tool(s, 2) * two
    rate = np.maximum((np.abs(dq) / caps.joint_speed).max(axis=1), np.linalg.norm(dp, axis=1) / caps.tool_speed)
    cap = 1.0 / np.maximum(rate, ROUNDING) ** 2
    dq, dp = dq * one, dp * one
    dq, ddq, dp, ddp = (np.ascontiguousarray(a) for a in (dq, ddq, dp, ddp))
    step = float(s[1] - s[0])
    return reachable_speeds(cap, dq, ddq, caps.joint_acceleration, dp, ddp, caps.tool_acceleration, step)


def _profiles(
    joints: CubicSpline, tool: CubicSpline, s: Array, caps: Caps, slowed: Array, windows_s: Sequence[float]
) -> Iterator[_Pace]:
    squared = _speeds(joints, tool, s, caps.shared(SHARE), slowed)
    times = passing_times(squared, float(s[1] - s[0]))
    place = CubicHermiteSpline(times, s, np.sqrt(squared))  # exact: acceleration is even between places
    whole = place.antiderivative()
    for window in windows_s:
        yield _Pace(place, whole, float(times[-1]), window)


def _missing(profile: _Pace, joints: CubicSpline, tool: CubicSpline, caps: Caps) -> tuple[Array, Array]:
    """Return times (n,), and by which factors (n,), at least 1, the motion has to be slower there to keep all caps."""
    t = profile.samples()
    one, two, three = _rates(joints, profile, t)
    factors = [
        np.abs(one / caps.joint_speed).max(axis=1),
        np.sqrt(np.abs(two).max(axis=1) / caps.joint_acceleration),
        np.cbrt(np.abs(three).max(axis=1) / caps.joint_jerk),
    ]
    one, two, three = (np.linalg.norm(r, axis=1) for r in _rates(tool, profile, t))
    factors += [
        one / caps.tool_speed,
        np.sqrt(two / caps.tool_acceleration),
        np.cbrt(three / TOOL_JERK_M_S3),
    ]
    return t, np.maximum(1.0, np.max(factors, axis=0))


def _rates(curve: CubicSpline, profile: _Pace, t: Array) -> tuple[Array, Array, Array]:
    """Return the first three derivatives by time (n, k) of a curve along the profile."""
    s, v, a, j = (x[:, None] for x in profile.at(t))
    s = np.clip(s[:, 0], curve.x[0], curve.x[-1])
    d1, d2, d3 = curve(s, 1), curve(s, 2), curve(s, 3)
    return d1 * v, d2 * v * v + d1 * a, d3 * v**3 + 3.0 * d2 * v * a + d1 * j


def joint_motion(cell: RobotCell, legs: Sequence[Array]) -> tuple[Waypoint, ...]:
    """Return the timed free motion along smooth `legs`, each (n, 6) joint angles, at rest between them."""
    out: list[Waypoint] = []
    for leg in legs:
        piece = timed(cell, leg, cell.limits.transfer_speed_m_s, cell.limits.transfer_acceleration_m_s2)
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
    shares = np.linspace(0.0, 1.0, max(FEWEST, int(np.ceil(length / LINE_M))) + 1)
    joints, reason = trace(cell.model, _poses(start, travel, shares), q_start)
    if reason:
        return (), reason
    return tuple(timed(cell, np.array(joints), speed_m_s, acceleration_m_s2)), ""


def line(start: Array, travel: Array, count: int) -> list[Array]:
    """Return `count` poses (4, 4) at even distances along a straight line."""
    return _poses(start, travel, np.linspace(0.0, 1.0, count))


def _poses(start: Array, travel: Array, shares: Array) -> list[Array]:
    out = []
    for share in shares:
        pose = start.copy()
        pose[:3, 3] += share * travel
        out.append(pose)
    return out


def reversed_motion(path: Sequence[Waypoint]) -> tuple[Waypoint, ...]:
    """Return the same path driven backwards."""
    end = path[-1].t
    return tuple(Waypoint(end - w.t, w.q, w.tcp) for w in reversed(path))
