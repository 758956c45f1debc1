"""Rehearsals in MuJoCo: parts are grasped, carried, slid in and let go; what goes wrong is seen and said."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import trimesh

from mocca_robot.assembly import Assembly, Mesh, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.config.config import load
from mocca_robot.contacts.find import find_contacts
from mocca_robot.design import Design, Insertion
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import read_design, write_design
from mocca_robot.plan.arm_models import MODELS
from mocca_robot.plan.plan import Plan, write_plan
from mocca_robot.plan.plan import document as plan_document
from mocca_robot.plan.reader import file_sha256, plan_from_document
from mocca_robot.plan.status import ExecutionStatus
from planners.cone_joints.designer import design
from planners.robot.build_plan import build_plan
from planners.robot.cell import RobotCell, read_cell
from planners.robot.grasp import find_grasps
from planners.robot.site import site
from planners.robot.tool import SuctionGripper
from sim.cell.build import Build
from sim.cell.cell_model import SUPPORT_N_M, Moment, Pose, Workplace, compile_moment, seat, workplace
from sim.cell.rehearsal import rehearse, waiting, watch
from sim.cell.rehearsal_json import rehearsal_to_data
from sim.cell.rehearsal_result import Options, Rehearsal
from sim.cell.simulated_arm import SimulatedCell
from sim.cell.weld import soften
from sim.cell.world import CellWorld
from sim.cell.wrist_force import hand_wrench

ROOT = Path(__file__).resolve().parents[2]
SCHEMA = json.loads((ROOT / "docs" / "schemas" / "rehearsal.schema.json").read_text(encoding="utf-8"))
QUICK = Options(speed=2.0)


def block(name: str, x: float, y: float, w: float, h: float, fixed: bool = False) -> Part:
    corners = np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])
    return Part(name, Polygon(corners), fixed=fixed)


def brick(low: float, high: float, width: float) -> Mesh:
    box = trimesh.creation.box(bounds=[[-width / 2, -width / 2, low], [width / 2, width / 2, high]])
    return Mesh(box.vertices, box.faces)


def _box(low: list[float], high: list[float]) -> tuple[np.ndarray, np.ndarray]:
    box = trimesh.creation.box(bounds=[low, high])
    return box.vertices, box.faces


def pile(overhang: float = -0.03) -> Design:
    """One block on a base, its middle `overhang` beyond the base's edge."""
    blocks = (block("base", -0.02, 0, 0.1, 0.03, True), block("b0", 0.05 + overhang, 0.03, 0.06, 0.05))
    down = (Insertion("b0", np.array([0.0, -1.0]), float(np.deg2rad(80))),)
    assembly = Assembly("pile", blocks, alpha_rad=np.deg2rad(10))
    return Design(source=assembly, assembly=assembly, joints=(), insertion=down, load_cases=())


@cache
def cell() -> RobotCell:
    return replace(read_cell(ROOT / "configs" / "cells" / "ur5e_2f85.yaml"), build_size_m=None)


def plan_for(design: Design, supports: tuple[str, ...] = (), cradles: tuple[str, ...] = ()) -> Plan:
    built = build_plan(design, cell(), "0" * 64, supports=supports, cradles=cradles)
    assert built.plan is not None, [r.reasons for r in built.reports]
    return built.plan


@cache
def good() -> Rehearsal:
    return rehearse(plan_for(pile()), pile(), QUICK)


def place_of(design: Design) -> Workplace:
    where = site(design.assembly, cell())
    return workplace(cell(), where, find_contacts(where.assembly).contacts, 0.0, 0.5)


def test_a_block_is_grasped_carried_put_down_and_stands() -> None:
    result = good()
    part = result.parts[0]
    assert result.succeeded and part.succeeded, part
    assert part.width_m == pytest.approx(0.02, abs=5e-4)
    assert part.held is True and part.slip_m is not None and part.slip_m < 1e-3
    assert part.depth_m == pytest.approx(part.wanted_m, abs=1e-3)
    assert (part.peak_force_n or 0.0) < result.plan.steps[0].moves[0].force_limit_n
    assert part.touches == ()
    assert part.standing is not None and part.standing.displacement_m < 1e-3


