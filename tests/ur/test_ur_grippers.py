"""Hands behind one interface: Hand-E, RG2 and RG6, fingers behind digital outputs; against the fake controller."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from ur_cell import CLOSED, OPENED, SERIAL, WIDTH, fake_controller, loopback, run, small_plan, undisturbed, written

from mocca_robot.errors import InputError
from mocca_robot.plan.gripper import FINGERS, Grip, GripperLost, holds, undrivable
from mocca_robot.plan.hand import not_open
from mocca_robot.plan.journal import read_journal
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.person import after_grip, confirmations
from mocca_robot.plan.plan import MoveKind, Plan, document
from mocca_robot.plan.reader import plan_from_document
from mocca_robot.plan.wiring import FingerWiring
from mocca_robot.ur.fake.compute_box import RG_PORT
from mocca_robot.ur.fake.controller import ask
from mocca_robot.ur.onrobot import RgFingers
from mocca_robot.ur.urscript import urscript
from planners.robot.tool import ParallelGripper, read_gripper

WIRING = FingerWiring(close_output="standard_2", open_input="standard_1", held_input="configurable_0", wait_s=0.5)
STROKE = 0.05


def plan_with(gripper: str, host: str = "") -> Plan:
    """The small plan for another hand; fingers that are only open or closed are wide open between parts."""
    plan = small_plan(1)
    stroke = STROKE if gripper == "digital" else FINGERS[gripper].stroke_m
    cell = replace(plan.cell, gripper_stroke_m=(0.0, stroke))
    if gripper == "digital":
        cell = replace(cell, fingers=WIRING)
    if host:
        cell = replace(cell, gripper_address=f"{host}:{RG_PORT}")
    return replace(plan, gripper=gripper, cell=cell)


@undisturbed
@pytest.mark.parametrize(("gripper", "address"), [("hande", 70), ("rg2", 71), ("rg6", 72), ("digital", 73)])
def test_every_hand_opens_holds_and_lets_go(gripper: str, address: int, tmp_path: Path) -> None:
    host = loopback(address)
    plan = plan_with(gripper, host if gripper.startswith("rg") else "")
    plan_file = written(plan, tmp_path)
    with fake_controller(plan_file, host) as there:
        done = run("execute", plan_file, "--robot", there, "--confirm", SERIAL, "--json", "--unchecked")
        truth = ask(there)
    assert done.returncode == 0, done.stdout + done.stderr
    events = read_journal(Path(json.loads(done.stdout)["journal"])).events
    opened = next(e for e in events if e["event"] == "hand_opened")
    assert opened["width_m"] == pytest.approx(STROKE if gripper == "digital" else OPENED, abs=1e-3)
    picked = next(e for e in events if e["event"] == "move_finished" and e["kind"] == MoveKind.PICK)
    if gripper == "digital":
        assert picked.get("held") is True
    else:
        assert picked["width_m"] == pytest.approx(WIDTH, abs=1e-3)
    assert truth["gripper_m"] == pytest.approx(STROKE if gripper == "digital" else OPENED, abs=1e-3)


@undisturbed
@pytest.mark.parametrize(("gripper", "address"), [("rg2", 74), ("digital", 75)])
def test_a_part_that_is_missing_is_seen_by_every_hand(gripper: str, address: int, tmp_path: Path) -> None:
    host = loopback(address)
    plan = plan_with(gripper, host if gripper == "rg2" else "")
    plan_file = written(plan, tmp_path)
    with fake_controller(plan_file, host, "--fault", "part_missing") as there:
        done = run("execute", plan_file, "--robot", there, "--confirm", SERIAL, "--json", "--unchecked")
    assert done.returncode == 1 and "part missing" in done.stdout, done.stdout + done.stderr


def test_plans_say_how_their_hand_is_reached_and_are_read_again() -> None:
    for gripper, host in (("digital", ""), ("rg6", "127.0.0.9"), ("hande", "")):
        plan = plan_with(gripper, host)
        assert plan_from_document(document(plan)) == plan
    bare = replace(plan_with("digital"), cell=replace(plan_with("digital").cell, fingers=None))
    assert "close_output" in undrivable(bare)
    raw = document(plan_with("digital"))
    raw["cell"]["fingers"]["held_input"] = "standard_9"
    with pytest.raises(InputError, match="held_input is 'standard_9'"):
        plan_from_document(raw)
    with pytest.raises(InputError, match="unknown gripper 'rg4'; did you mean"):
        plan_from_document({**document(small_plan(1)), "gripper": "rg4"})


def test_what_no_switch_shows_is_asked() -> None:
    step = small_plan(1).steps[0]
    assert confirmations(plan_with("digital")) == ()
    blind = replace(WIRING, held_input=None)
    plan = replace(plan_with("digital"), cell=replace(plan_with("digital").cell, fingers=blind))
    assert confirmations(plan) == ("p01",)
    assert "senses nothing" in after_grip(step, MoveKind.PICK, Grip(None, None))
    assert after_grip(step, MoveKind.PICK, Grip(None, None, held=True)) == ""
    limits = MotionLimits()
    assert holds(Grip(None, None, held=False), WIDTH, limits) is False
    assert "do not let go" in not_open(Grip(None, None, held=True), OPENED, limits)


def test_a_compute_box_that_is_not_there_is_named() -> None:
    with pytest.raises(GripperLost, match=r"127\.0\.0\.77:9.*address"):
        RgFingers("127.0.0.77:9", 0.11, 40.0)


def test_a_program_is_written_for_a_hand_e_and_refused_for_hands_that_it_cannot_drive() -> None:
    position = round(255 * (1 - CLOSED / FINGERS["hande"].stroke_m))
    assert f"grip({position}, 0)" in urscript(plan_with("hande"))
    for gripper in ("rg2", "digital"):
        with pytest.raises(InputError, match="mocca-robot execute"):
            urscript(plan_with(gripper))


HAND = {
    "tcp_offset_m": [0, 0, 0.15],
    "mass_kg": 1.0,
    "palm_m": [[-0.04, -0.06, 0], [0.04, 0.06, 0.1]],
    "finger_m": [[-0.01, 0.003, 0.09], [0.01, 0.02, 0.155]],
    "stroke_m": [0, 0.05],
}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"name": "hande", "stroke_m": [0, 0.06]}, "a hande opens to 0.05 m"),
        ({"name": "rg2", "force_n": 60}, "at most 40 N"),
        ({"name": "rg4"}, "gripper.name"),
        ({"name": "digital", "close_output": "standard_9"}, "close_output"),
        ({"name": "digital", "held_input": "standard_1"}, "but not 'close_output'"),
        ({"name": "digital", "close_output": "tool_0", "open_output": "tool_0"}, "two signals need two pins"),
        ({"name": "2f85", "close_output": "tool_0"}, "name: digital"),
        ({"name": "2f85", "address": "192.168.1.1"}, "'rg2' and 'rg6'"),
    ],
)
def test_a_hand_that_cannot_be_is_refused_by_key_value_and_limit(more: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_gripper({**HAND, **more}, "cell.yaml: gripper")


def test_fingers_that_are_open_or_closed_are_planned_wide_open() -> None:
    hand = read_gripper({**HAND, "name": "digital", "close_output": "standard_0"}, "here")
    assert isinstance(hand, ParallelGripper) and hand.opened_m(0.02) == pytest.approx(0.05)
    assert hand.fingers == FingerWiring(close_output="standard_0")
    assert read_gripper({**HAND, "name": "rg2"}, "here").opened_m(0.02) == pytest.approx(0.032)
