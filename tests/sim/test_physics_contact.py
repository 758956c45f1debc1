"""Shapes that MuJoCo gets: they cover the parts exactly, and models say beforehand how large they are."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import solids
import trimesh
from physics_models import box_stack_3d, jointed, rectangle, stack

from mocca_robot.assembly import Assembly, Mesh, Part, Polygon, signed_area
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import case_at, critical_tilt
from mocca_robot.statics.equilibrium import equilibrium
from mocca_robot.statics.loads import case_wrenches
from sim.scene import MEMORY_LIMIT, compile_scene, predict, spec
from sim.shapes.body_order import body_order
from sim.shapes.contact_model import BUDGET, ENOUGH, ContactModel, facets, geom, pieces, telling_rays
from sim.shapes.contact_rays import holding, pair_rays, reduced_rays
from sim.shapes.convex_pieces import convex_pieces
from sim.shapes.inertia import inertia
from sim.stability import free_scene


def turns(ring):
    after, before = np.roll(ring, -1, axis=0) - ring, ring - np.roll(ring, 1, axis=0)
    return before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]


def shapes() -> list[Polygon]:
    built, _ = jointed(stack(2), 0.25, 0.2)
    frame = Polygon(np.array([[0, 0], [4, 0], [4, 4], [0, 4.0]]), (np.array([[1, 1], [3, 1], [3, 3], [1, 3.0]]),))
    comb = Polygon(np.array([[0, 0], [5, 0], [5, 3], [4, 3], [4, 1], [3, 1], [3, 3], [2, 3], [2, 1], [1, 1], [0, 3.0]]))
    return [p.shape for p in built.parts] + [frame, comb]


@pytest.mark.parametrize("polygon", shapes())
def test_pieces_are_convex_and_cover_the_area_once(polygon):
    found = convex_pieces(polygon)
    assert sum(signed_area(p) for p in found) == pytest.approx(polygon.area_moments[0], rel=1e-12)
    for piece in found:
        scale = np.ptp(piece, axis=0).max() ** 2
        assert turns(piece).min() > -1e-9 * scale


def test_a_convex_shape_stays_one_piece():
    angles = np.linspace(0, 2 * np.pi, 30, endpoint=False)
    assert len(convex_pieces(Polygon(np.stack([np.cos(angles), np.sin(angles)], axis=1)))) == 1


def test_moments_of_inertia_have_their_closed_forms():
    plate = Part("plate", rectangle(3.0, 5.0, 2.0, 1.0), density=7.0)
    assert inertia(plate)[2, 2] == pytest.approx(plate.mass * (4 + 1) / 12)
    mesh = trimesh.creation.icosphere(subdivisions=2)
    mesh.apply_translation([3.0, 2.0, 1.0])
    ball = Part("ball", Mesh(mesh.vertices, mesh.faces), density=2.0)
    np.testing.assert_allclose(inertia(ball), 2.0 * mesh.moment_inertia, atol=1e-9)


def test_the_model_has_the_parts_masses_where_they_belong():
    assembly, _ = jointed(stack(3))
    compiled = compile_scene(free_scene(assembly, pieces(assembly)))
    for part in assembly.parts[1:]:
        body = compiled.model.body(part.name)
        assert body.mass[0] == pytest.approx(part.mass)
        np.testing.assert_allclose(body.ipos, 0.0, atol=1e-12)
        np.testing.assert_allclose(body.pos[[0, 2]], part.centroid)


def test_flat_contacts_keep_their_corners_and_no_more():
    contacts = box_stack_3d(2)[1]
    for rays in reduced_rays(contacts, 12):
        assert len(rays.points) == 4


def test_kept_rays_are_bounded_by_the_resolution():
    contacts = jointed(stack(2), 0.3)[1]
    for limit in (4, 8):
        assert all(len(r.points) <= limit for r in reduced_rays(contacts, limit))


def test_rays_chosen_for_a_load_hold_what_all_of_them_hold():
    assembly, contacts = jointed(stack(4), 0.3)
    graph = PartsGraph.of(assembly, contacts)
    critical = critical_tilt(graph, 0.0)
    few = tuple(pair_rays(contacts, 2))

    def tilt(chosen) -> float:
        pairs = np.concatenate([np.tile(p.rays.pair, (int(p.kept.sum()), 1)) for p in chosen])
        points = np.concatenate([p.reduced.points for p in chosen])
        normals = np.concatenate([p.reduced.normals for p in chosen])
        angles = np.linspace(0.0, critical, 50)
        loads = np.array([case_wrenches(case_at(assembly, a, 0.0), graph) for a in angles])
        return float(angles[[r.stands for r in equilibrium(pairs, points, normals, loads, fixed=[0])]].max(initial=0.0))

    assert tilt(few) < 0.5 * critical
    chosen = holding(graph, few, case_at(assembly, 0.98 * critical, 0.0))
    assert tilt(chosen) >= 0.96 * critical
    assert sum(p.kept.sum() for p in chosen) < sum(len(p.kept) for p in chosen)


def test_few_contact_points_are_taken_at_once_and_many_chosen_load_by_load():
    assembly, contacts = box_stack_3d(3)
    assert telling_rays(assembly, contacts) is None
    many = [replace(contacts[0], parts=(k, k + 1)) for k in range(BUDGET // ENOUGH + 1)]
    chosen = telling_rays(assembly, many)
    assert chosen is not None and len(chosen) == len(many)


def test_a_model_that_would_not_fit_is_refused_before_compiling(monkeypatch):
    assembly = stack(3)
    scene = free_scene(assembly, facets(find_contacts(assembly).contacts))
    assert predict(scene).memory_bytes < MEMORY_LIMIT
    monkeypatch.setattr("sim.scene.MEMORY_LIMIT", 1000)
    with pytest.raises(InputError, match="simulate fewer parts"):
        spec(scene)


def test_bodies_stand_so_that_the_factor_fills_in_little(monkeypatch):
    """MuJoCo does not permute: the same fall, with a factor of fewer numbers."""
    assembly = solids.dome(6, 12)
    scene = free_scene(assembly, facets(find_contacts(assembly).contacts))

    def filled() -> tuple[int, np.ndarray]:
        compiled = compile_scene(scene)
        data = mujoco.MjData(compiled.model)
        mujoco.mj_step(compiled.model, data, 50)
        return int(data.solver_nnz[0]), data.qpos[compiled.qpos]

    ours, places = filled()
    monkeypatch.setattr("sim.scene.body_order", lambda model, free: np.flatnonzero(free))
    as_given, same_places = filled()
    assert ours < 0.8 * as_given
    np.testing.assert_allclose(places, same_places, atol=1e-9)


def test_every_free_part_has_its_body_once():
    shapes = tuple(geom(k, "sphere", np.zeros(3), np.zeros(3)) for k in range(5))
    free = np.array([False, True, True, True, True])
    ring = ContactModel(shapes, ((0, 1), (1, 2), (2, 3), (1, 3)))
    assert sorted(body_order(ring, free)) == [1, 2, 3, 4]
    for nothing in (ContactModel(shapes, None), ContactModel(shapes, ((0, 1),)), ContactModel((), ())):
        assert list(body_order(nothing, free)) == [1, 2, 3, 4]


def test_a_part_without_mass_is_named():
    assembly = stack(2)
    parts = tuple(replace(p, density=0.0) if p.name == "b1" else p for p in assembly.parts)
    light = Assembly("light", parts)
    with pytest.raises(InputError, match=r"'b1' has mass 0 kg"):
        compile_scene(free_scene(light, pieces(light)))
