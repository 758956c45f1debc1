"""A suction cup behind digital outputs of a fake controller, through the real client: it lets go where planned only."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest
from ur_cell import (
    CELL,
    REST,
    SERIAL,
    WIRING,
    command,
    environment,
    fake_controller,
    loopback,
    run,
    small_plan,
    suction_plan,
    undisturbed,
    written,
)

from mocca_robot.errors import InputError
from mocca_robot.plan.dry_run import dry_run
from mocca_robot.plan.executor import Execution, execute
from mocca_robot.plan.gripper import GripperLost, require_drivable
from mocca_robot.plan.journal import Journal, read_journal
from mocca_robot.plan.plan import Plan, document
from mocca_robot.plan.reader import plan_from_document
from mocca_robot.plan.status import ArmState, ExecutionStatus
from mocca_robot.plan.supervision import Stopped
from mocca_robot.plan.wiring import SIGNALS, VacuumWiring
from mocca_robot.ur import outputs, suction
from mocca_robot.ur.driver import UrArm
from mocca_robot.ur.fake.controller import ask
from planners.robot.tool import read_gripper

ONE = suction_plan(1, short=True)
ON = 1 << WIRING.output_bit
VACUUM = 1 << SIGNALS.index("configurable_1")


def build(host: str, plan: Plan, folder: Path) -> Execution:
    """Return how building `plan` at `host` ended."""
    with UrArm(host, plan, SERIAL) as arm, Journal.create(folder / "j", plan, arm.name) as journal:
        return execute(plan, arm, journal)


@undisturbed
def test_vacuum_comes_at_the_pick_and_goes_at_the_release(tmp_path: Path) -> None:
    plan_file = written(ONE, tmp_path)
    with fake_controller(plan_file, loopback(40)) as host:
        done = run("execute", plan_file, "--robot", host, "--confirm", SERIAL, "--json")
        truth = ask(host)
    assert done.returncode == 0, done.stdout + done.stderr
    assert [w for w in truth["log"] if w.startswith("vacuum")] == ["vacuum on", "vacuum off"]
    assert truth["digital_outputs"] == 0 and not truth["on_cup"]
    events = read_journal(Path(json.loads(done.stdout)["journal"])).events
    seen = {e["kind"]: e["vacuum"] for e in events if "vacuum" in e}
    assert seen == {"approach": False, "pick": True, "release": False}


FAULTS = [
    ("part_missing", "any", ExecutionStatus.DEVIATED, "pick", "part missing: no vacuum under the cup"),
    (
        "part_lost",
        "servo:1:0.1",
        ExecutionStatus.DEVIATED,
        "approach",
        "part lost: input configurable_1 shows no vacuum",
    ),
    ("part_lost", "force:1:0.1", ExecutionStatus.DEVIATED, "insert", "part lost: input configurable_1 shows no vacuum"),
    ("part_sticks", "any", ExecutionStatus.REFUSED, None, "shows vacuum although output standard_3 is off"),
    ("part_sticks", "force:1", ExecutionStatus.DEVIATED, "release", "the cup does not let go"),
]


@pytest.mark.long
@pytest.mark.parametrize(("fault", "moment", "status", "kind", "words"), FAULTS)
@undisturbed
def test_what_happens_at_the_cup_is_named(
    fault: str, moment: str, status: ExecutionStatus, kind: str | None, words: str, tmp_path: Path
) -> None:
    with fake_controller(written(ONE, tmp_path), loopback(41), "--fault", f"{fault}@{moment}") as host:
        result = build(host, ONE, tmp_path)
        truth = ask(host)
    assert (result.status, result.last.part and result.events[-2].kind) == (status, kind), result.detail
    assert words in result.detail
    assert truth["speed_rad_s"] == 0.0
    if kind not in (None, "release"):
        assert truth["digital_outputs"] == ON  # a part that hangs on by its edge shall not be dropped on purpose


@undisturbed
def test_a_stop_keeps_the_part_and_the_next_start_asks_for_it(tmp_path: Path) -> None:
    with fake_controller(written(ONE, tmp_path), loopback(42), "--fault", "protective_stop@force:1:0.2") as host:
        stopped = build(host, ONE, tmp_path)
        held = ask(host)
        assert (stopped.status, stopped.events[-2].kind) == (ExecutionStatus.PROTECTIVE_STOP, "insert")
        assert held["on_cup"] and held["digital_outputs"] == ON
        ask(host, restore=True)
        ask(host, q=list(ONE.first_waypoint.q))
        with UrArm(host, ONE, SERIAL) as arm:
            refused = arm.preflight(ONE, 0)
        assert refused.status is ExecutionStatus.REFUSED and "a part may hang on the cup" in refused.detail
        assert ask(host)["on_cup"]
        ask(host, output=WIRING.output_bit, on=False)  # a person takes the part off
        with UrArm(host, ONE, SERIAL) as arm:
            assert arm.preflight(ONE, 0).succeeded


STOPS = (
    "connection_dropped",
    "rtde_silent",
    "nan",
    "emergency_stop",
    "safeguard_stop",
    "program_stopped",
    "slider_zero",
)


@pytest.mark.long
@pytest.mark.parametrize("moment", ["servo:1:0.1", "force:1:0.2"])
@pytest.mark.parametrize("fault", [*STOPS, "jam", "contact", "force"])
@undisturbed
def test_no_fault_drops_a_carried_part(fault: str, moment: str, tmp_path: Path) -> None:
    if (fault, moment) == ("jam", "servo:1:0.1"):
        moment = "force:1:0.1"
    with fake_controller(written(ONE, tmp_path), loopback(43), "--fault", f"{fault}@{moment}") as host:
        result = build(host, ONE, tmp_path)
        truth = ask(host)
    assert result.status is not ExecutionStatus.SUCCEEDED
    assert truth["on_cup"] and truth["digital_outputs"] == ON and "vacuum off" not in truth["log"]


@pytest.mark.long
@undisturbed
def test_killing_the_program_keeps_the_part(tmp_path: Path) -> None:
    plan_file = written(ONE, tmp_path)
    with fake_controller(plan_file, loopback(44)) as host:
        process = subprocess.Popen(
            command("execute", plan_file, "--robot", host, "--confirm", SERIAL),
            env=environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            end = time.monotonic() + 30.0
            while ask(host)["mode"] != "force" and time.monotonic() < end:
                time.sleep(0.02)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait(10)
        end = time.monotonic() + 5.0
        while (truth := ask(host))["program_running"] and time.monotonic() < end:
            time.sleep(0.05)
    assert not truth["program_running"] and truth["on_cup"] and truth["digital_outputs"] == ON


class Valve:
    """A digital output that reads back in the states of `Bench`."""

    def __init__(self, role: str, host: str, deadline_s: float) -> None:
        self.calls: list[tuple[object, ...]] = []
        Bench.valve = self

    def call(self, *request: object, deadline_s: float) -> bool:
        self.calls.append(request)
        Bench.on = bool(request[2]) and not Bench.broken
        return True

    def kill(self) -> None:
        """Nothing to end."""


class Bench:
    """The controller's side: `tick` returns states 20 ms apart."""

    valve: Valve
    on = broken = False

    def __init__(self, vacuum: bool | None = None) -> None:
        Bench.on = Bench.broken = False
        self.vacuum = vacuum
        self.time_s = 0.0

    def tick(self) -> ArmState:
        self.time_s += 0.02
        there = Bench.on if self.vacuum is None else self.vacuum
        return replace(REST, time_s=self.time_s, digital_outputs=ON * Bench.on, digital_inputs=VACUUM * there)


