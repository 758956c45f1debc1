"""Every family of solid joints in physics: no jam on the rim of its motion cone, no way in 3° beyond it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from solids import box

from mocca_robot.assembly import Assembly, Part
from mocca_robot.contacts.find import find_contacts
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.families.known import family_named
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from planners.cone_joints.designer import joint_contacts, joint_shapes, start_axes
from planners.cone_joints.shapes3d import Shapes3D
from sim.insertion.directions import directions, insertion_cone
from sim.insertion.trial import insert
from sim.insertion.trial_scene import insertion_scene

OPTIONS = JointOptions(profile=((0.2, 1.0, 0.2), (-0.4, 0.6, -0.4)))
ROWS = {
    "frustum": [0.3, 0.35],
    "outline": [-0.3, 0.35],
    "rib": [0.2, 0.7, -0.15],
    "rib_across": [-0.15, 0.7, -0.2],
    "free": [0.15, 0.9, -0.1, -0.1, 0.15],
    "twins": [0.12, 1.0, -0.12],
    "four": [0.08, 1.0, -0.06, -0.08, 0.08],
    "heights_3": [0.1, 1.0, -0.1, 0.1, 0.1, 0.1, -0.1, -0.1, 0.0, 0.1],
    "drawn": [0.15, 1.0],
}


@pytest.mark.parametrize("name", ROWS)
def test_all_ways_inside_the_cone_succeed_and_none_three_degrees_outside(name: str) -> None:
    parts = (
        Part("base", box((0, 0, 0), (0.06, 0.05, 0.05)), fixed=True),
        Part("block", box((0, 0, 0.05), (0.06, 0.05, 0.1))),
    )
    flat = Assembly("two", parts)
    graph = PartsGraph.of(flat, joint_contacts(flat, find_contacts(flat)))
    shapes = joint_shapes(graph, OPTIONS, start_axes(graph))
    assert isinstance(shapes, Shapes3D)
    numbers = max(family_named(name, OPTIONS).heights) + 1
    shapes = replace(shapes, numbers=max(2, numbers)).with_kinds([name])
    joint = shapes.joint(0, np.array(ROWS[name]), shapes.directions(np.full((1, 2), 0.05))[0])
    assembly = build_parts(flat, [joint])
    contacts = find_contacts(assembly).contacts
    cone = insertion_cone(PartsGraph.of(assembly, contacts), 1)
    ready = insertion_scene(PartsGraph.of(assembly, contacts), cone)
    found = [insert(ready, way) for way in directions(cone, 5)]
    inside, outside = ([t for t in found if (t.kind == "outside") is out] for out in (False, True))
    assert "rim" in {t.kind for t in inside} and len(outside) == 8
    assert all(t.succeeded for t in inside), [t.reason for t in inside]
    assert not any(t.succeeded for t in outside)
