"""What design is compared with: the paper's two stages and direct search, on flat assemblies small enough to know."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import numpy as np
import pytest
from solids import wall

from benchmarks.__main__ import main
from benchmarks.design_baseline import TOOLS, leaning_wall
from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.errors import InputError
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.options import JointOptions
from mocca_robot.verdicts.verification import verify
from planners.baselines.direct_search import direct_search, planar_problem
from planners.baselines.paper_kinematics import faces
from planners.baselines.paper_programme import paper_design
from planners.cone_joints.descent import PENALTY_WEIGHT, evaluate, hinge_values, surface_of
from planners.cone_joints.energy import energy
from planners.cone_joints.shapes2d import Shapes2D
from planners.cone_joints.unknowns import JointParameters, UnknownsLayout


def overhang(beyond: float) -> Assembly:
    """Return a block on a 60 mm wide base; its centroid lies `beyond` (m) the base's edge."""
    base = Polygon(np.array([[0, -0.05], [0.06, -0.05], [0.06, 0.0], [0.0, 0.0]]))
    width = 2 * (0.06 + beyond)
    top = Polygon(np.array([[0, 0], [width, 0], [width, 0.04], [0, 0.04]]))
    return Assembly("overhang", (Part("base", base, fixed=True), Part("top", top)))


@pytest.mark.parametrize("gradient", ["envelope", "finite differences"])
def test_direct_search_uses_the_moving_centroid_where_fixed_ones_say_no(gradient):
    """Fig. 17(e): the mass that the joint moves is what makes it stand; kinematic design does not see it."""
    assembly = overhang(0.012)
    found = direct_search(assembly, gradient=gradient, evaluations=4000)
    assert found.achieved
    built = build_parts(assembly, found.joints)
    verification = verify(built)
    assert verification.stands and verification.assemblable
    assert built.parts[1].centroid[0] < assembly.parts[1].centroid[0] - 1e-3
    problem, _ = planar_problem(assembly, JointOptions())
    points, normals = found.joints[0].rays
    still = energy(problem.loads, problem.pairs, points[None], normals[None], problem.loads.wrenches)
    assert still.infeasibility.max() > 1e-6, "with the input's centroid the same joint would not hold"
    assert not paper_design(assembly).achieved


def test_the_envelope_gradient_is_the_derivative_of_what_is_minimised():
    from planners.baselines import direct_search as module

    assembly = leaning_wall(5)
    assembly = Assembly(assembly.name, assembly.parts, alpha_rad=np.deg2rad(25.0))
    problem, start = planar_problem(assembly, JointOptions())
    layout = UnknownsLayout.of(problem, start)
    rng = np.random.default_rng(3)
    low, high = problem.shapes.bounds()
    shape = rng.uniform(low + 0.2 * (high - low), high - 0.2 * (high - low))
    somewhere = JointParameters(shape, rng.uniform(-0.3, 0.3, start.lean.shape), start.axis, start.curved)

    def value(step):
        parameters = layout.moved(somewhere, step)
        result = evaluate(problem, parameters)
        hinges = hinge_values(problem, parameters, surface_of(problem, parameters), 0.0)
        return result.total + PENALTY_WEIGHT * float((np.maximum(hinges, 0.0) ** 2).sum()), parameters, result, hinges

    zero = np.zeros(sum(layout.sizes))
    _, parameters, result, hinges = value(zero)
    slope = module._envelope(problem, layout, parameters, result, hinges, 1.0)
    ahead = [(value(1e-6 * e)[0] - value(-1e-6 * e)[0]) / 2e-6 for e in np.eye(len(zero))]
    assert np.abs(slope).max() > 1e-3
    assert slope == pytest.approx(np.array(ahead), abs=2e-4 * np.abs(slope).max())


def test_paper_programme_holds_a_small_leaning_wall():
    assembly = leaning_wall(8)
    assert not verify(assembly).stands
    found = paper_design(assembly)
    assert found.achieved
    assert found.cones.asked.any() and len(found.joints) == len(found.missed)
    assert all(j.is_planar for j, asked in zip(found.joints, found.cones.asked) if not asked)
    assert verify(build_parts(assembly, found.joints)).stands


def test_paper_programme_says_when_it_falls_short():
    found = paper_design(overhang(0.02))
    assert not found.achieved
    assert found.infeasibility.max() > 1e-4 and found.cones.infeasibility.max() > 1e-4
    assert found.rounds == 4


def test_required_cones_keep_the_assembly_cone_and_the_bounds():
    assembly = leaning_wall(8)
    assembly = Assembly(assembly.name, assembly.parts, alpha_rad=np.deg2rad(20.0))
    found = paper_design(assembly)
    problem, _ = planar_problem(assembly, JointOptions())
    assert isinstance(problem.shapes, Shapes2D)
    _, normals = faces(problem.shapes, found.cones.slopes, found.cones.levers)
    slack = np.einsum("efd,ed->ef", normals[:, :2], found.cones.axis[problem.pairs[:, 1]])
    assert slack.min() >= np.sin(np.deg2rad(20.0)) - 1e-6
    assert (found.cones.slopes >= 0.0).all() and (found.cones.levers >= 1.0).all()
    assert (found.cones.slopes <= 1.0 + 1e-9).all()


def test_planar_required_cones_are_the_planar_contact():
    problem, start = planar_problem(leaning_wall(8), JointOptions())
    shapes = problem.shapes
    assert isinstance(shapes, Shapes2D)
    count = len(shapes.contacts)
    points, normals = faces(shapes, np.zeros((count, 2)), np.ones((count, 2)))
    mine = energy(problem.loads, problem.pairs, points, normals, problem.loads.wrenches)
    assert mine.infeasibility == pytest.approx(evaluate(problem, start).infeasibility)


def test_walls_have_the_parts_that_are_asked_for_and_do_not_overlap():
    for parts in (4, 8, 16):
        assembly = leaning_wall(parts)
        assert len(assembly.parts) == parts
        assert verify(assembly).part_overlap < 1e-12


def test_solids_are_refused_with_a_reason():
    with pytest.raises(InputError, match="flat"):
        paper_design(wall())


def test_the_benchmark_writes_rows_and_a_figure(tmp_path, capsys):
    figure = tmp_path / "baseline.svg"
    assert main(["baseline", "--quick", "--case", "wall-4", "--json", "--plot", str(figure)]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert {r["tool"] for r in rows} == set(TOOLS)
    assert all(r["verdict"].startswith("holds") and r["seconds"] > 0 for r in rows)
    drawn = ElementTree.fromstring(figure.read_text(encoding="utf-8"))
    marks = [e for e in drawn.iter() if (e.get("class") or "").startswith("mark")]
    assert len(marks) == 2 * len(rows)  # in the figure, and beside the tools' names


def test_configurations_stand_beside_the_published_times(capsys):
    assert main(["configs", "--quick", "--case", "scarecrow", "--json"]) == 0
    ours, paper = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert ours["verdict"].startswith("holds") and ours["tool"] == "ours"
    assert paper["seconds"] == pytest.approx(4.8) and paper["repeats"] == 0
