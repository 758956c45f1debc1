"""The hand on the fake controller: it opens for each part before it goes there, and a part in it is never forgotten."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from ur_cell import SERIAL, fake_controller, loopback, run, small_plan, undisturbed, written

from mocca_robot.plan.executor import execute
from mocca_robot.plan.journal import Journal, read_journal
from mocca_robot.plan.motions import Motions
from mocca_robot.plan.plan import MoveKind
from mocca_robot.plan.status import ExecutionStatus
from mocca_robot.ur.driver import UrArm
from mocca_robot.ur.fake.controller import ask

WIDTHS = (0.03, 0.06, 0.02)
BOXES = small_plan(3, widths=WIDTHS)
ONE = small_plan(1)


@undisturbed
def test_parts_of_different_widths_are_each_met_with_the_opening_they_need(tmp_path: Path) -> None:
    plan_file = written(BOXES, tmp_path)
    with fake_controller(plan_file, loopback(60)) as host:
        done = run("execute", plan_file, "--robot", host, "--confirm", SERIAL, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    events = read_journal(Path(json.loads(done.stdout)["journal"])).events
    opened = [(e["step"], e["kind"], e["width_m"]) for e in events if e["event"] == "hand_opened"]
    assert [(i, kind) for i, kind, _ in opened] == [(i, "transit") for i in range(3)]
    assert [w for _, _, w in opened] == pytest.approx([w + 0.02 for w in WIDTHS], abs=1e-3)
    picked = [e["width_m"] for e in events if e["event"] == "move_finished" and e["kind"] == MoveKind.PICK]
    assert picked == pytest.approx(WIDTHS, abs=1e-3)


@undisturbed
def test_fingers_that_come_down_on_a_part_feel_it(tmp_path: Path) -> None:
    """What happens without an opening: the fake's fingers are as hard as real ones."""
    plan_file = written(ONE, tmp_path)
    step = ONE.steps[0]
    with fake_controller(plan_file, loopback(61), "--speedup", "1") as host, UrArm(host, ONE, SERIAL) as arm:
        assert arm.preflight(ONE, 0).succeeded
        approach = next(k for k, m in enumerate(step.moves) if m.kind is MoveKind.APPROACH)
        for opening, status in ((0.02, ExecutionStatus.CONTACT), (0.05, ExecutionStatus.SUCCEEDED)):
            ask(host, q=list(step.moves[approach].path[-1].q))
            ask(host, gripper_m=opening)
            motions = Motions(arm)
            assert motions.zero_force().succeeded
            down = motions.follow(step.moves[approach + 1].path, force_limit_n=20.0, contact_force_n=5.0)
            assert down.status is status, down.detail


@undisturbed
def test_a_build_does_not_begin_with_something_between_the_fingers(tmp_path: Path) -> None:
    plan_file = written(ONE, tmp_path)
    picks = next(m for m in ONE.steps[0].moves if m.kind is MoveKind.PICK)
    with fake_controller(plan_file, loopback(62)) as host:
        with UrArm(host, ONE, SERIAL) as arm:
            assert arm.preflight(ONE, 0).succeeded
            ask(host, q=list(picks.path[-1].q))
            outcome, grip = Motions(arm).grip(picks.gripper_m, 20.0)
            assert outcome.succeeded and grip.blocked
        ask(host, q=list(ONE.first_waypoint.q))
        with UrArm(host, ONE, SERIAL) as arm, Journal.create(tmp_path / "j", ONE, arm.name) as journal:
            result = execute(ONE, arm, journal)
        truth = ask(host)
    assert result.status is ExecutionStatus.REFUSED and "the fingers hold something, 30 mm wide" in result.detail
    assert truth["gripper_m"] == pytest.approx(0.03) and truth["q"] == pytest.approx(np.array(ONE.first_waypoint.q))
