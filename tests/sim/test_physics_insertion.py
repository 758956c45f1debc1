"""Insertion: nothing jams inside the cone, nothing passes outside, and the hand's errors cost what its springs say."""

from __future__ import annotations

import numpy as np
import pytest
from physics_models import WIDTH, box_stack_3d, jointed, stack

from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from sim.insertion.directions import OUTSIDE, directions, insertion_cone
from sim.insertion.hand import HAND, HandOptions, PlacingError
from sim.insertion.trial import LAST_STRETCH, insert
from sim.insertion.trial_scene import insertion_model, insertion_scene
from sim.shapes.contact_model import facets
from sim.tilt import physical_tilt, tilt_scene


def ridge() -> tuple[Assembly, tuple[Contact, ...]]:
    """Return a block with a roof-shaped underside on a matching ridge, 45° on both sides, along y."""
    import trimesh

    w = WIDTH

    def prism(profile: list[tuple[float, float]]) -> Mesh:
        front = np.array([(x, 0.0, z) for x, z in profile])
        mesh = trimesh.convex.convex_hull(np.concatenate([front, front + np.array([0, w, 0])]))
        return Mesh(mesh.vertices, mesh.faces)

    base = Part("base", prism([(0, 0), (w, 0), (w / 2, w / 2)]), fixed=True)
    n = np.sqrt(0.5)
    left = np.array([[0, 0, 0], [w / 2, 0, w / 2], [w / 2, w, w / 2], [0, w, 0]])
    right = np.array([[w, w, 0], [w / 2, w, w / 2], [w / 2, 0, w / 2], [w, 0, 0]])
    top_left = prism([(0, 0), (w / 2, w / 2), (w / 2, w), (0, w)])
    top_right = prism([(w, 0), (w / 2, w / 2), (w / 2, w), (w, w)])
    both = trimesh.util.concatenate([trimesh.Trimesh(m.vertices, m.faces) for m in (top_left, top_right)])
    saddle = Part("saddle", Mesh(both.vertices, both.faces))
    contacts = (Contact((0, 1), left, np.array([-n, 0, n]), 0), Contact((0, 1), right, np.array([n, 0, n]), 1))
    return Assembly("ridge", (base, saddle)), contacts


def trials(assembly, contacts, count=9, **scene):
    for index, part in enumerate(assembly.parts):
        if part.fixed:
            continue
        cone = insertion_cone(PartsGraph.of(assembly, contacts), index)
        ready = insertion_scene(PartsGraph.of(assembly, contacts), cone, **scene)
        for way in directions(cone, count):
            yield insert(ready, way)


def test_parts_that_are_all_held_are_not_collided_with_each_other():
    # MuJoCo collides what is paired even where neither side can move.
    assembly, contacts = jointed(stack(4))
    top = len(assembly.parts) - 1
    cone = insertion_cone(PartsGraph.of(assembly, contacts), top)
    held = insertion_scene(PartsGraph.of(assembly, contacts), cone).compiled.model
    free = insertion_scene(PartsGraph.of(assembly, contacts), cone, below="free").compiled.model
    assert held.npair == 0 and free.npair > 0
    bodies = free.geom_bodyid[free.pair_geom1], free.geom_bodyid[free.pair_geom2]
    assert (free.body_dofnum[bodies[0]] + free.body_dofnum[bodies[1]] > 0).all()


@pytest.mark.parametrize(("height", "lean"), [(0.2, 0.1), (-0.25, 0.0)])
def test_inside_the_cone_all_succeed_and_outside_none(height, lean):
    assembly, contacts = jointed(stack(2), height, lean)
    found = list(trials(assembly, contacts))
    inside, outside = [t for t in found if t.kind != "outside"], [t for t in found if t.kind == "outside"]
    assert {"axis", "rim", "interior"} <= {t.kind for t in inside} and len(outside) == 4
    assert all(t.succeeded for t in inside), [t.reason for t in inside]
    assert not any(t.succeeded for t in outside)
    assert max(t.peak_force / t.allowed_force for t in inside) < 0.05


@pytest.mark.parametrize("clearance", [1e-4, 3e-4])
def test_play_frees_the_part_entirely(clearance):
    assembly, contacts = jointed(stack(2))
    inside = [t for t in trials(assembly, contacts, 4, clearance=clearance) if t.kind != "outside"]
    assert all(t.succeeded and t.peak_force == 0.0 for t in inside)


