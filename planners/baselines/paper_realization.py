"""The paper's geometric realization of flat joints (§6.3): each joint for itself, towards its required cone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.geometry.cones import distance_to_cone, generalized_normals
from mocca_robot.joints.spline import SplineKind
from planners.baselines.paper_kinematics import RequiredCones, faces
from planners.cone_joints.descent import PENALTY_WEIGHT, hinge_values, surface_of
from planners.cone_joints.shapes2d import Shapes2D
from planners.cone_joints.unknowns import JointParameters, JointProblem

LEAST_GAIN = 1e-14
"""Of a step of the solver, relative: it ends where nothing is left to gain."""

REACHED = 1e-8
"""Squared distance of a unit face normal to cone(N) that counts as inside (Eq. 19)."""
SPLINES: tuple[SplineKind, ...] = ("n", "z")
STARTS: tuple[tuple[SplineKind, float], ...] = tuple(
    (kind, sign * h) for h in (0.1, 0.22, 0.35) for kind in SPLINES for sign in (1.0, -1.0)
)
"""Families and heights that the realization of every joint starts from; the best three are refined."""


def realize(problem: JointProblem, cones: RequiredCones) -> tuple[Shapes2D, JointParameters, Array]:
    """Return joint shapes that come nearest to `cones`, each for itself (Eq. 18), and what they miss (E,)."""
    shapes = problem.shapes
    assert isinstance(shapes, Shapes2D)
    points, normals = faces(shapes, cones.slopes, cones.levers)
    rows, missed = np.tile(shapes.rest, (len(shapes.contacts), 1)), np.zeros(len(shapes.contacts))
    kinds = list(shapes.kinds)
    wanted = cones.asked & shapes.can_curve
    for e in np.flatnonzero(wanted):
        alone = _alone(problem, shapes, int(e), cones.axis)
        targets = generalized_normals(points[e], normals[e], shapes.centres[e], 0.5 * float(shapes.lengths[e]))
        targets = targets / np.linalg.norm(targets, axis=1)[:, None]
        kinds[e], rows[e], missed[e] = _nearest_shape(alone, targets)
    lean = np.zeros((len(shapes.pair_normal), 1))
    return shapes.with_kinds(kinds), JointParameters(rows, lean, cones.axis, np.asarray(wanted)), missed


def _alone(problem: JointProblem, shapes: Shapes2D, e: int, axis: Array) -> tuple[JointProblem, JointParameters]:
    """Return the problem of joint `e` by itself."""
    room = shapes.clearance
    clearance = replace(
        room,
        start=room.start[e : e + 1],
        end=room.end[e : e + 1],
        is_contact=room.is_contact[e : e + 1],
        margin=room.margin[e : e + 1],
        origin=room.origin[e : e + 1],
        normal=room.normal[e : e + 1],
        length=room.length[e : e + 1],
    )
    one = replace(
        shapes,
        contacts=(shapes.contacts[e],),
        kinds=(shapes.kinds[e],),
        pair=np.zeros(1, dtype=np.int64),
        pair_normal=shapes.pair_normal[shapes.pair[e]][None],
        limits=shapes.limits[e : e + 1],
        clearance=clearance,
    )
    part = replace(problem, shapes=one, pairs=np.array([[0, 1]]))
    later = axis[problem.pairs[e, 1]]
    rest = JointParameters(one.rest[None], np.zeros((1, 1)), np.stack([later, later]), np.ones(1, dtype=np.bool_))
    return part, rest


def _nearest_shape(alone: tuple[JointProblem, JointParameters], targets: Array) -> tuple[SplineKind, Array, float]:
    """Return family, shape row (4,) and worst squared distance to `targets` (4, 3) that the best start leads to."""
    from scipy.optimize import minimize

    problem, rest = alone
    low, high = (b[0] for b in problem.shapes.bounds())

    def missing(family: JointProblem, row: Array) -> tuple[float, float]:
        """Return Σ dist² plus penalties, and the worst dist²."""
        parameters = replace(rest, shape=np.clip(row, low, high)[None])
        surface = surface_of(family, parameters)
        points, normals = family.shapes.rays(surface)
        shapes = family.shapes
        rays = generalized_normals(points[0], normals[0], shapes.centres[0], 0.5 * float(shapes.lengths[0]))
        distances = [distance_to_cone(rays, f)[0] ** 2 for f in targets]
        hinges = hinge_values(family, parameters, surface, 0.0)
        return sum(distances) + PENALTY_WEIGHT * float((np.maximum(hinges, 0.0) ** 2).sum()), max(distances)

    best: tuple[float, SplineKind, Array, float] | None = None
    tried: list[tuple[float, int, SplineKind, JointProblem, Array]] = []
    for kind, height in STARTS:
        if kind in problem.shapes.options.kinds:
            family = replace(problem, shapes=problem.shapes.with_kinds([kind]))
            row = np.clip([*problem.shapes.rest[:2], height, -height if kind == "z" else 0.0], low, high)
            tried.append((missing(family, row)[0], len(tried), kind, family, row))
    for _, _, kind, family, row in sorted(tried, key=lambda t: t[:2])[:3]:

        def objective(x: Array, family: JointProblem = family) -> float:
            return missing(family, x)[0]

        bounds = [(float(a), float(b)) for a, b in zip(low, high)]
        settings: dict[str, float] = {"maxiter": 25, "ftol": LEAST_GAIN}
        found = np.asarray(minimize(objective, row, method="L-BFGS-B", bounds=bounds, options=settings).x)  # type: ignore[call-overload]
        total, worst = missing(family, found)
        if best is None or total < best[0]:
            best = (total, kind, found, worst)
        if total <= REACHED:
            break
    assert best is not None
    return best[1], best[2], best[3]


def reached(problem: JointProblem, parameters: JointParameters, cones: RequiredCones) -> Array:
    """Return (E, 4) the largest share of each required face that cone(N) of the built joint contains, as bounds."""
    shapes = problem.shapes
    assert isinstance(shapes, Shapes2D)
    points, normals = shapes.rays(surface_of(problem, parameters))
    planar = np.array([0.0, 0.0, 1.0, 1.0])
    asked = np.concatenate([cones.slopes, cones.levers], axis=1)
    result = asked.copy()
    for e in np.flatnonzero(parameters.curved):
        half = 0.5 * float(shapes.lengths[e])
        rays = generalized_normals(points[e], normals[e], shapes.centres[e], half)
        for face in range(4):
            for share in np.linspace(1.0, 0.0, 11):
                row = planar + share * (asked[e] - planar)
                p, n = faces(_only(shapes, int(e)), row[None, :2], row[None, 2:])
                target = generalized_normals(p[0, face], n[0, face], shapes.centres[e], half)
                if share == 0.0 or distance_to_cone(rays, target)[0] ** 2 <= REACHED:
                    result[e, face] = row[face]
                    break
    return result


def _only(shapes: Shapes2D, e: int) -> Shapes2D:
    return replace(shapes, contacts=(shapes.contacts[e],))
