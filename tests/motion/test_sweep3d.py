"""Ways out of a solid structure: closed forms, and a second opinion from swept hulls."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from solids import box, dome, rotation, wall

from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.contacts.find import find_contacts
from mocca_robot.contacts.penetration import solid
from mocca_robot.joints.bicubic import bicubic_joint, largest_rectangle
from mocca_robot.joints.build3d import build_parts_3d
from mocca_robot.motion.sweep3d import mesh_overlap, sweep_blockers_3d

X, Y, Z = np.eye(3)


def pair(first: Mesh, second: Mesh) -> Assembly:
    return Assembly("pair", (Part("first", first, fixed=True), Part("second", second)))


@pytest.mark.parametrize("gap", [0.0, 1.0, 50.0])
def test_a_block_is_met_ahead_at_any_distance_and_never_behind_or_beside(gap):
    assembly = pair(box((1 + gap, 0, 0), (2 + gap, 1, 1)), box((0, 0, 0), (1, 1, 1)))
    assert sweep_blockers_3d(assembly, 1, X[None]) == (0,)
    for way in (-X, Y, -Y, Z, -Z):
        assert sweep_blockers_3d(assembly, 1, way[None]) == ()


def test_sliding_along_a_face_is_free_and_leaning_into_it_is_not():
    turn = rotation(2)

    def turned(mesh: Mesh) -> Mesh:
        return Mesh(mesh.vertices @ turn.T, mesh.faces)

    assembly = pair(turned(box((-5, -5, -1), (5, 5, 0))), turned(box((0, 0, 0), (1, 1, 1))))
    for angle in np.linspace(0, 2 * np.pi, 8):
        along = np.cos(angle) * X + np.sin(angle) * Y
        assert sweep_blockers_3d(assembly, 1, (turn @ along)[None]) == ()
        assert sweep_blockers_3d(assembly, 1, (turn @ (along - 1e-3 * Z))[None]) == (0,)
        assert sweep_blockers_3d(assembly, 1, (turn @ (along + 1e-3 * Z))[None]) == ()


def test_only_earlier_parts_block_and_every_way_counts():
    assembly = wall(2, 2)
    top = assembly.index("b10")
    assert sweep_blockers_3d(assembly, assembly.index("b01"), np.array([Z])) == (), "what is above came later"
    assert sweep_blockers_3d(assembly, top, np.array([Z])) == ()
    hit = sweep_blockers_3d(assembly, top, np.array([Z, -Z]))
    assert {assembly.parts[p].name for p in hit} == {"slab", "b00"}
    assert sweep_blockers_3d(assembly, 0, np.array([Z])) == ()


def test_convex_solids_agree_with_the_swept_hull():
    rng = np.random.default_rng(0)
    hits = tried = 0
    while tried < 60:
        hulls = [trimesh.convex.convex_hull(rng.normal(size=(12, 3)) * 0.5 + c) for c in (rng.normal(size=3) * 1.5, 0)]
        other, moving = (Mesh(h.vertices, h.faces) for h in hulls)
        if (solid(other) ^ solid(moving)).volume() > 1e-12:
            continue
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        swept = trimesh.convex.convex_hull(np.concatenate([moving.vertices, moving.vertices + 20 * way]))
        met = (solid(Mesh(swept.vertices, swept.faces)) ^ solid(other)).volume() > 1e-9
        assert bool(sweep_blockers_3d(pair(other, moving), 1, way[None])) == met
        hits, tried = hits + met, tried + 1
    assert 5 < hits < 55


def test_a_curved_joint_lets_go_inside_its_cone_and_blocks_outside():
    assembly = wall(1, 1)
    (contact,) = find_contacts(assembly).contacts
    joint = bicubic_joint(contact, largest_rectangle(contact, 0.01), -0.015, contact.normal)
    built = build_parts_3d(assembly, [joint])
    widest = float(np.arcsin((joint.facet_normals @ Z).min()))
    for azimuth in (0.0, np.pi / 2, np.pi):
        side = np.cos(azimuth) * X + np.sin(azimuth) * Y
        # The steepest flanks face ±x and ±y; the shorter side's are steeper than the longer side's.
        limit = np.arctan(1 / np.tan(np.arccos(joint.facet_normals[np.argmax(joint.facet_normals @ side)] @ Z)))
        assert limit >= widest - 1e-9
        for angle, free in ((limit - 0.01, True), (limit + 0.01, False)):
            way = np.cos(angle) * Z + np.sin(angle) * side
            assert (sweep_blockers_3d(built, 1, way[None]) == ()) == free


def test_overlap_is_the_shared_volume_over_the_smaller_one():
    big, small = box((0, 0, 0), (2, 2, 2)), box((1.5, 0, 0), (2.5, 1, 1))
    assert mesh_overlap([big, small]) == pytest.approx(0.5)
    assert mesh_overlap([big, box((2, 0, 0), (3, 1, 1))]) == 0.0
    assert mesh_overlap([big]) == 0.0


def test_built_structures_do_not_overlap():
    for assembly in (wall(), dome()):
        joints = []
        for e, contact in enumerate(find_contacts(assembly).contacts):
            rectangle = largest_rectangle(contact, 0.12 * np.sqrt(contact.measure))
            joints.append(bicubic_joint(contact, rectangle, (-1) ** e * 0.1 * rectangle.l2, contact.normal))
        assert mesh_overlap([p.shape for p in build_parts_3d(assembly, joints).parts]) < 1e-9
