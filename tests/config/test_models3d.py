"""The solid configurations: counts and character as in the paper, and room for the joints they need."""

from __future__ import annotations

import dataclasses
import importlib.util
from pathlib import Path

import numpy as np
import pytest
import trimesh

from mocca_robot.assembly import Interlocking
from mocca_robot.config.config import load
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.geometry.cones import largest_cone
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import load_cases

CONFIGS = Path(__file__).parents[2] / "configs"
TABLE = {
    "sphere": (6, 12, 3.0, "interlocking"),
    "horse": (13, 9, 5.0, "equilibrium"),
    "pavilion": (48, 62, 5.0, "equilibrium"),
    "lilium_tower": (139, 325, 5.0, "equilibrium"),
    "igloo": (139, 326, 5.0, "lateral"),
}
"""Parts, joints, α in degrees, goal."""


@pytest.fixture(scope="module", params=TABLE)
def model(request):
    assembly = load(CONFIGS / f"{request.param}.yaml").assembly
    return request.param, assembly, find_contacts(assembly)


def test_counts_alpha_and_goal_are_the_papers(model):
    name, assembly, report = model
    fixed = assembly.fixed
    joints = [c for c in report.contacts if not (fixed[c.parts[0]] and fixed[c.parts[1]])]
    found = (len(assembly.parts), len(joints), np.rad2deg(assembly.alpha_rad), assembly.goals[0].kind)
    assert found == pytest.approx(TABLE[name])


def test_parts_are_closed_apart_and_touching(model):
    _, assembly, report = model
    require_sound(assembly, report)
    assert not report.near_misses
    for part in assembly.parts:
        mesh = trimesh.Trimesh(part.shape.vertices, part.shape.faces)
        assert mesh.is_volume and mesh.volume > 0, part.name
    assert all(np.isfinite(c.polygon).all() and c.measure > 0 for c in report.contacts)


def test_the_planar_input_does_not_stand(model):
    _, assembly, report = model
    graph = PartsGraph.of(assembly, report.contacts)
    for case in load_cases(graph):
        result = solve_case(graph, case).result
        assert result.status == "not_in_equilibrium", case.name


def test_every_part_has_room_for_its_insertion_cone(model):
    # Joints only narrow the cones of the planar input, so these bound what any joint can reach.
    name, assembly, report = model
    room = assembly.alpha_rad + np.deg2rad(3.0)
    for index, part in enumerate(assembly.parts):
        if not part.fixed:
            normals = np.array([c.normal for c in report.contacts if c.parts[1] == index])
            assert largest_cone(normals)[0] >= room, (name, part.name)


def test_a_later_sequence_only_touches_what_is_there(model):
    _, assembly, report = model
    touched = {c.parts[1] for c in report.contacts}
    assert all(index in touched for index, part in enumerate(assembly.parts) if not part.fixed)


def test_the_drawings_are_what_the_program_draws(tmp_path):
    spec = importlib.util.spec_from_file_location("solid_models", CONFIGS / "models" / "solids.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main(tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == {"sphere.obj", "horse.obj", "lilium_tower.obj", "pavilion.json"}
    assert (tmp_path / "sphere.obj").read_text() == (CONFIGS / "models" / "sphere.obj").read_text()
    assert (tmp_path / "pavilion.json").read_text() == (CONFIGS / "models" / "pavilion.json").read_text()


def test_the_ball_locks_only_because_its_key_is_held():
    # Held pieces carry no load, so the case without the held key has one more piece that can move.
    assembly = load(CONFIGS / "sphere.yaml").assembly
    assert isinstance(assembly.goals[0], Interlocking)
    graph = PartsGraph.of(assembly)
    (case,) = load_cases(graph)
    assert case.held.sum() == 2
    loose = dataclasses.replace(case, held=assembly.fixed)
    assert not solve_case(graph, loose).result.stands
