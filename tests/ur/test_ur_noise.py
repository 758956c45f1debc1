"""A force sensor as it is, noisy and drifting: neither is a contact, a jam or a seat, and a contact is still one."""

from __future__ import annotations

from pathlib import Path

import pytest
from ur_cell import SERIAL, fake_controller, loopback, run, small_plan, undisturbed, written

from mocca_robot.plan.executor import Execution, execute
from mocca_robot.plan.journal import Journal
from mocca_robot.plan.plan import Plan
from mocca_robot.plan.status import ExecutionStatus
from mocca_robot.ur.driver import UrArm

SHORT, FULL = small_plan(1, short=True), small_plan(1)


def built(plan: Plan, number: int, folder: Path, *options: str) -> Execution:
    """Return how a build ended at the robot's own pace: the filter goes by its clock."""
    plan_file = written(plan, folder)
    with (
        fake_controller(plan_file, loopback(number), "--speedup", "1", *options) as host,
        UrArm(host, plan, SERIAL) as arm,
        Journal.create(folder / "j", plan, arm.name) as journal,
    ):
        return execute(plan, arm, journal)


@pytest.mark.parametrize("noise", [pytest.param(1.0, marks=pytest.mark.long), 1.5])
@undisturbed
def test_a_noisy_sensor_that_drifts_does_not_stop_a_build(noise: float, tmp_path: Path) -> None:
    result = built(FULL, 80, tmp_path, "--noise", str(noise), "--drift", "3")
    assert result.status is ExecutionStatus.SUCCEEDED, result.detail
    assert not [e for e in result.events if e.event == "attempt_failed"]


@pytest.mark.long
@undisturbed
def test_everything_at_once_is_still_a_build(tmp_path: Path) -> None:
    """Half speed, a noisy sensor that drifts, and an arm that is 3 mm from its model, fitted to its calibration."""
    plan_file = written(FULL, tmp_path)
    options = ("--speedup", "1", "--noise", "1.5", "--drift", "3", "--calibration", "3", "--slider", "0.5")
    with fake_controller(plan_file, loopback(83), *options) as host:
        done = run("execute", plan_file, "--robot", host, "--confirm", SERIAL, "--json")
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.long
@undisturbed
def test_a_contact_is_one_with_noise_too(tmp_path: Path) -> None:
    result = built(FULL, 81, tmp_path, "--noise", "1.5", "--fault", "contact@servo:2:0.1")
    assert result.status is ExecutionStatus.CONTACT and result.events[-2].kind == "approach"


@undisturbed
def test_a_sensor_that_is_too_noisy_is_refused_with_what_to_write(tmp_path: Path) -> None:
    result = built(SHORT, 82, tmp_path, "--noise", "4")
    assert result.status is ExecutionStatus.REFUSED
    assert "noise is" in result.detail and "accepted: WHO, WHY" in result.detail
