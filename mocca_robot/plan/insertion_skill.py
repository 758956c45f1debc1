"""The insertion skill: push along the axis, and when it jams, back out the way it came and try elsewhere in the cone.

The α-cone is what makes a retry safe: any direction inside it frees the part, so backing out along the reversed
direction cannot catch, and another direction of the cone cannot be blocked by the joint itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.motions import Motions
from mocca_robot.plan.plan import Move, Step, Waypoint, insertion_axis
from mocca_robot.plan.pose import angle_rad, six
from mocca_robot.plan.status import ArmState, ExecutionStatus, MotionOutcome

RETRYABLE = frozenset({ExecutionStatus.JAMMED, ExecutionStatus.TRAVEL_LIMIT})
BRIDGE_POINTS = 8
EARLY_M = 1.5e-3
"""A part that jams before it is in by this has not found the mouth of its joint."""
RINGS = (0.45, 0.85)
"""Radii on which its mouth is searched, as shares of how far a part may end beside its place."""
AROUND = 3
"""Alternatives that go all around; of fewer, the opposite sides are searched, too."""


def insert(
    arm: Motions, step: Step, move: Move, limits: MotionLimits, note: Callable[..., None], at: ArmState | None = None
) -> MotionOutcome:
    """Return how the insertion of `step`'s part ended: SUCCEEDED by measured depth, or why the last attempt failed.

    The first attempt runs along the move's own path; up to `limits.retries` more along its alternatives, in their
    order (the own path again when they are used up). Each retry starts after a retreat along the reversed direction.
    Before that, a part that did not even get into its mouth is pushed beside it, `limits.search_tries` times at most.
    `at` is the measured state in which it begins: an arm that stands a little ahead of the path's start, or behind it,
    pushes less or more, so that the part ends where it belongs. Depths in outcomes count from the path's start.
    """
    paths = (move.path, *move.alternatives)
    beside = iter(search_starts(move, limits)[: limits.search_tries])
    path, start, retries, attempt = move.path, move.path[0], 0, 0
    while True:
        axis, depth = insertion_axis(path)
        ahead = 0.0 if at is None else float(np.subtract(at.tcp[:3], path[0].tcp[:3]) @ axis)
        outcome = arm.push(axis, depth - ahead, force_limit_n=move.force_limit_n)
        if outcome.depth_m is not None:
            outcome = replace(outcome, depth_m=ahead + outcome.depth_m)
        if outcome.succeeded:
            return _judged(outcome, path, limits)
        if outcome.status not in RETRYABLE:
            return outcome
        before = path
        following = next(beside, None) if (outcome.depth_m or 0.0) < EARLY_M else None
        if following is not None:
            path, start = move.path, following
        elif retries == limits.retries:
            return outcome
        else:
            retries += 1
            path = paths[retries % len(paths)]
            start = path[0]
        note("attempt_failed", outcome, attempt)
        attempt += 1
        back = _retreat(before, outcome.depth_m or 0.0)
        for way in (back, _bridge(before[0], start, limits)):
            moved = arm.follow(way, force_limit_n=move.force_limit_n, contact_force_n=None)
            if not moved.succeeded:
                return moved
        zeroed = arm.zero_force()
        if not zeroed.succeeded:
            return zeroed
        at = zeroed.state


def search_starts(move: Move, limits: MotionLimits) -> list[Waypoint]:
    """Return where to begin a push a little beside the move's own start: rings around it, the inner one first.

    They lie towards the starts of the alternatives and away from them, so inside the α-cone as it opens there, and no
    farther out than a part may end beside its place.
    """
    first = move.path[0]
    out = []
    for ring in RINGS:
        for other in move.alternatives:
            far = float(np.linalg.norm(np.subtract(other[0].tcp[:3], first.tcp[:3])))
            if far <= 0.0:
                continue
            share = min(ring * limits.sideways_tolerance_m / far, 1.0)
            for sign in (1.0, -1.0) if len(move.alternatives) < AROUND else (1.0,):
                ends = (np.array([w.q for w in (first, other[0])]), np.array([w.tcp for w in (first, other[0])]))
                q, tcp = (a + sign * share * (b - a) for a, b in ends)
                out.append(Waypoint(0.0, six(q), six(tcp)))
    return out


def _judged(outcome: MotionOutcome, path: Sequence[Waypoint], limits: MotionLimits) -> MotionOutcome:
    """Return a push that reached its depth, or DEVIATED when the hand then is beside its place, or tilted."""
    if outcome.state is None:
        return outcome
    axis, _ = insertion_axis(path)
    gap = np.subtract(outcome.state.tcp[:3], path[-1].tcp[:3])
    aside, tilt = float(np.linalg.norm(gap - (gap @ axis) * axis)), angle_rad(outcome.state.tcp, path[-1].tcp)
    for value, limit, words in (
        (1e3 * aside, 1e3 * limits.sideways_tolerance_m, "mm beside its place"),
        (float(np.degrees(tilt)), float(np.degrees(limits.tilt_tolerance_rad)), "degrees tilted"),
    ):
        if value > limit:
            detail = f"in by its depth, but {value:.2f} {words}, limit {limit:.2f}"
            return replace(outcome, status=ExecutionStatus.DEVIATED, detail=detail)
    return replace(outcome, detail=f"{outcome.detail}, {1e3 * aside:.2f} mm aside")


def _retreat(path: Sequence[Waypoint], depth_m: float) -> tuple[Waypoint, ...]:
    """Return the way back from `depth_m` to the path's start, on the planned joint angles, as fast as it came."""
    axis, _ = insertion_axis(path)
    start = np.array(path[0].tcp[:3])
    depths = np.array([float((np.array(w.tcp[:3]) - start) @ axis) for w in path])
    times = np.array([w.t for w in path])
    here = float(np.clip(depth_m, 0.0, depths[-1]))
    until = float(np.interp(here, depths, times))
    q = np.array([w.q for w in path])
    tcp = np.array([w.tcp for w in path])
    turn = [_at(times, q, tcp, until, 0.0)] if until > times[0] else []
    back = [(w.t, w) for w in path if w.t < until]
    way = [*turn, *(Waypoint(until - t, w.q, w.tcp) for t, w in reversed(back))]
    return tuple(way) if way else (Waypoint(0.0, path[0].q, path[0].tcp),)


def _bridge(a: Waypoint, b: Waypoint, limits: MotionLimits) -> tuple[Waypoint, ...]:
    """Return a slow joint-space way between two starts of insertion, which lie within the cone's mouth."""
    far = float(np.linalg.norm(np.subtract(b.tcp[:3], a.tcp[:3])))
    turn = float(np.abs(np.subtract(b.q, a.q)).max())
    seconds = max(far / limits.insert_speed_m_s, turn / (0.25 * limits.joint_speed_rad_s), 0.1)
    times = np.array([0.0, seconds])
    q, tcp = np.array([a.q, b.q]), np.array([a.tcp, b.tcp])
    return tuple(_at(times, q, tcp, seconds * s, seconds * s) for s in np.linspace(0.0, 1.0, BRIDGE_POINTS))


def _at(times: Array, q: Array, tcp: Array, t: float, stamp: float) -> Waypoint:
    def pick(values: Array) -> tuple[float, float, float, float, float, float]:
        a, b, c, d, e, f = (float(np.interp(t, times, column)) for column in values.T)
        return a, b, c, d, e, f

    return Waypoint(stamp, pick(q), pick(tcp))
