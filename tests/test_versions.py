"""Versions of files: older ones are brought up to date and said so, newer ones are refused with the way out."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from ur_cell import small_plan

from mocca_robot.cli import main
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import read_design
from mocca_robot.files.versions import ASSEMBLY, DESIGN, JOURNAL, REHEARSAL, SIMULATION, STUDY, Format
from mocca_robot.files.versions import PLAN as PLAN_FORMAT
from mocca_robot.ur.plan import document
from mocca_robot.ur.plan_reader import plan_from_document
from planners.robot.cell import cell_of
from sim.simulation_json import read_simulation

FORMATS = (ASSEMBLY, DESIGN, SIMULATION, REHEARSAL, STUDY, PLAN_FORMAT, JOURNAL)
BLOCK: dict[str, Any] = {
    "format": "mocca-robot/assembly",
    "units": "mm",
    "dimension": 2,
    "name": "step",
    "parts": [
        {"name": "ground", "fixed": True, "polygon": [[0, 0], [100, 0], [100, 20], [0, 20]]},
        {"name": "block", "polygon": [[30, 20], [70, 20], [70, 50], [30, 50]]},
    ],
}


@pytest.mark.parametrize("known", FORMATS, ids=lambda f: f.name)
def test_the_present_version_is_read_as_it_is_and_the_next_refused(known: Format) -> None:
    document = {"format": known.name, "version": known.version, "parts": []}
    assert known.current(document, "'a.json'") == (document, ())
    with pytest.raises(InputError, match=f"'a.json' has version {known.version + 1} of .*Upgrade mocca-robot, or "):
        known.current({**document, "version": known.version + 1}, "'a.json'")
    with pytest.raises(InputError, match="must be"):
        known.current({**document, "format": "other"}, "'a.json'")
    for odd in (0, -1, 1.5, "1", None, True):
        with pytest.raises(InputError, match="version"):
            known.current({**document, "version": odd}, "'a.json'")


def test_steps_follow_each_other_without_touching_the_document() -> None:
    def metres(document: Any) -> dict[str, Any]:
        return {**document, "version": 2, "length_m": document["length_mm"] / 1e3}

    known = Format("x", (*ASSEMBLY.steps, metres))
    for old in ({"format": "x", "length_mm": 7.0}, {"format": "x", "version": 1, "length_mm": 7.0}):
        before = dict(old)
        found, (note,) = known.current(old, "'a'")
        assert found["version"] == known.version == 2 and found["length_m"] == 0.007
        assert old == before and "read as version 2" in note


def test_an_assembly_without_version_is_read_and_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "step.json"
    path.write_text(json.dumps(BLOCK))
    assert main(["check", str(path)]) == 0
    said = re.sub(r"\s+", " ", "".join(capsys.readouterr()))
    assert 'has no "version"; it was read as version 1 of mocca-robot/assembly' in said
    path.write_text(json.dumps({**BLOCK, "version": 2}))
    assert main(["check", str(path)]) == 2
    assert "Upgrade mocca-robot" in capsys.readouterr().err


def test_a_design_and_a_simulation_without_version_carry_a_note(tmp_path: Path) -> None:
    path = tmp_path / "design.json"
    sequence = [p["name"] for p in BLOCK["parts"]]
    path.write_text(json.dumps({**BLOCK, "format": DESIGN.name, "sequence": sequence, "notes": ["mine"]}))
    notes = read_design(path).notes
    assert 'no "version"' in notes[0] and notes[1:] == ("mine",)
    path = tmp_path / "simulation.json"
    path.write_text(json.dumps({"format": SIMULATION.name, "engine": "mujoco", "notes": ["mine"]}))
    found = read_simulation(path)
    assert found["version"] == 1 and 'no "version"' in found["notes"][0] and found["notes"][1:] == ["mine"]


def test_a_plan_from_before_cells_were_described_is_read_but_not_rehearsed() -> None:
    present = small_plan(2)
    raw = json.loads(json.dumps(document(present)))
    raw.pop("supports", None)
    raw["cell"].pop("description", None)
    plan = plan_from_document(raw)
    assert plan.steps == present.steps and plan.supports == ()
    with pytest.raises(InputError, match=r"does not describe its cell.*Plan again"):
        cell_of(plan)
