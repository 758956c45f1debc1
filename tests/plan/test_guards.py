"""Guards and supervision on made-up states: each limit trips just above itself, and not just below."""

from __future__ import annotations

import math
import os
from dataclasses import asdict, replace

import numpy as np
import pytest
from ur_cell import REST

from mocca_robot.plan.guards import (
    BEYOND_M,
    LATERAL_M,
    SEATING_PACE,
    Arrival,
    ForceGuard,
    PushGuard,
    check_path,
    check_start,
    needed_contact_n,
)
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Waypoint
from mocca_robot.plan.status import ArmState, ExecutionStatus
from mocca_robot.plan.supervision import Stopped, parse_state, program_stop, safety_stop
from mocca_robot.ur.priority import NICE, preferred

LIMITS = MotionLimits()
DOWN = np.array([0.0, 0.0, -1.0])
ZERO = np.zeros(6)


def pushed(time_s: float, depth: float, force: float = 0.0, side: float = 0.0, tilt: float = 0.0) -> ArmState:
    return replace(
        REST, time_s=time_s, tcp=(0.4 + side, 0.0, 0.3 - depth, tilt, 0.0, 0.0), force=(0.0, 0.0, force, 0.0, 0.0, 0.0)
    )


def status_of(guard: PushGuard, states: list[ArmState]) -> ExecutionStatus | None:
    """Return the status that a series of states ends with, SUCCEEDED at depth, None if it neither ends nor succeeds."""
    for state in states:
        try:
            if guard.check(state):
                return ExecutionStatus.SUCCEEDED
        except Stopped as stop:
            return stop.status
    return None


def guard(wanted: float = 0.02) -> PushGuard:
    return PushGuard(REST, DOWN, wanted, ForceGuard(ZERO, LIMITS, 20.0), LIMITS)


@pytest.mark.parametrize(("force", "depth"), [(0.0, 0.020), (2.4, 0.020), (2.6, 0.019)])
def test_a_push_ends_at_its_depth_or_where_the_part_resists_within_the_tolerance_of_it(
    force: float, depth: float
) -> None:
    states = [pushed(0.02 * k, 0.01 * 0.02 * k, force) for k in range(1, 120)]
    g = guard()
    assert status_of(g, states) is ExecutionStatus.SUCCEEDED
    assert depth <= g.depth_m <= depth + 0.0003


@pytest.mark.parametrize(("force", "speed", "jams"), [(7.1, 0.0015, True), (6.9, 0.0015, False), (7.1, 0.0025, False)])
def test_jam_needs_both_force_and_slowness_for_a_quarter_second(force: float, speed: float, jams: bool) -> None:
    states = [pushed(0.02 * k, 0.004 + speed * 0.02 * k, force) for k in range(1, 40)]
    assert status_of(guard(), states) is (ExecutionStatus.JAMMED if jams else None)
    short = [pushed(0.5 + 0.02 * k, 0.004, 18.0) for k in range(12)]
    assert status_of(guard(), short) is None


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("by", ["slider", "operator"])
def test_what_is_slow_and_how_long_it_may_be_scale_with_the_speed(share: float, by: str) -> None:
    slider, speed = (share, 1.0) if by == "slider" else (1.0, share)

    def pushes(pace: float, force: float) -> ExecutionStatus | None:
        g = PushGuard(REST, DOWN, 0.015, ForceGuard(ZERO, LIMITS, 20.0), LIMITS, speed=speed)
        dt, depth, states = 0.02, 0.0, []
        for k in range(1, int(3.0 / share / dt)):
            depth += min(pace, 1.0 if depth < 0.013 else SEATING_PACE) * share * LIMITS.insert_speed_m_s * dt
            states.append(replace(pushed(dt * k, depth, force), speed_scaling=slider))
        return status_of(g, states)

    assert pushes(1.0, 2.0) is ExecutionStatus.SUCCEEDED  # as fast as it is asked to
    assert pushes(0.4, 2.0) is None  # slower, but it gets on: 4 mm/s at full speed
    assert pushes(0.1, 2.0) is ExecutionStatus.JAMMED
    assert pushes(0.1, 9.0) is ExecutionStatus.JAMMED


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_an_arm_has_as_much_longer_to_settle_as_it_is_slower(share: float) -> None:
    arrival, now, away = Arrival(), 5.0, replace(REST, q=(0.02, 0, 0, 0, 0, 0), speed_scaling=share)
    goal = Waypoint(0.0, REST.q, REST.tcp)
    assert Arrival().check(REST, now, goal, LIMITS)
    with pytest.raises(Stopped, match=r"0\.0200 rad and 0\.0 mm away") as stop:
        while now < 1000.0:
            now += 0.02
            assert not arrival.check(away, now, goal, LIMITS)
    assert stop.value.status is ExecutionStatus.TIMED_OUT
    assert now == pytest.approx(5.0 + 2.0 / share, abs=0.1)


