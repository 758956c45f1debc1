"""Joint angles for tool poses: all branches of a UR arm in closed form, and straight lines that stay on one branch.

With the last three axes of a UR arm the wrist's side is fixed first (shoulder, then wrist flip), which leaves a planar
two-link arm for shoulder lift and elbow: 2 × 2 × 2 branches.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mocca_robot.assembly import Array
from mocca_robot.ur.models import RobotModel

BRANCH_STEP_RAD = 0.12
"""A joint that turns farther between two poses of a finely sampled line has changed its branch or is near a
singularity."""
SINGULAR = 0.02
"""Smallest singular value of the Jacobian (metres and radians) that a line may pass."""


def branches(model: RobotModel, flange: Array) -> list[Array]:
    """Return all joint angles (6,), each in (−π, π], that put the flange at `flange` (4, 4); none when out of reach."""
    d1, _, _, d4, d5, d6 = model.d
    a2, a3 = model.a[1], model.a[2]
    wrist = flange[:3, 3] - d6 * flange[:3, 2]
    reach = math.hypot(wrist[0], wrist[1])
    if reach <= abs(d4):
        return []
    found = []
    for shoulder in (1.0, -1.0):
        q1 = math.atan2(wrist[1], wrist[0]) + shoulder * math.acos(d4 / reach) + math.pi / 2
        s1, c1 = math.sin(q1), math.cos(q1)
        cosine = (flange[0, 3] * s1 - flange[1, 3] * c1 - d4) / d6
        if abs(cosine) > 1.0 + 1e-9:
            continue
        for flip in (1.0, -1.0):
            q5 = flip * math.acos(max(-1.0, min(1.0, cosine)))
            s5 = math.sin(q5)
            if abs(s5) < 1e-6:
                continue
            x, y = flange[:3, 0], flange[:3, 1]
            q6 = math.atan2((-y[0] * s1 + y[1] * c1) / s5, (x[0] * s1 - x[1] * c1) / s5)
            first = _link(q1, d1, 0.0, math.pi / 2)
            last = _link(q5, d5, 0.0, -math.pi / 2) @ _link(q6, d6, 0.0, 0.0)
            middle = np.linalg.inv(first) @ flange @ np.linalg.inv(last)
            px, py = middle[:2, 3]  # d4 is across the plane of the two links
            bend = (px * px + py * py - a2 * a2 - a3 * a3) / (2 * a2 * a3)
            if abs(bend) > 1.0:
                continue
            for elbow in (1.0, -1.0):
                q3 = elbow * math.acos(bend)
                q2 = math.atan2(py, px) - math.atan2(a3 * math.sin(q3), a2 + a3 * math.cos(q3))
                upper = _link(q2, 0.0, a2, 0.0) @ _link(q3, 0.0, a3, 0.0)
                rest = upper[:3, :3].T @ middle[:3, :3]
                q4 = math.atan2(rest[1, 0], rest[0, 0])
                q = np.array([q1, q2, q3, q4, q5, q6])
                found.append(np.arctan2(np.sin(q), np.cos(q)))
    return found


def _link(angle: float, d: float, a: float, alpha: float) -> Array:
    ct, st, ca, sa = math.cos(angle), math.sin(angle), math.cos(alpha), math.sin(alpha)
    return np.array([[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d], [0, 0, 0, 1.0]])


def nearest_turn(model: RobotModel, q: Array, near: Array) -> Array:
    """Return `q` with full turns added so that every joint lies as near to `near` as its limits allow.

    The elbow stays in (−π, π]: beyond, the forearm would have passed through the upper arm.
    """
    turns = np.round((near - q) / (2 * np.pi))
    turns[2] = 0.0
    limit = np.asarray(model.joint_limit_rad)
    out = q + 2 * np.pi * turns
    out = np.where(out > limit, out - 2 * np.pi, out)
    return np.asarray(np.where(out < -limit, out + 2 * np.pi, out))


def trace(model: RobotModel, flanges: Sequence[Array], start: Array) -> tuple[list[Array], str]:
    """Return joint angles along flange poses, on the branch of `start` (which reaches the first), and '' or the reason
    why the line ends early.
    """
    path = [start]
    for flange in flanges[1:]:
        options = [nearest_turn(model, q, path[-1]) for q in branches(model, flange)]
        if not options:
            return path, "the line leaves the arm's reach"
        q = min(options, key=lambda o: float(np.abs(o - path[-1]).max()))
        if float(np.abs(q - path[-1]).max()) > BRANCH_STEP_RAD:
            return path, "the line would need another arm configuration half way"
        if float(np.linalg.svd(model.jacobian(q), compute_uv=False)[-1]) < SINGULAR:
            return path, "the line passes a singularity of the arm"
        path.append(q)
    return path, ""
