"""The insertion skill against an arm that does what it is told: retries stay in the cone, back out, and end."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from ur_cell import MODEL, REST, TOOL, small_plan

from mocca_robot.arrays import Array
from mocca_robot.plan.gripper import Grip
from mocca_robot.plan.insertion_skill import insert, search_starts
from mocca_robot.plan.plan import MoveKind, Plan, Waypoint, insertion_axis
from mocca_robot.plan.pose import Three, six
from mocca_robot.plan.status import ArmState, ExecutionStatus, MotionOutcome

PLAN = small_plan(1)
STEP = PLAN.steps[0]
MOVE = next(m for m in STEP.moves if m.kind is MoveKind.INSERT)
LIMITS = PLAN.cell.limits


def state_at(tcp: Sequence[float]) -> ArmState:
    return replace(REST, tcp=six(tcp))


class Told:
    """An arm whose pushes end as `outcomes` say, one after the other; it keeps what it was told."""

    name = "told"

    def __init__(self, *outcomes: MotionOutcome) -> None:
        self.outcomes = list(outcomes)
        self.pushes: list[tuple[Array, float]] = []
        self.ways: list[Sequence[Waypoint]] = []
        self.zeroed = 0

    def preflight(self, plan: Plan, first_step: int) -> MotionOutcome:
        return MotionOutcome(ExecutionStatus.SUCCEEDED)

    def set_payload(self, mass_kg: float, cog_m: Three) -> MotionOutcome:
        return MotionOutcome(ExecutionStatus.SUCCEEDED)

    def zero_force(self) -> MotionOutcome:
        self.zeroed += 1
        return MotionOutcome(ExecutionStatus.SUCCEEDED, "", state_at(self.ways[-1][-1].tcp))

    def follow(self, path: Sequence[Waypoint], *, force_limit_n: float, contact_force_n: float | None) -> MotionOutcome:
        self.ways.append(path)
        return MotionOutcome(ExecutionStatus.SUCCEEDED)

    def push(self, axis: Array, depth_m: float, *, force_limit_n: float) -> MotionOutcome:
        self.pushes.append((axis, depth_m))
        return self.outcomes.pop(0)

    def grip(self, width_m: float, force_n: float) -> tuple[MotionOutcome, Grip]:
        return MotionOutcome(ExecutionStatus.SUCCEEDED), Grip(None, None)

    def stop(self) -> bool:
        return True


def jam(depth_m: float) -> MotionOutcome:
    return MotionOutcome(ExecutionStatus.JAMMED, depth_m=depth_m)


def silent(*_: object) -> None:
    """Take no notes."""


def test_a_jam_is_left_the_way_it_came_and_the_next_push_runs_elsewhere_in_the_cone() -> None:
    arm = Told(jam(0.004), MotionOutcome(ExecutionStatus.SUCCEEDED, depth_m=0.008))
    outcome = insert(arm, STEP, MOVE, LIMITS, silent, state_at(MOVE.path[0].tcp))
    assert outcome.succeeded and arm.zeroed == 1
    (first, _), (second, depth) = arm.pushes
    assert STEP.direction is not None
    axis, length = insertion_axis(MOVE.alternatives[0])
    assert np.allclose(second, axis) and depth == pytest.approx(length)
    for tried in (first, second):
        assert np.arccos(min(1.0, float(tried @ STEP.direction))) <= STEP.alpha_rad
    back, across = arm.ways
    # Backwards along the line that was pushed, to its very start, and only then to the other start.
    heights = [(np.array(w.tcp[:3]) - MOVE.path[0].tcp[:3]) @ first for w in back]
    assert heights[0] == pytest.approx(0.004, abs=1e-4) and heights[-1] == pytest.approx(0.0, abs=1e-6)
    assert all(a >= b for a, b in itertools.pairwise(heights))
    assert across[-1].tcp == pytest.approx(MOVE.alternatives[0][0].tcp, abs=1e-6)


def test_jams_end_after_the_retries_that_are_allowed() -> None:
    arm = Told(*[jam(0.002)] * 3)
    outcome = insert(arm, STEP, MOVE, LIMITS, silent)
    assert outcome.status is ExecutionStatus.JAMMED and len(arm.pushes) == 1 + LIMITS.retries
    once = Told(jam(0.002))
    insert(once, STEP, MOVE, replace(LIMITS, retries=0), silent)
    assert once.ways == []


@pytest.mark.parametrize("status", [ExecutionStatus.FORCE_LIMIT, ExecutionStatus.PROTECTIVE_STOP])
def test_whatever_is_no_jam_is_never_tried_again(status: ExecutionStatus) -> None:
    arm = Told(MotionOutcome(status))
    assert insert(arm, STEP, MOVE, LIMITS, silent).status is status
    assert len(arm.pushes) == 1 and arm.ways == []


@pytest.mark.parametrize("ahead", [-1e-3, 0.0, 1e-3])
def test_a_push_ends_at_the_planned_place_wherever_the_arm_stands(ahead: float) -> None:
    axis, length = insertion_axis(MOVE.path)
    start = np.array(MOVE.path[0].tcp)
    start[:3] += ahead * axis
    arm = Told(MotionOutcome(ExecutionStatus.SUCCEEDED, depth_m=length - ahead))
    outcome = insert(arm, STEP, MOVE, LIMITS, silent, state_at(start.tolist()))
    assert arm.pushes[0][1] == pytest.approx(length - ahead)
    assert outcome.depth_m == pytest.approx(length)


def test_a_mouth_that_is_missed_is_searched_beside_it_before_the_retries() -> None:
    searching = replace(LIMITS, search_tries=3)
    starts = search_starts(MOVE, searching)
    axis, _ = insertion_axis(MOVE.path)
    asides = []
    for start in starts:
        gap = np.subtract(start.tcp[:3], MOVE.path[0].tcp[:3])
        asides.append(gap - (gap @ axis) * axis)
        place = MODEL.tcp_pose(start.q, TOOL)
        assert np.linalg.norm(np.subtract(place[:3], start.tcp[:3])) < 2e-5  # joints and pose are one place
    sizes = [float(np.linalg.norm(a)) for a in asides]
    assert min(sizes) > 0 and max(sizes) < LIMITS.sideways_tolerance_m and sizes == sorted(sizes)
    assert float(asides[0] @ asides[1]) < 0.0  # both sides
    arm = Told(*[jam(1e-4)] * 3, MotionOutcome(ExecutionStatus.SUCCEEDED, depth_m=0.008))
    assert insert(arm, STEP, MOVE, searching, silent, state_at(MOVE.path[0].tcp)).succeeded
    ends = [way[-1].tcp for way in arm.ways[1::2]]
    assert ends == [pytest.approx(s.tcp, abs=1e-6) for s in starts[:3]]
    assert all(np.allclose(pushed, axis) for pushed, _ in arm.pushes)
    # What jams deep inside is no mouth that was missed; and searching ends.
    deep = Told(*[jam(0.004)] * 3)
    insert(deep, STEP, MOVE, searching, silent)
    assert len(deep.pushes) == 1 + LIMITS.retries
    never = Told(*[jam(1e-4)] * 6)
    assert insert(never, STEP, MOVE, searching, silent).status is ExecutionStatus.JAMMED
    assert len(never.pushes) == 1 + 3 + LIMITS.retries
