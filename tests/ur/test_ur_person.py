"""Where something has to hold a part, or nothing measures a grip, a person is asked: on terminal and pendant."""

from __future__ import annotations

import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest
from ur_cell import SERIAL, command, environment, fake_controller, loopback, small_plan, undisturbed, written

from mocca_robot.plan.executor import execute
from mocca_robot.plan.journal import Journal, read_journal
from mocca_robot.plan.person import Everybody
from mocca_robot.plan.plan import Plan
from mocca_robot.plan.status import ExecutionStatus
from mocca_robot.ur.driver import UrArm
from mocca_robot.ur.fake.controller import ask

ONE = small_plan(1, short=True)
SUPPORTED = replace(ONE, supports=("p01",))
BARE_TOOL = replace(ONE, gripper="none")


def building(plan_file: Path, host: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command("execute", plan_file, "--robot", host, "--confirm", SERIAL),
        env=environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def popup(host: str, process: subprocess.Popen[str]) -> dict[str, object]:
    """Return the fake's true state once it shows a popup."""
    end = time.monotonic() + 30.0
    while not (truth := ask(host))["popup"]:
        assert time.monotonic() < end and process.poll() is None, process.communicate()
        time.sleep(0.02)
    return truth


@pytest.mark.parametrize(("answer", "code"), [("what?\nyes\n", 0), ("no\n", 1), ("", 1)])
@undisturbed
def test_a_part_that_needs_holding_is_let_go_only_when_somebody_says_so(answer: str, code: int, tmp_path: Path) -> None:
    plan_file = written(SUPPORTED, tmp_path)
    with fake_controller(plan_file, loopback(90)) as host:
        process = building(plan_file, host)
        truth = popup(host, process)
        assert "p01 is about to be let go" in str(truth["popup"]) and truth["gripper_m"] == pytest.approx(0.03)
        time.sleep(0.3)
        waiting = ask(host)
        assert waiting["speed_rad_s"] == 0.0 and waiting["begun"] == truth["begun"] and process.poll() is None
        out, said = process.communicate(answer, timeout=60)
        after = ask(host)
    assert process.returncode == code, out + said
    assert "you will be asked, here and on the pendant, about: p01" in out and "Is it held?" in out
    assert after["popup"] == "" and (after["gripper_m"] > 0.04) == (code == 0)
    events = read_journal(plan_file.with_suffix(".journal.jsonl")).events
    confirmed = [e["kind"] for e in events if e["event"] == "confirmed"]
    assert confirmed == (["release"] if code == 0 else [])
    if code:
        assert events[-1]["status"] == "cancelled" and "nobody confirmed" in events[-1]["detail"]


@undisturbed
def test_a_tool_that_senses_nothing_asks_after_every_grip(tmp_path: Path) -> None:
    plan_file = written(BARE_TOOL, tmp_path)
    with fake_controller(plan_file, loopback(91)) as host:
        process = building(plan_file, host)
        out, said = process.communicate("yes\nyes\n", timeout=60)
        truth = ask(host)
    assert process.returncode == 0, out + said
    assert truth["popups"] == [
        "This tool senses nothing. Is p01 firmly held by it?",
        "This tool senses nothing. Has it let go of p01?",
    ]


@pytest.mark.parametrize("plan", [SUPPORTED, BARE_TOOL], ids=["supported", "bare tool"])
@undisturbed
def test_without_a_person_such_a_build_ends_where_one_is_needed(plan: Plan, tmp_path: Path) -> None:
    plan_file = written(plan, tmp_path)
    with fake_controller(plan_file, loopback(92)) as host:
        with UrArm(host, plan, SERIAL) as arm, Journal.create(tmp_path / "j", plan, arm.name) as journal:
            result = execute(plan, arm, journal)
        truth = ask(host)
    assert result.status is ExecutionStatus.CANCELLED and "nobody confirmed" in result.detail
    assert result.last.stop_observed is True and not truth["program_running"]


@undisturbed
def test_the_arm_is_watched_while_a_person_thinks(tmp_path: Path) -> None:
    plan_file = written(SUPPORTED, tmp_path)
    with fake_controller(plan_file, loopback(93)) as host:
        process = building(plan_file, host)
        popup(host, process)
        ask(host, fault="protective_stop")
        assert process.stdout is not None
        out = process.stdout.read()  # its input stays open: nobody answers
        process.communicate(timeout=60)
    assert process.returncode == 1 and "protective_stop at step 0 (p01)" in out


def test_a_simulation_is_told_that_supports_are_there() -> None:
    assert Everybody().answer() is True
