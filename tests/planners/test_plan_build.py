"""Plans of whole builds: found, sound, collision-free on a second look, refused with reasons where they cannot be."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from ur_cell import fake_controller, loopback, run, undisturbed

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.config.config import load
from mocca_robot.design import Design, Insertion
from mocca_robot.errors import InputError
from mocca_robot.plan.arm_models import MODELS
from mocca_robot.plan.plan import MoveKind, Plan, Waypoint, insertion_axis, write_plan
from mocca_robot.plan.safety import findings
from planners.robot.arm_poses import branches
from planners.robot.build_plan import build_plan
from planners.robot.build_result import BuildPlan
from planners.robot.cell import RobotCell, read_cell
from planners.robot.grasp import find_grasps
from planners.robot.recheck import recheck
from planners.robot.scene import straight
from planners.robot.site import site
from planners.robot.tray import tray_layout
from planners.robot.tray_files import tray_sheet, write_tray

ROOT = Path(__file__).resolve().parents[2]
CELL_FILE = ROOT / "configs" / "cells" / "ur5e_2f85.yaml"


def block(name: str, x: float, y: float, w: float, h: float, fixed: bool = False) -> Part:
    corners = np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])
    return Part(name, Polygon(corners), fixed=fixed)


def tower(count: int = 2) -> Design:
    """A pile of blocks, each put straight down on the one below."""
    blocks = [block(f"b{k}", 0.0, 0.03 + 0.05 * k, 0.06, 0.05) for k in range(count)]
    assembly = Assembly("tower", (block("base", -0.02, 0, 0.1, 0.03, True), *blocks), alpha_rad=np.deg2rad(10))
    down = tuple(Insertion(b.name, np.array([0.0, -1.0]), float(np.deg2rad(80))) for b in blocks)
    return Design(source=assembly, assembly=assembly, joints=(), insertion=down, load_cases=())


@cache
def cell() -> RobotCell:
    return replace(read_cell(CELL_FILE), build_size_m=None)


@cache
def built() -> BuildPlan:
    return build_plan(tower(), cell(), "0" * 64)


def plan_of(result: BuildPlan) -> Plan:
    assert result.plan is not None, [r.reasons for r in result.reports]
    return result.plan


@pytest.mark.parametrize("model", MODELS.values(), ids=lambda m: m.name)
def test_every_branch_reaches_the_pose_and_one_is_the_arm_as_it_stood(model: object) -> None:
    arm = MODELS[model.name]  # type: ignore[attr-defined]
    rng = np.random.default_rng(1)
    for _ in range(25):
        q = rng.uniform(-np.pi, np.pi, 6)
        flange = arm.frames(q)[-1]
        found = branches(arm, flange)
        assert 1 <= len(found) <= 8
        for other in found:
            assert np.abs(arm.frames(other)[-1] - flange).max() < 1e-9
        turns = [np.angle(np.exp(1j * (other - q))) for other in found]
        assert min(np.abs(t).max() for t in turns) < 1e-6
    flange[:3, 3] = [0.0, 0.0, 3.0]
    assert branches(arm, flange) == []


def test_a_small_tower_is_planned_and_sound() -> None:
    plan = plan_of(built())
    assert [s.part for s in plan.steps] == ["b0", "b1"]
    assert findings(plan) == []
    for step, report in zip(plan.steps, built().reports, strict=True):
        assert [m.kind for m in step.moves][:9] == [
            *(MoveKind.TRANSIT, MoveKind.APPROACH, MoveKind.PICK, MoveKind.LIFT, MoveKind.TRANSIT),
            *(MoveKind.APPROACH, MoveKind.INSERT, MoveKind.RELEASE, MoveKind.RETREAT),
        ]
        insert = step.moves[6]
        axis, _ = insertion_axis(insert.path)
        assert axis == pytest.approx([0, 0, -1], abs=1e-6)
        assert 0.0 < report.usable_rad <= report.cone_rad == pytest.approx(step.alpha_rad)
        assert len(insert.alternatives) == 2
        for other in insert.alternatives:
            angle = np.arccos(insertion_axis(other)[0] @ axis)
            assert angle == pytest.approx(0.5 * report.usable_rad, abs=1e-6)
    home = plan.steps[-1].moves[-1].path[-1].q
    assert home == pytest.approx(cell().home)
    assert plan.first_waypoint.q == pytest.approx(cell().home)


def test_the_second_look_finds_nothing_and_the_part_ends_where_it_belongs() -> None:
    result = built()
    assert recheck(plan_of(result), cell(), result.site, result.tray) == []


def test_the_second_look_sees_what_was_tampered_with() -> None:
    result = built()
    plan = plan_of(result)
    # The first transit goes straight from home to where it ends, but far lower at the shoulder half way.
    move = plan.steps[0].moves[0]
    low = [
        Waypoint(w.t, (w.q[0], w.q[1] + 1.4 * np.sin(np.pi * k / (len(move.path) - 1)), *w.q[2:]), w.tcp)
        for k, w in enumerate(move.path)
    ]
    first = replace(plan.steps[0], moves=(replace(move, path=tuple(low)), *plan.steps[0].moves[1:]))
    found = recheck(replace(plan, steps=(first, *plan.steps[1:])), cell(), result.site, result.tray)
    assert any(f.quantity == "a collision" and "move 0" in f.where for f in found)
    # A tray that stands elsewhere: the part would not end in its place.
    aside = straight(np.array([0.0, 0.01, 0.0]))
    moved = replace(result.tray, motions={k: aside @ v for k, v in result.tray.motions.items()})
    found = recheck(plan, cell(), result.site, moved)
    assert any("distance of the part from its place" in f.quantity for f in found)


def test_the_same_seed_gives_the_same_plan() -> None:
    assert plan_of(build_plan(tower(), cell(), "0" * 64)).sha256 == plan_of(built()).sha256


def test_a_state_that_falls_is_refused_and_supports_lift_the_refusal() -> None:
    assembly = Assembly(
        "overhang", (block("base", 0, 0, 0.04, 0.05, True), block("beam", 0.0, 0.05, 0.12, 0.04)), alpha_rad=0.1
    )
    design = Design(
        source=assembly,
        assembly=assembly,
        joints=(),
        insertion=(Insertion("beam", np.array([0.0, -1.0]), 0.1),),
        load_cases=(),
    )
    refused = build_plan(design, cell(), "0" * 64)
    assert refused.plan is None
    assert [(f.part, f.moving) for f in refused.falls] == [("beam", ("beam",))]
    assert plan_of(build_plan(design, cell(), "0" * 64, supports=["beam"]))


def test_a_part_out_of_reach_is_named() -> None:
    far = replace(cell(), build_origin_m=np.array([1.3, 0.16, 0.0]))
    result = build_plan(tower(), far, "0" * 64)
    assert result.plan is None
    assert result.out_of_reach == ("b0", "b1")


def test_a_part_that_cannot_be_held_comes_back_with_the_reason() -> None:
    thick = replace(cell(), thickness_m=0.09)
    result = build_plan(tower(1), thick, "0" * 64)
    assert result.plan is None
    assert "wider than the fingers open" in result.reports[-1].reasons


def test_the_tray_holds_every_part_once_and_is_refused_when_too_small() -> None:
    where = site(tower(3).assembly, cell())
    tray = tray_layout(where, cell())
    shift = {n: m[:3, 3] for n, m in tray.motions.items()}
    boxes = [(b.low + shift[b.name], b.high + shift[b.name]) for b in where.bodies if not b.fixed]
    for low, high in boxes:
        assert (low[:2] >= cell().tray_m[0] - 1e-9).all() and (high[:2] <= cell().tray_m[1] + 1e-9).all()
        assert low[2] == pytest.approx(cell().nest_m)
    for a, (low, high) in enumerate(boxes):
        for other_low, other_high in boxes[a + 1 :]:
            assert ((low[:2] >= other_high[:2] + 0.04) | (high[:2] <= other_low[:2] - 0.04)).any()
    drawing = tray_sheet(where, cell(), tray)
    assert [p.name for p in drawing.parts] == ["board", "b0", "b1", "b2"]
    with pytest.raises(InputError, match="no room for part 'b0'"):
        tray_layout(where, replace(cell(), tray_m=np.array([[0.1, -0.2], [0.15, -0.17]])))


def test_grasps_lie_inside_the_part_across_its_thickness() -> None:
    where = site(tower().assembly, cell())
    search = find_grasps(where, 1, cell())
    body = where.bodies[1]
    assert search.grasps
    for grasp in search.grasps:
        assert grasp.width_m == pytest.approx(0.02)
        assert (grasp.tcp[:3, 3] > body.low).all() and (grasp.tcp[:3, 3] < body.high).all()
        assert np.linalg.det(grasp.tcp[:3, :3]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ("robot: ur5", "robot is 'ur5'; did you mean"),
        ("table_m: [[0, 0, 0], [1, 1, -1]]", "low corner must lie below"),
        ("homes: 1", "unknown key 'homes'"),
        ("limits: {transfer_speed_m_s: 3}", "transfer_speed_m_s"),
        ("home_deg: [1, 2, 3]", "home_deg"),
    ],
)
def test_a_broken_cell_is_refused(tmp_path: Path, change: str, match: str) -> None:
    key = change.split(":")[0]
    lines = [x for x in CELL_FILE.read_text().splitlines() if not x.startswith(f"{key}:")]
    (tmp_path / "cell.yaml").write_text("\n".join([*lines, change]) + "\n")
    with pytest.raises(InputError, match=match):
        read_cell(tmp_path / "cell.yaml")


def test_scarecrow_from_its_design_to_a_dry_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from mocca_robot.files.design_json import write_design
    from planners.cone_joints.designer import design

    config = load(ROOT / "configs" / "scarecrow.yaml")
    write_design(design(config.assembly, config.joints, insertion=config.insertion).design, tmp_path)
    refused = main(["plan", str(tmp_path), "--cell", str(CELL_FILE), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert refused == 1 and found["falls"] and not found["files"]
    assert main(["plan", str(tmp_path), "--cell", str(CELL_FILE), "--supports", "all", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [p["part"] for p in found["parts"]] == ["arm_left", "arm_right", "head"]
    assert found["findings"] == []
    assert main(["execute", str(tmp_path / "plan.json"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["findings"] == []
    design_file = tmp_path / "design.json"
    design_file.write_text(design_file.read_text() + " ")
    assert main(["execute", str(tmp_path / "plan.json")]) == 2


@pytest.mark.long
@undisturbed
def test_a_planned_part_is_built_on_the_fake_controller(tmp_path: Path) -> None:
    result = build_plan(tower(1), replace(cell(), serial="20265500042"), "0" * 64)
    plan = plan_of(result)
    write_plan(plan, tmp_path / "plan.json")
    with fake_controller(tmp_path / "plan.json", loopback(9), "--speedup", "2") as host:
        done = run("execute", tmp_path / "plan.json", "--robot", host, "--confirm", plan.cell.name, "--json")
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout)["steps_finished"] == 1


def test_plans_in_one_folder_keep_their_trays_apart(tmp_path: Path) -> None:
    result = built()
    names = [
        {p.name for p in write_tray(tmp_path / f"{plan}.json", result.site, result.cell, result.tray)}
        for plan in ("plan", "left", "right")
    ]
    assert names == [{"tray.svg", "tray.dxf"}, {"left.tray.svg", "left.tray.dxf"}, {"right.tray.svg", "right.tray.dxf"}]
