"""What a motion must not do: forces, path, travel and jams, each judged from measured states alone.

Every function returns when the state is harmless and raises Stopped with value and limit when it is not.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Waypoint
from mocca_robot.plan.pose import angle_rad, distance_m
from mocca_robot.plan.status import ArmState, ExecutionStatus
from mocca_robot.plan.supervision import Stopped

LATERAL_M = 0.005
"""A part that drifts farther sideways while it is pushed has left its joint."""
BEYOND_M = 0.003
"""Pushed farther than planned by this, or back by it, the part is not where it was thought to be."""
PUSH_GRACE_S = 0.3
"""Force mode needs a moment to get going; standing still before that is no jam."""
SEATED_SHARE = 0.25
"""Of the push force: a part that resists this much within the tolerance of its depth has met its seat. To press on with
all of it would push a light structure apart that stands by its shape alone."""
SEATING_M, SEATING_PACE = 0.002, 0.3
"""Over the last 2 mm a part is pushed at this share of the speed: the arm's momentum is what hits the structure."""
GRACE_S, SLOWEST_SHARE = 2.0, 0.01
"""Within which an arm has settled where its path ends."""
STALL_S = 1.0
RESISTS = 0.7
"""Of the push force: an arm in force mode presses on a jam with no more than it was told to."""
CREEPS = 0.05
"""Of the speed that is asked for: what is slower than that stands still, whatever a cell calls slow."""
STILL_RAD_S = 0.01
OBEY_S, OBEY_RAD, OBEY_SHARE = 0.3, 0.01, 0.05
"""Joints that were told to move by more than 0.01 rad in 0.3 s, and did less than a twentieth of it, do not obey."""
IDLE_S, IDLE_SHARE = 0.3, 0.2
"""An arm that for this long neither moves nor presses with this share of the push is not pushing."""
FILTER_S = 0.04
"""Time constant of the filter on forces: white noise at 50 Hz is halved, a contact is seen two cycles later."""
CONTACT_SAMPLES = 3
"""So many filtered samples in a row above the limit are a contact."""
BLOW = 2.0
"""A single sample above so many times a limit is no noise."""
NOISE_SHARE = 2.5
"""Filtered to half, noise on three axes exceeds five standard deviations in three samples in a row once in days."""


class ForceGuard:
    """What one motion may feel over the bias (6,). Sensors are noisy: forces count filtered, contact when it lasts.

    Attributes:
        felt: the filtered wrench (6,).
    """

    def __init__(
        self, bias: Array, limits: MotionLimits, force_limit_n: float, contact_force_n: float | None = None
    ) -> None:
        self.felt = np.zeros(6)
        self._bias = bias
        self._limits = limits
        self._limit_n = min(force_limit_n, limits.abort_force_n)
        self._contact_n = contact_force_n
        self._time_s: float | None = None
        self._touching = 0

    def check(self, state: ArmState) -> None:
        """Stop above the motion's force limit, the torque limit, or (if any) the force that means contact."""
        now = np.subtract(state.force, self._bias)
        passed = FILTER_S if self._time_s is None else state.time_s - self._time_s
        if passed <= 0.0:
            return  # the same state again
        self._time_s = state.time_s
        self.felt = self.felt + (now - self.felt) * (1.0 - np.exp(-passed / FILTER_S))
        self._check_limits(now, state)
        force = float(np.linalg.norm(self.felt[:3]))
        touching = self._contact_n is not None and force > self._contact_n
        self._touching = self._touching + 1 if touching else 0
        if self._touching >= CONTACT_SAMPLES:
            raise Stopped(ExecutionStatus.CONTACT, f"{force:.1f} N, contact at {self._contact_n:g} N", state)

    def _check_limits(self, now: Array, state: ArmState) -> None:
        for part, limit, unit in ((slice(3), self._limit_n, "N"), (slice(3, 6), self._limits.abort_torque_nm, "Nm")):
            at_once, lasting = float(np.linalg.norm(now[part])), float(np.linalg.norm(self.felt[part]))
            if lasting > limit or at_once > BLOW * limit:
                shown = f"{max(at_once, lasting):.{1 if unit == 'N' else 2}f} {unit}"
                raise Stopped(ExecutionStatus.FORCE_LIMIT, f"{shown}, limit {limit:g} {unit}", state)


def needed_contact_n(noise_n: float) -> float:
    """Return the smallest contact force that white noise of `noise_n` per axis and sample does not feign in a build."""
    return NOISE_SHARE * noise_n


