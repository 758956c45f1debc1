"""Joints of solids where they can be seen: the faces that pictures emphasise, and the figures in the table."""

from __future__ import annotations

import re

import numpy as np
import pytest
from solids import box

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.contacts.find import find_contacts
from mocca_robot.joints.bicubic import bicubic_joint
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.joints.rectangle import largest_rectangle
from mocca_robot.joints.tenon import tenon_joint
from mocca_robot.report.drawing3d import close_up
from mocca_robot.report.joint_faces import EMPHASIS, curved_faces, with_joints_apart
from mocca_robot.report.joints_section import extents, height_of


def jointed(kind: str) -> tuple[Assembly, Joint]:
    """Return a block of 200 × 100 mm that is joined to the one below it, as built, and the joint."""
    low, high = (0.0, 0.0, 0.0), (0.2, 0.1, 0.1)
    parts = (Part("base", box(low, high), fixed=True), Part("top", box((0.0, 0.0, 0.1), (0.2, 0.1, 0.2))))
    source = Assembly("pile", parts)
    (contact,) = find_contacts(source).contacts
    rectangle = largest_rectangle(contact, 0.005)
    assert rectangle is not None
    if kind == "tenon":
        joint = tenon_joint(contact, rectangle, 0.03, contact.normal, 0.005)
    elif kind == "planar":
        joint = planar(contact)
    else:
        joint = bicubic_joint(contact, rectangle, 0.02, contact.normal, 3, "n")
    return build_parts(source, (joint,)), joint


def area(vertices: Array, faces: IntArray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("kind", ["bicubic", "tenon", "planar"])
def test_the_emphasised_faces_of_both_parts_are_the_joint_without_its_flat_rim(kind: str) -> None:
    built, joint = jointed(kind)
    level = (joint.vertices - joint.contact.polygon[0]) @ joint.contact.normal
    risen = joint.facets[(np.abs(level) > 1e-9)[joint.facets].any(axis=1)]
    assert (len(risen) > 0) == (kind != "planar")
    for part in built.parts:
        assert isinstance(part.shape, Mesh)
        mine = curved_faces(part.shape, [joint])
        assert area(part.shape.vertices, part.shape.faces[mine]) == pytest.approx(area(joint.vertices, risen), rel=1e-6)


def test_emphasised_faces_are_meshes_of_their_own_and_nothing_is_lost() -> None:
    built, joint = jointed("bicubic")
    meshes = [p.shape for p in built.parts if isinstance(p.shape, Mesh)]
    shown, fills, hatched = with_joints_apart(built, [joint], meshes, ["#112233", "#445566"])
    assert fills == ["#112233", "#445566", EMPHASIS, EMPHASIS] and hatched == [True, False, False, False]
    for k, whole in enumerate(meshes):
        assert len(shown[k].faces) + len(shown[k + 2].faces) == len(whole.faces)


def test_the_table_tells_height_and_size_of_a_joint() -> None:
    _, joint = jointed("bicubic")
    assert height_of(joint) == pytest.approx(0.02)
    assert extents(joint) == pytest.approx((0.2, 0.1))


@pytest.mark.parametrize("side", [0, 1])
def test_a_close_up_shows_the_joint_from_its_front(side: int) -> None:
    built, joint = jointed("bicubic")
    drawn = close_up(built, joint, side, "#112233")
    assert built.parts[side].name in drawn
    assert len(re.findall("data:image/png;base64,", drawn)) == 1
