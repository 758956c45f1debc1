"""Geometric realization of all joints together, from a start that `planners.catalogue` chose (Eq. 15, 18).

`polish` follows the envelope gradient of E on the true geometry, with moving centroids, until every case holds,
while the assemblability cone, slopes and clearances are kept as constraints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from mocca_robot.assembly import Array, BoolArray, IntArray
from planners.energy import EnergyResult, Loads, energy, local_power
from planners.shapes import Shapes


@dataclass(frozen=True, eq=False)
class Parameters:
    """All unknowns of a design.

    Attributes:
        shape: (E, S) parameters of each joint.
        lean: (Q, L) lean of each pair's principal direction, radians.
        axis: (N, d) unit direction a_j = −d_j in which each part leaves.
        curved: (E,) joints that may change; the others stay planar.
    """

    shape: Array
    lean: Array
    axis: Array
    curved: BoolArray


@dataclass(frozen=True, eq=False)
class Problem:
    """What polishing needs to know besides the parameters.

    Attributes:
        shapes: the parametrised joints.
        loads: required cases first, then margin cases.
        required: number of required cases.
        pairs: (E, 2) parts of each joint.
        alpha_rad: assemblability, None when not asked for.
    """

    shapes: Shapes
    loads: Loads
    required: int
    pairs: IntArray
    alpha_rad: float | None


@dataclass(frozen=True, eq=False)
class Polished:
    """Where polishing ended: parameters, E per case on the true geometry, largest constraint violation."""

    parameters: Parameters
    infeasibility: Array
    violation: float
    evaluations: int


ENERGY_WEIGHT = 10.0
PENALTY_WEIGHT = 30.0
SHALLOW_WEIGHT = 1e-6
SOLVED = 1e-13
"""E/|w|² of a required case that counts as zero: |s|/|w| below half of the verdict's tolerance."""
MARGIN_SOLVED = 1e-9
VIOLATED = 1e-6
PATIENCE = 10
"""Evaluations in which the objective has to fall by three tenths; slower than that it is on its way to a local rest."""


def evaluate(
    problem: Problem, parameters: Parameters, inset: float = 0.0, warm: EnergyResult | None = None
) -> EnergyResult:
    """Return E of every case on the geometry of `parameters`, masses and centroids included.

    `inset` narrows each joint about its middle and lowers its bump by that share, for designing with a reserve.
    """
    shapes = problem.shapes
    surface = shapes.surface(_drawn(parameters), shapes.directions(parameters.lean))
    wrenches = moved_wrenches(problem, surface)
    points, normals = shapes.rays(_inset(shapes, surface, inset))
    return energy(problem.loads, problem.pairs, points, normals, wrenches, warm)


def moved_wrenches(problem: Problem, surface: Array) -> Array:
    """Return the wrenches (K, N, dof) of every case after the surfaces have moved mass between parts."""
    return problem.loads.wrenches + problem.loads.moved(problem.pairs, *problem.shapes.transferred(surface))


def _drawn(parameters: Parameters) -> Array:
    """Return shapes (E, S) with the joints that may not curve laid flat."""
    flat = parameters.shape.copy()
    flat[:, 2:] = 0.0
    return np.where(parameters.curved[:, None], parameters.shape, flat)


def _inset(shapes: Shapes, surface: Array, inset: float) -> Array:
    """Return surfaces (E, V, d) narrowed about their contact's centre and flattened towards its plane."""
    if inset == 0.0:
        return surface
    offset = surface - shapes.centres[:, None]
    height = np.einsum("evd,ed->ev", offset, shapes.normals)
    lowered = offset * (1.0 - inset) - 2.0 * inset * height[..., None] * shapes.normals[:, None]
    return np.asarray(shapes.centres[:, None] + lowered)


def polish(
    problem: Problem,
    start: Parameters,
    *,
    evaluations: int = 60,
    progress: Callable[[int, float], None] | None = None,
) -> Polished:
    """Return parameters near `start` for which every case holds and every constraint is kept, if found.

    Works on the cases that fail only, and takes in others as they begin to. Stops as soon as the true geometry
    satisfies all required cases and, to `MARGIN_SOLVED`, the margin cases.
    """
    count, parameters = 0, start
    working = np.zeros(len(problem.loads.gravity), dtype=np.bool_)
    while True:
        with_reserve = evaluate(problem, parameters, problem.shapes.options.inset)
        failing = with_reserve.infeasibility > MARGIN_SOLVED
        violation = violation_of(problem, parameters)
        true = evaluate(problem, parameters)
        solved = not failing.any() and true.infeasibility[: problem.required].max(initial=0.0) <= SOLVED
        if (solved and violation <= VIOLATED) or count >= evaluations or (count and not (failing & ~working).any()):
            return Polished(parameters, true.infeasibility, violation, count)
        # A few of the worst newcomers at a time: neighbouring states fail for the same reason.
        newcomers = np.argsort(-np.where(working, -1.0, with_reserve.infeasibility))[:4]
        working[newcomers[failing[newcomers]]] = True
        if not working.any():
            working[0] = True
        part = replace(problem, loads=problem.loads.only(np.flatnonzero(working)))
        parameters, used = _descend(part, parameters, evaluations - count, progress)
        count += used