@pytest.mark.parametrize("error", [PlacingError((5e-4,)), PlacingError((-5e-4,)), PlacingError((), np.deg2rad(1.0))])
def test_the_grips_error_costs_no_more_than_its_springs(error):
    assembly, contacts = jointed(stack(1))
    cone = insertion_cone(PartsGraph.of(assembly, contacts), 1)
    found = insert(insertion_scene(PartsGraph.of(assembly, contacts), cone), directions(cone, 1)[0], error=error)
    assert found.succeeded, found.reason
    assert found.peak_force > 0.1 * found.allowed_force


def test_parts_below_that_are_free_stay_where_they_are():
    assembly, contacts = jointed(stack(3))
    cone = insertion_cone(PartsGraph.of(assembly, contacts), 3)
    ready = insertion_scene(PartsGraph.of(assembly, contacts), cone, below="free")
    inside = [insert(ready, way) for way in directions(cone, 3) if way.kind != "outside"]
    assert all(t.succeeded and t.below == "free" and not t.moved_below for t in inside)


def test_a_seat_that_sinks_is_met_gently_and_held_ones_do_not_sink():
    assembly, contacts = jointed(stack(3))
    cone = insertion_cone(PartsGraph.of(assembly, contacts), 3)
    free, held = (insertion_scene(PartsGraph.of(assembly, contacts), cone, below=b) for b in ("free", "held"))
    assert held.sunk == 0.0 and held.finer == free.finer == 1.0
    assert 0.0 < free.sunk < 1e-3 * np.ptp(assembly.parts[3].shape.bounds, axis=0).max()
    axis = directions(cone, 1)[0]
    resting, moving = insert(held, axis), insert(free, axis)
    assert moving.allowed_force > resting.allowed_force
    assert moving.peak_force < resting.allowed_force, "what the seat sinks by must not turn into a blow"
    assert moving.steps > LAST_STRETCH * HAND.steps, "slower near the seat than all the way before"


def test_what_does_not_keep_its_place_gets_a_finer_step(monkeypatch):
    assembly, contacts = jointed(stack(3))
    cone = insertion_cone(PartsGraph.of(assembly, contacts), 3)
    coarse = insertion_scene(PartsGraph.of(assembly, contacts), cone, below="free")
    monkeypatch.setattr(
        "sim.insertion.trial_scene.KEEPS", 0.5 * coarse.sunk / np.ptp(assembly.parts[3].shape.bounds, axis=0).max()
    )
    fine = insertion_scene(PartsGraph.of(assembly, contacts), cone, below="free")
    assert fine.finer > 1.0 and fine.sunk < 0.5 * coarse.sunk
    assert insert(fine, directions(cone, 1)[0]).succeeded


def test_a_part_driven_from_outside_pushes_free_parts_away():
    assembly, contacts = jointed(stack(2), 0.3)
    cone = insertion_cone(PartsGraph.of(assembly, contacts), 2)
    ready = insertion_scene(PartsGraph.of(assembly, contacts), cone, below="free")
    assert not any(insert(ready, way).succeeded for way in directions(cone, 1) if way.kind == "outside")


def test_negative_controls_lie_exactly_outside():
    assembly, contacts = jointed(stack(1), 0.2, 0.1)
    cone = insertion_cone(PartsGraph.of(assembly, contacts), 1)
    for way in directions(cone, 5):
        margin = np.arcsin((cone.normals @ -way.vector).min())
        expected = margin <= -OUTSIDE + 1e-9 and margin > -OUTSIDE - np.deg2rad(0.2)
        assert expected if way.kind == "outside" else margin >= -1e-9


def test_a_blocked_part_has_no_way_inside():
    """A block under a roof of its neighbours cannot come from below or above."""
    assembly = stack(2)
    contacts = find_contacts(assembly).contacts
    closed = (*contacts, Contact((0, 1), contacts[0].polygon[::-1] + np.array([0, WIDTH]), -contacts[0].normal))
    shut = (*closed, Contact((0, 1), np.array([[0, 0], [0, WIDTH]]), np.array([1.0, 0.0])))
    shut = (*shut, Contact((0, 1), np.array([[WIDTH, WIDTH], [WIDTH, 0]]), np.array([-1.0, 0.0])))
    cone = insertion_cone(PartsGraph.of(assembly, shut, {assembly.parts[1].name: np.array([0.6, -0.8])}), 1)
    assert cone.realised_rad < 0
    assert all(w.kind == "outside" for w in directions(cone, 5))


