"""A plan is looked at again before it runs, from its file alone: an edit that would destroy the build is refused."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.design import Design, Insertion
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import write_design
from mocca_robot.plan.arm_models import robot_model
from mocca_robot.plan.plan import Plan, document, write_plan
from mocca_robot.plan.reader import file_sha256, plan_from_document
from mocca_robot.plan.safety import findings
from planners.robot.build_plan import build_plan
from planners.robot.cell import RobotCell, cell_of, read_cell
from planners.robot.second_look import look_again

ROOT = Path(__file__).resolve().parents[2]


def block(name: str, x: float, y: float, w: float, h: float, fixed: bool = False) -> Part:
    return Part(name, Polygon(np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])), fixed=fixed)


@cache
def tower() -> Design:
    """Blocks 20 mm thick of different widths on a base, all let down from above."""
    blocks = (
        block("base", 0.0, 0.0, 0.1, 0.03, True),
        block("b0", 0.01, 0.03, 0.06, 0.05),
        block("b1", 0.02, 0.08, 0.04, 0.05),
    )
    down = tuple(Insertion(b.name, np.array([0.0, -1.0]), float(np.deg2rad(80))) for b in blocks[1:])
    assembly = Assembly("tower", blocks, alpha_rad=np.deg2rad(10))
    return Design(source=assembly, assembly=assembly, joints=(), insertion=down, load_cases=())


def cell() -> RobotCell:
    return replace(read_cell(ROOT / "configs" / "cells" / "ur5e_2f85.yaml"), build_size_m=None)


@cache
def plan() -> Plan:
    built = build_plan(tower(), cell(), "0" * 64)
    assert built.plan is not None, [r.reasons for r in built.reports]
    return built.plan


def refused(raw: dict[str, Any]) -> str:
    """Return every reason why an edited plan does not run, '' when it does."""
    try:
        edited = plan_from_document(raw)
        found = findings(edited) or look_again(edited, tower().assembly)
    except InputError as error:
        return str(error)
    return "\n".join(map(str, found))


def moves(raw: dict[str, Any]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = raw["steps"][0]["moves"]
    return found


def of_kind(raw: dict[str, Any], kind: str) -> dict[str, Any]:
    return next(m for m in moves(raw) if m["kind"] == kind)


def into_the_table(raw: dict[str, Any]) -> None:
    """Send the arm far down half way to the tray, with joints and poses that agree, slowly enough."""
    arm, offset = robot_model(raw["robot"]), raw["cell"]["tcp_offset"]
    path = moves(raw)[0]["path"]
    for k, w in enumerate(path):
        w["q"][1] += 0.7 * float(np.sin(np.pi * k / (len(path) - 1))) ** 2
        w["tcp"] = list(arm.tcp_pose(w["q"], offset))
        w["t"] *= 8.0


def swapped(raw: dict[str, Any]) -> None:
    raw["steps"].reverse()


EDITS: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "release deleted": (lambda r: moves(r).remove(of_kind(r, "release")), "the hand is seated"),
    "release closed": (lambda r: of_kind(r, "release").update(gripper_m=0.0), r"(release): gripper_m is 0.00 mm"),
    "insert relabelled": (lambda r: of_kind(r, "insert").update(kind="transit"), "the hand is held"),
    "centre of gravity": (lambda r: r["steps"][0]["grasp"].update(cog_m=[0, 0, 5.0]), "cog_m is"),
    "centre of gravity, 2 cm": (lambda r: r["steps"][0]["grasp"]["cog_m"].__setitem__(0, 0.02), "cog_m is"),
    "no mass": (lambda r: r["steps"][0]["grasp"].update(mass_kg=0.0), "mass_kg is 0, limit above 0"),
    "half the mass": (lambda r: r["steps"][1]["grasp"].update(mass_kg=0.02), "mass_kg is 0.02"),
    "crushing grip": (lambda r: r["steps"][0]["grasp"].update(force_n=1e6), "force_n is 1e+06"),
    "harder grip": (lambda r: r["steps"][0]["grasp"].update(force_n=200.0), "the cell's gripper"),
    "into the table": (into_the_table, "a collision"),
    "parts swapped": (swapped, "the design's order, each part once"),
    "tool": (lambda r: r["cell"].update(tool_mass_kg=0.2), "tool_mass_kg is 0.2"),
    "other part": (lambda r: r["steps"][0].update(part="b7"), "a part of the design"),
    "tray": (lambda r: r["steps"][0]["grasp"].pop("tray_motion"), "where the part waits"),
}


def test_a_plan_as_it_was_written_passes() -> None:
    assert refused(copy.deepcopy(document(plan()))) == ""
    assert cell_of(plan()).execution == plan().cell


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_that_would_destroy_the_build_is_refused(edit: str) -> None:
    raw = copy.deepcopy(document(plan()))
    change, words = EDITS[edit]
    change(raw)
    assert words in refused(raw)


def test_dry_run_and_execution_look_before_anything_moves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    design = write_design(tower(), tmp_path)
    good = replace(plan(), design_sha256=file_sha256(design), design="design.json")
    write_plan(good, tmp_path / "plan.json")
    assert main(["execute", str(tmp_path / "plan.json")]) == 0
    assert "second look: parts carried along every waypoint" in capsys.readouterr().out
    raw = document(good)
    raw["steps"][0]["grasp"]["force_n"] = 200.0
    (tmp_path / "edited.json").write_text(json.dumps(raw), encoding="utf-8")
    assert main(["execute", str(tmp_path / "edited.json")]) == 1
    assert "REFUSED step 0 (b0): force_n is 200" in capsys.readouterr().out
    # Refused before a robot is even looked for: this one does not exist.
    robot = ["--robot", "127.0.0.9", "--confirm", "x"]
    assert main(["execute", str(tmp_path / "edited.json"), *robot]) == 2
    assert "force_n is 200" in capsys.readouterr().err
    design.unlink()
    assert main(["execute", str(tmp_path / "plan.json"), *robot]) == 2
    assert "cannot be looked at again" in capsys.readouterr().err
