"""An arm as its factory made it: millimetres from its model, and parts end where they belong all the same."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ur_cell import MODEL, SERIAL, fake_controller, loopback, run, small_plan, undisturbed, written

from mocca_robot.plan.calibration import calibrated, difference
from mocca_robot.plan.executor import Execution, execute
from mocca_robot.plan.journal import Journal, read_journal
from mocca_robot.plan.plan import MoveKind, Plan, Waypoint, insertion_axis
from mocca_robot.plan.status import ExecutionStatus
from mocca_robot.ur.driver import UrArm
from mocca_robot.ur.primary import read_calibration

ONE = small_plan(1)
INSERT = next(m for m in ONE.steps[0].moves if m.kind is MoveKind.INSERT)


def aside_mm(tcp: list[float]) -> float:
    """Return how far beside the planned line the hand was when the part was in."""
    axis, _ = insertion_axis(INSERT.path)
    gap = np.subtract(tcp[:3], INSERT.path[-1].tcp[:3])
    return 1e3 * float(np.linalg.norm(gap - (gap @ axis) * axis))


@pytest.mark.parametrize("off", [pytest.param(1.2, marks=pytest.mark.long), 5.0])
@undisturbed
def test_a_part_ends_in_its_place_on_an_arm_that_is_not_as_its_model(off: float, tmp_path: Path) -> None:
    plan_file = written(ONE, tmp_path)
    with fake_controller(plan_file, loopback(100), "--calibration", str(off)) as host:
        read = read_calibration(host)
        done = run("execute", plan_file, "--robot", host, "--confirm", SERIAL, "--json")
    assert read is not None and difference(MODEL, calibrated(MODEL, read))[0] > 0.5e-3 * off
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the plan is fitted to this arm" in done.stderr
    events = read_journal(Path(json.loads(done.stdout)["journal"])).events
    seated = next(e for e in events if e["event"] == "move_finished" and e["kind"] == "insert")
    assert aside_mm(seated["tcp"]) < 0.3
    for e in events:
        if e["event"] == "move_finished":
            place = ONE.steps[e["step"]].moves[e["move"]].path[-1].tcp
            assert math.dist(e["tcp"][:3], place[:3]) < 1.5e-3


def built_as_published(plan: Plan, number: int, folder: Path, *options: str) -> Execution:
    """Return how building `ONE` ended where the fake has the seats of `plan`, without a fit to its calibration."""
    plan_file = written(plan, folder)
    with (
        fake_controller(plan_file, loopback(number), *options) as host,
        UrArm(host, ONE, SERIAL) as arm,
        Journal.create(folder / "j", ONE, arm.name) as journal,
    ):
        return execute(ONE, arm, journal)


def seats_moved(shift: float) -> Plan:
    """Return the plan with its insertions so far aside: what a structure looks like that was pushed."""

    def moved(path: tuple[Waypoint, ...]) -> tuple[Waypoint, ...]:
        return tuple(replace(w, tcp=(w.tcp[0] + shift, *w.tcp[1:])) for w in path)

    step = ONE.steps[0]
    moves = tuple(
        replace(m, path=moved(m.path), alternatives=tuple(map(moved, m.alternatives)))
        if m.kind is MoveKind.INSERT
        else m
        for m in step.moves
    )
    return replace(ONE, steps=(replace(step, moves=moves),))


@pytest.mark.parametrize(("shift", "status"), [(0.0, ExecutionStatus.SUCCEEDED), (0.0016, ExecutionStatus.DEVIATED)])
@undisturbed
def test_a_part_that_is_in_but_beside_its_place_is_not_called_placed(
    shift: float, status: ExecutionStatus, tmp_path: Path
) -> None:
    result = built_as_published(seats_moved(shift), 101, tmp_path)
    assert result.status is status, result.detail
    if shift:
        assert "in by its depth, but" in result.detail and "beside its place, limit 1.00" in result.detail


@undisturbed
def test_an_arm_that_is_too_far_off_is_refused_by_what_it_is(tmp_path: Path) -> None:
    result = built_as_published(ONE, 102, tmp_path, "--calibration", "5")
    assert result.status is ExecutionStatus.REFUSED
    assert "calibration is not the plan's" in result.detail or "move it to joint angles" in result.detail