def check_path(state: ArmState, trail: Sequence[Array], limits: MotionLimits) -> None:
    """Stop when the tool is far from every place (3,) commanded lately: lagging is allowed, straying is not."""
    gap = float(np.linalg.norm(np.array(trail) - np.array(state.tcp[:3]), axis=1).min())
    if gap > limits.tracking_distance_m:
        limit = 1e3 * limits.tracking_distance_m
        raise Stopped(ExecutionStatus.DEVIATED, f"{1e3 * gap:.1f} mm off the path, limit {limit:g} mm", state)


class ObeyGuard:
    """Whether an arm that is led moves at all: another program that took it does not say so, but does not obey."""

    def __init__(self) -> None:
        self._history: deque[tuple[float, Array, Array]] = deque()

    def check(self, state: ArmState, goal: Array) -> None:
        """Stop when joints stand still that were told to move, as fast as half a second shows it."""
        q, history = np.array(state.q), self._history
        history.append((state.time_s, goal, q))
        while len(history) > 2 and history[1][0] <= state.time_s - OBEY_S:
            history.popleft()
        since, first, before = history[0]
        asked, done = float(np.abs(goal - first).max()), float(np.abs(q - before).max())
        if state.time_s - since >= OBEY_S and asked > OBEY_RAD and done < OBEY_SHARE * asked:
            detail = (
                f"the arm does not follow: told to move a joint by {asked:.3f} rad in {state.time_s - since:.2f} s, it "
                f"moved {done:.3f} rad; another program may have taken it"
            )
            raise Stopped(ExecutionStatus.DEVIATED, detail, state)


def check_start(state: ArmState, first: Waypoint, limits: MotionLimits) -> None:
    """Stop when the arm is too far from a path's first waypoint to be led onto it."""
    gap, far = float(np.abs(np.subtract(state.q, first.q)).max()), distance_m(state.tcp, first.tcp)
    if gap > limits.joint_step_rad or far > limits.tracking_distance_m:
        raise Stopped(
            ExecutionStatus.DEVIATED,
            f"the arm stands {1e3 * far:.1f} mm and {gap:.3f} rad from the path's first waypoint, limit "
            f"{1e3 * limits.tracking_distance_m:g} mm and {limits.joint_step_rad:g} rad",
            state,
        )


def arrived(state: ArmState, goal: Waypoint, limits: MotionLimits) -> bool:
    """Return whether the arm stands still at a waypoint, as closely as a next motion asks for."""
    return (
        float(np.abs(np.subtract(state.q, goal.q)).max()) <= limits.start_joint_rad
        and distance_m(state.tcp, goal.tcp) <= limits.start_distance_m
        and max(abs(v) for v in state.qd) < STILL_RAD_S
    )


class Arrival:
    """Whether an arm gets where its path ends; there is no deadline before, a path takes as long as its clock does."""

    def __init__(self) -> None:
        self._since_s: float | None = None

    def check(self, state: ArmState, now: float, goal: Waypoint, limits: MotionLimits) -> bool:
        """Return whether the arm stands at `goal`; to be asked in every cycle after the path is over.

        Stopped with TIMED_OUT when it does not within two seconds, longer where the slider slows it down.
        """
        if arrived(state, goal, limits):
            return True
        self._since_s = now if self._since_s is None else self._since_s
        patience = GRACE_S / max(state.speed_scaling, SLOWEST_SHARE)
        if now - self._since_s > patience:
            gap, far = float(np.abs(np.subtract(state.q, goal.q)).max()), distance_m(state.tcp, goal.tcp)
            detail = f"not there {patience:.0f} s after the path's end: {gap:.4f} rad and {1e3 * far:.1f} mm away"
            raise Stopped(ExecutionStatus.TIMED_OUT, detail, state)
        return False


