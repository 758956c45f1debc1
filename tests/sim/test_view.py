"""The viewer: parts are where they belong, and the exported page needs nothing else."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.random_assemblies import random_assembly, random_solid
from mocca_robot.assembly import Assembly
from mocca_robot.cli import main
from mocca_robot.files.assembly_json import write_assembly
from mocca_robot.motion.parts_graph import PartsGraph
from sim.shapes.contact_model import embed
from sim.show.view import poses, shown


@pytest.mark.parametrize(
    "assembly", [random_assembly("wall", 1), random_solid("solid_stack", 0)], ids=("flat", "solid")
)
def test_finished_parts_stand_in_their_places_and_absent_ones_are_hidden(assembly: Assembly) -> None:
    what = shown(PartsGraph.of(assembly))
    places = np.array([embed(p.centroid) for p in assembly.parts])
    done = poses(what, float(len(assembly.parts)), 0.0, 0.0)
    assert np.allclose([p for p, _, _ in done], places) and all(visible for _, _, visible in done)
    assert [visible for _, _, visible in poses(what, 0.0, 0.0, 0.0)] == [p.fixed for p in assembly.parts]
    fallen = poses(what, float(len(assembly.parts)), 0.0, float(what.motion.times[-1]))
    travelled = np.linalg.norm(np.array([p for p, _, _ in fallen]) - places, axis=1)
    assert np.all(travelled[assembly.fixed] == 0.0)
    assert 0.1 * assembly.size < travelled.max() < assembly.size, "the fall is not to be seen"


def test_the_page_holds_everything(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write_assembly(random_assembly("stack", 1), tmp_path / "a.json")
    assert main(["view", str(file), "--export", str(tmp_path / "a.html"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["file"] == str(tmp_path / "a.html")
    assert (tmp_path / "a.html").stat().st_size > 100_000


def test_without_viser_the_message_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_assembly(random_assembly("stack", 1), tmp_path / "a.json")
    monkeypatch.setitem(sys.modules, "viser", None)
    assert main(["view", str(file), "--export", str(tmp_path / "a.html")]) == 2
    assert "pip install mocca-robot[viewer]" in capsys.readouterr().err


def test_without_a_screen_the_native_viewer_says_what_else_there_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_assembly(random_assembly("stack", 1), tmp_path / "a.json")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sim.show.native_view.sys.platform", "linux")
    assert main(["view", str(file), "--mujoco"]) == 2
    assert "needs a screen" in capsys.readouterr().err


def test_a_plan_is_played_from_its_waypoints_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from test_rehearse import cell, pile

    from mocca_robot.files.design_json import write_design
    from mocca_robot.plan.plan import MoveKind, write_plan
    from mocca_robot.plan.reader import file_sha256
    from planners.robot.build_plan import build_plan
    from sim.cell.cell_model import seat
    from sim.cell.planned import planned

    source = write_design(pile(), tmp_path)
    plan = build_plan(pile(), cell(), file_sha256(source), design_path=source.name).plan
    assert plan is not None
    build = planned(plan, pile())
    moves = plan.steps[0].moves
    assert build.frames[0].joints[:6] == pytest.approx(moves[0].path[0].q)
    assert build.frames[-1].joints[:6] == pytest.approx(moves[-1].path[-1].q)
    moving = build.place.assembly.index("b0")
    first, last = dict(build.frames[0].parts)[moving], dict(build.frames[-1].parts)[moving]
    home = seat(build.place.assembly.parts[moving])
    assert last.position == pytest.approx(home.position) and abs(last.quat_wxyz[0]) == pytest.approx(1.0)
    assert np.linalg.norm(np.subtract(first.position, home.position)) > 0.1  # it waits in the tray
    # Just before it is let go the hand has brought it there itself.
    lasts = sum(m.path[-1].t for m in moves[: [m.kind for m in moves].index(MoveKind.INSERT) + 1]) + 1.0
    brought = min(build.frames, key=lambda f: abs(f.time_s - lasts))
    assert dict(brought.parts)[moving].position == pytest.approx(home.position, abs=1e-3)
    write_plan(plan, tmp_path / "plan.json")
    assert main(["view", str(tmp_path / "plan.json"), "--json"]) == 0
    page = Path(json.loads(capsys.readouterr().out)["file"]).read_text(encoding="utf-8")
    assert page.count('class="step"') == 1 and "as they are written" in page
    source.unlink()
    assert main(["view", str(tmp_path / "plan.json")]) == 2
    assert "not where the plan says" in capsys.readouterr().err