@pytest.fixture
def cup(monkeypatch: pytest.MonkeyPatch) -> suction.SuctionCup:
    monkeypatch.setattr(outputs, "ChildLink", Valve)
    return suction.SuctionCup("nowhere", WIRING, 0.005)


def test_a_flicker_of_the_switch_is_no_loss_and_an_absence_is(cup: suction.SuctionCup) -> None:
    bench = Bench()
    assert cup.lost(bench.tick()) == "" and cup.move(0.0, 20.0, bench.tick).vacuum is True
    bench.vacuum = False
    assert [cup.lost(bench.tick()) for _ in range(4)] == [""] * 4
    bench.vacuum = True
    assert cup.lost(bench.tick()) == ""
    bench.vacuum = False
    assert "part lost" in [cup.lost(bench.tick()) for _ in range(8)][-1]


def test_a_part_that_is_gone_is_not_released_as_if_it_were_placed(cup: suction.SuctionCup) -> None:
    bench = Bench()
    cup.move(0.0, 20.0, bench.tick)
    bench.vacuum = False
    with pytest.raises(Stopped, match="part lost"):
        cup.move(0.01, 20.0, bench.tick)
    assert [c[2] for c in Bench.valve.calls] == [True]


def test_an_output_switched_by_somebody_else_is_seen(cup: suction.SuctionCup) -> None:
    bench = Bench()
    cup.move(0.0, 20.0, bench.tick)
    Bench.on = False
    assert "switched off by somebody else" in cup.lost(bench.tick())