class PushGuard:
    """The guard of one push from `start` along `axis` (3,) over `wanted_m`; `depth_m` is what was measured last.

    `speed` is the share of the insertion speed that is asked for. There is no deadline: a push goes on as long as it
    gets on, and what does not is a jam.
    """

    def __init__(
        self,
        start: ArmState,
        axis: Array,
        wanted_m: float,
        forces: ForceGuard,
        limits: MotionLimits,
        *,
        speed: float = 1.0,
    ) -> None:
        self.start = start
        self._speed = speed
        self.axis = axis
        self.wanted_m = wanted_m
        self.limits = limits
        self.depth_m = 0.0
        self._forces = forces
        self._history: deque[tuple[float, float, float]] = deque()

    def measure(self, state: ArmState) -> float:
        """Return how far the tool has moved along the axis, metres."""
        self.depth_m = float(np.subtract(state.tcp[:3], self.start.tcp[:3]) @ self.axis)
        return self.depth_m

    @property
    def seating(self) -> bool:
        """Return whether the part is on the last stretch of its way."""
        return self.depth_m >= self.wanted_m - SEATING_M

    def check(self, state: ArmState) -> bool:
        """Return whether the part is in its seat; Stopped for forces, tilt, travel off the line, or a jam.

        It is there at its full depth, or within the tolerance of it as soon as it resists.
        """
        self._forces.check(state)
        tilt = angle_rad(state.tcp, self.start.tcp)
        if tilt > self.limits.abort_tilt_rad:
            detail = f"tilted by {np.degrees(tilt):.1f}°, limit {np.degrees(self.limits.abort_tilt_rad):.1f}°"
            raise Stopped(ExecutionStatus.DEVIATED, detail, state)
        depth = self.measure(state)
        moved = np.subtract(state.tcp[:3], self.start.tcp[:3])
        drift = float(np.linalg.norm(moved - depth * self.axis))
        if drift > LATERAL_M:
            detail = f"{1e3 * drift:.1f} mm sideways, limit {1e3 * LATERAL_M:g} mm"
            raise Stopped(ExecutionStatus.TRAVEL_LIMIT, detail, state)
        if not -BEYOND_M <= depth <= self.wanted_m + BEYOND_M:
            low, high = -1e3 * BEYOND_M, 1e3 * (self.wanted_m + BEYOND_M)
            detail = f"{1e3 * depth:.1f} mm along the axis, allowed {low:g} to {high:.1f} mm"
            raise Stopped(ExecutionStatus.TRAVEL_LIMIT, detail, state)
        felt = abs(float(self._forces.felt[:3] @ self.axis))
        near = depth >= self.wanted_m - self.limits.depth_tolerance_m
        if depth >= self.wanted_m or (near and felt >= SEATED_SHARE * self.limits.push_force_n):
            return True
        self._history.append((state.time_s, depth, felt))
        self._check_jam(state)
        return False

    def _check_idle(self, state: ArmState, grace_s: float, creeps: float) -> None:
        """An arm that neither moves nor presses is in nobody's force mode, or in somebody else's hands."""
        recent = [h for h in self._history if h[0] >= state.time_s - IDLE_S]
        span = recent[-1][0] - recent[0][0]
        if state.time_s - self.start.time_s < grace_s + IDLE_S or span < 0.8 * IDLE_S:
            return
        moved, pressed = abs(recent[-1][1] - recent[0][1]), max(h[2] for h in recent)
        if moved < creeps * span and pressed < IDLE_SHARE * self.limits.push_force_n:
            detail = (
                f"the arm does not push: it neither moves nor presses ({pressed:.1f} N); another program may have it"
            )
            raise Stopped(ExecutionStatus.DEVIATED, detail, state)

    def _check_jam(self, state: ArmState) -> None:
        """Jam: slow for 0.25 s against most of the push; stall: slow for 1 s at any force.

        Slow is below 2 mm/s, or half of what is asked for where that is less, as slider and operator slow it down; a
        stall waits as much longer.
        """
        now, history, limits = state.time_s, self._history, self.limits
        share = self._speed * state.speed_scaling
        asked = limits.insert_speed_m_s * share * (SEATING_PACE if self.seating else 1.0)
        slow = min(limits.jam_speed_m_s * share, 0.5 * asked)
        stall_s, grace_s = STALL_S / share, PUSH_GRACE_S / share
        while history[0][0] < now - 2.0 * stall_s:
            history.popleft()
        self._check_idle(state, grace_s, CREEPS * asked)
        hard = min(limits.jam_force_n, RESISTS * limits.push_force_n)
        for window, force, speed in ((limits.jam_time_s, hard, slow), (stall_s, 0.0, max(slow, CREEPS * asked))):
            first = max((k for k, h in enumerate(history) if h[0] <= now - window), default=None)
            if first is None or now - self.start.time_s < grace_s + window:
                continue
            recent = [history[k] for k in range(first, len(history))]
            travel, span = recent[-1][1] - recent[0][1], recent[-1][0] - recent[0][0]
            if travel < speed * span and min(h[2] for h in recent) >= force:
                detail = f"{1e3 * travel / span:.1f} mm/s at {recent[-1][2]:.1f} N for {span:.2f} s"
                raise Stopped(ExecutionStatus.JAMMED, detail, state)
