"""Realisable shapes to start from: which joint gets which bump.

`fit` goes joint by joint, as in Eq. 18/19: the shallowest shape whose cone of generalized normals comes nearest to
the wrenches that kinematic design requires of the joint. `select` asks all joints at once: Eq. 8 over the union of
all shapes' normals, where force through a shape has a price; reweighting the prices leaves one shape per joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.geometry.cones import distance_to_cone, generalized_normals, largest_cone
from mocca_robot.statics.batch import BatchResult, solve_cases
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.tolerances import ROUNDING, TINY
from planners.cone_joints.energy import SMALL, each_case
from planners.cone_joints.kinematic import Requirement
from planners.cone_joints.rubbing import pushes
from planners.cone_joints.shapes import Shapes
from planners.cone_joints.unknowns import JointParameters, JointProblem

CURVED, USED = 1e-4, 1e-6
"""Slope that a joint has to have to curve, and share of use from which on a shape is chosen: less is rounding."""
SHALLOW_PRICE, STEEP_PRICE = 1e-3, 1e-4
"""What steepness costs where shapes fit alike: too little to choose a shape that holds less."""

FEW_JOINTS = 60
"""Joints up to which leaning shapes are in the catalogue from the start; descent leans those of larger ones."""
HEAVY_CASES = 6
"""Required wrenches that a joint is fitted to: its largest ones; the rest are smaller versions of them."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Entry:
    """One shape of the catalogue on every joint: its rays (E, R, d) and where it is allowed (E,)."""

    kind: Any
    row: Array
    lean: Array
    points: Array
    normals: Array
    allowed: BoolArray


def entries(problem: JointProblem, axis: Array, leans: Array | None = None) -> list[_Entry]:
    """Return the catalogue with each shape leaned by each of `leans` (m, L), and where its constraints hold."""
    shapes, options = problem.shapes, problem.shapes.options
    outer = other_normals(problem)
    found = []
    for tilt in np.zeros((1, shapes.n_lean)) if leans is None else leans:
        lean = np.tile(tilt, (len(shapes.pair_normal), 1))
        u = shapes.directions(lean)
        for kind, row in shapes.catalogue(options.kinds):
            family = shapes.with_kinds([kind] * len(problem.pairs))
            rows = np.tile(row, (len(problem.pairs), 1))
            surface = family.surface(rows, u)
            points, normals = family.rays(surface)
            steepest = np.einsum("erd,ed->er", normals, shapes.normals).min(axis=1)
            good = shapes.can_curve & (steepest >= np.cos(options.max_slope_rad))
            good &= (family.violations(surface, rows) <= 0.0).all(axis=1)
            heights = rows[:, list(shapes.heights)]
            low, top = (b[:, list(shapes.heights)] for b in family.bounds())
            good &= ((heights >= low) & (heights <= top)).all(axis=1)
            good &= assemblable(problem, axis, normals, outer)
            found.append(_Entry(kind=kind, row=row, lean=lean, points=points, normals=normals, allowed=good))
    return found


def other_normals(problem: JointProblem) -> list[Array]:
    """Return for each joint the planar normals (m, d) of its later part's other earlier contacts."""
    pairs, normals = problem.pairs, problem.shapes.normals
    later = pairs[:, 1]
    return [normals[(later == later[e]) & (np.arange(len(pairs)) != e)] for e in range(len(pairs))]


def assemblable(problem: JointProblem, axis: Array, normals: Array, outer: list[Array]) -> BoolArray:
    """Return (E,) whether each joint's normals (E, R, d), beside planar other joints, leave a cone of α.

    About the axis (N, d) given; for parts whose way out may turn, about the best one.
    """
    if problem.alpha_rad is None:
        return np.ones(len(normals), dtype=np.bool_)
    wanted = problem.alpha_rad + problem.shapes.options.alpha_margin_rad
    turning = problem.turning[problem.pairs[:, 1]]
    about = np.einsum("erd,ed->er", normals, axis[problem.pairs[:, 1]]).min(axis=1) >= np.sin(wanted)
    if not turning.any():
        return np.asarray(about)
    a = axis[problem.pairs[:, 1]]
    angle = _angle_about(normals, a[:, None])
    low, high = angle.min(axis=1), angle.max(axis=1)
    for e, others in enumerate(outer):
        if len(others):
            planar = _angle_about(others, a[e])
            low[e], high[e] = min(low[e], planar.min()), max(high[e], planar.max())
    return np.asarray(np.where(turning, high - low <= np.pi - 2.0 * wanted, about), dtype=np.bool_)


def _angle_about(vectors: Array, axis: Array) -> Array:
    cross = axis[..., 0] * vectors[..., 1] - axis[..., 1] * vectors[..., 0]
    return np.asarray(np.arctan2(cross, (vectors * axis).sum(axis=-1)))


def fit(problem: JointProblem, required: Requirement, start: JointParameters) -> tuple[Shapes, JointParameters]:
    """Return, joint by joint, the realisable shape nearest to the required wrenches, the shallowest among equals.

    Joints that need no slope stay planar, and so do those for which no shape is allowed.
    """
    shapes = problem.shapes
    catalogue = entries(problem, start.axis)
    curved = (required.slope > CURVED) & shapes.can_curve
    best = np.full(len(problem.pairs), np.inf)
    chosen = np.full(len(problem.pairs), -1)
    for index, entry in enumerate(catalogue):
        points, normals = pushes(shapes, entry.points, entry.normals)
        steepness = SHALLOW_PRICE * float((entry.row[list(shapes.heights)] ** 2).sum())
        for e in np.flatnonzero(curved & entry.allowed):
            rays = generalized_normals(points[e] - shapes.centres[e], normals[e], None, shapes.lengths[e])
            wanted = required.wrenches[:, e]
            size = np.linalg.norm(wanted, axis=1)
            heavy = np.argsort(-size)[:HEAVY_CASES]
            miss = sum(distance_to_cone(rays, wanted[k])[0] ** 2 for k in heavy if size[k] > ROUNDING)
            score = miss / max(float((size[heavy] ** 2).sum()), TINY) + steepness
            if score < best[e]:
                best[e], chosen[e] = score, index
    return _assembled(problem, start, catalogue, chosen, curved)


