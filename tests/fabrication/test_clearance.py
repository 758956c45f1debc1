"""Play between solid parts: the gap is the same everywhere, outer faces stay, parts stay closed."""

from __future__ import annotations

import numpy as np
import pytest
from solids import box

from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.fabrication.clearance import with_clearance
from mocca_robot.joints.bicubic import bicubic_joint, largest_rectangle
from mocca_robot.joints.build import build_parts
from mocca_robot.motion.sweep3d import mesh_overlap


def stacked() -> Assembly:
    parts = (
        Part("low", box((0, 0, 0), (0.1, 0.1, 0.05)), fixed=True),
        Part("high", box((0, 0, 0.05), (0.1, 0.1, 0.1))),
    )
    return Assembly("stack", parts)


def built(height: float) -> Assembly:
    assembly = stacked()
    (contact,) = find_contacts(assembly).contacts
    rectangle = largest_rectangle(contact, 0.01)
    assert rectangle is not None
    return build_parts(assembly, [bicubic_joint(contact, rectangle, height, contact.normal)])


@pytest.mark.parametrize("height", [0.01, -0.015])
def test_the_gap_is_the_clearance_along_every_facets_normal(height: float) -> None:
    whole = built(height)
    apart = with_clearance(whole, 4e-4)
    low, high = (p.shape for p in apart.parts)
    assert isinstance(low, Mesh) and isinstance(high, Mesh)
    assert mesh_overlap([low, high]) == 0.0
    # The volume that is gone is the area of the joint times the clearance, to first order.
    gone = sum(p.shape.volume for p in whole.parts) - low.volume - high.volume
    first, second = (p.shape for p in whole.parts)
    assert isinstance(first, Mesh) and isinstance(second, Mesh)
    corners = first.vertices[first.faces]
    twice = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    inside = (corners.mean(axis=1)[:, 2] > 0.03) & (
        np.ptp(corners[:, :, 0], axis=1) + np.ptp(corners[:, :, 1], axis=1) > 0
    )
    walls = (np.ptp(corners[:, :, 0], axis=1) < 1e-12) | (np.ptp(corners[:, :, 1], axis=1) < 1e-12)
    joint_area = 0.5 * twice[inside & ~walls].sum()
    assert gone == pytest.approx(joint_area * 4e-4, rel=0.03)
    # Outer faces stay where they were.
    for before, after in ((first, low), (second, high)):
        assert after.bounds[:, :2] == pytest.approx(before.bounds[:, :2], abs=1e-12)


def test_refusals() -> None:
    with pytest.raises(InputError, match="cannot be made"):
        with_clearance(built(0.01), 0.05)
    far = Assembly("far", (Part("a", box((0, 0, 0), (1, 1, 1)), fixed=True), Part("b", box((3, 0, 0), (4, 1, 1)))))
    with pytest.raises(InputError, match="share a facet"):
        with_clearance(far, 1e-3)
