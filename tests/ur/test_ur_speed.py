"""The speed slider and `--speed`: a build takes longer, and neither a deadline nor a jam comes of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from ur_cell import SERIAL, fake_controller, loopback, run, small_plan, undisturbed, written

from mocca_robot.plan.executor import execute
from mocca_robot.plan.journal import Journal, read_journal
from mocca_robot.plan.status import ExecutionStatus
from mocca_robot.ur.driver import UrArm
from mocca_robot.ur.fake.controller import ask

ONE = small_plan(1, short=True)
LONG = pytest.mark.long


@pytest.mark.parametrize(
    ("slider", "speed"),
    [(0.5, 1.0), pytest.param(0.1, 1.0, marks=LONG), (1.0, 0.2), pytest.param(0.5, 0.4, marks=LONG)],
)
@undisturbed
def test_a_slower_build_is_a_longer_build(slider: float, speed: float, tmp_path: Path) -> None:
    plan_file = written(ONE, tmp_path)
    with fake_controller(plan_file, loopback(70), "--slider", str(slider)) as host:
        done = run("execute", plan_file, "--robot", host, "--confirm", SERIAL, "--speed", speed, "--json")
        truth = ask(host)
    assert done.returncode == 0, done.stdout + done.stderr
    events = read_journal(Path(json.loads(done.stdout)["journal"])).events
    assert f"speed slider at {slider:.0%}" in events[0]["detail"]
    moving = sum(m.path[-1].t for m in ONE.steps[0].moves)
    took = events[-1]["robot_time_s"] - events[0]["robot_time_s"]
    assert took > 0.9 * moving / (slider * speed)
    assert truth["begun"]["force"] == 1


@pytest.mark.parametrize("slider", [pytest.param(0.25, marks=LONG), 1.0])
@undisturbed
def test_a_real_jam_is_seen_at_any_speed(slider: float, tmp_path: Path) -> None:
    """The arm presses with no more than it was told to, and a third of a second of that is enough."""
    plan_file = written(ONE, tmp_path)
    options = ("--slider", str(slider), "--speedup", "1", "--fault", "jam@force:1:1.0")
    with (
        fake_controller(plan_file, loopback(71), *options) as host,
        UrArm(host, ONE, SERIAL) as arm,
        Journal.create(tmp_path / "j", ONE, arm.name) as journal,
    ):
        result = execute(ONE, arm, journal)
    assert result.status is ExecutionStatus.JAMMED and "10.0 N for 0.2" in result.detail
    first = next(e for e in result.events if e.event == "attempt_failed")
    assert "10.0 N for 0.2" in first.detail


def test_a_speed_that_is_none_is_refused(tmp_path: Path) -> None:
    plan_file = written(ONE, tmp_path)
    for wrong in ("0", "1.5", "-1", "nan"):
        done = run("execute", plan_file, "--speed", wrong)
        assert done.returncode == 2 and "give a share of the planned speeds from 0.01 to 1" in done.stderr
