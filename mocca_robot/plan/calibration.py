"""The kinematics of one arm instead of its model's: what the factory measured, and a plan fitted to it.

A real arm's links differ from the published ones; the same joint angles bring its tool millimetres elsewhere. A plan is
about places: fitted, its poses stay and its joint angles change by milliradians.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.errors import InputError
from mocca_robot.plan.arm_models import RobotModel
from mocca_robot.plan.plan import Plan, Waypoint
from mocca_robot.plan.pose import Six, angle_rad, distance_m, six

FAR_M, FAR_RAD = 0.03, np.deg2rad(3.0)
"""No arm of a model differs more from it than this: the figures are those of another model."""
_POSES = ((0.0, -1.57, 1.57, -1.57, -1.57, 0.0), (0.7, -0.9, 1.2, -1.9, -1.2, 0.5), (-1.1, -2.0, 1.9, -0.6, 1.4, -2.0))


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Denavit–Hartenberg parameters of one arm, six each, metres and radians: its model's, corrected by the factory.

    Attributes:
        checksum: by which the controller knows them.
    """

    theta: Six
    a: Six
    d: Six
    alpha: Six
    checksum: tuple[int, ...] = ()


def calibrated(model: RobotModel, calibration: Calibration) -> RobotModel:
    """Return the arm that `calibration` describes; InputError when that is no arm of this model."""
    c = calibration
    arm = replace(model, theta=c.theta, a=c.a, d=c.d, alpha=c.alpha)
    gap, turn = difference(model, arm)
    if not (gap <= FAR_M and turn <= FAR_RAD):
        raise InputError(
            f"The controller's calibration puts the flange {1e3 * gap:.1f} mm and {np.rad2deg(turn):.1f}° from where a "
            f"{model.name} has it, limit {1e3 * FAR_M:g} mm and {np.rad2deg(FAR_RAD):g}°: this is no {model.name}. "
            "Check which robot answers."
        )
    return arm


def difference(a: RobotModel, b: RobotModel) -> tuple[float, float]:
    """Return how far apart the flanges of two arms are at most, metres and radians, in a few poses."""
    pairs = [(a.tcp_pose(q), b.tcp_pose(q)) for q in _POSES]
    return max(distance_m(*p) for p in pairs), max(angle_rad(*p) for p in pairs)


def fitted(plan: Plan, arm: RobotModel) -> Plan:
    """Return `plan` with joint angles that bring the tool of `arm` to its poses; InputError where none near do."""
    known: dict[tuple[Six, Six], Six] = {}

    def joints(point: Waypoint, where: str) -> Six:
        key = (point.q, point.tcp)
        if key not in known:
            try:
                known[key] = six(arm.solve_pose(point.tcp, point.q, plan.cell.tcp_offset))
            except InputError as error:
                raise InputError(f"{where} cannot be fitted to this robot's calibration: {error}") from error
        return known[key]

    def path(points: tuple[Waypoint, ...], where: str) -> tuple[Waypoint, ...]:
        return tuple(replace(p, q=joints(p, f"{where}, waypoint {w}")) for w, p in enumerate(points))

    steps = []
    for i, step in enumerate(plan.steps):
        moves = []
        for k, move in enumerate(step.moves):
            where = f"Step {i} ({step.part}), move {k} ({move.kind})"
            others = tuple(path(p, where) for p in move.alternatives)
            moves.append(replace(move, path=path(move.path, where), alternatives=others))
        steps.append(replace(step, moves=tuple(moves)))
    return replace(plan, steps=tuple(steps))
