"""The fake controller as the unmodified ur-rtde client meets it, in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from ur_cell import HOME, MODEL, TOOL, command, environment, fake_controller, loopback, small_plan, undisturbed

from mocca_robot.errors import InputError
from mocca_robot.plan.plan import MoveKind, insertion_axis, write_plan
from mocca_robot.plan.push_frame import frame_along
from mocca_robot.ur.fake.arm import PLAYING, STOPPED
from mocca_robot.ur.fake.controller import LONGEST_TICK_S, FakeController, ask
from mocca_robot.ur.fake.world import SEAT_PLAY_M, SEAT_STIFFNESS_N_M, Fault, Trigger

PLAN = small_plan(1, short=True)

CLIENT = """
import json, os, sys, time
import rtde_control, rtde_receive

def seen(read, wanted):
    # The stream of states is another than that of commands: what it said last may be some cycles old.
    for _ in range(100):
        found = read()
        if max(abs(a - b) for a, b in zip(found, wanted)) < 1e-3:
            break
        time.sleep(0.02)
    return found

host, tool, target = sys.argv[1], json.loads(sys.argv[2]), json.loads(sys.argv[3])
hands = rtde_control.RTDEControlInterface(host, 125.0)
eyes = rtde_receive.RTDEReceiveInterface(host)
out = {"set_tcp": hands.setTcp(tool), "tcp": hands.getTCPOffset()}
out["home"] = eyes.getActualQ()
out["move_j"] = hands.moveJ([q + 0.1 for q in out["home"]], 1.0, 2.0)
out["after_j"] = seen(eyes.getActualQ, [q + 0.1 for q in out["home"]])
out["move_l"] = hands.moveL(target, 0.25, 1.2)
out["after_l"] = seen(eyes.getActualTCPPose, target)
out["fk"] = hands.getForwardKinematics(out["home"], tool)
out["payload"] = hands.setPayload(1.25, [0.0, 0.0, 0.05])
time.sleep(0.1)
out["payload_read"] = eyes.getPayload()
hands.speedL([0.0, 0.0, 0.02, 0.0, 0.0, 0.0], 0.5, 0.5)
time.sleep(0.2)
out["speed"] = eyes.getActualTCPSpeed()
out["speed_stop"] = hands.speedStop()
out["steady"] = hands.isSteady()
out["unreachable"] = hands.isPoseWithinSafetyLimits([2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
out["program"] = hands.isProgramRunning()
try:
    rtde_control.RTDEControlInterface(host, 125.0)
    out["second"] = "accepted"
except RuntimeError as error:
    out["second"] = str(error)
hands.stopScript()
print("RESULT" + json.dumps(out), flush=True)
os._exit(0)
"""


@undisturbed
def test_real_client_moves_reads_and_is_alone(tmp_path: Path) -> None:
    write_plan(PLAN, tmp_path / "plan.json")
    target = list(MODEL.tcp_pose(HOME, TOOL))
    target[2] -= 0.03
    with fake_controller(tmp_path / "plan.json", loopback(20)) as host:
        done = subprocess.run(
            [sys.executable, "-c", CLIENT, host, json.dumps(TOOL), json.dumps(target)],
            env=environment(),
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert "RESULT" in done.stdout, done.stdout + done.stderr
        truth = ask(host)
    out = json.loads(done.stdout.split("RESULT")[1])
    assert out["set_tcp"] and out["move_j"] and out["move_l"] and out["payload"] and out["speed_stop"] and out["steady"]
    assert out["tcp"] == pytest.approx(TOOL)
    assert out["home"] == pytest.approx(HOME, abs=1e-9)
    assert out["after_j"] == pytest.approx(HOME + 0.1, abs=1e-3)
    assert out["after_l"][:3] == pytest.approx(target[:3], abs=1e-3)
    assert out["fk"] == pytest.approx(MODEL.tcp_pose(HOME, TOOL), abs=1e-9)
    assert out["payload_read"] == 1.25
    assert out["speed"][:3] == pytest.approx([0.0, 0.0, 0.02], abs=1e-4)
    assert out["unreachable"] is False and out["program"] is True
    assert "already in use" in out["second"]
    assert not truth["program_running"]


def test_person_can_inject_and_clear_faults_while_it_runs(tmp_path: Path) -> None:
    write_plan(PLAN, tmp_path / "plan.json")
    with fake_controller(tmp_path / "plan.json", loopback(21), "--json") as host:
        assert ask(host, fault="protective_stop")["safety_mode"] == 3
        assert ask(host, restore=True)["safety_mode"] == 1
        with pytest.raises(InputError, match="did you mean 'jam'"):
            ask(host, fault="jamm")


def test_faults_are_spelled_with_their_moment() -> None:
    for fault in Fault:
        assert Trigger.parse(fault) == Trigger(fault)
    assert Trigger.parse("jam@force:2:0.5") == Trigger(Fault.JAM, "force", 2, 0.5)
    for bad, words in (("jam@forces", "did you mean 'force'"), ("jam@force:x", "FAULT@MODE"), ("fire", "Known: ")):
        with pytest.raises(InputError, match=words):
            Trigger.parse(bad)


def test_every_fault_is_on_the_page() -> None:
    page = (Path(__file__).parents[2] / "docs" / "robot.md").read_text(encoding="utf-8")
    listed = page.split("Faults: `")[1].split("`")[0].split()
    assert sorted(listed) == sorted(Fault)


def test_fake_serves_loopback_only_and_says_when_its_ports_are_taken(tmp_path: Path) -> None:
    away = subprocess.run(
        command("fake-ur", "--host", "0.0.0.0"), env=environment(), capture_output=True, text=True, timeout=20
    )
    assert away.returncode == 2 and "loopback addresses only" in away.stderr
    write_plan(PLAN, tmp_path / "plan.json")
    with fake_controller(tmp_path / "plan.json", loopback(22)) as host:
        again = subprocess.run(
            command("fake-ur", "--host", host), env=environment(), capture_output=True, text=True, timeout=20
        )
    assert again.returncode == 2 and f"Cannot listen on {host}" in again.stderr


def test_forces_come_from_seats_and_jams() -> None:
    from mocca_robot.ur.fake.world import World

    world = World.of_plan(PLAN)
    insert = PLAN.steps[0].moves[3]
    end, down = np.array(insert.path[-1].tcp[:3]), np.array([0.0, 0.0, -1.0])
    still = np.zeros(3)
    assert world.force(end, still, down) == pytest.approx(np.zeros(6))
    assert world.force(end + 0.0012 * down, still, down)[2] == pytest.approx(20.0)
    assert world.force(end + 0.0012 * down, still, None) == pytest.approx(np.zeros(6))
    world.active.add(Fault.JAM)
    assert world.force(end, still, down, 10.0)[2] == pytest.approx(10.0)


def test_watchdog_runs_on_the_time_in_which_the_fake_runs() -> None:
    """A computer that stalls for a moment has kept the client from writing and the fake from reading, too."""
    controller = FakeController(PLAN)
    arm = controller.arm
    arm.start_program()
    arm.watchdog_s = 4.5 * LONGEST_TICK_S
    for _ in range(3):
        controller.advance(60.0)
        assert arm.runtime_state == PLAYING
        arm.feed()
    for _ in range(4):
        controller.advance(LONGEST_TICK_S)
        assert arm.runtime_state == PLAYING
    controller.advance(LONGEST_TICK_S)
    assert arm.runtime_state == STOPPED and arm.log[-1] == "program stopped: watchdog"


@pytest.mark.parametrize("speedup", [1.0, 4.0, 20.0])
def test_a_late_tick_does_not_shake_a_part_on_its_seat(speedup: float) -> None:
    """However long a tick lasts, a pushed part comes to rest on its stop at the force it is pushed with."""
    controller = FakeController(PLAN, speedup=speedup)
    arm, insert = controller.arm, next(m for m in PLAN.steps[0].moves if m.kind is MoveKind.INSERT)
    arm.tcp_offset, arm.q = np.array(TOOL), np.array(insert.path[0].q)
    arm.start_program()
    axis, depth = insertion_axis(insert.path)
    arm.doubles[:18] = [*frame_along(axis, insert.path[0].tcp), 0, 0, 10, 0, 0, 0, *[0.01] * 3, *[0.1] * 3]
    arm.ints[0], arm.ints[2:8] = 6, [1, 1, 1, 0, 0, 0]
    arm.command()
    for _ in range(400):
        controller.advance(LONGEST_TICK_S)
        assert float(np.linalg.norm(arm.force[:3])) < 20.0
    travelled = float((arm.tcp[:3, 3] - np.array(insert.path[0].tcp[:3])) @ axis)
    assert travelled == pytest.approx(depth + SEAT_PLAY_M + 10.0 / SEAT_STIFFNESS_N_M, abs=2e-4)
