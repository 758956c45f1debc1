"""Plans built end to end by the real ur-rtde client on a fake controller in another process; interruptions; resumes."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ur_cell import CELL, SERIAL, command, environment, fake_controller, loopback, run, small_plan, undisturbed, written

from mocca_robot.cli.build import Signals
from mocca_robot.errors import EnvironmentNeeded, InputError
from mocca_robot.plan.executor import execute
from mocca_robot.plan.journal import Journal, read_journal
from mocca_robot.plan.motions import Motions
from mocca_robot.plan.plan import MoveKind, document
from mocca_robot.plan.status import ExecutionStatus
from mocca_robot.ur.driver import UrArm
from mocca_robot.ur.fake.controller import ask

PLAN = small_plan(2)
ONE = small_plan(1, short=True)
TWO = small_plan(2, short=True)


def wait_for(host: str, condition: Callable[[dict[str, object]], bool], seconds: float = 20.0) -> dict[str, object]:
    """Return the fake's true state once `condition` holds; fail if it never does."""
    end = time.monotonic() + seconds
    while not condition(truth := ask(host)):
        assert time.monotonic() < end, truth
        time.sleep(0.02)
    return truth


def start(*arguments: object) -> subprocess.Popen[str]:
    """Start a robot command in a session of its own."""
    return subprocess.Popen(
        command(*arguments),
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def put_back(host: str, step: int) -> None:
    """Do what a person does before a step is repeated: arm to its first waypoint, gripper open, stops cleared."""
    ask(host, restore=True)
    ask(host, q=list(TWO.steps[step].moves[0].path[0].q))
    ask(host, gripper_m=0.085)


@undisturbed
def test_two_parts_are_built_and_every_motion_is_in_the_journal(tmp_path: Path) -> None:
    plan_file = written(PLAN, tmp_path)
    with fake_controller(plan_file, loopback(0)) as host:
        done = run("execute", plan_file, "--robot", host, "--confirm", "bench", "--json")
        assert done.returncode == 0, done.stderr
        truth = ask(host)
    result = json.loads(done.stdout)
    assert (result["status"], result["steps_finished"]) == ("succeeded", 2)
    record = read_journal(Path(result["journal"]))
    assert (record.finished, record.unfinished, record.robot) == ((0, 1), None, SERIAL)
    finished = [e for e in record.events if e["event"] == "move_finished"]
    planned = [(i, str(m.kind)) for i, s in enumerate(PLAN.steps) for m in s.moves]
    assert [(e["step"], e["kind"]) for e in finished] == planned
    for e in finished:
        move = PLAN.steps[e["step"]].moves[e["move"]]
        assert math.dist(e["tcp"][:3], move.path[-1].tcp[:3]) < 3e-3
        if move.kind is MoveKind.INSERT:
            assert e["depth_m"] == pytest.approx(0.008, abs=CELL.limits.depth_tolerance_m)
        if move.kind is MoveKind.PICK:
            assert e["width_m"] == pytest.approx(0.03, abs=1e-3)
    assert not truth["program_running"] and truth["gripper_m"] == pytest.approx(0.05, abs=1e-3)
    assert truth["payload_kg"] == CELL.tool_mass_kg


@undisturbed
def test_real_time_motion_stays_below_the_speed_cap(tmp_path: Path) -> None:
    """At the robot's own pace the fake's servo adds nothing: what it measures is what the driver commands."""
    one_file = written(ONE, tmp_path)
    with fake_controller(one_file, loopback(1), "--speedup", "1") as host:
        with UrArm(host, ONE, SERIAL) as arm:
            assert arm.preflight(ONE, 0).succeeded
            ask(host, q=list(ONE.steps[0].moves[-1].path[0].q))
            motions = Motions(arm)
            assert motions.zero_force().succeeded
            outcome = motions.follow(ONE.steps[0].moves[-1].path, force_limit_n=20.0, contact_force_n=None)
        assert outcome.status is ExecutionStatus.SUCCEEDED
        # The path peaks at 0.09 m/s; cycles of uneven length show as unevenness, never as catching up.
        assert 0.05 < ask(host)["largest_speed_m_s"] < 1.5 * CELL.limits.transfer_speed_m_s


def test_dry_run_is_the_default_and_needs_no_robot(tmp_path: Path) -> None:
    plan_file = written(PLAN, tmp_path)
    done = run("execute", plan_file)
    assert done.returncode == 0
    assert "nothing is sent to a robot" in done.stdout and "p02), move 6: insert, alternative 0" in done.stdout


def test_unsafe_plan_gives_a_dry_run_with_reasons_and_is_never_sent(tmp_path: Path) -> None:
    raw = document(PLAN)
    raw["steps"][1]["moves"][3]["speed_m_s"] = 0.5
    (tmp_path / "fast.json").write_text(json.dumps(raw))
    dry = run("execute", tmp_path / "fast.json", "--json")
    assert dry.returncode == 1
    assert json.loads(dry.stdout)["findings"][0]["where"] == "step 1 (p02), move 3 (lift)"
    sent = run("execute", tmp_path / "fast.json", "--robot", "127.0.0.1", "--confirm", SERIAL)
    assert sent.returncode == 2 and "speed_m_s is 0.5, limit 0 to 0.05" in sent.stderr
    with pytest.raises(InputError, match=r"speed_m_s is 0\.5"), UrArm("127.0.0.1", plan_of(raw), SERIAL):
        pass


def plan_of(raw: dict[str, object]):  # type: ignore[no-untyped-def]
    from mocca_robot.plan.reader import plan_from_document

    return plan_from_document(raw)


def test_robot_without_its_name_or_name_without_robot_is_refused(tmp_path: Path) -> None:
    plan_file = written(PLAN, tmp_path)
    assert "--confirm" in run("execute", plan_file, "--robot", "127.0.0.1").stderr
    assert "--robot does not say where" in run("execute", plan_file, "--confirm", SERIAL).stderr


def test_unreachable_host_is_named_with_its_port(tmp_path: Path) -> None:
    plan_file = written(PLAN, tmp_path)
    done = run("execute", plan_file, "--robot", loopback(9), "--confirm", SERIAL)
    assert done.returncode == 2
    assert f"No robot answers at {loopback(9)}, port 29999" in done.stderr
    assert not plan_file.with_suffix(".journal.jsonl").exists()


def test_missing_client_library_is_named_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    from mocca_robot.ur import link

    monkeypatch.setattr(link.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(EnvironmentNeeded, match=r"pip install 'mocca-robot\[robot\]'"):
        link.ChildLink("eyes", "127.0.0.1", 1.0)


@pytest.mark.parametrize(
    ("options", "confirm", "words"),
    [
        ((), "99999", "has serial number 20265500042"),
        (("--serial", "777"), "777", "is for the cell 'bench' with robot 20265500042"),
        (("--serial", "777"), "bench", "the cell's name counts only when"),
        (("--fault", "local_control"), SERIAL, "switch the pendant to remote control"),
        (("--fault", "protective_stop"), SERIAL, "safety status PROTECTIVE_STOP: have a person"),
        (("--fault", "emergency_stop"), SERIAL, "robot mode POWER_OFF|safety status ROBOT_EMERGENCY"),
        (("--fault", "slider_zero"), SERIAL, "the speed slider is at 0 %"),
        (("--fault", "rtde_silent"), SERIAL, "connection_lost"),
        (("--fault", "tcp_ignored"), SERIAL, "the TCP offset reads back as"),
        (("--fault", "payload_ignored"), SERIAL, "the payload reads back as 0.000 kg, the gripper weighs 0.900"),
        (("--fault", "unsafe_pose"), SERIAL, "outside the controller's safety limits"),
    ],
)
@undisturbed
def test_robot_that_is_not_ready_is_refused_before_anything_moves(
    options: tuple[str, ...], confirm: str, words: str, tmp_path: Path
) -> None:
    one_file = written(ONE, tmp_path)
    with fake_controller(one_file, loopback(2), *options) as host:
        ended = before_moving(host, confirm, one_file.with_suffix(".journal"))
        truth = ask(host)
    assert any(w in ended for w in words.split("|")), ended
    assert truth["q"] == pytest.approx(ONE.first_waypoint.q, abs=1e-9)
    assert truth["begun"] == {} and "unlock requested" not in truth["log"]


def before_moving(host: str, confirm: str, journal_file: Path) -> str:
    """Return why an execution did not begin, refused on entering or by the preflight."""
    try:
        with UrArm(host, ONE, confirm) as arm, Journal.create(journal_file, ONE, arm.name) as journal:
            result = execute(ONE, arm, journal)
    except InputError as refusal:
        return str(refusal)
    assert result.status is ExecutionStatus.REFUSED
    return result.detail


@undisturbed
def test_arm_that_stands_elsewhere_is_refused_with_the_joint_angles_to_go_to(tmp_path: Path) -> None:
    one_file = written(ONE, tmp_path)
    with fake_controller(one_file, loopback(3)) as host:
        ask(host, q=list(np.add(ONE.first_waypoint.q, [0, 0, 0, 0, 0, 0.02])))
        ended = before_moving(host, SERIAL, one_file.with_suffix(".journal"))
    assert "step 0 (p01), move 0, waypoint 0: the arm stands 0.0200 rad" in ended
    assert "limit 0.01 rad and 2 mm" in ended and "with the pendant" in ended


@undisturbed
def test_no_motion_without_a_preflight_that_passed(tmp_path: Path) -> None:
    one_file = written(ONE, tmp_path)
    with fake_controller(one_file, loopback(11)) as host, UrArm(host, ONE, SERIAL) as arm:
        path = ONE.steps[0].moves[2].path
        motions = Motions(arm)
        outcomes = [
            motions.follow(path, force_limit_n=20.0, contact_force_n=None),
            motions.push(np.array([0.0, 0.0, -1.0]), 0.005, force_limit_n=20.0),
            motions.grip(0.02, 20.0)[0],
        ]
        truth = ask(host)
    assert [o.status for o in outcomes] == [ExecutionStatus.REFUSED] * 3
    assert truth["begun"] == {} and truth["q"] == pytest.approx(ONE.first_waypoint.q, abs=1e-9)


@undisturbed
def test_second_process_is_refused_by_the_lock_and_without_it_by_the_robot(tmp_path: Path) -> None:
    one_file = written(ONE, tmp_path)
    other = tmp_path / "elsewhere"
    other.mkdir()
    with fake_controller(one_file, loopback(4)) as host, UrArm(host, ONE, SERIAL) as arm:
        again = run("execute", one_file, "--robot", host, "--confirm", SERIAL, TMPDIR=tempfile.gettempdir())
        assert again.returncode == 2
        assert f"owned by another process of this machine (pid {os.getpid()})" in again.stderr
        remote = run("execute", one_file, "--robot", host, "--confirm", SERIAL, TMPDIR=str(other))
        assert remote.returncode == 2
        assert "running another program" in remote.stderr
        assert Motions(arm).zero_force().succeeded  # the owner does not notice


@undisturbed
def test_jam_is_left_backwards_and_the_retry_elsewhere_in_the_cone_succeeds(tmp_path: Path) -> None:
    one_file = written(ONE, tmp_path)
    with (
        fake_controller(one_file, loopback(5), "--fault", "jam_once@force:1:0.2") as host,
        UrArm(host, ONE, SERIAL) as arm,
    ):
        with Journal.create(tmp_path / "j", ONE, arm.name) as journal:
            result = execute(ONE, arm, journal)
        truth = ask(host)
    assert result.status is ExecutionStatus.SUCCEEDED
    failed = [e for e in result.events if e.event == "attempt_failed"]
    assert [(e.status, e.attempt) for e in failed] == [(ExecutionStatus.JAMMED, 0)]
    assert failed[0].stop_observed is True and 0 < (failed[0].depth_m or 0) < 0.007
    assert truth["begun"]["force"] == 2  # type: ignore[index]
    inserted = next(e for e in result.events if e.event == "move_finished" and e.kind == "insert")
    assert inserted.tcp is not None
    assert math.dist(inserted.tcp[:3], ONE.steps[0].moves[3].path[-1].tcp[:3]) < 1.5e-3


def test_a_system_without_some_of_the_signals_hears_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows has no SIGHUP."""
    monkeypatch.delattr(signal, "SIGHUP", raising=False)
    before = signal.getsignal(signal.SIGTERM)
    with Signals() as interrupted:
        assert interrupted() == ""
        signal.raise_signal(signal.SIGTERM)
        assert interrupted() == "cancelled by the user"
    assert signal.getsignal(signal.SIGTERM) is before


@undisturbed
def test_ctrl_c_stops_the_arm_and_is_journalled(tmp_path: Path) -> None:
    one_file = written(ONE, tmp_path)
    with fake_controller(one_file, loopback(6)) as host:
        process = start("execute", one_file, "--robot", host, "--confirm", SERIAL, "--json")
        wait_for(host, lambda t: t["mode"] == "servo" and float(t["speed_rad_s"]) > 0.01)  # type: ignore[arg-type]
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=20)
        truth = ask(host)
    result = json.loads(out)
    assert process.returncode == 1
    assert (result["status"], result["stop_observed"]) == ("cancelled", True)
    assert truth["speed_rad_s"] == 0.0 and not truth["program_running"]
    assert read_journal(Path(result["journal"])).unfinished == 0


def real_command(plan_file: Path, host: str, **options: Any) -> subprocess.Popen[str]:
    """Start the real command, as a person would."""
    words = [sys.executable, "-m", "mocca_robot.cli", "execute", plan_file, "--robot", host, "--confirm", SERIAL]
    words.append("--unchecked")
    return subprocess.Popen(
        [str(w) for w in words],
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        **options,
    )


@undisturbed
def test_a_build_whose_output_is_closed_stops_and_is_not_called_done(tmp_path: Path) -> None:
    """As `execute … | head` does: the arm stops, the journal says so, and the rest is said on stderr."""
    one_file = written(ONE, tmp_path)
    with fake_controller(one_file, loopback(14)) as host:
        process = real_command(one_file, host)
        wait_for(host, lambda t: t["mode"] == "servo")
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        said = process.stderr.read()
        process.wait(30)
        truth = ask(host)
    assert process.returncode == 1, said
    assert "nobody reads what this program says" in said and "standstill measured: yes" in said
    assert truth["speed_rad_s"] == 0.0 and not truth["program_running"]
    record = read_journal(one_file.with_suffix(".journal.jsonl"))
    assert (record.events[-1]["event"], record.events[-1]["status"]) == ("stopped", "cancelled")
    assert record.unfinished == 0 and record.events[-1]["stop_observed"] is True


@pytest.mark.parametrize("size", [1500, 2600])
@undisturbed
def test_nothing_moves_that_a_full_disk_does_not_announce(size: int, tmp_path: Path) -> None:
    import resource

    one_file = written(ONE, tmp_path)
    with fake_controller(one_file, loopback(15)) as host:
        process = real_command(
            one_file, host, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        )
        out, said = process.communicate(timeout=60)
        truth = ask(host)
    assert process.returncode == 1, said
    assert "unrecorded" in out and "cannot be written" in out and "standstill measured: yes" in out
    record = read_journal(one_file.with_suffix(".journal.jsonl"))
    assert record.truncated is None and record.unfinished == 0
    begun = [e["kind"] for e in record.events if e["event"] == "move_started"]
    assert truth["begun"].get("force", 0) <= begun.count("insert") and not truth["program_running"]
    assert truth["begun"].get("grip", 0) <= sum({"approach": 1, "pick": 1, "release": 1}.get(k, 0) for k in begun)


@undisturbed
def test_kill_9_ends_motion_and_the_resume_repeats_nothing_by_itself(tmp_path: Path) -> None:
    two_file = written(TWO, tmp_path)
    journal = tmp_path / "build.jsonl"
    arguments = ("--confirm", SERIAL, "--json")
    with fake_controller(two_file, loopback(7)) as host:
        process = start("execute", two_file, "--robot", host, "--journal", journal, *arguments)
        wait_for(host, lambda t: t["begun"].get("grip", 0) == 5)  # type: ignore[attr-defined]
        process.kill()
        process.wait()
        wait_for(host, lambda t: t["speed_rad_s"] == 0.0 and not t["program_running"])
        record = read_journal(journal)
        assert (record.finished, record.unfinished) == ((0,), 1)

        put_back(host, 1)
        plain = run("execute", "--resume", journal, "--robot", host, *arguments)
        assert plain.returncode == 2 and "Step 1 (p02) was begun and not finished" in plain.stderr

        raw = document(TWO)
        raw["steps"][1]["grasp"]["force_n"] = 21.0
        (tmp_path / "edited.json").write_text(json.dumps(raw))
        edited = run("execute", tmp_path / "edited.json", "--resume", journal, "--robot", host, *arguments)
        assert edited.returncode == 2 and "another or an edited plan is never resumed" in edited.stderr
        before = ask(host)["begun"]

        resumed = run("execute", "--resume", journal, "--resolve", "p02=repeat", "--robot", host, *arguments)
        assert resumed.returncode == 0, resumed.stderr + resumed.stdout
        after = ask(host)["begun"]
        assert after["grip"] - before["grip"] == 3 and after["force"] - before["force"] == 1  # one part, not two
        assert read_journal(journal).finished == (0, 1)

        again = run("execute", "--resume", journal, "--robot", host, *arguments)
        assert again.returncode == 0 and "finished already" in again.stdout
        assert ask(host)["begun"] == after


@undisturbed
def test_a_refused_start_leaves_no_journal_and_no_other_payload(tmp_path: Path) -> None:
    one_file = written(ONE, tmp_path)
    with fake_controller(one_file, loopback(16)) as host:
        arguments = ("execute", one_file, "--robot", host, "--confirm", SERIAL)
        ask(host, q=list(np.add(ONE.first_waypoint.q, [0, 0, 0, 0, 0, 0.02])))
        ask(host, payload_kg=1.1)  # what it carries since it was stopped
        refused = run(*arguments)
        assert refused.returncode == 1 and "the arm stands" in refused.stdout
        assert ask(host)["payload_kg"] == 1.1
        assert not one_file.with_suffix(".journal.jsonl").exists()
        ask(host, q=list(ONE.first_waypoint.q))
        again = run(*arguments)
        assert again.returncode == 0, again.stdout + again.stderr


@undisturbed
def test_a_build_is_not_continued_on_another_robot(tmp_path: Path) -> None:
    plan = replace(TWO, cell=replace(TWO.cell, serial=None))
    two_file, journal = written(plan, tmp_path), tmp_path / "build.jsonl"
    with Journal.create(journal, plan, "20265500001", two_file):
        pass
    with fake_controller(two_file, loopback(17), "--serial", "777") as host:
        done = run("execute", "--resume", journal, "--robot", host, "--confirm", "777")
        truth = ask(host)
    assert done.returncode == 2 and "begun on robot 20265500001, and this is robot 777" in done.stderr
    assert truth["begun"] == {} and len(read_journal(journal).events) == 0


@undisturbed
def test_ctrl_c_while_connecting_is_called_that(tmp_path: Path) -> None:
    one_file = written(ONE, tmp_path)
    with (
        fake_controller(one_file, loopback(18)) as host,
        pytest.raises(InputError, match=r"Cancelled while connecting .*Nothing was moved"),
        UrArm(host, ONE, SERIAL, cancelled=lambda: "cancelled by the user"),
    ):
        pass


@undisturbed
def test_watchdog_stops_the_arm_when_every_process_of_ours_is_killed(tmp_path: Path) -> None:
    one_file = written(ONE, tmp_path)
    with fake_controller(one_file, loopback(8)) as host:
        process = start("execute", one_file, "--robot", host, "--confirm", SERIAL)
        wait_for(host, lambda t: t["mode"] == "force")
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        truth = wait_for(host, lambda t: t["speed_rad_s"] == 0.0 and not t["program_running"])
    assert "program stopped: watchdog" in truth["log"]  # type: ignore[operator]


@pytest.mark.long
@pytest.mark.parametrize(
    ("mode", "count"), [("servo", 1), ("force", 1), ("grip", 3), ("servo", 2), ("servo", 3)], ids=lambda v: str(v)
)
@undisturbed
def test_kill_9_at_any_moment_ends_motion_and_leaves_a_journal_that_asks_a_person(
    mode: str, count: int, tmp_path: Path
) -> None:
    one_file = written(ONE, tmp_path)
    journal = tmp_path / "build.jsonl"
    with fake_controller(one_file, loopback(13)) as host:
        process = start("execute", one_file, "--robot", host, "--confirm", SERIAL, "--journal", journal)
        wait_for(host, lambda t: t["begun"].get(mode, 0) == count)  # type: ignore[attr-defined]
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        wait_for(host, lambda t: t["speed_rad_s"] == 0.0 and not t["program_running"])
        resumed = run("execute", "--resume", journal, "--robot", host, "--confirm", SERIAL)
        truth = ask(host)
    assert resumed.returncode == 2 and "Step 0 (p01) was begun and not finished" in resumed.stderr
    assert "--resolve p01=placed" in resumed.stderr and "--resolve p01=repeat" in resumed.stderr
    assert read_journal(journal).unfinished == 0
    assert truth["begun"].get(mode) == count  # the resume moved nothing
