"""Frusta: straight flanks of one slope, the same surface in both parts, and designs that curved bumps cannot give."""

from __future__ import annotations

import numpy as np
import pytest
from solids import box, flat_contact

from mocca_robot.assembly import Assembly, Lateral, Part
from mocca_robot.contacts.find import find_contacts
from mocca_robot.files.design_json import read_design, write_design
from mocca_robot.files.stored_joints import joints_of
from mocca_robot.joints.bicubic import largest_rectangle
from mocca_robot.joints.frustum import LEAST_FLANK, WIDEST_FLANK, frustum_joint
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.verdicts.verification import verify
from planners.cone_joints.designer import design, joint_contacts, joint_shapes, start_axes

PLATE = flat_contact([(0, 0), (0.3, 0), (0.3, 0.2), (0, 0.2)])
UP = np.array([0.0, 0.0, 1.0])


def trestle(tilt_deg: float) -> Assembly:
    """Return a plate on two posts, 60 mm square and 300 mm tall, to be designed for a tilted ground."""
    parts = (
        Part("ground", box((-0.3, -0.1, -0.1), (0.3, 0.1, 0.0)), fixed=True),
        Part("left", box((-0.23, -0.03, 0.0), (-0.17, 0.03, 0.3))),
        Part("right", box((0.17, -0.03, 0.0), (0.23, 0.03, 0.3))),
        Part("plate", box((-0.3, -0.1, 0.3), (0.3, 0.1, 0.4))),
    )
    goals = (Lateral(float(np.deg2rad(tilt_deg)), 4),)
    return Assembly("trestle", parts, goals=goals, alpha_rad=float(np.deg2rad(5.0)))


@pytest.mark.parametrize("flank", [LEAST_FLANK, 0.4, WIDEST_FLANK])
@pytest.mark.parametrize("height", [-0.05, 0.05])
def test_every_flank_has_one_slope_and_the_volume_is_that_of_a_frustum(flank: float, height: float) -> None:
    rectangle = largest_rectangle(PLATE, 0.01)
    assert rectangle is not None
    joint = frustum_joint(PLATE, rectangle, height, UP, flank)
    up = joint.facet_normals @ UP
    sides = np.array([height / (flank * side) for side in (rectangle.l1, rectangle.l2)])
    slopes = 1.0 / np.sqrt(1.0 + sides**2)
    distance = np.abs(up[:, None] - np.array([1.0, *slopes])).min(axis=1)
    assert distance.max() < 1e-9
    assert {int(np.abs(u - np.array([1.0, *slopes])).argmin()) for u in up} == {0, 1, 2}
    a, b, c = (joint.vertices[joint.facets[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)[:, 2] / 2
    volume = (area * (a + b + c)[:, 2] / 3).sum() - PLATE.centre[2] * PLATE.measure
    top = 1.0 - 2.0 * flank
    assert volume == pytest.approx(height * rectangle.area * (1.0 + top + top**2) / 3.0, rel=1e-9)


def test_the_optimisers_frusta_are_the_ones_that_are_built() -> None:
    assembly = trestle(10.0)
    graph = PartsGraph.of(assembly, joint_contacts(assembly, find_contacts(assembly)))
    shapes = joint_shapes(graph, JointOptions(), start_axes(graph))
    count = len(shapes.contacts)
    shapes = shapes.with_kinds(["frustum"] * count)
    rows = np.tile([0.3, 0.3], (count, 1))
    lean = np.full((len(shapes.pair_normal), 2), 0.05)
    u = shapes.directions(lean)
    surface = shapes.surface(rows, u)
    points, normals = shapes.rays(surface)
    every, all_normals = shapes.all_rays(surface)
    volume = shapes.transferred(surface)[0]
    for e in range(count):
        joint = shapes.joint(e, rows[e], u[e])
        built = np.unique(np.round(joint.facet_normals, 9), axis=0)
        for some in (normals[e], all_normals[e]):
            assert np.abs(np.round(some, 9)[:, None] - built).sum(axis=2).min(axis=1).max() < 1e-8
        assert joint.motion_cone().contains(np.array([*u[e], 0.0, 0.0, 0.0]))
        a, b, c = (joint.vertices[joint.facets[:, k]] - joint.contact.centre for k in range(3))
        assert volume[e] == pytest.approx(np.einsum("fd,fd->f", a, np.cross(b, c)).sum() / 6.0, rel=1e-9)
        assert len(np.unique(np.round(points[e], 9), axis=0)) <= len(np.unique(np.round(every[e], 9), axis=0))


def test_frusta_are_chosen_where_curved_bumps_do_not_hold_and_read_back_as_they_were(tmp_path) -> None:
    assembly = trestle(12.0)
    curved = design(assembly, JointOptions(kinds=("n", "z")))
    assert not curved.achieved and curved.impossible is None
    outcome = design(assembly)
    assert outcome.achieved
    assert {j.kind for j in outcome.design.joints} == {"frustum"}
    assert all(abs(j.parameters["height_m"]) <= 0.9 * j.parameters["l2_m"] + 1e-9 for j in outcome.design.joints)
    check = verify(outcome.design.assembly, directions={i.part: i.direction for i in outcome.design.insertion})
    assert check.assemblable and check.part_overlap <= 1e-9
    write_design(outcome.design, tmp_path)
    stored = read_design(tmp_path)
    assert stored.source is not None
    again = joints_of(stored, [j.contact for j in outcome.design.joints])
    for joint, read in zip(outcome.design.joints, again):
        assert read.kind == joint.kind
        assert np.abs(read.vertices - joint.vertices).max() < 1e-7


def test_no_frusta_where_the_tool_has_a_radius() -> None:
    assert not JointOptions(min_radius=0.001).frusta
    assert not JointOptions(kinds=("n",)).frusta
    outcome = design(trestle(12.0), JointOptions(min_radius=0.0005))
    assert "frustum" not in {j.kind for j in outcome.design.joints}


@pytest.mark.parametrize("flank", [0.0, 0.5])
def test_flanks_that_leave_no_frustum_are_refused(flank: float) -> None:
    rectangle = largest_rectangle(PLATE, 0.01)
    assert rectangle is not None
    with pytest.raises(ValueError, match=r"between 0 and 0\.5"):
        frustum_joint(PLATE, rectangle, 0.01, UP, flank)