def test_an_output_that_does_not_switch_is_a_lost_gripper(cup: suction.SuctionCup) -> None:
    bench = Bench()
    Bench.broken = True
    with pytest.raises(GripperLost, match="switched on and reads back as off"):
        cup.move(0.0, 20.0, bench.tick)


def test_vacuum_that_does_not_come_in_its_time_is_measured_and_left_on(cup: suction.SuctionCup) -> None:
    bench = Bench(vacuum=False)
    assert cup.move(0.0, 20.0, bench.tick).vacuum is False
    assert bench.time_s >= WIRING.wait_s and Bench.on


def test_without_a_switch_nothing_is_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outputs, "ChildLink", Valve)
    bench = Bench()
    blind = suction.SuctionCup("nowhere", VacuumWiring("tool_1"), 0.005)
    monkeypatch.setattr("test_ur_suction.ON", 1 << SIGNALS.index("tool_1"))
    assert blind.move(0.0, 20.0, bench.tick).vacuum is None
    assert Bench.valve.calls == [("setToolDigitalOut", 1, True)]
    assert bench.time_s >= 1.0 and blind.lost(bench.tick()) == ""


def test_the_wiring_is_part_of_the_plan_and_its_absence_changes_no_hash() -> None:
    assert plan_from_document(document(ONE)) == ONE
    bare = small_plan(1, short=True)
    assert "vacuum" not in document(bare)["cell"]
    other = replace(ONE, cell=replace(ONE.cell, vacuum=VacuumWiring("standard_4", "configurable_1", 0.5)))
    assert other.sha256 != ONE.sha256
    raw = document(ONE)
    raw["cell"]["vacuum"]["output"] = "standard_8"
    with pytest.raises(InputError, match="cell: vacuum: output is 'standard_8'"):
        plan_from_document(raw)


def test_an_unwired_cup_is_planned_and_dry_run_and_says_why_it_is_not_executed() -> None:
    unwired = replace(ONE, cell=replace(ONE.cell, vacuum=None))
    with pytest.raises(InputError, match="Add 'vacuum_output: standard_0'"):
        require_drivable(unwired)
    assert "cannot be executed: The cell 'bench' does not say" in dry_run(unwired).text()
    text = dry_run(ONE).text()
    assert "vacuum: output standard_3, switch configurable_1; at most 0.5 s" in text
    assert "pick; at most 20 N, vacuum on" in text and "retreat; at most 20 N, vacuum off" in text
    assert "cannot be executed" not in text and "vacuum" not in dry_run(replace(small_plan(1), cell=CELL)).text()


def test_a_cell_file_says_how_its_cup_is_wired() -> None:
    raw = {
        "kind": "suction",
        "tcp_offset_m": [0, 0, 0.25],
        "mass_kg": 1.0,
        "palm_m": [[-0.05, -0.05, 0], [0.05, 0.05, 0.1]],
        "stem_radius_m": 0.008,
        "cup_radius_m": 0.0125,
    }
    wired = {**raw, "vacuum_output": "tool_0", "vacuum_input": "tool_1", "vacuum_wait_s": 0.4}
    gripper = read_gripper(wired, "gripper")
    assert gripper.wiring == VacuumWiring("tool_0", "tool_1", 0.4)  # type: ignore[union-attr]
    for wrong, words in (
        ({"vacuum_input": "tool_1"}, "but not 'vacuum_output'"),
        ({"vacuum_output": "tool_2"}, "vacuum_output"),
        ({"vacuum_output": "tool_0", "vacuum_wait_s": 60}, "vacuum_wait_s"),
    ):
        with pytest.raises(InputError, match=words):
            read_gripper({**raw, **wrong}, "gripper")
