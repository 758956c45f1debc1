"""The arm and its gripper as bodies of a MuJoCo model: servo joints with torque limits, fingers that close with force.

Links are the capsules of `mocca_robot.plan.arm_links` with published masses. The arm carries its own weight, as a
controller does that knows its tool: gravity acts on nothing but the parts.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from planners.robot.arm_bodies import add_finger, add_links, add_palm
from planners.robot.cell import RobotCell
from planners.robot.tool import ParallelGripper, SuctionGripper

ROLLING = 1e-4
"""Friction of rolling, which MuJoCo asks for (m): pads hardly roll."""

LINK_MASS_KG = MappingProxyType(
    {
        "ur3e": (1.98, 3.4445, 1.437, 0.871, 0.805, 0.261),
        "ur5e": (3.761, 8.058, 2.846, 1.37, 1.3, 0.365),
        "ur7e": (3.761, 8.058, 2.846, 1.37, 1.3, 0.365),
        "ur10e": (7.369, 13.051, 3.989, 2.1, 1.98, 0.615),
        "ur12e": (7.369, 13.051, 3.989, 2.1, 1.98, 0.615),
        "ur16e": (7.369, 10.45, 4.321, 2.18, 2.033, 0.907),
        "ur20": (16.343, 29.632, 7.879, 3.054, 3.126, 0.926),
        "ur30": (16.343, 29.632, 7.879, 3.054, 3.126, 0.926),
    }
)
"""As Universal Robots publishes them for dynamics; the UR30 counts as a UR20, which is heavier."""
JOINT_TORQUE_NM = MappingProxyType(
    {
        "ur3e": (56.0, 56.0, 28.0, 12.0, 12.0, 12.0),
        "ur5e": (150.0, 150.0, 150.0, 28.0, 28.0, 28.0),
        "ur7e": (150.0, 150.0, 150.0, 28.0, 28.0, 28.0),
        "ur10e": (330.0, 330.0, 150.0, 54.0, 54.0, 54.0),
        "ur12e": (330.0, 330.0, 150.0, 54.0, 54.0, 54.0),
        "ur16e": (330.0, 330.0, 150.0, 54.0, 54.0, 54.0),
        "ur20": (738.0, 738.0, 433.0, 107.0, 107.0, 107.0),
        "ur30": (730.0, 730.0, 430.0, 100.0, 100.0, 100.0),
    }
)
"""Published largest joint torques."""

STIFFNESS_PER_TORQUE = 40.0
"""Servo stiffness of a joint per newton metre of its largest torque, 1/rad: a UR5e gives 0.4 mm under 10 N at 0.5 m."""
RATE_S = 60.0
"""Stiffness over damping of a joint's servo, 1/s: the driver's own commands come at 50 Hz."""
ARMATURE = 0.002
"""Rotor inertia as the gears show it, kg m² per newton metre of a joint's largest torque."""

FINGER_KG, FINGER_ARMATURE_KG = 0.05, 0.5
FINGER_STIFFNESS, FINGER_DAMPING = 4e4, 300.0
PAD_SPHERE_M = 0.002
PAD_SPREAD = 0.7
"""Of the pad's radius: how far from its middle the four points lie with which it presses."""
PAD_SOLREF, PAD_SOLIMP = (0.006, 1.0), (0.98, 0.999, 1e-4, 0.5, 2.0)
"""Pads are of rubber: softer than the parts' own contacts; 20 N press them in by a tenth of a millimetre or so."""

ARM, PAD, PART = 1, 2, 4
"""Collision bits: arm and hand, pads, parts' outer surfaces. What obeys which is said where the shapes are made."""


