"""The paper's kinematic design for flat assemblies (§6.2): motion cones with a rectangular conic section.

In a joint's own frame such a cone has four face normals: two forces through the middle of the contact that lean by
slopes s₁ and s₂, and two upright ones at r₁ and r₂ half-lengths from it. s = 0, r = 1 is the planar contact. Eq. 13
minimises E over (s, r) within bounds, and over the ways out a_j, subject to Eq. 12, for fixed centroids.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.geometry.frames import tangents
from mocca_robot.tolerances import EXACT, ROUNDING
from planners.cone_joints.energy import energy, joint_wrenches
from planners.cone_joints.shapes2d import Shapes2D
from planners.cone_joints.unknowns import JointProblem

CURVED = 1e-4
"""Slope, or lever beyond 1, of a joint that is more than a plane: smaller ones come from the solver's rounding."""
STEP = 1e-6
"""Of forward differences: half of the digits for the step, half for the difference."""
LEAST_GAIN = 1e-13
"""Of a step of the solver, relative: it ends where nothing is left to gain."""


@dataclass(frozen=True, eq=False)
class RequiredCones:
    """V̄ of E joints.

    Attributes:
        slopes: (E, 2) s₁, s₂ ≥ 0: shear that can be transmitted per unit of pressure, to either side.
        levers: (E, 2) r₁, r₂ ≥ 1: where pressure can act, in half-lengths from the middle.
        axis: (N, 2) way out a_j of every part.
        infeasibility: (K,) E/|w|² with these cones.
    """

    slopes: Array
    levers: Array
    axis: Array
    infeasibility: Array

    @property
    def asked(self) -> BoolArray:
        """Return (E,) joints of which more is required than the planar contact gives."""
        return np.asarray((self.slopes > CURVED).any(axis=1) | (self.levers > 1.0 + CURVED).any(axis=1))


def faces(shapes: Shapes2D, slopes: Array, levers: Array) -> tuple[Array, Array]:
    """Return points and unit normals (E, 4, 2) of the forces that are dual to the required cones (Eq. 16)."""
    n = shapes.normals
    t = (shapes.segments[:, 1] - shapes.segments[:, 0]) / shapes.lengths[:, None]
    lean = np.stack([slopes[:, 0], -slopes[:, 1]], axis=1)[..., None] * t[:, None] + n[:, None]
    lean /= np.linalg.norm(lean, axis=2)[..., None]
    arm = 0.5 * shapes.lengths[:, None, None] * np.stack([levers[:, 0], -levers[:, 1]], axis=1)[..., None]
    middle = np.repeat(shapes.centres[:, None], 2, axis=1)
    points = np.concatenate([middle, shapes.centres[:, None] + arm * t[:, None]], axis=1)
    return points, np.concatenate([lean, np.repeat(n[:, None], 2, axis=1)], axis=1)


def kinematic_design(
    problem: JointProblem, start: RequiredCones, bounds: Array, wrenches: Array
) -> tuple[RequiredCones, int]:
    """Return the cones that minimise E under Eq. 12 and `bounds` (E, 4), and how often E was evaluated (Eq. 13).

    Off-the-shelf: SLSQP with assemblability as constraints, L-BFGS-B when it is not asked for; envelope gradient.
    """
    from scipy.optimize import minimize

    shapes, loads, pairs = problem.shapes, problem.loads, problem.pairs
    assert isinstance(shapes, Shapes2D)
    count, parts = len(pairs), len(start.axis)
    across = tangents(start.axis)[:, 0]
    evaluations = 0

    def cones(x: Array) -> tuple[Array, Array]:
        rows = x[: 4 * count].reshape(count, 4)
        return rows[:, :2], rows[:, 2:]

    def value(x: Array) -> tuple[float, Array]:
        nonlocal evaluations
        evaluations += 1
        points, normals = faces(shapes, *cones(x))
        result = energy(loads, pairs, points, normals, wrenches)
        pull = np.stack([result.motions[:, pairs[:, side]] for side in (0, 1)], axis=2)
        none, rest = np.zeros(count), np.zeros((count, 2))
        base = joint_wrenches(loads, pairs, points, normals, result.forces, none, rest)
        slope = np.zeros_like(x)
        for p in range(4):
            ahead = x.copy()
            ahead[p : 4 * count : 4] += STEP
            changed = joint_wrenches(loads, pairs, *faces(shapes, *cones(ahead)), result.forces, none, rest)
            slope[p : 4 * count : 4] = np.einsum("kesd,kesd->e", pull, changed - base) / STEP
        return unit * result.total, unit * slope

    def room(x: Array) -> Array:
        """Return n̂·a_j − sin α of the leaning faces and the planar normal (Eq. 12)."""
        axis = start.axis + x[4 * count :, None] * across
        axis /= np.linalg.norm(axis, axis=1)[:, None]
        _, normals = faces(shapes, *cones(x))
        slack = np.einsum("efd,ed->ef", normals[:, :3], axis[pairs[:, 1]]) - np.sin(problem.alpha_rad or 0.0)
        return np.asarray(slack.ravel())

    def room_slope(x: Array) -> Array:
        rows = np.zeros((count, 3, len(x)))
        base, joint = room(x).reshape(count, 3), np.arange(count)
        for p in range(4):
            ahead = x.copy()
            ahead[p : 4 * count : 4] += STEP
            rows[joint, :, 4 * joint + p] = (room(ahead).reshape(count, 3) - base) / STEP
        ahead = x.copy()
        ahead[4 * count :] += STEP
        rows[joint, :, 4 * count + pairs[:, 1]] = (room(ahead).reshape(count, 3) - base) / STEP
        return rows.reshape(-1, len(x))

    free = problem.alpha_rad is not None
    low = np.tile([0.0, 0.0, 1.0, 1.0], count)
    limits = [*zip(low, np.maximum(bounds.ravel(), low)), *([(-0.5, 0.5) if free else (0.0, 0.0)] * parts)]
    x0 = np.concatenate([np.concatenate([start.slopes, start.levers], axis=1).ravel(), np.zeros(parts)])
    x0 = np.clip(x0, *np.array(limits).T)
    unit = 1.0
    unit = 1.0 / max(value(x0)[0], EXACT)
    keep = [{"type": "ineq", "fun": room, "jac": room_slope}] if free else []
    settings: dict[str, float] = {"maxiter": 150, "ftol": LEAST_GAIN}
    method = "SLSQP" if free else "L-BFGS-B"
    found: Any = minimize(  # type: ignore[call-overload]
        value, x0, jac=True, method=method, bounds=limits, constraints=keep, options=settings
    )
    best = np.array(found.x)
    left = energy(loads, pairs, *faces(shapes, *cones(best)), wrenches)
    # Faces that carry nothing in any case are not required: the planar contact's will do there.
    idle = (left.forces.max(axis=0) <= ROUNDING).ravel()
    best[: 4 * count] = np.where(idle, low, best[: 4 * count])
    axis = start.axis + best[4 * count :, None] * across
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    return RequiredCones(*cones(best), axis, left.infeasibility), evaluations