def test_standing_still_for_a_second_is_a_jam_at_any_force() -> None:
    assert status_of(guard(), [pushed(0.02 * k, 0.004, 5.0) for k in range(1, 100)]) is ExecutionStatus.JAMMED
    assert status_of(guard(), [pushed(0.02 * k, 0.004, 5.0) for k in range(1, 50)]) is None


@pytest.mark.parametrize(
    ("state", "status"),
    [
        (pushed(0.1, 0.001, 20.1), ExecutionStatus.FORCE_LIMIT),
        (pushed(0.1, 0.001, 19.9), None),
        (pushed(0.1, 0.001, side=LATERAL_M + 1e-4), ExecutionStatus.TRAVEL_LIMIT),
        (pushed(0.1, 0.001, side=LATERAL_M - 1e-4), None),
        (pushed(0.1, -BEYOND_M - 1e-4), ExecutionStatus.TRAVEL_LIMIT),
        (pushed(0.1, 0.02 + BEYOND_M + 1e-4), ExecutionStatus.TRAVEL_LIMIT),
        (pushed(0.1, 0.001, tilt=math.radians(5.1)), ExecutionStatus.DEVIATED),
        (pushed(0.1, 0.001, tilt=math.radians(4.9)), None),
        (replace(REST, time_s=0.1, force=(0, 0, 0, 1.5, 1.5, 0)), ExecutionStatus.FORCE_LIMIT),
    ],
)
def test_push_limits(state: ArmState, status: ExecutionStatus | None) -> None:
    lasting = [replace(state, time_s=0.1 + 0.02 * k) for k in range(15)]
    assert status_of(guard(), lasting) is status


def felt(guard: ForceGuard, *forces: tuple[float, ...], seconds: float = 0.5) -> None:
    """Let a guard feel forces in turn, a sample every 20 ms, over and over for a while."""
    for k in range(int(seconds / 0.02)):
        guard.check(replace(REST, time_s=0.02 * k, force=forces[k % len(forces)]))


def test_forces_count_over_the_zeroed_bias_and_never_above_the_abort_force() -> None:
    down, bias = (0.0, 0.0, -12.0, 0.0, 0.0, 0.0), np.array([0, 0, -8.0, 0, 0, 0])
    felt(ForceGuard(bias, LIMITS, 25.0, 5.0), down)
    with pytest.raises(Stopped, match=r"N, contact at 5 N"):
        felt(ForceGuard(ZERO, LIMITS, 25.0, 5.0), down)
    with pytest.raises(Stopped, match=r"30\.0 N, limit 25 N"):
        felt(ForceGuard(ZERO, LIMITS, 100.0), (30.0, 0, 0, 0, 0, 0))


