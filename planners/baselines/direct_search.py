"""The baseline of Fig. 17: a gradient method over all joint parameters at once, without a kinematic stage (§7).

It starts from the planar contacts and tests equilibrium on the densely sampled joints at every step. It is given
the project's own statics, so what it is slow or stuck at is the approach.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.contacts.find import find_contacts, require_exact, require_sound
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.loads import load_cases
from mocca_robot.tolerances import CASE_SOLVED, TINY
from planners.cone_joints.descent import PENALTY_WEIGHT, evaluate, hinge_values, surface_of, violation_of
from planners.cone_joints.designer import joint_shapes, start_axes
from planners.cone_joints.energy import EnergyResult, Loads, joint_wrenches
from planners.cone_joints.unknowns import JointParameters, JointProblem, UnknownsLayout

LEAST_GAIN, LEAST_SLOPE = 1e-15, 1e-12
"""Relative gain of a step, and slope, at which the search ends: it is to end by its number of evaluations."""

Gradient = Literal["envelope", "finite differences"]
STEP = 1e-6
"""Forward difference, in contact lengths and radians."""
SOLVED_PENALTY = 1e-6
"""Worst hinge, dimensionless, that counts as kept."""


@dataclass(frozen=True, eq=False)
class DirectResult:
    """Where a comparison method ended.

    Attributes:
        joints: one per contact.
        infeasibility: (K,) E/|w|² of every load case on the true geometry, moved centroids included.
        violation: worst violated constraint, dimensionless; see `planners.cone_joints.descent.violation_of`.
        evaluations: how often E was evaluated.
    """

    joints: tuple[Joint, ...]
    infeasibility: Array
    violation: float
    evaluations: int

    @property
    def achieved(self) -> bool:
        """Return whether every load case holds within all constraints."""
        return bool(self.infeasibility.max(initial=0.0) <= CASE_SOLVED and self.violation <= SOLVED_PENALTY)


def direct_search(
    assembly: Assembly,
    options: JointOptions | None = None,
    *,
    contacts: ContactReport | None = None,
    gradient: Gradient = "envelope",
    evaluations: int = 400,
) -> DirectResult:
    """Return where L-BFGS-B over all joint parameters ends, from planar contacts (§7).

    Unknowns are every joint's shape, every pair's lean of u and, with α, every part's way out. Assemblability, slope
    and clearance are squared penalties, bounds are bounds. `gradient` is the envelope theorem's (one equilibrium
    test a step) or forward differences of E (one more per unknown). Raises InputError like `design`.
    """
    from scipy.optimize import minimize

    problem, start = planar_problem(assembly, options or JointOptions(), contacts)
    first = evaluate(problem, start)
    if first.infeasibility.max(initial=0.0) <= CASE_SOLVED:
        return searched(problem, start, 1)
    layout = UnknownsLayout.of(problem, start)
    unit = 1.0 / max(first.total, TINY)
    count = 0
    best = (np.inf, start)

    def value(step: Array) -> tuple[float, JointParameters, EnergyResult, Array]:
        nonlocal count, best
        count += 1
        parameters = layout.moved(start, step)
        result = evaluate(problem, parameters)
        hinges = hinge_values(problem, parameters, surface_of(problem, parameters), 0.0)
        total = unit * result.total + PENALTY_WEIGHT * float((np.maximum(hinges, 0.0) ** 2).sum())
        if total < best[0]:
            best = (total, parameters)
        return total, parameters, result, hinges

    def value_and_slope(step: Array) -> tuple[float, Array]:
        if count >= evaluations:
            raise StopIteration
        total, parameters, result, hinges = value(step)
        if result.infeasibility.max() <= CASE_SOLVED and hinges.max(initial=0.0) <= 0.0:
            raise StopIteration
        if gradient == "envelope":
            return total, _envelope(problem, layout, parameters, result, hinges, unit)
        ahead = [value(step + STEP * unknown)[0] for unknown in np.eye(len(step))]
        return total, (np.array(ahead) - total) / STEP

    with suppress(StopIteration):  # solved, or out of evaluations: `best` knows
        minimize(
            value_and_slope,
            np.zeros(sum(layout.sizes)),
            jac=True,
            method="L-BFGS-B",
            bounds=_bounds(problem, layout, start),
            options={"maxiter": evaluations, "maxfun": 10 * evaluations, "ftol": LEAST_GAIN, "gtol": LEAST_SLOPE},
        )
    return searched(problem, best[1], count)


def planar_problem(
    assembly: Assembly, options: JointOptions, contacts: ContactReport | None = None
) -> tuple[JointProblem, JointParameters]:
    """Return the design problem of the required load cases, without margins, and its planar start."""
    report = contacts or find_contacts(assembly)
    require_sound(assembly, report)
    require_exact(assembly, report)
    found = report.contacts
    graph = PartsGraph.of(assembly, found)
    required = load_cases(graph)
    axis = start_axes(graph)
    shapes = joint_shapes(graph, options, axis)
    loads = Loads.of(graph, required)
    turning = np.full(len(assembly.parts), assembly.dimension == 2 and assembly.alpha_rad is not None)
    pairs = np.array([c.parts for c in found])
    problem = JointProblem(
        shapes=shapes, loads=loads, required=len(required), pairs=pairs, alpha_rad=assembly.alpha_rad, turning=turning
    )
    lean = np.zeros((len(shapes.pair_normal), shapes.n_lean))
    return problem, JointParameters(np.tile(shapes.rest, (len(found), 1)), lean, axis, shapes.can_curve)


def searched(problem: JointProblem, parameters: JointParameters, evaluations: int) -> DirectResult:
    """Return the joints of `parameters` with E on their true geometry."""
    shapes = problem.shapes
    u = shapes.directions(parameters.lean)
    joints = tuple(
        shapes.joint(e, parameters.shape[e], u[e]) if curved else planar(contact)
        for e, (contact, curved) in enumerate(zip(shapes.contacts, parameters.curved))
    )
    result = evaluate(problem, parameters)
    return DirectResult(joints, result.infeasibility, violation_of(problem, parameters), evaluations)


def _bounds(problem: JointProblem, layout: UnknownsLayout, start: JointParameters) -> list[tuple[float, float]]:
    low, high = problem.shapes.bounds()
    n_shape, n_lean, n_axis = layout.sizes
    below, above = (np.asarray(b - start.shape)[layout.joints].ravel() for b in (low, high))
    lean = problem.shapes.steepest_lean
    rows = [*zip(np.minimum(below, 0.0), np.maximum(above, 0.0)), *([(-lean, lean)] * n_lean)]
    assert len(rows) == n_shape + n_lean
    return [*((float(a), float(b)) for a, b in rows), *([(-0.5, 0.5)] * n_axis)]


def _envelope(
    problem: JointProblem,
    layout: UnknownsLayout,
    parameters: JointParameters,
    result: EnergyResult,
    hinges: Array,
    unit: float,
) -> Array:
    """Return the gradient of Σ E · unit plus penalties: forces held, geometry moved, all joints at once."""
    columns = layout.columns(problem.shapes)
    gradient = np.zeros(sum(layout.sizes))
    surface = surface_of(problem, parameters)
    base = _wrenches(problem, surface, result)
    pull = np.stack([result.motions[:, problem.pairs[:, side]] for side in (0, 1)], axis=2)  # (K, E, 2, dof)
    push = 2.0 * PENALTY_WEIGHT * np.maximum(hinges, 0.0)
    for p, column in enumerate(columns):
        ahead = parameters.stepped(p, STEP)
        moved = surface_of(problem, ahead)
        power = np.einsum("kesd,kesd->e", pull, _wrenches(problem, moved, result) - base) / STEP
        bend = (push * (hinge_values(problem, ahead, moved, 0.0) - hinges)).sum(axis=1) / STEP
        _scatter(gradient, column, unit * power + bend)
    first = sum(layout.sizes[:2])
    place = np.full(len(parameters.axis), -1)
    place[layout.parts] = np.arange(len(layout.parts))
    for t in range(layout.tangents.shape[1] if len(layout.parts) else 0):
        turned = parameters.axis + STEP * layout.tangents[:, t]
        turned = turned / np.linalg.norm(turned, axis=1)[:, None]
        ahead = JointParameters(parameters.shape, parameters.lean, turned, parameters.curved)
        bend = (push * (hinge_values(problem, ahead, surface, 0.0) - hinges)).sum(axis=1) / STEP
        where = place[problem.pairs[:, 1]]
        column = np.where(where >= 0, first + where * layout.tangents.shape[1] + t, -1)
        _scatter(gradient, column, bend)
    return gradient


def _scatter(gradient: Array, column: IntArray, slope: Array) -> None:
    known = column >= 0
    np.add.at(gradient, column[known], slope[known])


def _wrenches(problem: JointProblem, surface: Array, result: EnergyResult) -> Array:
    points, normals = problem.shapes.rays(surface)
    moved = problem.shapes.transferred(surface)
    return joint_wrenches(problem.loads, problem.pairs, points, normals, result.forces, *moved)