def add_arm(spec: Any, cell: RobotCell, position: Array, quat_wxyz: Array, pad_friction: float) -> None:
    """Add the arm of `cell` with its base at a pose of the world.

    Joints and actuators come first in the model: six of the arm, then, where there are fingers, the left and the right
    one, each with its half of the opening as coordinate.
    """
    import mujoco

    model, torque, gripper = cell.model, JOINT_TORQUE_NM[cell.model.name], cell.gripper
    base = spec.worldbody.add_body(name="base", pos=position, quat=quat_wxyz)
    links, flange = add_links(base, model)
    for k, link in enumerate(links):
        link.body.gravcomp = 1.0
        link.joint.armature = ARMATURE * torque[k]
        for shape in link.shapes:
            shape.mass = LINK_MASS_KG[model.name][k] / len(link.shapes)
            # The shoulder stands on the table.
            shape.contype, shape.conaffinity = 0 if k == 0 else ARM, 0
        stiffness = STIFFNESS_PER_TORQUE * torque[k]
        drive = spec.add_actuator(name=f"joint {k}", target=f"joint {k}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.set_to_position(kp=stiffness, kv=stiffness / RATE_S)
        drive.forcerange = [-torque[k], torque[k]]
    flange.gravcomp = 1.0
    palm = add_palm(flange, gripper)
    palm.mass, palm.contype, palm.conaffinity = max(gripper.mass_kg - 2 * FINGER_KG, 0.05), ARM, 0
    if isinstance(gripper, SuctionGripper):
        _add_stem(flange, gripper)
    else:
        _add_fingers(spec, gripper, flange, pad_friction)


def add_cup(spec: Any, part: str) -> None:
    """Add what a suction cup holds the body `part` with: a weld that begins inactive (see `cup.suck`)."""
    import mujoco

    cup = spec.add_equality(name="cup", type=mujoco.mjtEq.mjEQ_WELD)
    cup.name1, cup.name2 = "flange", part
    cup.objtype = mujoco.mjtObj.mjOBJ_BODY
    cup.active = False


def _add_stem(flange: Any, gripper: SuctionGripper) -> None:
    import mujoco

    x, y, lip = gripper.tcp_offset[:3]
    flange.add_geom(
        name="stem",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        fromto=[x, y, float(gripper.palm_m[1, 2]), x, y, lip - max(2.0 * gripper.bellows_m, 0.004)],
        size=[gripper.stem_radius_m, 0, 0],
        mass=2 * FINGER_KG,
        contype=ARM,
        conaffinity=0,
    )


def _add_fingers(spec: Any, gripper: ParallelGripper, flange: Any, pad_friction: float) -> None:
    import mujoco

    tip = np.asarray(gripper.tcp_offset[:3])
    for name in ("left", "right"):
        finger = add_finger(flange, gripper, name)
        finger.body.gravcomp, finger.joint.armature = 1.0, FINGER_ARMATURE_KG
        finger.shape.mass, finger.shape.contype, finger.shape.conaffinity = FINGER_KG, ARM, 0
        for n, (x, z) in enumerate(((1, 1), (1, -1), (-1, -1), (-1, 1))):
            spread = PAD_SPREAD * gripper.pad_radius_m
            finger.body.add_geom(
                name=f"pad {name} {n}",
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                pos=tip + np.array([x * spread, finger.sign * PAD_SPHERE_M, z * spread]),
                size=[PAD_SPHERE_M, 0, 0],
                mass=0.0,
                contype=PAD,
                conaffinity=0,
                priority=1,
                condim=4,
                friction=[pad_friction, 0.5 * spread, ROLLING],
                solref=PAD_SOLREF,
                solimp=PAD_SOLIMP,
            )
        drive = spec.add_actuator(name=f"finger {name}", target=f"finger {name}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.set_to_position(kp=FINGER_STIFFNESS, kv=FINGER_DAMPING)
        drive.forcerange = [-gripper.force_n, gripper.force_n]
    linkage = spec.add_equality(name="linkage", type=mujoco.mjtEq.mjEQ_JOINT)
    linkage.name1, linkage.name2 = "finger left", "finger right"
    linkage.objtype = mujoco.mjtObj.mjOBJ_JOINT
    linkage.data[:5] = [0.0, 1.0, 0.0, 0.0, 0.0]
    linkage.solref = (0.004, 1.0)