def select(
    problem: JointProblem, start: JointParameters, cases: IntArray, passes: int = 6, *, leaning: bool = True
) -> tuple[Shapes, JointParameters]:
    """Return one realisable shape per joint, chosen for all joints and the given load cases together.

    Each pass solves Eq. 8 with a price on force through each shape, then makes little-used shapes dearer. Of few joints
    the catalogue has every shape leaning to all sides, too, unless `leaning` is false.
    """
    shapes, pairs = problem.shapes, problem.pairs
    few = leaning and len(pairs) <= FEW_JOINTS
    leans = np.concatenate([np.zeros((1, shapes.n_lean)), *(s * 0.4 * np.eye(shapes.n_lean) for s in (1, -1) if few)])
    catalogue = entries(problem, start.axis, leans)
    rest = shapes.surface(np.tile(shapes.rest, (len(pairs), 1)), shapes.directions(start.lean))
    flat = pushes(shapes, *shapes.rays(rest))
    points, normals, owner, which = (
        [flat[0].reshape(-1, flat[0].shape[2])],
        [flat[1].reshape(-1, flat[1].shape[2])],
        [],
        [],
    )
    owner.append(np.repeat(np.arange(len(pairs)), flat[0].shape[1]))
    which.append(np.full(len(owner[0]), -1))
    for index, entry in enumerate(catalogue):
        use = np.flatnonzero(entry.allowed)
        kept = slice(None, None, 2)
        pushed = pushes(shapes, entry.points[:, kept], entry.normals[:, kept])
        points.append(pushed[0][use].reshape(-1, points[0].shape[1]))
        normals.append(pushed[1][use].reshape(-1, points[0].shape[1]))
        owner.append(np.repeat(use, pushed[0].shape[1]))
        which.append(np.full(len(owner[-1]), index))
    owners, shape_of = np.concatenate(owner), np.concatenate(which)
    loads = problem.loads.only(cases)
    free = np.asarray(loads.free.any(axis=0))
    system = ContactSystem.build(
        pairs[owners], np.concatenate(points), np.concatenate(normals), free, loads.about, loads.length
    )
    scale = np.linalg.norm(loads.wrenches.reshape(len(cases), -1), axis=1)
    wrenches = loads.wrenches[:, free].reshape(len(cases), -1) / scale[:, None]
    steep = np.array([np.abs(e.row[list(shapes.heights)]).sum() for e in catalogue])
    price = np.where(shape_of < 0, 0.0, STEEP_PRICE * (0.3 + steep[shape_of]))
    slot = owners * len(catalogue) + np.maximum(shape_of, 0)
    weight = np.ones(len(pairs) * len(catalogue))
    warm: BatchResult | None = None
    use_of: Array = np.zeros((len(pairs), len(catalogue)))
    active = loads.active[:, owners]
    for _ in range(passes):
        if wrenches.shape[1] <= SMALL:
            warm = solve_cases(system, wrenches, active=active, free=loads.free, cost=price * weight[slot], warm=warm)
            forces = warm.forces
        else:
            forces = each_case(system, wrenches, active, loads.free, price * weight[slot])[1]
        strongest = forces.max(axis=0) * (shape_of >= 0)
        use_of = np.asarray(np.bincount(slot, strongest, len(weight)).reshape(len(pairs), -1), dtype=np.float64)
        most = np.maximum(use_of.max(axis=1, keepdims=True), ROUNDING)
        weight = (1.0 / (use_of / most + 0.03)).ravel()
    curved = (use_of.max(axis=1) > USED) & shapes.can_curve
    return _assembled(problem, start, catalogue, np.where(curved, use_of.argmax(axis=1), -1), curved)


def _assembled(
    problem: JointProblem, start: JointParameters, catalogue: list[_Entry], chosen: IntArray, curved: BoolArray
) -> tuple[Shapes, JointParameters]:
    """Return the families and parameters of the chosen entries (−1 = planar), part axes centred among them."""
    shapes, pairs = problem.shapes, problem.pairs
    kinds = [catalogue[c].kind if c >= 0 else shapes.rest_kind for c in chosen]
    shape = np.array([catalogue[c].row if c >= 0 else shapes.rest for c in chosen])
    lean, axis = start.lean.copy(), start.axis.copy()
    for e in np.flatnonzero(chosen >= 0):
        lean[shapes.pair[e]] = catalogue[chosen[e]].lean[shapes.pair[e]]
    if problem.alpha_rad is not None:
        for part in np.unique(pairs[problem.turning[pairs[:, 1]], 1]):
            mine = np.flatnonzero(pairs[:, 1] == part)
            rows = [catalogue[chosen[e]].normals[e] if chosen[e] >= 0 else shapes.normals[e][None] for e in mine]
            axis[part] = largest_cone(np.concatenate(rows))[1]
    return shapes.with_kinds(kinds), JointParameters(shape, lean, axis, curved)
