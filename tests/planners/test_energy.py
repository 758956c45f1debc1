"""E as a function of joint parameters: the envelope gradient against finite differences, and its invariances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.loads import load_cases
from planners.cone_joints.descent import evaluate, linearised, moved_wrenches, value_of
from planners.cone_joints.designer import margin_cases
from planners.cone_joints.energy import Loads
from planners.cone_joints.shapes2d import Shapes2D
from planners.cone_joints.unknowns import JointParameters, JointProblem, UnknownsLayout


def tilted_wall(tilt_rad: float, scale: float = 1.0) -> Assembly:
    """Return three courses of bricks in running bond on a wedge, leaning by `tilt_rad`."""
    c, s = np.cos(tilt_rad), np.sin(tilt_rad)
    turn = np.array([[c, s], [-s, c]])

    def brick(name: str, x0: float, x1: float, course: int) -> Part:
        y = 0.05 * course
        corners = np.array([[x0, y], [x1, y], [x1, y + 0.05], [x0, y + 0.05]])
        return Part(name, Polygon(scale * corners @ turn.T))

    left, right = np.array([0.0, 0.0]) @ turn.T, np.array([0.2, 0.0]) @ turn.T
    base = np.array([[left[0], -0.12], [right[0], -0.12], right, left])
    parts = [Part("base", Polygon(scale * base), fixed=True)]
    parts += [brick("a1", 0.0, 0.1, 0), brick("a2", 0.1, 0.2, 0)]
    parts += [brick("b1", 0.0, 0.05, 1), brick("b2", 0.05, 0.15, 1), brick("b3", 0.15, 0.2, 1)]
    return Assembly("wall", tuple(parts))


def problem_of(assembly: Assembly, alpha: bool = True) -> tuple[JointProblem, JointParameters]:
    graph = PartsGraph.of(assembly)
    contacts = graph.contacts
    required = load_cases(graph)
    loads = Loads.of(graph, (*required, *margin_cases(assembly, required, 0.02)))
    shapes = Shapes2D.of(assembly, contacts, JointOptions())
    pairs = np.array([c.parts for c in contacts])
    axis = np.tile([0.0, 1.0], (len(assembly.parts), 1))
    for part, motion in graph.motions():
        axis[part] = motion.axis
    rng = np.random.default_rng(3)
    shape = np.tile([0.1, 0.12, 0.0, 0.0], (len(contacts), 1))
    shape[:, 2] = 0.08 * rng.standard_normal(len(contacts))
    lean = 0.1 * rng.standard_normal((len(shapes.pair_normal), 1))
    curved = np.ones(len(contacts), dtype=np.bool_)
    turning = np.full(len(assembly.parts), alpha)
    problem = JointProblem(
        shapes=shapes,
        loads=loads,
        required=len(required),
        pairs=pairs,
        alpha_rad=assembly.alpha_rad if alpha else None,
        turning=turning,
    )
    return problem, JointParameters(shape, lean, axis, curved)


@pytest.mark.parametrize("kind", ["n", "z"])
def test_gradient_agrees_with_central_differences(kind: str) -> None:
    problem, start = problem_of(tilted_wall(0.35))
    if kind == "z":
        shapes = problem.shapes.with_kinds(["z"] * len(problem.pairs))
        problem = replace(problem, shapes=shapes)
        start.shape[:, 3] = -start.shape[:, 2]
    layout = UnknownsLayout.of(problem, start)
    here = linearised(problem, layout, start)
    size = sum(layout.sizes)
    assert here.value > 1e-4
    step = 1e-6
    for k in np.random.default_rng(0).choice(size, 25, replace=False):
        move = np.zeros(size)
        move[k] = step
        ahead = value_of(problem, layout.moved(start, move), None)[0]
        behind = value_of(problem, layout.moved(start, -move), None)[0]
        numeric = (ahead - behind) / (2 * step)
        assert here.gradient[k] == pytest.approx(numeric, rel=1e-4, abs=1e-5 * np.abs(here.gradient).max())


def test_energy_does_not_depend_on_the_models_scale() -> None:
    values = []
    for scale in (1.0, 1e-2, 1e3):
        problem, start = problem_of(tilted_wall(0.35, scale))
        values.append(evaluate(problem, start).infeasibility)
    assert values[1] == pytest.approx(values[0], rel=1e-7)
    assert values[2] == pytest.approx(values[0], rel=1e-7)


def test_moved_mass_matches_the_built_parts() -> None:
    from mocca_robot.joints.build import build_parts
    from mocca_robot.statics.loads import gravity_wrenches

    assembly = tilted_wall(0.2)
    problem, start = problem_of(assembly)
    u = problem.shapes.directions(start.lean)
    wrenches = moved_wrenches(problem, problem.shapes.surface(start.shape, u))
    joints = [problem.shapes.joint(e, start.shape[e], u[e]) for e in range(len(problem.pairs))]
    built = build_parts(assembly, joints)
    weights = gravity_wrenches(built, assembly.gravity) / problem.loads.unit
    free = ~assembly.fixed
    assert wrenches[0][free, :2] == pytest.approx(weights[free, :2], abs=1e-9)
    about = problem.loads.about[free]
    torque = weights[free, 2] - (about[:, 0] * weights[free, 1] - about[:, 1] * weights[free, 0])
    assert wrenches[0][free, 2] * problem.loads.length == pytest.approx(torque, abs=1e-9)
