"""The stand-alone program: well-formed, and every number of it one of the plan's or of its limits."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from ur_cell import small_plan

from mocca_robot.errors import InputError
from mocca_robot.ur.commands import export_urscript
from mocca_robot.ur.plan import MoveKind, Plan, write_plan
from mocca_robot.ur.urscript import urscript

PLAN = small_plan(2)
OPENS = re.compile(r"^(def|if|while|thread)\b.*:$")


def blocks(text: str) -> int:
    """Return the number of lines, having checked that blocks open, indent and end as URScript wants them."""
    depth = 0
    for line in text.splitlines():
        words = line.strip()
        if words == "end" or words.startswith(("elif ", "else")):
            depth -= 1
        assert line == "  " * depth + words, line
        if OPENS.match(words) or words.startswith(("elif ", "else")):
            depth += 1
        assert line.count('"') % 2 == 0
        assert line.count("(") == line.count(")") and line.count("[") == line.count("]"), line
    assert depth == 0
    return len(text.splitlines())


def lists(text: str, command: str) -> list[list[float]]:
    found = re.findall(rf"^\s+{command}\(\[([^\]]*)\]", text, re.M)
    return [[float(v) for v in f.split(",")] for f in found]


def test_program_is_well_formed() -> None:
    assert blocks(urscript(PLAN)) > 100
    assert blocks(urscript(replace(PLAN, gripper="none"))) > 100


def test_motions_go_where_the_plan_goes() -> None:
    text = urscript(PLAN)
    transits = [w.q for s in PLAN.steps for m in s.moves if m.kind is MoveKind.TRANSIT for w in m.path[1:]]
    assert [x for q in lists(text, "movej") for x in q] == pytest.approx([x for q in transits for x in q], abs=1e-6)
    straight = (MoveKind.APPROACH, MoveKind.PICK, MoveKind.LIFT, MoveKind.RETREAT)
    ends = [m.path[-1].q for s in PLAN.steps for m in s.moves if m.kind in straight]
    assert [x for q in lists(text, "movel") for x in q] == pytest.approx([x for q in ends for x in q], abs=1e-6)
    assert len(lists(text, "insert")) == len(PLAN.steps)


def test_speeds_and_accelerations_stay_below_the_caps() -> None:
    limits, text = PLAN.cell.limits, urscript(PLAN)
    for a, v in re.findall(r"movej\(.*a=([\d.]+), v=([\d.]+)", text):
        assert float(a) <= limits.joint_acceleration_rad_s2 + 1e-6 and float(v) <= limits.joint_speed_rad_s + 1e-6
    for a, v in re.findall(r"movel\(.*a=([\d.]+), v=([\d.]+)", text):
        assert float(a) <= limits.transfer_acceleration_m_s2 and float(v) <= limits.approach_speed_m_s


def test_blends_never_overlap() -> None:
    text = urscript(PLAN)
    radii = [float(r) for r in re.findall(r"movej\(.*r=([\d.]+)\)", text)]
    ends = 0
    for step in PLAN.steps:
        for move in step.moves:
            if move.kind is MoveKind.TRANSIT:
                ends += len(move.path) - 1
                assert radii[ends - 1] == 0.0
                for w in range(1, len(move.path) - 1):
                    r = radii[ends - len(move.path) + w]
                    following = radii[ends - len(move.path) + w + 1]
                    assert r + following <= math.dist(move.path[w].tcp[:3], move.path[w + 1].tcp[:3]) + 1e-6


def test_names_cannot_smuggle_code_into_the_program() -> None:
    step = replace(PLAN.steps[0], part='x")\nhalt #')
    cell = replace(PLAN.cell, name='a"\nset_tcp(p[0,0,0,0,0,0])')
    text = urscript(replace(PLAN, steps=(step, *PLAN.steps[1:]), cell=cell))
    blocks(text)
    assert len(re.findall(r"^\s+set_tcp", text, re.M)) == 1
    assert text.count("\n    halt") == urscript(PLAN).count("\n    halt")


def test_unsound_plan_is_not_exported(tmp_path: Path) -> None:
    move = PLAN.steps[0].moves[0]
    steps = (replace(PLAN.steps[0], moves=(replace(move, speed_m_s=1.0), *PLAN.steps[0].moves[1:])),)
    unsound: Plan = replace(PLAN, steps=steps)
    write_plan(unsound, tmp_path / "plan.json")
    with pytest.raises(InputError, match="speed_m_s is 1"):
        export_urscript(tmp_path / "plan.json", tmp_path / "build.script")
    assert not (tmp_path / "build.script").exists()
