"""Rectangles in contacts, flat triangulations, bicubic patches and the room they have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from solids import dome, flat_contact, rotation, wall

from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.geometry.frames import tangents
from mocca_robot.geometry.triangulation import boundary_chain
from mocca_robot.joints.bicubic import (
    BumpParameters,
    Rectangles,
    bicubic_joint,
    bump_pattern,
    bump_rays,
    largest_rectangle,
    lean_of,
    rectangle_of,
    triangulated,
)
from mocca_robot.joints.build3d import build_parts_3d
from mocca_robot.joints.clearance import height_limits
from mocca_robot.joints.joint import planar
from mocca_robot.motion.sweep3d import mesh_overlap

QUAD = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.5), (0.0, 1.0)]
RING = flat_contact([(0, 0), (3, 0), (3, 3), (1.5, 3), (0, 3)], [[(1, 1), (1, 2), (2, 2), (2, 1)]])
UP = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize("contact", [flat_contact(QUAD), RING, flat_contact([(0, 0), (1, 0), (2, 0), (3, 0), (0, 1)])])
def test_flat_triangles_cover_the_contact_and_keep_every_corner(contact):
    vertices, facets = triangulated(contact)
    corners = vertices[facets]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all() and np.abs(normals[:, :2]).max() == 0
    assert normals[:, 2].sum() / 2 == pytest.approx(contact.measure, rel=1e-12)
    rings = [contact.polygon, *contact.holes]
    assert len(boundary_chain(facets, len(vertices))) == sum(len(r) for r in rings)


def test_a_sliver_among_a_flat_contacts_triangles_has_the_contacts_normal():
    joint = planar(flat_contact(QUAD))
    thin = replace(joint, facets=np.vstack([joint.facets, [[0, 1, 1]]]))
    assert np.array_equal(thin.facet_normals, np.tile(UP, (len(thin.facets), 1)))


def test_largest_rectangle_of_known_shapes():
    rectangle = largest_rectangle(flat_contact([(0, 0), (2, 0), (2, 1), (0, 1)]), 0.1)
    assert (rectangle.l1, rectangle.l2) == pytest.approx((1.8, 0.8), abs=1e-4)
    triangle = largest_rectangle(flat_contact([(0, 0), (1, 0), (0, 1)]))
    assert triangle.area == pytest.approx(0.25, rel=1e-4)
    turns = np.linspace(0, 2 * np.pi, 96, endpoint=False)
    assert largest_rectangle(flat_contact([(np.cos(t), np.sin(t)) for t in turns])).area == pytest.approx(2, rel=2e-3)
    ell = largest_rectangle(flat_contact([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]), 0.05)
    assert ell.area == pytest.approx(0.9 * 2.9, rel=1e-2)
    assert largest_rectangle(RING).area == pytest.approx(3.0, rel=1e-2)
    assert largest_rectangle(flat_contact([(0, 0), (1, 0), (1, 0.1), (0, 0.1)]), 0.06) is None


def test_rectangles_stay_inside_by_their_margin_in_any_pose():
    rng = np.random.default_rng(2)
    for seed in range(12):
        ring = np.array(QUAD) + rng.normal(size=(4, 2)) * 0.1
        flat = flat_contact([tuple(p) for p in ring])
        turn, shift = rotation(seed), rng.normal(size=3)
        posed = type(flat)((0, 1), flat.polygon @ turn.T + shift, turn @ flat.normal)
        found = largest_rectangle(posed, 0.05)
        axes = tangents(posed.normal)
        inner = shapely.Polygon((posed.polygon - shift) @ axes.T).buffer(-0.05 + 1e-9, join_style="mitre")
        assert inner.contains(shapely.Polygon((found.corners - shift) @ axes.T))
        assert found.normal == pytest.approx(posed.normal)
        assert found.l1 >= found.l2
        assert found.area == pytest.approx(largest_rectangle(flat, 0.05).area, rel=0.02)


def test_a_patch_passes_the_control_points_and_never_overshoots():
    pattern = bump_pattern(3)
    height = {tuple(np.round(xy, 9)): s for xy, s in zip(pattern.xy, pattern.share)}
    third = round(1 / 3, 9), round(2 / 3, 9)
    assert all(height[x, y] == pytest.approx(1.0) for x in third for y in third)
    assert pattern.share.min() == 0.0 and pattern.share.max() == pytest.approx(1.0)
    assert np.abs(pattern.share[pattern.rim]).max() == 0.0
    saddle = bump_pattern(3, "z")
    assert saddle.share.min() == pytest.approx(-1.0) and saddle.share.max() == pytest.approx(1.0)
    assert saddle.share.sum() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("kind", ["n", "z"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_joint_keeps_the_boundary_and_is_a_height_field(kind, sign):
    contact = flat_contact(QUAD)
    rectangle = largest_rectangle(contact, 0.05)
    u = np.array([0.3, -0.2, 1.0])
    joint = bicubic_joint(contact, rectangle, sign * 0.2, u, 3, kind)
    assert (joint.facet_normals @ joint.direction > 0).all()
    assert {tuple(e) for e in boundary_chain(joint.facets, len(joint.vertices))} == {(0, 1), (1, 2), (2, 3), (3, 0)}
    corners = joint.vertices[joint.facets]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    assert area == pytest.approx(contact.measure * UP), "same boundary, same vector area"
    assert rectangle_of(joint).corners == pytest.approx(rectangle.corners)


def test_steepest_normal_follows_from_height_and_side():
    contact = flat_contact([(0, 0), (1, 0), (1, 1), (0, 1)])
    rectangle = largest_rectangle(contact, 0.05)
    steepest = []
    for pieces in (1, 3, 9):
        normals = bicubic_joint(contact, rectangle, 0.1, UP, pieces).facet_normals
        steepest.append(np.tan(np.arccos(normals[:, 2].min())))
    chord, smooth = 3 * 0.1 / rectangle.l2, 4.5 * 0.1 / rectangle.l2
    assert steepest[0] == pytest.approx(chord, rel=1e-6)
    assert chord < steepest[1] <= steepest[2] <= smooth * (1 + 1e-9)
    assert steepest[1] > 0.95 * smooth


def test_without_height_the_joint_is_the_planar_contact():
    contact = flat_contact(QUAD)
    joint = bicubic_joint(contact, largest_rectangle(contact, 0.05), 0.0, UP)
    assert joint.facet_normals == pytest.approx(np.tile(UP, (len(joint.facets), 1)))
    slight = bicubic_joint(contact, largest_rectangle(contact, 0.05), 1e-7, UP)
    assert np.abs(slight.facet_normals - UP).max() < 1e-5


def test_a_rectangle_on_the_boundary_and_a_direction_along_the_contact_are_refused():
    contact = flat_contact([(0, 0), (1, 0), (1, 1), (0, 1)])
    rectangle = largest_rectangle(contact, 0.1)
    with pytest.raises(InputError, match="margin"):
        bicubic_joint(contact, rectangle.part((-0.3, 0.0), (1.0, 1.0)), 0.1, UP)
    with pytest.raises(ValueError, match="u·n"):
        lean_of(Rectangles.of([rectangle]), np.array([[1.0, 0.0, 0.1]]))


def test_bumps_of_many_joints_equal_the_joints_one_by_one():
    assembly = wall()
    contacts = find_contacts(assembly).contacts
    single = [largest_rectangle(c, 0.01) for c in contacts]
    rectangles = Rectangles.of(single)
    u = np.array([c.normal + 0.2 * r.axis_x for c, r in zip(contacts, single)])
    flat = BumpParameters.flat(len(contacts))
    parameters = BumpParameters(np.full(len(contacts), 0.02), lean_of(rectangles, u), flat.low, flat.high)
    together = bump_rays(rectangles, parameters)
    assert parameters.directions(rectangles) == pytest.approx(u / np.linalg.norm(u, axis=1)[:, None])
    for e in (0, len(contacts) - 1):
        alone = bicubic_joint(contacts[e], single[e], 0.02, u[e]).facet_normals
        assert alone[-together.facet_normals.shape[1] :] == pytest.approx(together.facet_normals[e])


@pytest.mark.parametrize("assembly", [wall(), dome()], ids=["wall", "dome"])
@pytest.mark.parametrize("lean", [0.0, 0.25])
def test_bumps_at_their_limits_never_meet(assembly, lean):
    contacts = find_contacts(assembly).contacts
    single = [largest_rectangle(c, 0.1 * np.sqrt(c.measure)) for c in contacts]
    normals = np.array([c.normal for c in contacts])
    low, high = height_limits(assembly, contacts, Rectangles.of(single), normals, 0.003, lean)
    assert (low < 0).all() and (high > 0).all()
    rng = np.random.default_rng(1)
    for _ in range(3):
        up = rng.random(len(contacts)) < 0.5
        joints = []
        for e, (contact, rectangle) in enumerate(zip(contacts, single)):
            turn, way = 2 * np.arcsin(lean / 2), rng.uniform(0, 2 * np.pi)
            side = np.cos(way) * rectangle.axis_x + np.sin(way) * rectangle.axis_y
            u = np.cos(turn) * contact.normal + np.sin(turn) * side
            joints.append(bicubic_joint(contact, rectangle, high[e] if up[e] else low[e], u))
        assert mesh_overlap([p.shape for p in build_parts_3d(assembly, joints).parts]) < 1e-9


def test_height_limit_of_a_slab_is_half_the_way_to_the_joint_across():
    assembly = wall(2, 1)
    contacts = [c for c in find_contacts(assembly).contacts if abs(c.normal[2]) > 0.9]
    single = [r.part((0.4, 0.4), (0.6, 0.6)) for r in (largest_rectangle(c, 0.01) for c in contacts)]
    normals = np.array([c.normal for c in contacts])
    low, high = height_limits(assembly, contacts, Rectangles.of(single), normals, 0.0)
    assert high[0] <= 0.1 and low[1] >= -0.1, "the block between both contacts is 0.1 m thick"
    assert high[0] >= 0.049 and low[1] <= -0.049, "each may go to the middle"
    assert low[0] == pytest.approx(-0.1, rel=0.01), "the slab has no other joint: down to its lower face"
