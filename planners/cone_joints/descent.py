"""Descent of E on true joint geometry: Gauss–Newton steps with the envelope theorem's exact gradient.

With E = ½ Σ_c |r_c|², r_c = G f_c + w the residual at the optimal forces, a parameter φ moves the wrench balance by
b = dG/dφ f + dw/dφ. The gradient is Σ rᵀb, exactly. Forces that are active answer to a change of geometry and take
up all of it that they can; what is left of b is M⁻¹b with M = I + Bᵀ(F/σ)B stiff along the active rays, so
Σ bᵀM⁻¹b is the Gauss–Newton matrix. Constraints enter as squared hinges and are linearised alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.tolerances import EXACT, MARGIN_SOLVED, VIOLATED
from planners.cone_joints.curvature import LARGE, Answer, Curvature, Products, Written, answered, unanswered
from planners.cone_joints.energy import EnergyResult, energy, joint_wrenches
from planners.cone_joints.rubbing import pushes
from planners.cone_joints.shapes import Shapes
from planners.cone_joints.unknowns import JointParameters, JointProblem, UnknownsLayout

STEP = 1e-6
"""Of forward differences: half of the digits for the step, half for the difference."""
LEAST_GAIN = 1e-6
"""Relative gain of a step that is worth taking."""
LEAST_DAMPING, RENEWED_DAMPING = 1e-9, 1e-6
"""Of Levenberg–Marquardt steps: how far success lowers it, and from where failure raises it again."""

ENERGY_WEIGHT = 10.0
PENALTY_WEIGHT = 30.0
SHALLOW_WEIGHT = 1e-6
ROOM_RESERVE = 1e-3
"""Distance, in contact sizes, that descent keeps from the limits of a joint's room."""
PATIENCE = 6
"""Steps in which the objective has to fall by three tenths; slower than that it is on its way to a local rest."""
LONGEST_STEP = 0.2
"""Of any unknown in one step: contact sizes, radians."""


def evaluate(
    problem: JointProblem, parameters: JointParameters, inset: float = 0.0, warm: EnergyResult | None = None
) -> EnergyResult:
    """Return E of every case on the geometry of `parameters`, masses and centroids included.

    `inset` narrows each joint about its middle and lowers its bump by that share, for designing with a reserve.
    """
    surface = surface_of(problem, parameters)
    rays = problem.shapes.rays(narrowed(problem.shapes, surface, inset))
    points, normals = pushes(problem.shapes, *rays)
    return energy(problem.loads, problem.pairs, points, normals, moved_wrenches(problem, surface), warm)


def evaluate_built(problem: JointProblem, parameters: JointParameters) -> EnergyResult:
    """Return E of every case with every facet that will be built, not only those that designing looks at."""
    surface = surface_of(problem, parameters)
    points, normals = pushes(problem.shapes, *problem.shapes.all_rays(surface))
    return energy(problem.loads, problem.pairs, points, normals, moved_wrenches(problem, surface))


def surface_of(problem: JointProblem, parameters: JointParameters) -> Array:
    """Return the joints' surfaces (E, V, d), flat where a joint may not curve."""
    return problem.shapes.surface(_drawn(problem.shapes, parameters), problem.shapes.directions(parameters.lean))


def moved_wrenches(problem: JointProblem, surface: Array) -> Array:
    """Return the wrenches (K, N, dof) of every case after the surfaces have moved mass between parts."""
    return problem.loads.wrenches + problem.loads.moved(problem.pairs, *problem.shapes.transferred(surface))


def _drawn(shapes: Shapes, parameters: JointParameters) -> Array:
    flat = parameters.shape.copy()
    flat[:, list(shapes.heights)] = 0.0
    return np.where(parameters.curved[:, None], parameters.shape, flat)


