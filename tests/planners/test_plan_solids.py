"""Solid parts in a robot cell: what a cup and two fingers can hold, trays that turn parts, and a ball built whole."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from solids import box

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.config.config import load
from mocca_robot.errors import InputError
from mocca_robot.motion.ways_out import insertion_rim, sweep_blockers
from mocca_robot.plan.plan import MoveKind, Plan, insertion_axis, write_plan
from mocca_robot.plan.reader import read_plan
from planners.cone_joints.designer import design
from planners.robot.arm_poses import branches
from planners.robot.bench import Bench
from planners.robot.build_plan import build_plan
from planners.robot.build_result import BuildPlan
from planners.robot.cell import RobotCell, cell_from_document, cell_of, read_cell
from planners.robot.grasp import find_grasps
from planners.robot.grasp_suction import pull
from planners.robot.rays import first_hits
from planners.robot.recheck import recheck
from planners.robot.scene import CellScene
from planners.robot.site import site
from planners.robot.tool import ParallelGripper, SuctionGripper
from planners.robot.transit import connect
from planners.robot.tray import tray_layout, with_layout
from planners.robot.tray_files import nest

CELLS = Path(__file__).resolve().parents[2] / "configs" / "cells"


@cache
def suction() -> RobotCell:
    return replace(read_cell(CELLS / "ur10e_suction.yaml"), build_size_m=None)


@cache
def fingers() -> RobotCell:
    return replace(read_cell(CELLS / "ur5e_2f85.yaml"), build_size_m=None)


def cup() -> SuctionGripper:
    gripper = suction().gripper
    assert isinstance(gripper, SuctionGripper)
    return gripper


def solid(mesh: Mesh, density: float = 700.0) -> Assembly:
    base = Part("base", box((-0.05, -0.05, -0.02), (0.1, 0.1, 0.0)), density, fixed=True)
    return Assembly("solid", (base, Part("part", mesh, density)))


def ball(radius: float) -> Mesh:
    import trimesh

    shape = trimesh.creation.icosphere(3, radius)
    return Mesh(shape.vertices + np.array([0.02, 0.02, radius]), shape.faces)


@cache
def built() -> BuildPlan:
    config = load(CELLS.parent / "sphere.yaml")
    made = design(config.assembly, config.joints, insertion=config.insertion).design
    free = [p.name for p in made.assembly.parts if not p.fixed]
    return build_plan(made, replace(suction(), build_size_m=0.14), "0" * 64, supports=free)


def plan_of(result: BuildPlan) -> Plan:
    assert result.plan is not None, [(r.part, r.reasons) for r in result.reports if not r.placed]
    return result.plan


def test_rays_meet_the_triangle_that_a_linear_system_says() -> None:
    rng = np.random.default_rng(0)
    corners, starts, rays = rng.normal(size=(40, 3, 3)), 2 * rng.normal(size=(60, 3)), rng.normal(size=(60, 3))
    found, distance = first_hits(corners, starts, rays)
    for k in range(60):
        best, face = np.inf, -1
        for f, (a, b, c) in enumerate(corners):
            t, u, v = np.linalg.solve(np.stack([-rays[k], b - a, c - a], axis=1), starts[k] - a)
            if min(u, v) >= 0 and u + v <= 1 and 1e-5 < t < best:
                best, face = t, f
        assert (face, best) == (found[k], pytest.approx(distance[k]))


def test_a_cup_sits_on_faces_and_not_on_edges_or_tight_curves() -> None:
    where = site(solid(box((0, 0, 0), (0.06, 0.05, 0.04))), suction())
    body = where.bodies[1]
    found = find_grasps(where, 1, suction()).grasps
    assert found
    for grasp in found:
        outward = -grasp.tcp[:3, 2]
        assert np.abs(outward).max() == pytest.approx(1.0)  # square to a face
        axis = int(np.abs(outward).argmax())
        beside = [k for k in range(3) if k != axis]
        room = np.minimum(grasp.tcp[:3, 3] - body.low, body.high - grasp.tcp[:3, 3])[beside]
        assert room.min() > cup().cup_radius_m - 1e-6
    # Under a lip of 12.5 mm a ball of 20 mm radius falls off by 4.4 mm, one of 100 mm by 0.8 mm: the bellows give 1.5.
    small = find_grasps(site(solid(ball(0.02)), suction()), 1, suction())
    assert not small.grasps and small.rejected
    assert find_grasps(site(solid(ball(0.1), 20.0), suction()), 1, suction()).grasps


def test_a_cup_that_slips_or_tears_off_is_no_grasp() -> None:
    gripper = cup()
    tcp = np.diag([1.0, -1.0, -1.0, 1.0])  # points straight down
    down, side = np.array([0, 0, -1.0]), np.array([1.0, 0, 0])
    assert pull(gripper, tcp, down, 10.0) == ""
    assert "slips" in pull(gripper, tcp, side, gripper.force_n)
    assert "holds" in pull(gripper, tcp, -down, 1.1 * gripper.force_n)
    heavy = find_grasps(site(solid(box((0, 0, 0), (0.06, 0.05, 0.04)), 9000.0), suction()), 1, suction())
    assert not heavy.grasps
    assert "heavier than the cup holds" in next(iter(heavy.rejected))


def test_fingers_hold_slanted_faces_along_their_mean_and_only_what_fills_a_pad() -> None:
    # A wedge: its sides lean by 8° each, so the fingers close along x and neither face is square to it.
    lean = 0.05 * np.tan(np.deg2rad(8.0))
    wedge = box((0, 0, 0), (0.05, 0.04, 0.05))
    corners = wedge.vertices + np.outer(wedge.vertices[:, 2] / 0.05 * lean, [1.0, 0, 0]) * np.where(
        wedge.vertices[:, :1] > 0.02, -1.0, 1.0
    )
    cell = fingers()
    gripper = cell.gripper
    assert isinstance(gripper, ParallelGripper)
    where = site(solid(Mesh(corners, wedge.faces)), cell)
    found = find_grasps(where, 1, cell)
    assert found.grasps
    for grasp in found.grasps:
        tilts = [np.arccos(abs(grasp.tcp[:3, 1] @ (where.turn @ n))) for n in np.eye(3)]
        assert min(tilts) < np.deg2rad(1.0)
        assert gripper.stroke_m[0] < grasp.width_m < gripper.stroke_m[1] - gripper.opening_m
    thin = find_grasps(site(solid(box((0, 0, 0), (0.05, 0.006, 0.006))), cell), 1, cell)
    assert not thin.grasps and "the part does not fill a pad" in thin.rejected


def test_too_narrow_a_gripper_and_too_weak_an_arm_are_said_so() -> None:
    big = find_grasps(site(solid(box((0, 0, 0), (0.09, 0.1, 0.08)), 100.0), fingers()), 1, fingers())
    assert not big.grasps and any("wider than the fingers open" in r for r in big.rejected)
    strong = replace(fingers(), gripper=replace(fingers().gripper, force_n=235.0))
    loaded = find_grasps(site(solid(box((0, 0, 0), (0.05, 0.1, 0.1)), 10000.0), strong), 1, strong)
    assert any("heavier than the arm carries" in r for r in loaded.rejected)


def test_a_ball_in_six_pieces_is_planned_whole_and_nothing_is_found_on_a_second_look() -> None:
    result = built()
    plan = plan_of(result)
    assert [s.part for s in plan.steps] == ["east", "north", "west", "south", "key"]
    assert recheck(plan, result.cell, result.site, result.tray) == []
    assert plan.gripper == "suction"
    for step in plan.steps:
        pick = next(m for m in step.moves if m.kind is MoveKind.PICK)
        tool = result.cell.model.tcp_matrix(pick.path[-1].q)[:3, 2]
        assert tool[2] < -0.9  # parts lie in the tray so that the cup comes from above
        insert = next(m for m in step.moves if m.kind is MoveKind.INSERT)
        assert insertion_axis(insert.path)[0] == pytest.approx(step.direction, abs=1e-6)


def test_a_plan_read_back_describes_the_same_cell_structure_and_tray(tmp_path: Path) -> None:
    result = built()
    write_plan(plan_of(result), tmp_path / "plan.json")
    cell = cell_of(read_plan(tmp_path / "plan.json"))
    config = load(CELLS.parent / "sphere.yaml")
    where = site(config.assembly, cell)
    assert where.turn == pytest.approx(result.site.turn) and where.shift == pytest.approx(result.site.shift)
    again = tray_layout(result.site, cell)
    for name, motion in result.tray.motions.items():
        assert again.motions[name] == pytest.approx(motion, abs=1e-9)


def test_the_share_of_the_cone_that_is_called_usable_can_be_used() -> None:
    result = built()
    bench = Bench(result.cell, result.site, CellScene(result.cell, result.site))
    bench.clear(result.tray)
    assembly = result.site.assembly
    for step, report in zip(plan_of(result).steps, result.reports, strict=True):
        index = assembly.index(step.part)
        insert = next(m for m in step.moves if m.kind is MoveKind.INSERT)
        q = np.array(insert.path[-1].q)
        flange = result.cell.model.frames(q)[-1]
        bench.scene.assign(absent=(step.part,))
        assert report.usable_rad > 0.0
        axis = -np.asarray(step.direction) @ result.site.turn
        for way in insertion_rim(axis / np.linalg.norm(axis), 0.97 * report.usable_rad, 11)[1:]:
            assert not sweep_blockers(assembly, index, way[None]), step.part
            assert bench.along(flange, 0.015 * (result.site.turn @ way), q, step.grasp.width_m)[1] == "", step.part
        bench.scene.place(step.part, np.eye(4))


def test_the_structure_stands_where_the_arm_reaches_it() -> None:
    low = solid(box((0, 0, 0), (0.05, 0.05, 0.05)))
    far, near = np.array([1.9, 0.0, 0.15]), np.array([0.7, 0.2, 0.15])
    cell = replace(suction(), places_m=(far, near), build_origin_m=far, yaws_rad=(0.0, 1.0))
    from mocca_robot.design import Design, Insertion

    made = Design(
        source=low, assembly=low, joints=(), insertion=(Insertion("part", np.array([0, 0, -1.0]), 0.5),), load_cases=()
    )
    result = build_plan(made, cell, "0" * 64)
    assert result.cell.build_origin_m == pytest.approx(near)
    assert recheck(plan_of(result), result.cell, result.site, result.tray) == []


def test_a_tray_can_be_given_and_is_refused_when_it_does_not_fit_the_design() -> None:
    assembly = solid(box((0, 0, 0), (0.05, 0.04, 0.03)))
    document = {
        **suction().document,
        "build": {"origin_m": [0.7, 0.2, 0.15], "size_m": None},
        "tray": {"low_m": [0.3, -1], "high_m": [1, -0.3], "parts": {"part": {"at_m": [0.5, -0.6], "yaw_deg": 90}}},
    }
    cell = cell_from_document(document, "cell")
    where = site(assembly, cell)
    tray = tray_layout(where, cell)
    corners = np.concatenate(where.bodies[1].pieces) @ tray.motions["part"][:3, :3].T + tray.motions["part"][:3, 3]
    assert 0.5 * (corners.min(axis=0) + corners.max(axis=0))[:2] == pytest.approx([0.5, -0.6])
    assert np.ptp(corners, axis=0) == pytest.approx([0.04, 0.05, 0.03])
    assert corners[:, 2].min() == pytest.approx(cell.nest_m)
    again = tray_layout(where, with_layout(cell, where, tray))
    assert again.motions["part"] == pytest.approx(tray.motions["part"])
    for name, match in (("prat", "did you mean 'part'"), ("base", "no free part")):
        wrong = cell_from_document(
            {**document, "tray": {**document["tray"], "parts": {name: {"at_m": [0.5, -0.6]}}}}, "cell"
        )
        with pytest.raises(InputError, match=match):
            tray_layout(where, wrong)


def test_a_nest_holds_its_part_from_below_and_lets_it_out_upwards() -> None:
    from mocca_robot.contacts.penetration import shared_volume
    from mocca_robot.contacts.penetration import solid as manifold

    assembly = solid(ball(0.03))
    where = site(assembly, suction())
    tray = tray_layout(where, suction())
    holder = manifold(nest(where, suction(), tray, "part"))
    shape = assembly.parts[1].shape
    assert isinstance(shape, Mesh)
    for height in (0.0, 0.01, 0.1):
        motion = tray.motions["part"]
        points = where.point(shape.vertices) @ motion[:3, :3].T + motion[:3, 3] + [0, 0, height]
        assert shared_volume(holder, manifold(Mesh(points, shape.faces))) < 1e-12
    assert holder.volume() > 0
    sunk = where.point(shape.vertices) + tray.motions["part"][:3, 3] - [0, 0, 0.002]
    assert shared_volume(holder, manifold(Mesh(sunk, shape.faces))) > 1e-9


def test_a_way_around_a_wall_is_found_again_with_the_same_seed_and_none_where_there_is_none() -> None:
    def free(q: Array) -> bool:
        return not (abs(q[0]) < 0.2 and q[1] < 0.8)

    start, goal = np.array([-1.0, 0, 0, 0, 0, 0]), np.array([1.0, 0, 0, 0, 0, 0])
    limit = np.full(6, 3.0)
    found = connect(start, goal, free, limit, seed=5)
    assert found is not None and len(found) > 2
    assert found[0] == pytest.approx(start) and found[-1] == pytest.approx(goal)
    for a, b in pairwise(found):
        assert all(free(a + s * (b - a)) for s in np.linspace(0, 1, 400))
    again = connect(start, goal, free, limit, seed=5)
    assert again is not None and all(np.array_equal(a, b) for a, b in zip(found, again, strict=True))
    assert connect(start, goal, lambda q: abs(q[0]) > 0.2, limit, seed=5, checks=500) is None


def test_the_second_look_catches_every_kind_of_corruption() -> None:
    result = built()
    plan = plan_of(result)
    look = (result.cell, result.site, result.tray)

    def changed(kind: MoveKind, **values: object) -> Plan:
        step = plan.steps[0]
        moves = tuple(replace(m, **values) if m.kind is kind else m for m in step.moves)  # type: ignore[arg-type]
        return replace(plan, steps=(replace(step, moves=moves),))

    def found(corrupted: Plan) -> str:
        return " | ".join(f"{f.where}: {f.quantity}" for f in recheck(corrupted, *look))

    insert = next(m for m in plan.steps[0].moves if m.kind is MoveKind.INSERT)
    fast = tuple(replace(w, t=0.2 * w.t) for w in insert.path)
    assert "speed of the tool" in found(changed(MoveKind.INSERT, path=fast))
    backwards = tuple(
        replace(w, t=insert.path[-1].t * k / (len(insert.path) - 1)) for k, w in enumerate(insert.path[::-1])
    )
    assert "angle to the insertion direction" in found(changed(MoveKind.INSERT, path=backwards))
    beyond = tuple(replace(w, q=(w.q[0] + 7.0, *w.q[1:])) for w in insert.path)
    assert "joint 0" in found(changed(MoveKind.INSERT, path=beyond))
    narrow = replace(plan.steps[0], direction=(0.0, 0.0, 1.0))
    assert "angle to the insertion direction" in found(replace(plan, steps=(narrow,)))
    # Built in another order, parts are in the way of each other or missing below.
    swapped = replace(plan, steps=(plan.steps[4], plan.steps[0]))
    assert "a collision" in found(swapped)
    # One waypoint aside and back: a jolt.
    transit = plan.steps[0].moves[0]
    middle = len(transit.path) // 2
    jolt = list(transit.path)
    jolt[middle] = replace(jolt[middle], q=(jolt[middle].q[0] + 0.1, *jolt[middle].q[1:]))
    assert "jerk" in found(changed(MoveKind.TRANSIT, path=tuple(jolt)))


def test_the_arm_reaches_the_same_flange_from_every_branch_of_a_plan() -> None:
    result = built()
    for step in plan_of(result).steps:
        q = np.array(step.moves[0].path[-1].q)
        model = result.cell.model
        flange = model.frames(q)[-1]
        assert all(np.abs(model.frames(other)[-1] - flange).max() < 1e-9 for other in branches(model, flange))