def test_clearance_that_leaves_nothing_is_refused():
    assembly, contacts = jointed(stack(1))
    with pytest.raises(InputError, match="Nothing of part 'b0' is left"):
        insertion_scene(
            PartsGraph.of(assembly, contacts), insertion_cone(PartsGraph.of(assembly, contacts), 1), clearance=0.03
        )


def test_a_stiffer_hand_pushes_harder_outside():
    assembly, contacts = jointed(stack(1))
    cone = insertion_cone(PartsGraph.of(assembly, contacts), 1)
    way = next(w for w in directions(cone, 1) if w.kind == "outside")
    forces = []
    for stiffness in (300.0, 1250.0):
        hand = HandOptions(stiffness=stiffness, weight_share=1e3)
        forces.append(
            insert(insertion_scene(PartsGraph.of(assembly, contacts), cone, hand=hand), way, hand=hand).peak_force
        )
    assert forces[0] < forces[1]


@pytest.mark.parametrize("model", [ridge, lambda: box_stack_3d(2)])
def test_solids_go_in_inside_their_cone_only(model):
    assembly, contacts = model()
    found = list(trials(assembly, contacts, 13))
    inside, outside = [t for t in found if t.kind != "outside"], [t for t in found if t.kind == "outside"]
    assert all(t.succeeded for t in inside), [t.reason for t in inside if not t.succeeded]
    assert outside and not any(t.succeeded for t in outside)


def test_the_ridges_cone_is_45_degrees_wide():
    assembly, contacts = ridge()
    assert insertion_cone(PartsGraph.of(assembly, contacts), 1).realised_rad == pytest.approx(np.pi / 4)


def bumped_cubes(height: float) -> tuple[Assembly, tuple[Contact, ...]]:
    """Return a cube on a wide slab with one bicubic bump between them, contacts found anew."""
    from mocca_robot.joints.bicubic import bicubic_joint
    from mocca_robot.joints.build3d import build_parts_3d
    from mocca_robot.joints.rectangle import largest_rectangle

    assembly, _ = box_stack_3d(1)
    contact = find_contacts(assembly).contacts[0]
    rectangle = largest_rectangle(contact, 0.1 * WIDTH)
    assert rectangle is not None
    joint = bicubic_joint(contact, rectangle, height * WIDTH, contact.normal)
    built = build_parts_3d(assembly, [joint])
    return built, find_contacts(built).contacts


@pytest.mark.parametrize("height", [0.15, -0.15])
def test_a_curved_solid_joint_lets_in_and_holds_what_its_cone_says(height):
    assembly, contacts = bumped_cubes(height)
    found = list(trials(assembly, contacts, 9))
    inside, outside = [t for t in found if t.kind != "outside"], [t for t in found if t.kind == "outside"]
    assert all(t.succeeded for t in inside), [t.reason for t in inside]
    assert max(t.peak_force / t.allowed_force for t in inside) < 0.05
    assert len(outside) == 8 and not any(t.succeeded for t in outside)
    compiled = tilt_scene(assembly, facets(contacts))
    for azimuth in (0.0, np.pi / 4):
        tilt = physical_tilt(compiled, PartsGraph.of(assembly, contacts), azimuth)
        assert tilt.statics_rad > np.deg2rad(5.0)
        assert abs(tilt.critical_rad - tilt.statics_rad) < np.deg2rad(1.5)


def test_resting_flat_parts_meet_only_where_they_share_a_contact_and_the_driven_one_meets_all():
    assembly, contacts = jointed(stack(3))
    model = insertion_model(PartsGraph.of(assembly, contacts), 3, 0.0)
    assert {g.role for g in model.geoms if g.part == 3} == {"point"}
    assert {g.role for g in model.geoms if g.part < 3} == {"face"}
    touching = {c.parts for c in contacts if 3 not in c.parts}
    assert {(model.geoms[a].part, model.geoms[b].part) for a, b in model.pairs or ()} == touching


def test_the_hand_is_where_it_should_be_after_every_step():
    """Commands computed once for the whole path: without contact the part follows to rounding."""
    assembly, contacts = jointed(stack(2))
    cone = insertion_cone(PartsGraph.of(assembly, contacts), 2)
    found = insert(insertion_scene(PartsGraph.of(assembly, contacts), cone), directions(cone, 1)[0])
    assert found.succeeded and found.tracking_error < 1e-9