def narrowed(shapes: Shapes, surface: Array, inset: float) -> Array:
    """Return surfaces (E, V, d) narrowed about their contact's centre and flattened towards its plane."""
    if inset == 0.0:
        return surface
    offset = surface - shapes.centres[:, None]
    height = np.einsum("evd,ed->ev", offset, shapes.normals)
    lowered = offset * (1.0 - inset) - 2.0 * inset * height[..., None] * shapes.normals[:, None]
    return np.asarray(shapes.centres[:, None] + lowered)


def violation_of(problem: JointProblem, parameters: JointParameters) -> float:
    """Return the worst violation of assemblability, slope, room and radius; ≤ `VIOLATED` counts as none."""
    surface = surface_of(problem, parameters)
    hinges = hinge_values(problem, parameters, surface, 0.0, problem.shapes.all_rays(surface)[1])
    return float(hinges.max(initial=0.0))


def hinge_values(
    problem: JointProblem, parameters: JointParameters, surface: Array, margin_rad: float, normals: Array | None = None
) -> Array:
    """Return constraint values (E, H), violated where positive: slope, room and radius, then assemblability.

    n̂·n_contact ≥ cos(max slope − margin); n̂·a_j ≥ sin(α + margin), in the last columns, one per ray. With a margin
    some room is kept, too: squared hinges end a little beyond the limits they are given. `normals` (E, R, d) are
    those of `shapes.rays` unless given.
    """
    shapes = problem.shapes
    normals = shapes.rays(surface)[1] if normals is None else normals
    steepest = np.cos(shapes.options.max_slope_rad - margin_rad)
    slope = steepest - np.einsum("erd,ed->er", normals, shapes.normals)
    room = shapes.violations(surface, _drawn(shapes, parameters)) + (ROOM_RESERVE if margin_rad > 0.0 else 0.0)
    if problem.alpha_rad is None:
        return np.concatenate([slope, room], axis=1)
    wanted = np.sin(min(problem.alpha_rad + margin_rad, np.pi / 2))
    short = wanted - np.einsum("erd,ed->er", normals, parameters.axis[problem.pairs[:, 1]])
    return np.concatenate([slope, room, short], axis=1)


@dataclass(frozen=True, eq=False)
class Linear:
    """The objective about one point: value, gradient (n,), Gauss–Newton matrix (n × n), E, worst violation."""

    value: float
    gradient: Array
    curvature: Curvature
    result: EnergyResult
    violation: float


def value_of(
    problem: JointProblem, parameters: JointParameters, warm: EnergyResult | None
) -> tuple[float, EnergyResult, Array]:
    """Return energy plus penalties, E of every case (with the designer's inset) and the hinges (E, H)."""
    options = problem.shapes.options
    result = evaluate(problem, parameters, options.inset, warm)
    surface = surface_of(problem, parameters)
    hinges = hinge_values(problem, parameters, surface, options.alpha_margin_rad)
    heights = parameters.shape[parameters.curved][:, list(problem.shapes.heights)]
    value = ENERGY_WEIGHT * result.total + PENALTY_WEIGHT * float((np.maximum(hinges, 0.0) ** 2).sum())
    return value + SHALLOW_WEIGHT * float((heights**2).sum()), result, hinges


