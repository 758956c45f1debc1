"""The nine flat models: counts, planar verdicts, room to insert, and that cone joints can hold them at all."""

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import TypeAlias

import numpy as np
import pytest

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.config.config import load
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.motion.insertion import insertion_verdicts
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.equilibrium import equilibrium
from mocca_robot.statics.loads import LoadCase, case_wrenches, load_cases, tilted_gravity
from mocca_robot.statics.solution import EquilibriumResult
from mocca_robot.verdicts.verification import part_overlap

CONFIGS = Path(__file__).parents[2] / "configs"
COUNTS = {
    "m": (10, 9),
    "scarecrow": (4, 5),
    "stack": (10, 10),
    "tree": (7, 9),
    "leaning_tower_10": (14, 28),
    "leaning_tower_20": (14, 28),
    "leaning_tower_30": (13, 27),
    "leaning_tower_support_free": (14, 28),
    "deer": (14, 23),
}
SHARPNESS = np.deg2rad(55.0)
"""How far a cone joint may turn a force away from its contact's normal here."""
INSET = 0.12
"""Share of a contact at either end where its joint is flat."""
ROOM = np.deg2rad(25.0)
"""What the planar insertion cones have in hand beyond α, so that joints have room to lean."""
WOBBLE = np.deg2rad(1.5)

Models: TypeAlias = dict[str, tuple[Assembly, tuple[Contact, ...]]]

each_model = pytest.mark.parametrize("name", COUNTS)


@pytest.fixture(scope="module")
def models() -> Models:
    assemblies = {name: load(CONFIGS / f"{name}.yaml").assembly for name in COUNTS}
    return {name: (assembly, find_contacts(assembly).contacts) for name, assembly in assemblies.items()}


@pytest.fixture(scope="module")
def draw() -> ModuleType:
    spec = importlib.util.spec_from_file_location("draw", CONFIGS / "models" / "draw.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def bent_forces(graph: PartsGraph, case: LoadCase) -> EquilibriumResult:
    """Return the equilibrium with forces up to SHARPNESS off each normal and inside every insertion cone.

    This is what all joints within those bounds can do together: no equilibrium here, no cone joints.
    """
    assembly = graph.assembly
    most = np.pi / 2 - (assembly.alpha_rad or 0.0)
    pairs, points, normals = [], [], []
    for contact in graph.contacts:
        if not case.present[list(contact.parts)].all():
            continue
        axis = graph.motion(contact.parts[1]).axis
        angle = np.arctan2(*contact.normal[::-1])
        off = (angle - np.arctan2(*axis[::-1]) + np.pi) % (2 * np.pi) - np.pi
        for share in (INSET, 1.0 - INSET):
            for turn in (max(-SHARPNESS, -most - off), min(SHARPNESS, most - off)):
                pairs.append(contact.parts)
                points.append((1.0 - share) * contact.polygon[0] + share * contact.polygon[1])
                normals.append([np.cos(angle + turn), np.sin(angle + turn)])
    result = equilibrium(
        np.array(pairs),
        np.array(points),
        np.array(normals),
        case_wrenches(case, graph),
        fixed=~case.free,
        about=np.array([p.centroid for p in assembly.parts]),
        length=assembly.size / 2,
    )
    assert isinstance(result, EquilibriumResult)
    return result


def wobbled(assembly: Assembly, case: LoadCase) -> Iterator[LoadCase]:
    """Yield the case upright and with the ground tilted a little to either side."""
    yield case
    for azimuth in (0.0, np.pi):
        gravity: Array = tilted_gravity(assembly.gravity, WOBBLE, azimuth)
        yield LoadCase(f"{case.name}_{azimuth:.0f}", gravity, case.present, case.held)


@each_model
def test_counts_are_exact_and_the_drawing_is_sound(name: str) -> None:
    assembly = load(CONFIGS / f"{name}.yaml").assembly
    report = find_contacts(assembly)
    require_sound(assembly, report)
    assert (len(assembly.parts), len(report.contacts)) == COUNTS[name]
    assert not report.overlaps and not report.near_misses
    assert part_overlap(assembly) < 1e-9
    assert not any(assembly.fixed[list(c.parts)].all() for c in report.contacts)


@each_model
def test_contacts_are_long_enough_to_cut_joints(name: str, models: Models) -> None:
    assembly, contacts = models[name]
    assert 0.4 < assembly.size < 0.75
    assert min(c.measure for c in contacts) > 0.020
    assert all(isinstance(p.shape, Polygon) and p.shape.thickness == 0.02 for p in assembly.parts)


@each_model
def test_planar_contacts_do_not_hold_it(name: str, models: Models) -> None:
    graph = PartsGraph.of(*models[name])
    result = solve_case(graph, load_cases(graph)[0])
    assert not result.result.stands
    assert result.result.infeasibility > 1e-3
    assert result.moving


@each_model
def test_every_part_goes_in_with_room_for_leaning_joints(name: str, models: Models) -> None:
    assembly, contacts = models[name]
    graph = PartsGraph.of(assembly, contacts)
    for verdict in insertion_verdicts(graph):
        assert verdict.assemblable, f"{verdict.part} is blocked by {verdict.blockers}"
    for _, motion in graph.motions():
        assert motion.alpha_rad > (assembly.alpha_rad or 0.0) + ROOM


@each_model
def test_cone_joints_can_hold_every_required_state(name: str, models: Models) -> None:
    graph = PartsGraph.of(*models[name])
    for case in load_cases(graph):
        for tilted in wobbled(graph.assembly, case):
            assert bent_forces(graph, tilted).stands, tilted.name


@each_model
def test_drawing_is_what_the_generator_writes(name: str, draw: ModuleType) -> None:
    committed = (CONFIGS / "models" / f"{name}.svg").read_text(encoding="utf-8")
    assert committed == draw.svg(name, draw.DRAWINGS[name]())