def test_the_same_rehearsal_says_the_same_and_fits_its_schema() -> None:
    data, again = rehearsal_to_data(good()), rehearsal_to_data(rehearse(plan_for(pile()), pile(), QUICK))
    jsonschema.Draft202012Validator(SCHEMA).validate(data)
    assert {**again, "seconds": 0.0} == {**data, "seconds": 0.0}


def test_what_only_a_support_holds_falls_without_it() -> None:
    design = pile(overhang=0.005)
    result = rehearse(plan_for(design, ("b0",)), design, QUICK)
    assert [p.succeeded for p in result.parts] == [True]
    assert result.whole is not None and result.whole.stands is False and result.whole.moved == ("b0",)
    assert not result.succeeded


def test_pads_without_grip_lose_the_part_and_the_build_ends_there() -> None:
    result = rehearse(plan_for(pile()), pile(), replace(QUICK, pad_friction=0.01))
    part = result.parts[0]
    assert not result.succeeded and result.whole is None
    assert part.status is not ExecutionStatus.SUCCEEDED or part.standing is None or not part.standing.stands
    assert part.slip_m is None or part.slip_m > 1e-3


def test_a_cup_carries_what_its_vacuum_holds_and_drops_what_it_does_not() -> None:
    cup = replace(read_cell(ROOT / "configs" / "cells" / "ur10e_suction.yaml"), build_size_m=None)
    bricks = (Part("base", brick(0.0, 0.05, 0.14), fixed=True), Part("lid", brick(0.05, 0.1, 0.1)))
    down = (Insertion("lid", np.array([0.0, 0.0, -1.0]), float(np.deg2rad(60))),)
    assembly = Assembly("bricks", bricks, alpha_rad=np.deg2rad(10))
    bricked = Design(source=assembly, assembly=assembly, joints=(), insertion=down, load_cases=())
    built = build_plan(bricked, cup, "0" * 64)
    assert built.plan is not None, [r.reasons for r in built.reports]
    result = rehearse(built.plan, bricked, QUICK)
    assert result.succeeded and result.parts[0].held is True, result.parts
    slack = rehearse(built.plan, bricked, replace(QUICK, pad_friction=0.01))
    assert slack.parts[0].status is ExecutionStatus.DEVIATED and "the cup let go" in slack.parts[0].detail