def linearised(
    problem: JointProblem, layout: UnknownsLayout, parameters: JointParameters, warm: EnergyResult | None = None
) -> Linear:
    """Return the objective about `parameters`; derivatives of surfaces by forward differences, all joints at once."""
    shapes, loads, pairs = problem.shapes, problem.loads, problem.pairs
    value, result, hinges = value_of(problem, parameters, warm)
    size = sum(layout.sizes)
    columns = layout.columns(shapes)
    step = STEP
    surface = surface_of(problem, parameters)
    base = _wrenches(problem, surface, result)
    changes, bends = [], []
    for p in range(len(columns)):
        ahead = parameters.stepped(p, step)
        moved = surface_of(problem, ahead)
        changes.append((_wrenches(problem, moved, result) - base) / step)
        bends.append((hinge_values(problem, ahead, moved, shapes.options.alpha_margin_rad) - hinges) / step)
    gradient, matrix = np.zeros(size), np.zeros((size, size) if size <= LARGE else (0, 0))
    answers: list[Answer] = []
    for k in range(len(loads.gravity)):
        free = loads.free[k]
        forces = result.forces[k].ravel()
        if size > LARGE:
            sparse = _upset(problem, columns, [change[k] for change in changes], free, size)
            gradient += ENERGY_WEIGHT * (sparse.T @ result.motions[k][free].ravel())
            answers.append(answered(result.system, forces, free, sparse))
            continue
        balance = np.zeros((len(loads.about), loads.wrenches.shape[2], size))
        for p, change in enumerate(changes):
            used = np.flatnonzero(columns[p] >= 0)
            for side in (0, 1):
                _scatter(balance, pairs[used, side], columns[p, used], change[k, used, side])
        b = balance[free].reshape(-1, size)
        gradient += ENERGY_WEIGHT * (result.motions[k][free].ravel() @ b)
        left = unanswered(result.system, forces, free, b)
        matrix += ENERGY_WEIGHT * (left.T @ left)
    slopes, violated = _violated(problem, layout, parameters, hinges, bends, columns)
    curvature: Curvature
    if size > LARGE:
        gradient += 2.0 * PENALTY_WEIGHT * (slopes.T @ violated)
        curvature = Products.of(answers, np.sqrt(2.0 * PENALTY_WEIGHT) * slopes, ENERGY_WEIGHT)
    else:
        written = slopes.toarray()
        gradient += 2.0 * PENALTY_WEIGHT * (written.T @ violated)
        curvature = Written(matrix + 2.0 * PENALTY_WEIGHT * (written.T @ written))
    heights = np.zeros(size)
    for h in shapes.heights:
        heights[columns[h, layout.joints]] = parameters.shape[layout.joints, h]
    gradient += 2.0 * SHALLOW_WEIGHT * heights
    strict = hinge_values(problem, parameters, surface, 0.0)
    return Linear(value, gradient, curvature, result, float(strict.max(initial=0.0)))


def _scatter(balance: Array, part: IntArray, column: IntArray, change: Array) -> None:
    """Add change (m, dof) to balance (N, dof, n) at the given parts and columns, which may repeat."""
    flat = (part[:, None] * balance.shape[1] + np.arange(balance.shape[1])) * balance.shape[2] + column[:, None]
    np.add.at(balance.reshape(-1), flat.ravel(), change.ravel())


def _wrenches(problem: JointProblem, surface: Array, result: EnergyResult) -> Array:
    """Return (K, E, 2, dof): what each joint's forces and moved mass do to its two parts, over |w| of the case."""
    shapes, loads = problem.shapes, problem.loads
    points, normals = pushes(shapes, *shapes.rays(narrowed(shapes, surface, shapes.options.inset)))
    return joint_wrenches(loads, problem.pairs, points, normals, result.forces, *shapes.transferred(surface))


def _upset(problem: JointProblem, columns: IntArray, changes: list[Array], free: BoolArray, size: int) -> sp.csr_array:
    """Return (free · dof, n) the balance that each unknown upsets in one case, from its changes (E, 2, dof)."""
    dof = problem.loads.wrenches.shape[2]
    place = np.full(len(free), -1)
    place[free] = np.arange(int(free.sum())) * dof
    rows, across, values = [], [], []
    for column, change in zip(columns, changes):
        for side in (0, 1):
            used = np.flatnonzero((column >= 0) & (place[problem.pairs[:, side]] >= 0))
            rows.append((place[problem.pairs[used, side], None] + np.arange(dof)).ravel())
            across.append(np.repeat(column[used], dof))
            values.append(change[used, side].ravel())
    index = (np.concatenate(rows), np.concatenate(across))
    return sp.csr_array((np.concatenate(values), index), shape=(int(free.sum()) * dof, size))


