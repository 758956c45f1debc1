"""A seat that is 0.6 mm aside, on the fake controller: found by searching, and by nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from ur_cell import SERIAL, fake_controller, loopback, small_plan, undisturbed, written

from mocca_robot.plan.executor import execute
from mocca_robot.plan.journal import Journal
from mocca_robot.plan.status import ExecutionStatus
from mocca_robot.ur.driver import UrArm

ONE = small_plan(1, short=True)


@undisturbed
@pytest.mark.parametrize(
    ("tries", "status", "address"), [(4, ExecutionStatus.SUCCEEDED, 85), (0, ExecutionStatus.JAMMED, 86)]
)
def test_a_mouth_aside_is_found_by_searching_alone(
    tries: int, status: ExecutionStatus, address: int, tmp_path: Path
) -> None:
    plan = replace(ONE, cell=replace(ONE.cell, limits=replace(ONE.cell.limits, search_tries=tries)))
    plan_file = written(plan, tmp_path)
    with (
        fake_controller(plan_file, loopback(address), "--fault", "misplaced") as host,
        UrArm(host, plan, SERIAL) as arm,
        Journal.create(tmp_path / "j", plan, arm.name) as journal,
    ):
        result = execute(plan, arm, journal)
    assert result.status is status, result.detail
    pushes = [e for e in result.events if e.kind == "insert"]
    failed = [e for e in pushes if e.event == "attempt_failed"]
    if tries:
        assert 1 <= len(failed) <= tries
        done = next(e for e in pushes if e.event == "move_finished")
        aside = float(done.detail.split(", ")[1].split(" mm aside")[0])
        assert 0.3 <= aside <= 1.0  # where the seat really is
    else:
        assert len(failed) == plan.cell.limits.retries