def _descend(
    problem: Problem, start: Parameters, evaluations: int, progress: Callable[[int, float], None] | None
) -> tuple[Parameters, int]:
    """Return where L-BFGS on energy and penalties ends, or stops because both are gone, and evaluations used."""
    layout = _Layout.of(problem, start)
    lower, upper = layout.bounds()
    count = 0
    last: EnergyResult | None = None

    values: list[float] = []

    class Ended(Exception):
        """Everything holds, or nothing moves any more; `args[0]` is the optimiser's vector."""

    def objective(x: Array) -> tuple[float, Array]:
        nonlocal count, last
        count += 1
        value, gradient, last, violation = _objective(problem, layout, layout.parameters(x), last)
        worst = float(last.infeasibility.max())
        if progress is not None:
            progress(count, worst)
        values.append(value)
        if violation <= VIOLATED and worst <= 0.1 * MARGIN_SOLVED:
            raise Ended(x.copy())
        if len(values) > 2 * PATIENCE and min(values[-PATIENCE:]) > 0.7 * min(values[:-PATIENCE]):
            raise Ended(x.copy())
        return value, gradient

    try:
        answer = minimize(
            objective,
            np.clip(layout.vector(start), lower, upper),
            jac=True,
            method="L-BFGS-B",
            bounds=list(zip(lower, upper)),
            options={"maxfun": evaluations, "maxiter": evaluations, "ftol": 0.0, "gtol": 1e-12, "maxcor": 20},
        )
        return layout.parameters(answer.x), count
    except Ended as ended:
        return layout.parameters(ended.args[0]), count


@dataclass(frozen=True, eq=False)
class _Layout:
    """The optimiser's vector: shapes of curved joints, leans of their pairs, tangential moves of part axes."""

    joints: IntArray
    pairs: IntArray
    parts: IntArray
    tangents: Array
    start: Parameters
    shape_bounds: tuple[Array, Array]

    @classmethod
    def of(cls, problem: Problem, start: Parameters) -> _Layout:
        joints = np.flatnonzero(start.curved)
        pairs = np.unique(problem.shapes.pair[joints])
        parts = np.unique(problem.pairs[:, 1]) if problem.alpha_rad is not None else np.zeros(0, dtype=np.int64)
        d = start.axis.shape[1]
        if d == 2:
            tangents = np.stack([-start.axis[:, 1], start.axis[:, 0]], axis=1)[:, None]
        else:
            seed = np.eye(3)[np.abs(start.axis).argmin(axis=1)]
            first = np.cross(start.axis, seed)
            first /= np.linalg.norm(first, axis=1)[:, None]
            tangents = np.stack([first, np.cross(start.axis, first)], axis=1)
        return cls(joints, pairs, parts, tangents, start, problem.shapes.bounds())

    @property
    def sizes(self) -> tuple[int, int, int]:
        s, lean = self.start.shape.shape[1], self.start.lean.shape[1]
        return len(self.joints) * s, len(self.pairs) * lean, len(self.parts) * self.tangents.shape[1]

    def vector(self, parameters: Parameters) -> Array:
        moves = np.zeros(self.sizes[2])
        return np.concatenate([parameters.shape[self.joints].ravel(), parameters.lean[self.pairs].ravel(), moves])

    def parameters(self, x: Array) -> Parameters:
        n_shape, n_lean, _ = self.sizes
        shape, lean, axis = self.start.shape.copy(), self.start.lean.copy(), self.start.axis.copy()
        shape[self.joints] = x[:n_shape].reshape(len(self.joints), shape.shape[1])
        lean[self.pairs] = x[n_shape : n_shape + n_lean].reshape(len(self.pairs), lean.shape[1])
        moves = x[n_shape + n_lean :].reshape(len(self.parts), self.tangents.shape[1])
        axis[self.parts] += np.einsum("pt,ptd->pd", moves, self.tangents[self.parts])
        axis /= np.linalg.norm(axis, axis=1)[:, None]
        return Parameters(shape, lean, axis, self.start.curved)

    def bounds(self) -> tuple[Array, Array]:
        low, high = self.shape_bounds
        lean = np.full(self.sizes[1], np.deg2rad(50.0))
        move = np.full(self.sizes[2], 1.5)
        return (
            np.concatenate([np.tile(low, len(self.joints)), -lean, -move]),
            np.concatenate([np.tile(high, len(self.joints)), lean, move]),
        )


