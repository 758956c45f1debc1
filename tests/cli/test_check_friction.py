"""`check --friction`: what is only clamped is a negative verdict with its reason; the bound is a second figure."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import case_at, critical_tilt, solve_case
from mocca_robot.statics.friction_cases import tilt_band, tilt_bound, tilt_with_friction
from mocca_robot.statics.friction_verdict import Standing
from mocca_robot.statics.loads import state_cases

Ring = list[list[float]]


def box(x: float, y: float, width: float, height: float) -> Ring:
    return [[x, y], [x + width, y], [x + width, y + height], [x, y + height]]


BETWEEN = {"left": box(-80, -20, 80, 160), "right": box(90, -20, 80, 160), "block": box(0, 10, 90, 60)}
TENON = {
    "ceiling": [[-40, 0], [-8, 0], [-8, 25], [8, 25], [8, 0], [40, 0], [40, 50], [-40, 50]],
    "pin": [[-8, -30], [8, -30], [8, 25], [-8, 25]],
}
DRAWER = {
    "chest": [[0, 0], [100, 0], [100, 30], [20, 30], [20, 50], [100, 50], [100, 80], [0, 80]],
    "drawer": box(20, 30, 90, 20),
}
FIXED = {"left", "right", "ceiling", "chest"}


def written(path: Path, parts: dict[str, Ring]) -> Path:
    data = {
        "format": "mocca-robot/assembly",
        "version": 1,
        "units": "mm",
        "dimension": 2,
        "name": path.stem,
        "alpha_deg": None,
        "parts": [{"name": n, "polygon": p, "fixed": n in FIXED} for n, p in parts.items()],
    }
    path.write_text(json.dumps(data), encoding="utf-8")
    return path


def loaded(parts: dict[str, Ring]) -> Assembly:
    made = tuple(Part(n, Polygon(np.array(p) * 1e-3), fixed=n in FIXED) for n, p in parts.items())
    return Assembly("made", made)


@pytest.mark.parametrize("parts", [BETWEEN, TENON], ids=["between", "tenon"])
@pytest.mark.parametrize("friction", ["0.01", "0.5", "1.5"])
def test_what_only_clamping_would_hold_is_a_negative_verdict(
    parts: dict[str, Ring], friction: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path / "made.json", parts)
    assert main(["check", str(path), "--friction", friction, "--json"]) == 1
    captured = capsys.readouterr()
    found: dict[str, Any] = json.loads(captured.out)
    (finding,) = (f for f in found["findings"] if f["kind"] == "clamped")
    assert finding["parts"] == [list(parts)[-1]]
    assert "nothing brings them about" in finding["text"]
    (state,) = found["states"]
    assert (state["status"], state["standing"]) == ("not_in_equilibrium", "stands_only_clamped")
    assert "would slide out" in captured.err + captured.out


def test_a_drawer_slides_at_the_friction_angle_whatever_could_pinch_it() -> None:
    assembly = loaded(DRAWER)
    graph = PartsGraph.of(assembly)
    assert critical_tilt(graph, 0.0, 0.3) == pytest.approx(np.arctan(0.3), abs=2e-3)
    assert tilt_bound(graph, 0.0, 0.3) > np.deg2rad(80.0)
    found = tilt_with_friction(graph, 0.0, 0.3)
    assert found.failure is not None and found.failure.standing is Standing.STANDS_ONLY_CLAMPED
    low, high = tilt_band(graph, 0.0, 0.3)
    assert high - low < np.deg2rad(0.1)


def test_a_case_tells_the_verdict_that_its_result_stands_for() -> None:
    assembly = loaded(DRAWER)
    graph = PartsGraph.of(assembly)
    flat, steep = (solve_case(graph, case_at(assembly, np.deg2rad(t), 0.0), 0.3) for t in (5.0, 40.0))
    assert flat.result.stands and flat.rubbing is not None and flat.rubbing.stands and not flat.only_clamped
    assert steep.only_clamped and not steep.result.stands and steep.moving == ("drawer",)
    frictionless = solve_case(graph, case_at(assembly, 0.0, 0.0))
    assert frictionless.rubbing is None and not frictionless.only_clamped


def test_a_state_in_which_only_fixed_parts_touch_is_a_verdict() -> None:
    fixed = {"left": box(0, 0, 100, 10), "right": box(100, 0, 100, 10)}
    parts = {**fixed, "hat": box(40, 60, 20, 20), "post": box(40, 10, 20, 50)}
    assembly = loaded(parts)
    graph = PartsGraph.of(assembly)
    verdicts = [solve_case(graph, case, 0.6) for case in state_cases(graph)]
    assert [v.result.stands for v in verdicts] == [False, True]
    assert verdicts[0].moving == ("hat",) and verdicts[0].rubbing is not None
    assert verdicts[0].rubbing.standing is Standing.FALLS


@pytest.mark.parametrize("steps", [0, 1])
def test_what_cannot_be_decided_is_said_to_be_undecided(
    steps: int, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mocca_robot.statics.solver.coulomb_steps.MOST_CORRECTIONS", steps)
    assembly = loaded(BETWEEN)
    found = solve_case(PartsGraph.of(assembly), case_at(assembly, 0.0, 0.0), 0.5)
    assert found.rubbing is not None and found.rubbing.standing is Standing.UNDECIDED
    assert (found.result.stands, str(found.result.status)) == (False, "inaccurate")
    assert len(found.rubbing.shares) == steps
    assert main(["check", str(written(tmp_path / "made.json", BETWEEN)), "--friction", "0.5"]) == 1
    said = "".join(capsys.readouterr())
    assert "neither rest nor a lasting fall was found" in said and "stands only clamped" not in said


def test_check_says_the_bound_beside_the_tilt(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path / "drawer.json", DRAWER)
    assert main(["check", str(path), "--friction", "0.3", "--json"]) in (0, 1)
    captured = capsys.readouterr()
    right, _ = json.loads(captured.out)["tilt"]
    assert right["critical_deg"] == pytest.approx(16.7, abs=0.1)
    assert right["stands_deg"] <= right["critical_deg"] <= right["fails_deg"] < right["bound_deg"]
    assert right["falls_deg"] == right["fails_deg"]
    assert right["fails_as"] == "stands_only_clamped"
    assert main(["check", str(path), "--friction", "0.3"]) in (0, 1)
    captured = capsys.readouterr()
    assert "clamped it could stand up to: right" in captured.err + captured.out


def test_the_reserve_with_friction_stands_beside_the_one_without(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path / "stack.json", {"chest": box(0, 0, 100, 10), "low": box(20, 10, 60, 10)})
    main(["check", str(path), "--friction", "0.4", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert told["reserve"]["friction"] == 0.4
    assert told["reserve"]["critical_deg"] == pytest.approx(np.rad2deg(np.arctan(0.4)), abs=0.1)
    assert told["reserve_without_friction"]["critical_deg"] == pytest.approx(0.0, abs=0.01)
    main(["check", str(path), "--friction", "0.4"])
    said = capsys.readouterr().out
    assert "towards right, with friction 0.4" in said and "towards right, without friction" in said
    main(["check", str(path), "--json"])
    assert "reserve_without_friction" not in json.loads(capsys.readouterr().out)
