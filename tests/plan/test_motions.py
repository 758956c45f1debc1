"""The supervised loop on an arm of a few lines: whatever a command of it meets ends in an outcome, and in a stop."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from ur_cell import CELL, MODEL, REST, TOOL, small_plan

from mocca_robot.arrays import Array
from mocca_robot.plan.gripper import Grip
from mocca_robot.plan.guards import OBEY_RAD
from mocca_robot.plan.motions import LEAD_IN_S, Motions
from mocca_robot.plan.plan import MoveKind, Plan, insertion_axis
from mocca_robot.plan.pose import Six, Three, six
from mocca_robot.plan.status import ArmState, ExecutionStatus, MotionOutcome
from mocca_robot.plan.supervision import Stopped

PLAN = small_plan(1, short=True)
MOVES = {m.kind: m for m in PLAN.steps[0].moves}
INSERT = MOVES[MoveKind.INSERT]
AXIS, DEPTH = insertion_axis(INSERT.path)
CYCLE_S = 0.02
Trouble = Callable[[str, int], None]


def quiet(command: str, count: int) -> None:
    """Let every command pass."""


class Obedient:
    """An arm that is where it was sent; `trouble` hears of every command, with its count, and may raise."""

    name = "obedient"
    limits = CELL.limits

    def __init__(self, trouble: Trouble = quiet, q: Six = MOVES[MoveKind.APPROACH].path[0].q) -> None:
        self.q = np.array(q)
        self.time_s = 0.0
        self.speed_scaling, self.payload_kg, self.reach, self.force = 1.0, 0.0, 1.0, np.zeros(6)
        self._start = np.array(q)
        self.commands: list[str] = []
        self.shown: list[str] = []
        self.halted: list[Stopped] = []
        self.stops = 0
        self._trouble = trouble
        self._goal: Array | None = None
        self._push: tuple[Array, float] | None = None
        self._qd = np.zeros(6)

    def _note(self, command: str) -> None:
        self.commands.append(command)
        self._trouble(command, self.commands.count(command))

    def now(self) -> float:
        return self.time_s

    def preflight(self, plan: Plan, first_step: int) -> MotionOutcome:
        return MotionOutcome(ExecutionStatus.SUCCEEDED)

    def watch(self) -> ArmState:
        self._note("watch")
        return replace(
            REST,
            time_s=self.time_s,
            q=six(self.q),
            qd=six(self._qd),
            tcp=MODEL.tcp_pose(self.q, TOOL),
            force=six(self.force),
            speed_scaling=self.speed_scaling,
            payload_kg=self.payload_kg,
        )

    def attend(self) -> ArmState:
        self._note("attend")
        self.time_s += CYCLE_S
        before = self.q
        if self._goal is not None:
            self.q = self._start + (self._goal - self._start) * self.reach
        if self._push is not None:
            axis, speed = self._push
            pose = np.array(MODEL.tcp_pose(before, TOOL))
            pose[:3] += axis * speed * CYCLE_S
            self.q = np.array(MODEL.solve_pose(pose, before, TOOL))
        self._qd = (self.q - before) / CYCLE_S
        return self.watch()

    def servo(self, q: Array) -> None:
        self._note("servo")
        self._goal = q

    def end_servo(self) -> None:
        self._note("end_servo")
        self._goal = None

    def push_along(self, frame: Six, force_n: float, speed_m_s: float) -> None:
        self._note("push_along")
        self._push = (AXIS, speed_m_s)

    def end_push(self) -> None:
        self._note("end_push")
        self._push = None

    def zero_force(self) -> None:
        self._note("zero_force")

    def set_payload(self, mass_kg: float, cog_m: Three) -> None:
        self._note("set_payload")
        self.payload_kg = mass_kg

    def grip(self, width_m: float, force_n: float) -> Grip:
        self._note("grip")
        return Grip(width_m, True)

    def show(self, text: str) -> None:
        self.shown.append(text)

    def halt(self, stop: Stopped) -> MotionOutcome:
        self.halted.append(stop)
        return MotionOutcome(stop.status, stop.detail, stop.state, stop_observed=self.stop())

    def stop(self) -> bool:
        self.stops += 1
        self._goal = self._push = None
        return True


def follow(motions: Motions) -> MotionOutcome:
    path = MOVES[MoveKind.APPROACH].path
    return motions.follow(path, force_limit_n=20.0, contact_force_n=5.0)


def push(motions: Motions) -> MotionOutcome:
    return motions.push(AXIS, DEPTH, force_limit_n=20.0)


def grip(motions: Motions) -> MotionOutcome:
    return motions.grip(0.02, 20.0)[0]


def carry(motions: Motions) -> MotionOutcome:
    return motions.set_payload(1.2, (0.0, 0.0, 0.05))


MOTIONS = {"follow": follow, "push": push, "grip": grip, "carry": carry, "zero": Motions.zero_force}


def commands_of(motion: Callable[[Motions], MotionOutcome]) -> tuple[tuple[str, int], ...]:
    """Return the first, the middle and the last call of each command that an undisturbed motion gives."""
    arm = Obedient()
    assert motion(Motions(arm)).succeeded and arm.stops == 0
    counts = {name: arm.commands.count(name) for name in arm.commands}
    return tuple((name, n) for name, last in counts.items() for n in sorted({1, (last + 1) // 2, last}))


def failing(command: str, count: int, error: BaseException) -> Trouble:
    def trouble(name: str, n: int) -> None:
        if (name, n) == (command, count):
            raise error

    return trouble


def every_call() -> Iterator[tuple[str, str, int]]:
    for name, motion in MOTIONS.items():
        for command, count in commands_of(motion):
            yield name, command, count


@pytest.mark.parametrize(("name", "command", "count"), list(every_call()))
def test_whatever_stops_a_command_ends_the_motion_with_that_status_and_one_halt(
    name: str, command: str, count: int
) -> None:
    stop = Stopped(ExecutionStatus.SAFEGUARD_STOP, "somebody came near", REST)
    arm = Obedient(failing(command, count, stop))
    outcome = MOTIONS[name](Motions(arm))
    assert outcome.status is ExecutionStatus.SAFEGUARD_STOP and "somebody came near" in outcome.detail
    assert outcome.stop_observed is True and arm.halted == [stop]
    assert arm.commands.count(command) == count  # nothing is commanded after it


@pytest.mark.parametrize(("name", "command", "count"), list(every_call()))
def test_an_error_that_nobody_foresaw_stops_the_arm_and_is_not_hidden(name: str, command: str, count: int) -> None:
    arm = Obedient(failing(command, count, ZeroDivisionError("a bug")))
    with pytest.raises(ZeroDivisionError):
        MOTIONS[name](Motions(arm))
    assert arm.stops == 1


@pytest.mark.parametrize("speed", [0.1, 0.5, 1.0])
def test_a_path_takes_as_much_longer_as_it_is_followed_slower(speed: float) -> None:
    times = {}
    for share in (1.0, speed):
        arm = Obedient()
        outcome = follow(Motions(arm, share))
        assert outcome.succeeded and outcome.waypoint == len(MOVES[MoveKind.APPROACH].path) - 1
        times[share] = arm.time_s
    assert times[speed] == pytest.approx(times[1.0] / speed, rel=0.1)


def test_an_arm_that_does_not_get_there_is_given_up_after_the_paths_end() -> None:
    path = MOVES[MoveKind.TRANSIT].path
    arm = Obedient(q=path[0].q)
    arm.reach = 0.8  # it stays behind, though within reach of the path's trail
    outcome = Motions(arm).follow(path, force_limit_n=20.0, contact_force_n=None)
    last = max(path[-1].t, LEAD_IN_S)
    assert outcome.status is ExecutionStatus.TIMED_OUT
    assert arm.time_s == pytest.approx(last + 2.0, abs=3.0 * CYCLE_S)
    assert outcome.waypoint == len(path) - 1


@pytest.mark.parametrize("late", [3, 10])
def test_a_computer_that_is_late_makes_a_path_longer_and_nothing_else(late: int) -> None:
    """Every cycle takes as much longer as a busy computer makes it: no path is given up for that."""
    path = MOVES[MoveKind.TRANSIT].path
    arm = Obedient(q=path[0].q)
    count = [0]
    attend = arm.attend

    def busy() -> ArmState:
        count[0] += 1
        arm.time_s += late * CYCLE_S * (count[0] % 4 == 0)
        return attend()

    arm.attend = busy  # type: ignore[method-assign]
    outcome = Motions(arm).follow(path, force_limit_n=20.0, contact_force_n=None)
    assert outcome.succeeded, outcome.detail


def test_an_arm_that_does_not_obey_is_noticed_in_a_third_of_a_second() -> None:
    path = MOVES[MoveKind.TRANSIT].path
    arm = Obedient(q=path[0].q)
    arm.reach = 0.0
    outcome = Motions(arm).follow(path, force_limit_n=20.0, contact_force_n=None)
    moving = next(w.t for w in path if np.abs(np.subtract(w.q, path[0].q)).max() > OBEY_RAD)
    assert outcome.status is ExecutionStatus.DEVIATED and "the arm does not follow" in outcome.detail
    assert arm.time_s < moving + 0.35


def test_a_force_that_zeroing_does_not_explain_is_refused_and_a_payload_that_is_not_taken_too() -> None:
    arm = Obedient()
    arm.force = np.array([0.0, 0.0, 6.0, 0.0, 0.0, 0.0])
    refused = Motions(arm).zero_force()
    assert refused.status is ExecutionStatus.REFUSED and "the hand feels 6.0 N" in refused.detail
    deaf = Obedient()
    deaf.set_payload = lambda mass_kg, cog_m: None  # type: ignore[method-assign]
    refused = carry(Motions(deaf))
    assert refused.status is ExecutionStatus.REFUSED and "reads back as 0.000 kg" in refused.detail