def _objective(
    problem: Problem, layout: _Layout, parameters: Parameters, warm: EnergyResult | None
) -> tuple[float, Array, EnergyResult, float]:
    """Return value and gradient of energy + penalties, the energy itself (with inset), the worst violation."""
    shapes, options = problem.shapes, problem.shapes.options
    result = evaluate(problem, parameters, options.inset, warm)
    surface = shapes.surface(_drawn(parameters), shapes.directions(parameters.lean))
    penalty, axis_gradient, violation = _constraints(problem, parameters, surface)
    curved = parameters.curved
    heights = parameters.shape[:, list(shapes.heights)] * curved[:, None]
    value = (
        ENERGY_WEIGHT * result.total
        + PENALTY_WEIGHT * float(penalty.sum())
        + SHALLOW_WEIGHT * float((heights**2).sum())
    )

    def local(shape: Array, lean: Array) -> Array:
        """Everything that depends on one joint only, (E,), as a function of all joints' parameters."""
        moved = Parameters(shape, lean, parameters.axis, curved)
        surface = shapes.surface(_drawn(moved), shapes.directions(lean))
        points, normals = shapes.rays(_inset(shapes, surface, options.inset))
        power = local_power(result, problem.loads, problem.pairs, points, normals)
        power += _load_power_per_joint(problem, result, *shapes.transferred(surface))
        h = shape[:, list(shapes.heights)] * curved[:, None]
        own = _constraints(problem, moved, surface)[0]
        return np.asarray(ENERGY_WEIGHT * power + PENALTY_WEIGHT * own + SHALLOW_WEIGHT * (h**2).sum(axis=1))

    step = 1e-6
    base = local(parameters.shape, parameters.lean)
    shape_gradient = np.zeros_like(parameters.shape)
    for s in range(shape_gradient.shape[1]):
        moved = parameters.shape.copy()
        moved[:, s] += step
        shape_gradient[:, s] = (local(moved, parameters.lean) - base) / step
    lean_gradient = np.zeros_like(parameters.lean)
    for k in range(lean_gradient.shape[1]):
        leaned = parameters.lean.copy()
        leaned[:, k] += step
        change = (local(parameters.shape, leaned) - base) / step
        np.add.at(lean_gradient[:, k], shapes.pair[curved], change[curved])
    tangential = PENALTY_WEIGHT * np.einsum("pd,ptd->pt", axis_gradient[layout.parts], layout.tangents[layout.parts])
    gradient = np.concatenate(
        [shape_gradient[layout.joints].ravel(), lean_gradient[layout.pairs].ravel(), tangential.ravel()]
    )
    return value, gradient, result, violation


def _load_power_per_joint(problem: Problem, result: EnergyResult, volume: Array, moment: Array) -> Array:
    """Return (E,) rᵀ dw of the mass each joint moves: linear in volume and moment, so evaluated per joint."""
    loads, pairs = problem.loads, problem.pairs
    d = loads.about.shape[1]
    power = np.zeros(len(pairs))
    for gravity, motion, unit in zip(loads.gravity, result.motions, loads.scale):
        for side, sign in ((0, 1.0), (1, -1.0)):
            part = pairs[:, side]
            density = sign * loads.weight_per_volume[part] / unit
            linear = motion[part, :d]
            arm = moment - volume[:, None] * loads.about[part]
            if d == 2:
                lever = arm[:, 0] * gravity[1] - arm[:, 1] * gravity[0]
                turning = motion[part, 2] * lever / loads.length
            else:
                turning = np.einsum("ed,ed->e", motion[part, 3:], np.cross(arm, gravity)) / loads.length
            power += density * (volume * (linear @ gravity) + turning)
    return power


def violation_of(problem: Problem, parameters: Parameters) -> float:
    """Return the worst violation of assemblability, slope, room and radius; ≤ 1e-6 counts as none."""
    shapes = problem.shapes
    surface = shapes.surface(_drawn(parameters), shapes.directions(parameters.lean))
    return _constraints(problem, parameters, surface)[2]


def _constraints(problem: Problem, parameters: Parameters, surface: Array) -> tuple[Array, Array, float]:
    """Return squared hinge penalties per joint (E,), their gradient by part axis (N, d), the worst violation.

    Assemblability n̂·a_j ≥ sin α, slope n̂·n_contact ≥ cos(max slope), room and radius.
    """
    shapes, options = problem.shapes, problem.shapes.options
    _, normals = shapes.rays(surface)
    slope = np.maximum(0.0, np.cos(options.max_slope_rad) - np.einsum("erd,ed->er", normals, shapes.normals))
    room = np.maximum(0.0, shapes.violations(surface, _drawn(parameters)))
    penalty = (slope**2).sum(axis=1) + (room**2).sum(axis=1)
    worst = max(float(slope.max(initial=0.0)), float(room.max(initial=0.0)))
    axis_gradient = np.zeros_like(parameters.axis)
    if problem.alpha_rad is not None:
        later = problem.pairs[:, 1]
        a = parameters.axis[later]
        wanted = np.sin(min(problem.alpha_rad + options.alpha_margin_rad, np.pi / 2))
        short = np.maximum(0.0, wanted - np.einsum("erd,ed->er", normals, a))
        penalty = penalty + (short**2).sum(axis=1)
        np.add.at(axis_gradient, later, -2.0 * np.einsum("er,erd->ed", short, normals))
        strict = np.sin(problem.alpha_rad) - np.einsum("erd,ed->er", normals, a)
        worst = max(worst, float(strict.max(initial=0.0)))
    return penalty, axis_gradient, worst
