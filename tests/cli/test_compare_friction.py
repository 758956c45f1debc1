"""`compare --friction`: designs that count on different friction, side by side."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mocca_robot.cli import main

SLOPE = {
    "ground": [[0, 0], [100, 0], [100, 30], [0, 20]],
    "block": [[0, 20], [100, 30], [100, 60], [0, 60]],
}


@pytest.fixture
def sloped(tmp_path: Path) -> Path:
    parts = [{"name": n, "polygon": p, "fixed": n == "ground"} for n, p in SLOPE.items()]
    data = {"format": "mocca-robot/assembly", "version": 1, "units": "mm", "dimension": 2, "name": "sloped",
            "alpha_deg": 5, "parts": parts}  # fmt: skip
    path = tmp_path / "sloped.json"
    path.write_text(json.dumps(data))
    return path


def test_with_friction_fewer_joints_are_needed(
    sloped: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["compare", str(sloped), "--friction", "0", "0.4", "-o", str(out), "--json"]) == 0
    smooth, rough = json.loads(capsys.readouterr().out)["variants"]
    assert [v["friction"] for v in (smooth, rough)] == [0.0, 0.4]
    assert smooth["curved_joints"] == 1 and smooth["heights_mm"] > 0.5
    assert rough["curved_joints"] == 0 and rough["heights_mm"] == 0.0
    for variant in (smooth, rough):
        assert variant["verdict"] == "stands" and variant["physics_stands"] is True
        assert variant["physics_tilt_deg"] == pytest.approx(variant["tilt_deg"], abs=0.3)
    assert rough["tilt_deg"] == pytest.approx(21.8 - 5.71, abs=0.1)
    assert "Physics" in (out / "comparison.html").read_text()


@pytest.mark.parametrize(
    ("given", "words"),
    [(["-0.2"], "--friction -0.2: give numbers from 0"), (["nan"], "--friction nan"), (["0.2", "0.2"], "0.2 twice")],
)
def test_wrong_coefficients_are_named(
    given: list[str], words: str, sloped: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", str(sloped), "--friction", *given]) == 2
    assert words in capsys.readouterr().err
