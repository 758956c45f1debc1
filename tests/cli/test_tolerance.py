"""`tolerance` and `check --heal`: parts that nearly touch, from the error to a design."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest

from mocca_robot.cli import main
from mocca_robot.files.documents import parse_yaml

Ring = list[list[float]]


def box(x: float, y: float, width: float, height: float) -> Ring:
    return [[x, y], [x + width, y], [x + width, y + height], [x, y + height]]


@pytest.fixture
def pile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a configuration of four flat parts, one sunk in by 0.02 mm, one 0.03 mm apart."""
    monkeypatch.chdir(tmp_path)
    parts = {
        "slab": box(0, 0, 200, 20),
        "left": box(20, 19.98, 40, 60),
        "right": box(100, 20, 40, 60),
        "lintel": box(20, 80.01, 120, 20),
    }
    data = {
        "format": "mocca-robot/assembly",
        "version": 1,
        "units": "mm",
        "name": "pile",
        "dimension": 2,
        "parts": [{"name": n, "polygon": p, "fixed": n == "slab"} for n, p in parts.items()],
    }
    Path("pile.json").write_text(json.dumps(data), encoding="utf-8")
    path = Path("pile.yaml")
    path.write_text(
        "model: pile.json\ngoal: {kind: lateral, angle_deg: 5}\nalpha_deg: 3\njoints: {min_radius: 0.5, margin: 0.12}\n"
        "insertion: {lintel: [0, -1]}\ncut: {kerf: 0.2}\n",
        encoding="utf-8",
    )
    return path


def ran(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, dict[str, Any]]:
    code = main([*words, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_the_error_names_the_command_that_helps(pile: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = ran(capsys, "design", str(pile), "--set", "alpha_deg=2")
    assert code == 2 and "'slab' and 'left' overlap by 0.02 mm" in said["error"]
    command = shlex.split(said["error"].split("`")[1])
    assert command[:5] == ["mocca-robot", "check", "pile.yaml", "--set", "alpha_deg=2"]
    code, said = ran(capsys, *command[1:])
    assert code == 1  # without joints it does not stand tilted
    assert {tuple(t["parts"]) for t in said["taken_as_touching"]} == {
        ("slab", "left"),
        ("left", "lintel"),
        ("right", "lintel"),
    }
    deep = {tuple(t["parts"]): (t["overlap_m"], t["gap_m"]) for t in said["taken_as_touching"]}
    assert deep["slab", "left"] == pytest.approx((2e-5, 0.0), abs=1e-9)
    assert deep["left", "lintel"] == pytest.approx((0.0, 3e-5), abs=1e-9)
    code, said = ran(capsys, *command[1:], "--heal", "mended")
    assert code == 0 and said["left"] == []


def test_design_needs_the_mended_copy_and_works_on_it(pile: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = ran(capsys, "design", str(pile), "--set", "tolerance=0.05 mm", "-o", "no")
    assert code == 2 and "share their faces exactly" in said["error"] and "--heal" in said["error"]
    assert ran(capsys, "check", str(pile), "--heal", "mended")[0] == 0
    written = parse_yaml(Path("mended/pile.yaml").read_text(encoding="utf-8"), "it")
    assert written["joints"] == {"min_radius": "0.5 mm", "margin": 0.12} and written["cut"] == {"kerf": 0.2}
    assert written["insertion"] == {"lintel": [0, -1]} and "tolerance" not in written
    code, said = ran(capsys, "design", "mended/pile.yaml", "-o", "made")
    assert code == 0 and said["parts"] == 4


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("3 mm", "at most a tenth of that, 2 mm"),
        ("-1", "at least 0"),
        ("9 %", "at most 0.05"),
        ("a few %", "as '0.02 %'"),
        ("[1]", "must be a number"),
    ],
)
def test_a_tolerance_that_makes_no_sense_is_refused(
    pile: Path, capsys: pytest.CaptureFixture[str], value: str, said: str
) -> None:
    code, found = ran(capsys, "check", str(pile), "--set", f"tolerance={value}")
    assert code == 2 and said in found["error"]


def test_a_share_is_one_of_the_diagonal(pile: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for share, code in (("0.02 %", 1), ("0.005 %", 2)):  # of 224 mm: 0.045 mm, and 0.011 mm
        assert ran(capsys, "check", str(pile), "--set", f"tolerance={share}")[0] == code


def test_nothing_to_heal_is_said(pile: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ran(capsys, "check", str(pile), "--heal", "mended")
    code, said = ran(capsys, "check", "mended/pile.yaml", "--heal")
    assert code == 2 and "nothing to heal" in said["error"]