def _violated(
    problem: JointProblem,
    layout: UnknownsLayout,
    parameters: JointParameters,
    hinges: Array,
    bends: list[Array],
    columns: IntArray,
) -> tuple[sp.csr_array, Array]:
    """Return the slopes (m, n) of the constraints that are violated, and by how much (m,)."""
    joint, row = np.nonzero(hinges > 0.0)
    index = np.arange(len(joint))
    rows, across, values = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
    for p, bend in enumerate(bends):
        known = columns[p, joint] >= 0
        rows.append(index[known])
        across.append(columns[p, joint[known]])
        values.append(bend[joint[known], row[known]])
    if len(layout.parts):
        _, normals = problem.shapes.rays(surface_of(problem, parameters))
        first = hinges.shape[1] - normals.shape[1]
        place = np.full(len(parameters.axis), -1)
        place[layout.parts] = np.arange(len(layout.parts))
        about = (row >= first) & (place[problem.pairs[joint, 1]] >= 0)  # the others keep their way out
        later = problem.pairs[joint[about], 1]
        t = layout.tangents.shape[1]
        start = layout.sizes[0] + layout.sizes[1] + place[later] * t
        pull = np.einsum("hd,htd->ht", normals[joint[about], row[about] - first], layout.tangents[later])
        for k in range(t):
            rows.append(index[about])
            across.append(start + k)
            values.append(-pull[:, k])
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(across)))
    return sp.csr_array(entries, shape=(len(joint), sum(layout.sizes))), hinges[joint, row]


@dataclass(frozen=True, eq=False)
class Descent:
    """Where a descent stands before its next step: enough to go on exactly there.

    Attributes:
        parameters: where it is.
        damping: of the next Levenberg–Marquardt step.
        values: the objective before every step so far.
    """

    parameters: JointParameters
    damping: float = 1e-3
    values: tuple[float, ...] = ()


def descend(
    problem: JointProblem, start: Descent, steps: int, watch: Callable[[Descent, EnergyResult], None] | None
) -> tuple[JointParameters, int]:
    """Return where Levenberg–Marquardt steps end: everything holds, nothing moves, or `steps` are used up.

    `watch` is shown every step's beginning and E there; steps of `start` count.
    """
    parameters, damping, values = start.parameters, start.damping, list(start.values)
    warm: EnergyResult | None = None
    for count in range(len(values), steps):
        layout = UnknownsLayout.of(problem, parameters)
        if not sum(layout.sizes):
            return parameters, count + 1
        here = linearised(problem, layout, parameters, warm)
        warm, worst = here.result, float(here.result.infeasibility.max())
        if watch is not None:
            watch(Descent(parameters, damping, tuple(values)), here.result)
        values.append(here.value)
        stalled = len(values) > PATIENCE and values[-1] > 0.7 * values[-1 - PATIENCE]
        if (here.violation <= VIOLATED and worst <= 0.1 * MARGIN_SOLVED) or stalled:
            return parameters, count + 1
        for _ in range(9):
            ahead = layout.moved(parameters, _step(layout, parameters, here, damping))
            if value_of(problem, ahead, warm)[0] < here.value * (1.0 - LEAST_GAIN):
                parameters, damping = ahead, max(damping / 4.0, LEAST_DAMPING)
                break
            damping = max(damping * 6.0, RENEWED_DAMPING)
        else:
            return parameters, count + 1
    return parameters, max(steps, 0)


def _step(layout: UnknownsLayout, parameters: JointParameters, here: Linear, damping: float) -> Array:
    """Return the damped Gauss–Newton step; unknowns at a bound that the gradient pushes against stay there."""
    movable = ~layout.blocked(parameters, here.gradient)
    diagonal = here.curvature.diagonal
    largest = float(diagonal[movable].max(initial=0.0))
    step = here.curvature.solve(-here.gradient, movable, damping * (diagonal + 0.1 * largest + EXACT))
    return np.clip(step, -LONGEST_STEP, LONGEST_STEP)