@pytest.mark.parametrize("mass_kg", [0.01, 0.05, 1.0])
def test_a_cup_gives_way_as_its_bellows_do(mass_kg: float) -> None:
    """Under a steady load a part on the cup shifts by load/stiffness and turns by moment/stiffness, whatever it weighs;
    the lip's own stiffness makes both.
    """
    import mujoco

    gripper = read_cell(ROOT / "configs" / "cells" / "ur10e_suction.yaml").gripper
    assert isinstance(gripper, SuctionGripper)
    assert gripper.stiffness_n_m * gripper.bellows_m == pytest.approx(gripper.force_n)
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = 1e-3, [0.0, 0.0, 0.0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    body = spec.worldbody.add_body(name="part")
    body.add_freejoint()
    body.explicitinertial, body.mass, body.inertia = True, mass_kg, mass_kg * np.array([1e-4, 4e-4, 4.5e-4])
    weld = spec.add_equality(name="cup", type=mujoco.mjtEq.mjEQ_WELD)
    weld.name1, weld.name2, weld.objtype = "world", "part", mujoco.mjtObj.mjOBJ_BODY
    weld.data[:11] = [0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1]
    model = spec.compile()
    soften(model, 0, gripper.stiffness_n_m, gripper.stiffness_nm_rad)
    for axis in range(3):
        data = mujoco.MjData(model)
        data.xfrc_applied[1, axis], data.xfrc_applied[1, 3 + axis] = 2.0, 0.02
        mujoco.mj_step(model, data, 1500)
        assert data.qpos[axis] == pytest.approx(2.0 / gripper.stiffness_n_m, rel=1e-3)
        turn = 2.0 * float(np.arcsin(data.qpos[4 + axis]))
        assert turn == pytest.approx(0.02 / gripper.stiffness_nm_rad, rel=1e-3)


def test_a_part_that_would_tip_off_the_cup_is_not_held_there() -> None:
    """Far off the middle its weight would lift the lip's edge; more vacuum reaches farther."""
    standard = read_cell(ROOT / "configs" / "cells" / "ur10e_suction.yaml")
    gripper = standard.gripper
    assert isinstance(gripper, SuctionGripper)
    long = Mesh(*_box([-0.3, -0.03, 0.0], [0.3, 0.03, 0.06]))
    parts = (Part("base", brick(-0.1, 0.0, 0.2), fixed=True), Part("beam", long, density=230.0))
    where = site(Assembly("beam", parts), replace(standard, build_size_m=None))
    beam, reached = where.bodies[1], []
    for stronger in (1.0, 1.5):
        tool = replace(gripper, vacuum_pa=stronger * gripper.vacuum_pa)
        found = find_grasps(where, 1, replace(standard, gripper=tool), rng=np.random.default_rng(0))
        levers = [float(np.linalg.norm(g.tcp[:3, 3] - beam.centroid)) for g in found.grasps]
        assert max(levers) <= 0.5 * tool.force_n * tool.cup_radius_m / (9.81 * beam.mass_kg)
        assert found.rejected["its weight would tip it off the cup"] > 0
        reached.append(max(levers))
    assert reached[0] < reached[1]


def test_a_part_out_of_place_on_its_support_is_not_called_placed() -> None:
    design = pile(overhang=0.005)
    plan = plan_for(design, ("b0",))
    place = place_of(design)
    for shift, stands in ((0.001, True), (0.004, False)):
        with SimulatedCell(place, plan, waiting(place, plan, QUICK)) as arm:
            x, y, z = seat(place.assembly.parts[1]).position
            arm.put(1, Pose((x + shift, y, z)))
            standing = watch(arm, 1)
        assert standing.stands is stands and standing.displacement_m == pytest.approx(shift)
        assert "on its support" in standing.reason and standing.moved == (() if stands else ("b0",))


def test_a_support_gives_way_as_a_spring_and_comes_back() -> None:
    """Pushed with 10 N beside a part that is being inserted, what is supported gives 0.4 mm; let alone it returns."""
    import mujoco

    place = place_of(pile())
    poses = {k: seat(p) for k, p in enumerate(place.assembly.parts)}
    moment = Moment("insert", None, (), (0,), ((1, poses[1]),))
    model = compile_moment(place, moment, poses)
    data = mujoco.MjData(model)
    data.qpos[:6] = data.ctrl[:6] = cell().home
    body = int(model.body("part b0").id)
    data.xfrc_applied[body, 2] = 10.0
    mujoco.mj_step(model, data, 1000)
    assert data.xpos[body, 2] - poses[1].position[2] == pytest.approx(10.0 / SUPPORT_N_M, rel=0.02)
    data.xfrc_applied[body, 2] = 0.0
    mujoco.mj_step(model, data, 1000)
    assert data.xpos[body] == pytest.approx(poses[1].position, abs=2e-5)


def test_a_cradle_brings_a_part_to_its_place_where_a_support_leaves_it() -> None:
    """Let go 1 mm beside its place, a part lies there on a support, and at its place in a cradle."""
    design = pile(overhang=0.005)
    for cradles, left in (((), 0.001), (("b0",), 0.0)):
        plan = plan_for(design, ("b0",), cradles)
        place = place_of(design)
        base, home = (seat(p) for p in place.assembly.parts)
        x, y, z = home.position
        beside = Pose((x, y, z + 0.001))
        world = CellWorld(place, {0: base, 1: beside})
        world.begin(Build(place, plan).release(1, beside), cell().home, 0.0)
        world.hold(0.3)
        world.remember()
        assert math.dist(world.poses[1].position, home.position) == pytest.approx(left, abs=2e-5)
        with SimulatedCell(place, plan, {**waiting(place, plan, QUICK), 1: world.poses[1]}) as arm:
            standing = watch(arm, 1)
        assert standing.displacement_m == pytest.approx(left, abs=2e-5) and standing.stands


def test_what_lies_in_a_cradle_is_supported_until_the_cradles_are_taken_away() -> None:
    design = pile(overhang=0.005)
    plan = plan_for(design, cradles=("b0",))
    assert plan.supports == plan.cradles == ("b0",)
    assert plan_from_document(json.loads(json.dumps(plan_document(plan)))) == plan
    result = rehearse(plan, design, QUICK)
    assert [p.succeeded for p in result.parts] == [True]
    assert result.whole is not None and result.whole.stands is False and result.whole.moved == ("b0",)
    raw = plan_document(plan)
    raw["supports"] = []
    with pytest.raises(InputError, match=r"'b0' lies in a cradle but is not among the 'supports'"):
        plan_from_document(raw)


def test_what_cannot_move_meets_nothing_that_cannot() -> None:
    place = place_of(pile())
    poses = {k: seat(p) for k, p in enumerate(place.assembly.parts)}
    counts = [compile_moment(place, Moment("rest", None, *s), poses).npair for s in (((), (0, 1)), ((1,), (0,)))]
    assert counts[0] == 0 < counts[1]


def test_errors_in_the_tray_are_drawn_from_the_seed() -> None:
    noisy = replace(QUICK, noise_m=3e-4, noise_rad=math.radians(0.5), seed=3)
    results = [rehearse(plan_for(pile()), pile(), o) for o in (noisy, replace(noisy, seed=4))]
    assert all(r.succeeded for r in results), [r.parts for r in results]
    slips = [r.parts[0].slip_m for r in results]
    assert slips[0] != slips[1]


def test_interrupted_rehearsal_keeps_what_it_saw() -> None:
    calls = iter(range(10**9))
    result = rehearse(plan_for(pile()), pile(), QUICK, cancelled=lambda: next(calls) > 200)
    assert result.interrupted and not result.succeeded
    assert [p.status for p in result.parts] == [ExecutionStatus.CANCELLED]
    jsonschema.Draft202012Validator(SCHEMA).validate(rehearsal_to_data(result))


@pytest.mark.parametrize("name", sorted(MODELS))
def test_every_arm_holds_its_pose_against_gravity(name: str) -> None:
    import mujoco

    place = replace(place_of(pile()), cell=replace(cell(), model=MODELS[name]))
    model = compile_moment(place, Moment("fetch", None, (), (0,)), {0: seat(place.assembly.parts[0])})
    data = mujoco.MjData(model)
    pose = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.4])
    data.qpos[:6] = data.ctrl[:6] = pose
    mujoco.mj_step(model, data, 200)
    assert np.abs(data.qpos[:6] - pose).max() < 1e-6
    flange = MODELS[name].frames(pose)[-1]
    assert np.allclose(place.turn @ data.body("flange").xpos + place.shift, flange[:3, 3], atol=1e-6)


