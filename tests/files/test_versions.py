"""Versions of files: older ones are brought up to date and said so, newer ones are refused with the way out."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from ur_cell import small_plan

from mocca_robot.cli import main
from mocca_robot.config.config import load
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import read_design
from mocca_robot.files.versions import (
    ASSEMBLY,
    CELL,
    CONFIG,
    DESIGN,
    JOURNAL,
    PROGRESS,
    REHEARSAL,
    SIMULATION,
    STUDY,
    STUDY_FILE,
    Format,
)
from mocca_robot.files.versions import PLAN as PLAN_FORMAT
from mocca_robot.plan.plan import document
from mocca_robot.plan.reader import plan_from_document
from mocca_robot.verdicts.simulation_json import read_simulation
from planners.cone_joints.checkpoint import Checkpoint, read_checkpoint
from planners.cone_joints.search import SearchState
from planners.robot.cell import cell_of, read_cell
from sim.studies.study import read_study

FORMATS = (ASSEMBLY, DESIGN, SIMULATION, REHEARSAL, STUDY, PLAN_FORMAT, JOURNAL, PROGRESS)
BY_HAND = (CONFIG, STUDY_FILE, CELL)
ROOT = Path(__file__).parents[2]
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
    assert found.engine == "mujoco" and 'no "version"' in found.notes[0] and found.notes[1:] == ("mine",)


def test_a_plan_from_before_cells_were_described_is_read_but_not_rehearsed() -> None:
    present = small_plan(2)
    raw = json.loads(json.dumps(document(present)))
    raw.pop("supports", None)
    raw["cell"].pop("description", None)
    plan = plan_from_document(raw)
    assert plan.steps == present.steps and plan.supports == ()
    with pytest.raises(InputError, match=r"does not describe its cell.*Plan again"):
        cell_of(plan)


@pytest.mark.parametrize("known", BY_HAND, ids=lambda f: f.name)
def test_a_file_written_by_hand_needs_no_version_but_is_refused_with_another(known: Format) -> None:
    assert known.current({"name": "x"}, "'a.yaml'") == ({"name": "x"}, ())
    assert known.current({"version": 1}, "'a.yaml'") == ({"version": 1}, ())
    with pytest.raises(InputError, match=r"has version 2 of mocca-robot/.*reads up to version 1\. Upgrade mocca-robot"):
        known.current({"version": 2}, "'a.yaml'")


@pytest.mark.parametrize("kind", ["config", "study", "cell"])
def test_a_newer_yaml_file_is_refused_before_its_keys_are_looked_at(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "new.yaml"
    path.write_text("version: 2\nkey_of_tomorrow: 1\n")
    with pytest.raises(InputError, match="Upgrade mocca-robot"):
        {"config": load, "study": read_study, "cell": read_cell}[kind](path)


def test_unknown_keys_of_cells_and_studies_come_with_the_nearest(tmp_path: Path) -> None:
    cell = (ROOT / "configs" / "cells" / "ur10e_suction.yaml").read_text()
    study = f"base: {ROOT / 'configs' / 'stack.yaml'}\nvary: {{alpha_deg: [1]}}\n"
    path = tmp_path / "file.yaml"
    for text, old, new in (
        (cell, "table_m", "tabel_m"),
        (cell, "  size_m", "  sice_m"),
        (cell, "  gap_m", "  gab_m"),
        (cell, "bellows_m: 0", "belows_m: 0"),
        (cell, "limits: {}", "limits: {retrys: 1}"),
        (study, "vary", "varry"),
    ):
        assert old in text
        path.write_text(text.replace(old, new))
        right = {"limits: {}": "retries", "bellows_m: 0": "bellows_m"}.get(old, old.strip())
        with pytest.raises(InputError, match=f"did you mean '{right}'"):
            (read_study if text is study else read_cell)(path)


def test_the_source_of_a_design_has_its_own_version(tmp_path: Path) -> None:
    path = tmp_path / "design.json"
    sequence = [p["name"] for p in BLOCK["parts"]]
    design = {**BLOCK, "format": DESIGN.name, "version": DESIGN.version, "sequence": sequence}
    path.write_text(json.dumps({**design, "source": {**BLOCK, "version": ASSEMBLY.version + 1}}))
    with pytest.raises(InputError, match=r"source has version 2 of mocca-robot/assembly.*Upgrade"):
        read_design(path)
    path.write_text(json.dumps({**design, "source": BLOCK}))
    assert 'source has no "version"' in read_design(path).notes[0]


def test_where_a_design_stood_in_another_version_is_not_gone_on_from(tmp_path: Path) -> None:
    path = tmp_path / "design-progress.json"
    checkpoint = Checkpoint(path, "x")
    checkpoint.keep(SearchState())
    checkpoint.save()
    assert read_checkpoint(path, "x").state is not None
    for version, told in ((2, "Upgrade mocca-robot"), (None, 'no "version"')):
        data = json.loads(path.read_text()) | {"version": version}
        path.write_text(json.dumps({k: v for k, v in data.items() if v is not None}))
        found = read_checkpoint(path, "x")
        assert found.state is None and told in found.why_not
