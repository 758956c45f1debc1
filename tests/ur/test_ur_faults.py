"""Faults at several moments of a build: motion ends, the status says which and where, the journal stays readable."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from ur_cell import SERIAL, fake_controller, loopback, small_plan, undisturbed, written

from mocca_robot.errors import InputError
from mocca_robot.plan.executor import execute
from mocca_robot.plan.journal import Journal, next_step, read_journal
from mocca_robot.plan.status import ExecutionStatus as Status
from mocca_robot.ur.driver import UrArm
from mocca_robot.ur.fake.controller import ask

PLANS = {"full": small_plan(1), "short": small_plan(1, short=True)}

CASES = [
    # plan, fault, moment, status, kind of move, words of the detail, whether standstill can be measured
    ("full", "connection_dropped", "servo:1:0.5", Status.CONNECTION_LOST, "transit", "watchdog has to stop it", False),
    ("short", "connection_dropped", "force:1:0.3", Status.CONNECTION_LOST, "insert", "watchdog has to stop it", False),
    ("full", "connection_blip", "servo:1:0.5", Status.CONNECTION_LOST, "transit", "", True),
    ("short", "connection_blip", "force:1:0.3", Status.CONNECTION_LOST, "insert", "", True),
    ("full", "rtde_silent", "servo:1:0.5", Status.CONNECTION_LOST, "transit", "its program has stopped", False),
    ("short", "rtde_silent", "grip:2", Status.CONNECTION_LOST, "pick", "its program has stopped", False),
    ("full", "nan", "servo:2:0.3", Status.CONNECTION_LOST, "approach", "not finite", False),
    ("full", "stale", "servo:1:0.3", Status.CONNECTION_LOST, "transit", "ms old, limit 100 ms", False),
    ("full", "protective_stop", "servo:1:0.5", Status.PROTECTIVE_STOP, "transit", "protective stop", True),
    ("short", "protective_stop", "force:1:0.3", Status.PROTECTIVE_STOP, "insert", "depth", True),
    ("full", "emergency_stop", "servo:3:0.2", Status.EMERGENCY_STOP, "pick", "emergency stop", True),
    ("short", "emergency_stop", "force:1:0.3", Status.EMERGENCY_STOP, "insert", "emergency stop", True),
    ("full", "safeguard_stop", "servo:1:0.5", Status.SAFEGUARD_STOP, "transit", "safeguard stop", True),
    ("short", "safeguard_stop", "grip:2", Status.SAFEGUARD_STOP, "pick", "safeguard stop", True),
    ("full", "program_stopped", "servo:1:0.5", Status.PROGRAM_STOPPED, "transit", "the program is stopped", True),
    ("short", "program_stopped", "force:1:0.2", Status.PROGRAM_STOPPED, "insert", "the program is stopped", True),
    ("full", "other_program", "servo:1:0.5", Status.DEVIATED, "transit", "the arm does not follow", True),
    ("short", "slider_zero", "force:1:0.3", Status.PROGRAM_STOPPED, "insert", "speed slider is at 0 %", True),
    ("full", "slider_zero", "servo:1:0.5", Status.PROGRAM_STOPPED, "transit", "speed slider is at 0 %", True),
    ("short", "other_program", "force:1:0.2", Status.DEVIATED, "insert", "neither moves nor presses", True),
    ("full", "stuck", "servo:1:0.3", Status.DEVIATED, "transit", "the arm does not follow", True),
    ("full", "stuck", "servo:2:0.1", Status.DEVIATED, "approach", "the arm does not follow", True),
    ("full", "contact", "servo:2:0.3", Status.CONTACT, "approach", "contact at 5 N", True),
    ("full", "force", "servo:4:0.1", Status.FORCE_LIMIT, "lift", "30.0 N, limit 20 N", True),
    ("short", "force", "force:1:0.2", Status.FORCE_LIMIT, "insert", "limit 20 N", True),
    ("short", "jam", "force:1:0.2", Status.JAMMED, "insert", "10.0 N", True),
    ("full", "fingers_stuck", "any", Status.DEVIATED, "transit", "stand at 85.0 mm, commanded 50.0 mm", None),
    ("full", "part_missing", "servo:1", Status.DEVIATED, "pick", "part missing: the fingers closed to 28", None),
]


@pytest.mark.parametrize(("which", "fault", "moment", "status", "kind", "words", "observed"), CASES)
@undisturbed
def test_fault_ends_the_motion_and_is_named(
    which: str, fault: str, moment: str, status: Status, kind: str, words: str, observed: bool | None, tmp_path: Path
) -> None:
    plan = PLANS[which]
    plan_file = written(plan, tmp_path)
    with fake_controller(plan_file, loopback(10), "--fault", f"{fault}@{moment}") as host:
        with UrArm(host, plan, SERIAL) as arm, Journal.create(tmp_path / "j", plan, arm.name) as journal:
            result = execute(plan, arm, journal)
        end = time.monotonic() + 5.0
        while (truth := ask(host))["speed_rad_s"] > 0 or (truth["program_running"] and truth["mode"] != "idle"):
            assert time.monotonic() < end, truth
            time.sleep(0.02)
    assert result.status is status, result.detail
    assert words in result.detail
    assert result.steps_finished == 0
    stopped = result.events[-2]
    assert (stopped.event, stopped.kind, stopped.part) == ("move_stopped", kind, "p01")
    assert stopped.stop_observed is observed
    assert stopped.tcp is not None and stopped.robot_time_s is not None
    record = read_journal(tmp_path / "j")
    assert record.truncated is None and record.unfinished == 0
    assert [e["event"] for e in record.events] == [e.event for e in result.events]
    assert "unlock requested" not in truth["log"]
    assert truth["begun"].get("force", 0) <= 3  # one push and two retries


MOMENTS = {
    "approach": "servo:1:0.1",
    "insert": "force:1:0.3",
    "release": "grip:3",
    "retreat": "servo:2:0.1",
    "transit": "servo:3:0.3",
}
EVERYWHERE = {
    "connection_dropped": {Status.CONNECTION_LOST},
    "rtde_silent": {Status.CONNECTION_LOST},
    "nan": {Status.CONNECTION_LOST},
    "stale": {Status.CONNECTION_LOST},
    "protective_stop": {Status.PROTECTIVE_STOP},
    "emergency_stop": {Status.EMERGENCY_STOP},
    "safeguard_stop": {Status.SAFEGUARD_STOP},
    "program_stopped": {Status.PROGRAM_STOPPED},
    "slider_zero": {Status.PROGRAM_STOPPED},
    # Nothing tells a client that the program is no longer its own; the arm that does not obey does.
    "other_program": {Status.DEVIATED, Status.TIMED_OUT, Status.PROGRAM_STOPPED, Status.CONNECTION_LOST, Status.JAMMED},
    "force": {Status.FORCE_LIMIT, Status.REFUSED},
}


@pytest.mark.long
@pytest.mark.parametrize("kind", MOMENTS)
@pytest.mark.parametrize("fault", EVERYWHERE)
@undisturbed
def test_every_fault_at_every_moment(fault: str, kind: str, tmp_path: Path) -> None:
    """Motion ends, status and journal say which and where, and nothing is repeated without a person's word."""
    plan = PLANS["short"]
    plan_file = written(plan, tmp_path)
    with fake_controller(plan_file, loopback(12), "--fault", f"{fault}@{MOMENTS[kind]}") as host:
        with UrArm(host, plan, SERIAL) as arm, Journal.create(tmp_path / "j", plan, arm.name) as journal:
            result = execute(plan, arm, journal)
        end = time.monotonic() + 5.0
        while (truth := ask(host))["speed_rad_s"] > 0 or (truth["program_running"] and truth["mode"] != "idle"):
            assert time.monotonic() < end, truth
            time.sleep(0.02)
    assert result.status in EVERYWHERE[fault], f"{result.status}: {result.detail}"
    stopped = result.events[-2]
    # A hand that stands still feels nothing move: what hits it there is noticed by the move that follows.
    assert stopped.event == "move_stopped" and stopped.kind in (kind, "retreat" if kind == "release" else kind)
    assert result.detail and stopped.robot_time_s is not None
    record = read_journal(tmp_path / "j")
    assert record.truncated is None and (record.finished, record.unfinished) == ((), 0)
    with pytest.raises(InputError, match=r"Step 0 \(p01\) was begun and not finished"):
        next_step(record, plan, None)
    assert "unlock requested" not in truth["log"]
