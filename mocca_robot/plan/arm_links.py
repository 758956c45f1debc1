"""The arms as bodies: where each link sits in its parent, and thick capsules that enclose it.

The capsules follow the published kinematics and are thicker than the real links with their covers, so that what they
clear the arm clears, too. One description for the collision checks of planning and for the simulated cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin

from mocca_robot.plan.arm_models import RobotModel
from mocca_robot.plan.pose import Three

RADII_M = (0.075, 0.065, 0.058, 0.05, 0.05, 0.05)
"""Of a UR5e's six links with their covers; other arms in proportion to their shoulder height."""
_ALPHA = (pi / 2, 0.0, 0.0, pi / 2, -pi / 2, 0.0)


@dataclass(frozen=True)
class Capsule:
    """A capsule in its link's frame: ends and radius, metres."""

    start: Three
    end: Three
    radius: float


@dataclass(frozen=True)
class Offset:
    """Where a frame sits in its parent: position, and rotation as a quaternion, w first."""

    position: Three
    quat_wxyz: tuple[float, float, float, float]


def thickness(model: RobotModel) -> float:
    """Return how thick the arm is, relative to a UR5e."""
    return model.d[0] / 0.1625


def offsets(model: RobotModel) -> tuple[Offset, ...]:
    """Return the offsets of links 0–5 and of the flange, each in the frame before it at joint angle zero.

    A link's joint turns about z of its own frame; the offset after joint k goes along z by d, along x by a, about x by
    alpha (Denavit–Hartenberg).
    """
    out = [Offset((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))]
    for d, a, alpha in zip(model.d, model.a, _ALPHA, strict=True):
        out.append(Offset((a, 0.0, d), (cos(0.5 * alpha), sin(0.5 * alpha), 0.0, 0.0)))
    return tuple(out)


def capsules(model: RobotModel) -> tuple[tuple[Capsule, ...], ...]:
    """Return the capsules of links 0–5."""
    thick = thickness(model)
    side = 1.02 * model.d[3]
    upper, fore = model.a[1], model.a[2]
    ends: tuple[tuple[tuple[Three, Three], ...], ...] = (
        (((0, 0, 0.03), (0, 0, model.d[0])),),
        (((0, 0, 0), (0, 0, side)), ((0, 0, side), (upper, 0, side)), ((upper, 0, side), (upper, 0, 0))),
        (((0, 0, 0), (fore, 0, 0)),),
        (((0, 0, 0), (0, 0, model.d[3])),),
        (((0, 0, 0), (0, 0, model.d[4])),),
        (((0, 0, 0), (0, 0, model.d[5] - 0.05 * thick)),),
    )
    return tuple(
        tuple(Capsule(a, b, radius * thick) for a, b in link) for link, radius in zip(ends, RADII_M, strict=True)
    )
