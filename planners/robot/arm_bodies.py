"""The arm and its hand as bodies of a MuJoCo model: what collision checks of planning and the simulated cell share.

Only frames, joints and shapes; who collides with whom, masses and drives are set by whoever adds them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mocca_robot.plan.arm_links import capsules, offsets
from mocca_robot.plan.arm_models import RobotModel
from planners.robot.obstacles import CellBox
from planners.robot.tool import Gripper, ParallelGripper


@dataclass(frozen=True, eq=False)
class ArmLink:
    """One link: its body, the hinge that turns it, and its capsules."""

    body: Any
    joint: Any
    shapes: tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class Finger:
    """One finger: its body, the slide that opens it (half the opening, metres), and its box without the pad."""

    side: str
    sign: float
    body: Any
    joint: Any
    shape: Any


def add_links(parent: Any, model: RobotModel) -> tuple[tuple[ArmLink, ...], Any]:
    """Add the six links of an arm to `parent`, its base; return them and the body of its flange."""
    import mujoco

    links = []
    places, segments = offsets(model), capsules(model)
    for k in range(6):
        body = parent.add_body(name=f"link {k}", pos=places[k].position, quat=places[k].quat_wxyz)
        joint = body.add_joint(name=f"joint {k}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
        shapes = [
            body.add_geom(
                name=f"link {k} {n}",
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=[*capsule.start, *capsule.end],
                size=[capsule.radius, 0, 0],
            )
            for n, capsule in enumerate(segments[k])
        ]
        links.append(ArmLink(body, joint, tuple(shapes)))
        parent = body
    return tuple(links), parent.add_body(name="flange", pos=places[6].position, quat=places[6].quat_wxyz)


def add_palm(flange: Any, gripper: Gripper) -> Any:
    """Add the box around the hand to the flange and return it."""
    import mujoco

    low, high = gripper.palm_m
    return flange.add_geom(name="palm", type=mujoco.mjtGeom.mjGEOM_BOX, pos=0.5 * (low + high), size=0.5 * (high - low))


def add_finger(flange: Any, gripper: ParallelGripper, side: str) -> Finger:
    """Add the finger on a `side`, "left" (towards +y) or "right", to the flange and return it."""
    import mujoco

    sign = {"left": 1.0, "right": -1.0}[side]
    low, high = gripper.finger_m
    name = f"finger {side}"
    body = flange.add_body(name=name)
    joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, sign, 0])
    shape = body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=0.5 * (low + high) * np.array([1.0, sign, 1.0]),
        size=0.5 * (high - low),
    )
    return Finger(side, sign, body, joint, shape)


def add_obstacle(body: Any, obstacle: CellBox, **options: Any) -> None:
    """Add an obstacle of the cell as a box named after it to a body that stands in the base's frame."""
    import mujoco

    c, s = float(np.cos(0.5 * obstacle.yaw_rad)), float(np.sin(0.5 * obstacle.yaw_rad))
    body.add_geom(
        name=f"obstacle {obstacle.name}",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=obstacle.middle,
        quat=[c, 0.0, 0.0, s],
        size=obstacle.half,
        **options,
    )
