"""A block on another one, tilted: how far each family of joints holds it, beside a closed form of its limit.

Towards +x, two forces balance the weight of a block of half width a and centre of mass at height c: one on a facet of
slope g against the motion, at (x, z), and one on the flat rest, at x = ±a at most. Equilibrium of forces and moments
gives tan θ ≤ g, a / ((x + a)/g + z − c) and a / ((a − x)/g + c − z), where these are positive; the best facet counts.
Two facets of one slope g that the weight passes between, like those of two bumps, hold tan θ = g.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from solids import box

from mocca_robot.assembly import Assembly, Lateral, Part
from mocca_robot.contacts.find import find_contacts
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.families.known import family_named, further_families
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import critical_tilt
from planners.cone_joints.designer import joint_contacts, joint_shapes, start_axes
from planners.cone_joints.largest_tilt import largest_tilt
from planners.cone_joints.shapes3d import Shapes3D

STEEPEST = float(np.deg2rad(40.0))
AZIMUTHS = 8
HALF, CENTRE = 0.1, 0.015
"""Half width of the upper block, and the height of its centre of mass above the contact, m."""


def two_blocks(tilt_deg: float = 15.0) -> Assembly:
    parts = (
        Part("ground", box((-0.2, -0.2, -0.1), (0.2, 0.2, 0)), fixed=True),
        Part("block", box((-0.1, -0.1, 0), (0.1, 0.1, 0.03))),
    )
    goals = (Lateral(float(np.deg2rad(tilt_deg)), AZIMUTHS),)
    return Assembly("two", parts, goals=goals, alpha_rad=float(np.deg2rad(5.0)))


def allowed_towards_x(joint: Joint) -> float:
    """Return the closed form's tilt, over all corners of all facets."""
    points, normals = joint.rays
    slope = -normals[:, 0] / normals[:, 2]
    against = slope > 1e-6
    x, z, g = points[against, 0], points[against, 2], slope[against]
    uphill, downhill = (HALF + x) / g + z - CENTRE, (HALF - x) / g + CENTRE - z
    limits = [g, *(np.where(lever > 0.0, HALF / np.maximum(lever, 1e-9), np.inf) for lever in (uphill, downhill))]
    alone = float(np.min(limits, axis=0).max())
    # Two facets of one slope need no third force when the weight passes between them.
    steepest = g > (1.0 - 1e-6) * g.max()
    between = x[steepest].min() <= (CENTRE - z[steepest].mean()) * g.max() <= x[steepest].max()
    return float(np.arctan(g.max() if between else alone))


@pytest.mark.parametrize("name", ["n", "frustum", *further_families(JointOptions()), "heights_4"])
def test_each_family_holds_a_block_as_far_as_its_closed_form_says(name: str) -> None:
    flat = two_blocks()
    graph = PartsGraph.of(flat, joint_contacts(flat, find_contacts(flat)))
    shapes = joint_shapes(graph, JointOptions(), start_axes(graph))
    assert isinstance(shapes, Shapes3D)
    family = family_named(name, JointOptions())
    shapes = replace(shapes, numbers=max(2, max(family.heights) + 1)).with_kinds([name])
    row = shapes.rest
    row[list(family.heights)] = -0.08
    row[1] = 0.5 * sum(family.sizes)
    joint = shapes.joint(0, row, np.array([0.0, 0.0, 1.0]))
    built = build_parts(flat, [joint])
    # The bump moves a little mass, which the closed form leaves out.
    measured, limit = critical_tilt(PartsGraph.of(built), 0.0), allowed_towards_x(joint)
    assert limit > np.deg2rad(10.0)
    assert abs(measured - limit) <= 0.05 * limit


@pytest.mark.parametrize(
    ("kinds", "share"),
    [(("n", "frustum"), np.sqrt(0.5)), (("n", "several"), np.cos(np.pi / 8))],
)
def test_designs_come_within_five_percent_of_what_their_steepest_slope_allows(
    kinds: tuple[str, ...], share: float
) -> None:
    """Flanks of one bump face four ways; between two of them they hold 1/√2 of their slope. Several bumps have flanks
    that lean between those, too: eight ways.
    """
    options = JointOptions(kinds=kinds, max_slope_rad=STEEPEST, tilt_margin_rad=0.0, inset=0.0)
    found = largest_tilt(two_blocks(25.0), options)
    limit = float(np.arctan(share * np.tan(STEEPEST)))
    assert found.angle_rad is not None
    assert 0.95 * limit <= found.angle_rad <= STEEPEST
    assert found.impossible_rad is not None and found.impossible_rad <= 1.1 * STEEPEST
