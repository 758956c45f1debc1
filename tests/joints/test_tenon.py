"""Mortise-and-tenon joints: one way out, upright, tilted and flat."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from solids import flat_contact, wall

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.joints.bicubic import bicubic_joint, largest_rectangle
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.joint import planar
from mocca_robot.joints.tenon import tenon_joint, tenon_joint_2d, tenon_of
from mocca_robot.motion.sweep3d import mesh_overlap, sweep_blockers_3d

UP = np.array([0.0, 0.0, 1.0])
CONTACT = flat_contact([(0, 0), (2, 0), (2, 1.5), (0, 1)])


@pytest.mark.parametrize("u", [UP, np.array([0.4, 0.2, 1.0])])
@pytest.mark.parametrize("h", [0.2, -0.2])
def test_walls_are_parallel_to_u_and_leave_one_way_out(u, h):
    joint = tenon_joint(CONTACT, largest_rectangle(CONTACT, 0.1), h, u)
    along = joint.facet_normals @ joint.direction
    assert along.min() == pytest.approx(0.0, abs=1e-12)
    assert (np.abs(along) < 1e-9).sum() == 8, "four walls of two triangles"
    free = joint.motion_cone().translational()
    assert free.contains(joint.direction, 1e-9)
    across = np.cross(joint.direction, [1.0, 0.3, 0.0])
    for side in (across, -across, np.cross(joint.direction, across)):
        assert not free.contains(joint.direction + 0.01 * side)
    corners = joint.vertices[joint.facets]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    assert area == pytest.approx(CONTACT.measure * UP)


def test_draft_opens_a_cone_of_its_angle_and_can_be_too_much():
    rectangle = largest_rectangle(CONTACT, 0.1)
    joint = tenon_joint(CONTACT, rectangle, 0.2, draft_rad=np.deg2rad(5))
    assert np.arcsin((joint.facet_normals @ UP).min()) == pytest.approx(np.deg2rad(5))
    with pytest.raises(InputError, match="draft"):
        tenon_joint(CONTACT, rectangle, 1.0, draft_rad=np.deg2rad(40))


def test_a_tilted_tenon_stands_on_the_bicubic_joints_rectangle_and_allows_no_more_motion():
    rectangle = largest_rectangle(CONTACT, 0.1)
    curved = bicubic_joint(CONTACT, rectangle, 0.15, np.array([0.2, 0.1, 1.0]))
    tenon = tenon_of(curved)
    assert tenon.direction == pytest.approx(curved.direction)
    rng = np.random.default_rng(0)
    normals = curved.motion_cone().translational().normals
    for x in rng.normal(size=(200, 3)):
        if tenon.motion_cone().translational().contains(x):
            assert (normals @ x).min() >= -1e-9
    assert tenon_of(planar(CONTACT)).is_planar


def test_tenons_build_into_closed_parts_that_slide_out_along_u_only():
    assembly = wall(1, 1)
    (contact,) = find_contacts(assembly).contacts
    joint = tenon_joint(contact, largest_rectangle(contact, 0.02), -0.04, np.array([0.3, 0.0, 1.0]))
    built = build_parts(assembly, [joint])
    shapes = [p.shape for p in built.parts]
    assert all(trimesh.Trimesh(s.vertices, s.faces, process=False).is_watertight for s in shapes)
    assert mesh_overlap(shapes) < 1e-9
    assert sweep_blockers_3d(built, 1, joint.direction[None]) == ()
    assert sweep_blockers_3d(built, 1, UP[None]) == (0,)


def test_flat_tenon_has_walls_along_its_direction():
    parts = (
        Part("low", Polygon(np.array([[0, 0], [1, 0], [1, 1], [0, 1]])), fixed=True),
        Part("high", Polygon(np.array([[0, 1], [1, 1], [1, 2], [0, 2]]))),
    )
    assembly = Assembly("two", parts)
    (contact,) = find_contacts(assembly).contacts
    direction = np.array([0.3, 1.0])
    joint = tenon_joint_2d(contact, direction, 0.3, 0.7, 0.2)
    along = joint.facet_normals @ joint.direction
    assert np.sort(np.abs(along))[:2] == pytest.approx([0.0, 0.0], abs=1e-12) and along.min() > -1e-12
    built = build_parts(assembly, [joint])
    areas = [p.shape.volume for p in built.parts]
    assert sum(areas) == pytest.approx(sum(p.shape.volume for p in parts))
    block = 0.4 * 0.2 * direction[1] / np.linalg.norm(direction) * parts[0].shape.thickness
    assert abs(areas[0] - parts[0].shape.volume) == pytest.approx(block)
    with pytest.raises(InputError, match="0 < a < b < 1"):
        tenon_joint_2d(contact, direction, 0.7, 0.3, 0.2)
