"""A reserve against tilting that was asked for and not reached is said wherever the verdict stands."""

from __future__ import annotations

import html
import json
from pathlib import Path

import pytest

from mocca_robot.cli import main
from mocca_robot.joints.bounds import Bound


def block(folder: Path, **joints: object) -> Path:
    """Return a configuration of a block on the ground that may have a joint of hardly any slope."""
    square = [[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]]
    ground = [[-0.1, -0.1], [0.2, -0.1], [0.2, 0], [-0.1, 0]]
    model = {
        "format": "mocca-robot/assembly",
        "version": 1,
        "units": "m",
        "dimension": 2,
        "name": "block",
        "alpha_deg": None,
        "parts": [{"name": "ground", "fixed": True, "polygon": ground}, {"name": "block", "polygon": square}],
    }
    (folder / "block.json").write_text(json.dumps(model))
    path = folder / "block.yaml"
    path.write_text(json.dumps({"model": "block.json", "joints": {"max_slope_deg": 0.9, **joints}}))
    return path


def asked(command: str, path: Path, folder: Path, capsys: pytest.CaptureFixture[str], *more: str) -> tuple[int, str]:
    """Return the exit status and what is printed."""
    output = [] if command == "check" else ["--output", str(folder / "out")]
    status = main([command, str(path), *output, *more])
    return status, capsys.readouterr().out


@pytest.mark.parametrize("command", ["design", "run", "check"])
def test_a_default_that_is_missed_stands_in_the_verdict(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, said = asked(command, block(tmp_path), tmp_path, capsys)
    assert status == 0
    assert "every verdict is positive" not in said
    verdict = next(line for line in said.splitlines() if line.startswith("✓"))
    assert "less reserve than asked for" in verdict and "not 1.00°" in verdict
    assert "'block' would move" in said
    if command != "check":
        page = (tmp_path / "out" / "report.html").read_text()
        assert "where 1.00° was asked for" in page and "'ground'–'block'" in html.unescape(page)


def test_a_figure_that_somebody_wrote_down_is_a_negative_verdict_when_missed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked_for = ("--set", "joints.tilt_margin_deg=30", "--json")
    status, said = asked("design", Path("configs/m.yaml"), tmp_path, capsys, *asked_for)
    assert status == 1
    told = json.loads(said)
    reserve = told["reserve"]
    assert reserve["reached"] is False and reserve["margin_deg"] == pytest.approx(30.0)
    assert 10.0 < reserve["critical_deg"] < 30.0
    pairs = [tuple(pair) for pair in reserve["gives_way"]]
    assert pairs and [tuple(j["parts"]) for j in reserve["limits"]] == pairs
    tight = {bound for joint in reserve["limits"] for bound in joint["bounds"]}
    assert tight and tight <= {str(b) for b in Bound}
    (finding,) = told["findings"]
    assert finding["kind"] == "reserve" and finding["parts"] == reserve["moving"]
    assert "not 30.00°" in finding["text"] and any(bound in finding["text"] for bound in tight)


def test_a_reserve_that_is_reached_leaves_the_verdict_plain(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, said = asked("design", block(tmp_path, max_slope_deg=45, tilt_margin_deg=3), tmp_path, capsys)
    assert status == 0
    assert "✓ every verdict is positive" in said
