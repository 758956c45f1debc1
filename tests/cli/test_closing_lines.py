"""The closing line tells physics' verdicts; what it holds against a design is what the report says, word for word."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Equilibrium, Part, Polygon, SupportFree
from mocca_robot.cli.closing_lines import document, physics_words
from mocca_robot.cli.console import Pace
from mocca_robot.cli.reasons import physics_findings
from mocca_robot.cli.stages import DesignOutcome
from mocca_robot.design import Design
from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report.data import ReportData, collect
from mocca_robot.report.findings import disagreements
from mocca_robot.report.markup import esc
from mocca_robot.report.page import report_page
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.physics import (
    InsertionTrial,
    PartInsertion,
    Simulation,
    StateVerdict,
    TiltVerdict,
    Verdict,
)

CONFIGS = Path(__file__).parents[2] / "configs"


def tilt(
    critical_deg: float, statics_deg: float, friction: float, within_deg: float = 0.0, cause: str = ""
) -> TiltVerdict:
    critical, statics, within = (float(np.deg2rad(a)) for a in (critical_deg, statics_deg, within_deg))
    return TiltVerdict(
        azimuth_rad=0.0, critical_rad=critical, statics_rad=statics, friction=friction, within_rad=within, cause=cause
    )


def simulation(*tilts: TiltVerdict) -> Simulation:
    return Simulation(name="x", engine="mujoco 3", tilt=tilts)


def told() -> Simulation:
    """A simulation that holds everything against a pile of two blocks that there is."""
    ways = (("rim", False), ("outside", True))
    trials = tuple(
        InsertionTrial(part="c", kind=kind, direction=(0.0, -1.0), succeeded=succeeded, reason="penetrated by 1 mm")
        for kind, succeeded in ways
    )
    return Simulation(
        name="x",
        engine="mujoco 3",
        states=(
            StateVerdict(placed="b", verdict=Verdict.FELL, statics=Status.EQUILIBRIUM, moved=("b",), cause="soft"),
            StateVerdict(placed="c", verdict=Verdict.FAILED, statics=Status.EQUILIBRIUM, reason="it exploded"),
        ),
        tilt=(tilt(10.0, 12.0, 0.3, cause="none found"), tilt(10.0, 12.0, 0.0)),
        insertion=(PartInsertion(part="c", axis=(0.0, -1.0), realised_rad=0.2, tried_rad=0.1, trials=trials),),
    )


@pytest.fixture(scope="module")
def pile() -> ReportData:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    shapes = [Polygon(square + np.array([0.0, height])) for height in range(3)]
    parts = tuple(Part(name, shape, fixed=name == "a") for name, shape in zip("abc", shapes))
    assembly = Assembly("x", parts, (Equilibrium(), SupportFree()))
    joints = PartsGraph.of(assembly).joints
    return collect(
        Design(source=assembly, assembly=assembly, joints=joints, insertion=(), load_cases=()),
        versions={},
        simulation=told(),
    )


def outcome(data: ReportData) -> DesignOutcome:
    return DesignOutcome(
        design=data.design, before=data.before, after=data.after, states=data.states, simulation=data.simulation
    )


def test_report_and_command_line_say_the_same_words(pile: ReportData) -> None:
    mine = outcome(pile)
    found = physics_findings(mine.remarks)
    notes = document(mine, ())["notes"]
    kinds = ["disagreement"] * 3 + ["falls", "inaccurate", "jams", "disagreement"]
    assert [f.kind for f in found] == kinds
    assert notes == []
    assert list(disagreements(pile)) == [f.text for f in found if f.kind != "falls"]
    page = report_page(pile)
    assert all(esc(text) in page for text in (*disagreements(pile), *notes))
    told_in_file = document(mine, ())["simulation"]["disagreements"]
    assert set(told_in_file) <= {*disagreements(pile), *notes} and len(told_in_file) == 4


def test_what_is_held_against_a_design_names_its_parts_and_state(pile: ReportData) -> None:
    by_kind = {f.kind: f for f in physics_findings(outcome(pile).remarks)}
    assert by_kind["falls"].parts == ("b",) and by_kind["falls"].case == "state_b"
    assert by_kind["jams"].parts == ("c",) and by_kind["inaccurate"].case == "state_c"


def test_a_simulation_that_agrees_holds_nothing_against_a_design(pile: ReportData) -> None:
    agreeing = dataclasses.replace(pile, simulation=simulation(tilt(12.0, 12.1, 0.0)))
    assert outcome(agreeing).remarks == () and disagreements(agreeing) == ()
    unasked = dataclasses.replace(pile, simulation=None)
    assert outcome(unasked).remarks == () and document(outcome(unasked), ())["simulation"] is None


def test_engines_are_no_closer_than_physics_is_fine() -> None:
    assert "statics at most 0.05° apart" in physics_words(simulation(tilt(12.5, 12.5, 0.0, within_deg=0.05)))


def test_every_friction_has_its_tilt() -> None:
    said = physics_words(simulation(tilt(12.5, 12.5, 0.0), tilt(30.0, 30.0, 0.3), tilt(21.0, 21.5, 0.3)))
    assert "(statics at most 0.00° apart), 21.00° with friction 0.3 (statics at most 0.50°" in said


def test_states_are_counted_by_what_they_agree_on() -> None:
    said = physics_words(told())
    assert said.startswith("mujoco 3: 0 of 2 states stand, 0 agree with statics; falls at a tilt of 10.00° (")
    assert said.endswith("0 of 1 insertions inside the cones succeed, 1 of 1 outside")


def test_every_engine_that_judged_is_named_once() -> None:
    springs = dataclasses.replace(tilt(10.0, 10.1, 0.3), engine="coulomb 1")
    assert physics_words(simulation(tilt(12.0, 12.1, 0.0), springs, springs)).startswith("mujoco 3, coulomb 1: ")


def test_insertions_that_were_not_tried_are_not_counted() -> None:
    """Ctrl-C ends a simulation before its first trial."""
    part = PartInsertion(part="b", axis=(0.0, 1.0), realised_rad=0.1, tried_rad=0.1, friction=0.0)
    begun = dataclasses.replace(simulation(tilt(12.5, 12.5, 0.0)), insertion=(part,), interrupted=True)
    assert "insertions" not in physics_words(begun) and "falls at a tilt" in physics_words(begun)


def test_quick_and_thorough_say_what_physics_is_asked() -> None:
    from argparse import ArgumentParser

    from mocca_robot.cli import simulate
    from mocca_robot.config.config import load

    parser = ArgumentParser()
    simulate.add_questions(parser)
    config = load(CONFIGS / "stack.yaml")

    def stages(*words: str) -> tuple[str, ...]:
        return simulate.questions(parser.parse_args(words), config).stages

    assert stages("--quick") == ("states",)
    assert set(stages("--thorough")) == {*stages(), "robust"}
    with pytest.raises(InputError, match="leave out --insert"):
        stages("--quick", "--insert")


def test_the_rest_is_estimated_once_a_tenth_is_done() -> None:
    pace = Pace()
    assert [pace.left(done, 40) for done in (1, 2)] == ["", ""]
    assert "left" in pace.left(10, 40)
    assert pace.left(40, 40) == ""
    assert pace.left(1, 500) == ""  # another piece of work
