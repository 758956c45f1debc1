"""What an operator asks for on the way: some parts only, one move at a time, a pause."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ur_cell import SERIAL, command, environment, fake_controller, loopback, run, small_plan, undisturbed, written

from mocca_robot.plan.journal import read_journal
from mocca_robot.ur.fake.controller import ask

ONE, TWO = small_plan(1, short=True), small_plan(2, short=True)


def told(words: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Return a finished command that was told `words` on its input."""
    return subprocess.run(
        command(*arguments), env=environment(), input=words, capture_output=True, text=True, timeout=90
    )


@undisturbed
def test_some_parts_now_and_the_others_another_time(tmp_path: Path) -> None:
    plan_file = written(TWO, tmp_path)
    with fake_controller(plan_file, loopback(110)) as host:
        robot = ("--robot", host, "--confirm", SERIAL)
        first = run("execute", plan_file, *robot, "--parts", "..p01")
        assert first.returncode == 0, first.stdout + first.stderr
        journal = plan_file.with_suffix(".journal.jsonl")
        assert read_journal(journal).finished == (0,) and ask(host)["begun"]["force"] == 1
        wrong = run("execute", "--resume", journal, *robot, "--parts", "p01..p02")
        assert wrong.returncode == 2 and "the journal goes on with p02" in wrong.stderr
        second = run("execute", "--resume", journal, *robot)
        assert second.returncode == 0, second.stdout + second.stderr
        assert read_journal(journal).finished == (0, 1) and ask(host)["begun"]["force"] == 2


@pytest.mark.parametrize(("answer", "code", "forces"), [("yes\n", 0, 1), ("no\n", 2, 0)])
@undisturbed
def test_beginning_further_on_needs_a_word_that_the_rest_stands(
    answer: str, code: int, forces: int, tmp_path: Path
) -> None:
    plan_file = written(TWO, tmp_path)
    with fake_controller(plan_file, loopback(111)) as host:
        ask(host, q=list(TWO.steps[1].moves[0].path[0].q))
        done = told(answer, "execute", plan_file, "--robot", host, "--confirm", SERIAL, "--parts", "p02")
        truth = ask(host)
    assert done.returncode == code, done.stdout + done.stderr
    assert "p01 has to stand, and nothing else. Is it so?" in done.stdout
    assert truth["begun"].get("force", 0) == forces
    journal = plan_file.with_suffix(".journal.jsonl")
    assert read_journal(journal).finished == (0, 1) if code == 0 else not journal.exists()


def test_parts_that_are_none_are_named(tmp_path: Path) -> None:
    plan_file = written(TWO, tmp_path)
    for text, words in (("p03", "did you mean"), ("p02..p01", "comes after p01"), ("..q", "--parts names 'q'")):
        done = run("execute", plan_file, "--parts", text)
        assert done.returncode == 2 and words in done.stderr
    dry = run("execute", plan_file, "--parts", "..p01")
    assert dry.returncode == 0 and "step 0 (p01)" in dry.stdout and "step 1 (p02)" not in dry.stdout


@pytest.mark.parametrize("moves", [len(ONE.steps[0].moves), 2])
@undisturbed
def test_step_by_step_every_move_is_confirmed(moves: int, tmp_path: Path) -> None:
    plan_file = written(ONE, tmp_path)
    kinds = [str(m.kind) for m in ONE.steps[0].moves]
    answers = "yes\n" * moves + "no\n"
    with fake_controller(plan_file, loopback(112)) as host:
        done = told(answers, "execute", plan_file, "--robot", host, "--confirm", SERIAL, "--step")
        truth = ask(host)
    whole = moves == len(kinds)
    assert done.returncode == (0 if whole else 1), done.stdout + done.stderr
    asked = [p.split(": ")[1].split(" ")[0] for p in truth["popups"]]
    assert asked == kinds[: moves + 1]
    events = read_journal(plan_file.with_suffix(".journal.jsonl")).events
    assert [e["kind"] for e in events if e["event"] == "move_started"] == kinds[:moves]


def until(host: str, seconds: float, condition: Callable[[dict[str, Any]], bool]) -> None:
    """Wait until a condition has held for so long."""
    end, since = time.monotonic() + 30.0, None
    while since is None or time.monotonic() - since < seconds:
        truth = ask(host)
        since = (since or time.monotonic()) if condition(truth) else None
        assert time.monotonic() < end, truth
        time.sleep(0.02)


@undisturbed
def test_a_pause_holds_the_arm_under_supervision_and_it_goes_on(tmp_path: Path) -> None:
    plan = small_plan(1)
    plan_file = written(plan, tmp_path)
    with fake_controller(plan_file, loopback(113), "--speedup", "1") as host:
        process = subprocess.Popen(
            command("execute", plan_file, "--robot", host, "--confirm", SERIAL),
            env=environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert process.stdin is not None
        until(host, 0.0, lambda t: t["mode"] == "servo" and t["speed_rad_s"] > 0.02)
        process.stdin.write("p\n")
        process.stdin.flush()
        until(host, 1.0, lambda t: t["mode"] == "servo" and t["speed_rad_s"] < 1e-3 and t["program_running"])
        assert process.poll() is None
        process.stdin.write("c\n")
        process.stdin.flush()
        out, said = process.communicate(timeout=90)
    assert process.returncode == 0, out + said
    assert "pausing; type c to continue" in out and "going on" in out