def test_the_hand_feels_the_weight_that_rests_on_it() -> None:
    import mujoco

    place = place_of(pile())
    parts = place.assembly.parts
    model = compile_moment(place, Moment("rest", None, (1,), (0,)), {k: seat(p) for k, p in enumerate(parts)})
    data = mujoco.MjData(model)
    data.qpos[:6] = data.ctrl[:6] = cell().home
    mujoco.mj_step(model, data, 500)
    base = np.zeros(model.nbody, dtype=bool)
    base[model.body("part base").id] = True
    wrench = hand_wrench(model, data, base, np.array(seat(parts[1]).position))
    assert wrench[:3] == pytest.approx([0.0, 0.0, -9.80665 * parts[1].mass], abs=1e-3)
    assert np.abs(wrench[3:]).max() < 1e-4


def test_the_command_writes_its_verdict_and_its_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    design = write_design(pile(), tmp_path)
    built = build_plan(pile(), cell(), file_sha256(design), design_path="design.json")
    assert built.plan is not None
    write_plan(built.plan, tmp_path / "plan.json")
    assert main(["rehearse", str(tmp_path / "plan.json"), "--speed", "3", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["succeeded"] and said["parts"][0]["part"] == "b0"
    stored = json.loads((tmp_path / "rehearsal.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(SCHEMA).validate(stored)
    page = (tmp_path / "rehearsal.html").read_text(encoding="utf-8")
    assert "pile: rehearsal" in page and "http://" not in page.replace("http://www.w3.org", "")
    design.write_text(design.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert main(["rehearse", str(tmp_path / "plan.json")]) == 2
    assert "the design was altered" in capsys.readouterr().err


def test_a_film_that_cannot_be_written_is_refused_before_the_rehearsal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["rehearse", str(tmp_path / "no plan.json"), "--film", str(tmp_path / "build.mp4")]) == 2
    assert "imageio-ffmpeg" in capsys.readouterr().err


def test_plans_that_cannot_be_rehearsed_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = plan_for(pile())
    bare = replace(plan, cell=replace(plan.cell, description={}))
    with pytest.raises(InputError, match="does not describe its cell"):
        rehearse(bare, pile())
    write_design(pile(), tmp_path)
    plan = replace(plan, design_sha256=file_sha256(tmp_path / "design.json"), design="design.json")
    for options, words in (
        (["--speed", "0"], "speed is 0"),
        (["--pose-noise", "x"], "write millimetres"),
        (["--parts", "2"], "the plan has 1"),
    ):
        write_plan(plan, tmp_path / "plan.json")
        assert main(["rehearse", str(tmp_path / "plan.json"), *options]) == 2
        assert words in capsys.readouterr().err


def test_the_scarecrow_is_designed_planned_and_rehearsed_and_stands_without_its_supports(tmp_path: Path) -> None:
    config = load(ROOT / "configs" / "scarecrow.yaml")
    designed = design(config.assembly, config.joints)
    stored = read_design(write_design(designed.design, tmp_path))
    standard = read_cell(ROOT / "configs" / "cells" / "ur5e_2f85.yaml")
    built = build_plan(stored, standard, "0" * 64, supports=("arm_left", "arm_right"))
    assert built.plan is not None
    result = rehearse(built.plan, stored, QUICK)
    assert result.succeeded, [(p.part, p.status, p.detail, p.standing) for p in result.parts]
    assert result.whole is not None and result.whole.displacement_m < 1e-3


@pytest.mark.parametrize("thickness", [0.03, 0.012])
def test_flat_parts_of_different_thickness_meet_and_stand(thickness: float) -> None:
    """A base of 70 mm under a block of 30 or 12 mm: their contact points lie in the thinner of the two."""
    base, upper = pile().assembly.parts
    thick = Part("base", replace(base.shape, thickness=0.07), fixed=True)
    thin = Part("b0", replace(upper.shape, thickness=thickness))
    assembly = replace(pile().assembly, parts=(thick, thin))
    made = replace(pile(), source=assembly, assembly=assembly)
    here = replace(cell(), thickness_m=None)
    built = build_plan(made, here, "0" * 64)
    assert built.plan is not None, [r.reasons for r in built.reports]
    seen = rehearse(built.plan, made, QUICK).parts[0]
    assert seen.succeeded and seen.standing is not None and seen.standing.displacement_m < 1e-3