def test_what_lasts_is_a_contact_and_a_single_sample_is_not_unless_it_is_a_blow() -> None:
    hit, nothing = (9.0, 0, 0, 0, 0, 0), (0.0,) * 6
    felt(ForceGuard(ZERO, LIMITS, 25.0, 5.0), nothing, hit, nothing, nothing)
    with pytest.raises(Stopped, match="contact at 5 N"):
        felt(ForceGuard(ZERO, LIMITS, 25.0, 5.0), hit, seconds=0.12)
    with pytest.raises(Stopped, match=r"51\.0 N, limit 25 N"):
        felt(ForceGuard(ZERO, LIMITS, 25.0, 5.0), (51.0, 0, 0, 0, 0, 0), seconds=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_no_contact_up_to_what_the_limit_allows(seed: int) -> None:
    """Twenty minutes of white noise as large as the zeroing lets pass."""
    rng = np.random.default_rng(seed)
    noise = LIMITS.contact_force_n / needed_contact_n(1.0)
    assert noise >= 2.0
    guard = ForceGuard(ZERO, LIMITS, 20.0, LIMITS.contact_force_n)
    wrenches = rng.normal(0.0, noise, (60_000, 6)) * [1, 1, 1, 0.05, 0.05, 0.05]
    for k, wrench in enumerate(wrenches):
        guard.check(replace(REST, time_s=0.02 * k, force=tuple(wrench)))


def test_lag_along_the_path_is_allowed_and_straying_is_not() -> None:
    trail = [np.array([0.4, 0.0, 0.3 + 0.01 * k]) for k in range(10)]
    check_path(REST, trail, LIMITS)
    with pytest.raises(Stopped, match=r"25\.0 mm off the path, limit 20 mm"):
        check_path(replace(REST, tcp=(0.425, 0, 0.3, 0, 0, 0)), trail, LIMITS)
    with pytest.raises(Stopped, match=r"0\.300 rad from the path's first waypoint"):
        check_start(REST, Waypoint(0.0, (0.3, 0, 0, 0, 0, 0), REST.tcp), LIMITS)


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({}, None),
        ({"safety_mode": 2}, None),
        ({"safety_mode": 3}, ExecutionStatus.PROTECTIVE_STOP),
        ({"safety_mode": 5}, ExecutionStatus.SAFEGUARD_STOP),
        ({"safety_mode": 6}, ExecutionStatus.EMERGENCY_STOP),
        ({"safety_mode": 7}, ExecutionStatus.EMERGENCY_STOP),
        ({"safety_mode": 12}, ExecutionStatus.SAFEGUARD_STOP),
        ({"safety_mode": 77}, ExecutionStatus.PROTECTIVE_STOP),
        ({"safety_bits": 1 << 2}, ExecutionStatus.PROTECTIVE_STOP),
        ({"safety_bits": 1 << 4}, ExecutionStatus.SAFEGUARD_STOP),
        ({"safety_bits": 1 << 7}, ExecutionStatus.EMERGENCY_STOP),
        ({"robot_mode": 3}, ExecutionStatus.PROGRAM_STOPPED),
    ],
)
def test_safety_codes_become_statuses_and_unknown_ones_stop(
    change: dict[str, int], status: ExecutionStatus | None
) -> None:
    found = safety_stop(replace(REST, **change))
    assert (found and found[0]) is status


def test_program_must_play_and_the_slider_be_above_zero() -> None:
    assert program_stop(REST) is None
    for change in ({"runtime_state": 1}, {"runtime_state": 4}, {"speed_scaling": 0.0}):
        found = program_stop(replace(REST, **change))
        assert found is not None and found[0] is ExecutionStatus.PROGRAM_STOPPED


def test_states_with_holes_or_numbers_that_are_not_finite_are_no_states() -> None:
    whole = asdict(REST)
    assert parse_state(whole) == REST
    broken: list[tuple[str, object]] = [
        ("q", []),
        ("tcp", [0.0] * 5),
        ("qd", [math.nan] * 6),
        ("time_s", math.inf),
        ("payload_kg", None),
        ("digital_outputs", None),
        ("robot_mode", "running"),
    ]
    for name, value in broken:
        with pytest.raises(Stopped) as stop:
            parse_state({**whole, name: value})
        assert stop.value.status is ExecutionStatus.CONNECTION_LOST
    for name in whole:
        with pytest.raises(Stopped):
            parse_state({k: v for k, v in whole.items() if k != name})


@pytest.mark.skipif(not hasattr(os, "sched_getscheduler"), reason="this system has one scheduler for all")
def test_the_scheduler_prefers_this_process_only_as_long_as_it_is_asked_to() -> None:
    """An arm is watched on a clock; afterwards the process is scheduled as before."""
    before = os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)
    with preferred():
        policy, nice = os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)
        # Real-time where that is allowed, niceness where only that is, and as before where nothing is.
        assert policy == os.SCHED_RR or nice == NICE or (policy, nice) == before
    assert (os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)) == before
