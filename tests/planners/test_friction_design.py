"""Designs that count on friction: fewer and shallower joints, and never on friction that nothing brings about."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.config.config import load
from mocca_robot.design import CountedFriction, Design
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import read_design, write_design
from mocca_robot.joints.options import JointOptions
from mocca_robot.statics.friction_verdict import Standing
from mocca_robot.verdicts.verification import verify
from planners.cone_joints.descent import linearised, value_of
from planners.cone_joints.designer import design
from planners.cone_joints.kinematic import _around, fan
from planners.cone_joints.rubbing import cone_edges
from planners.cone_joints.unknowns import UnknownsLayout
from tests.planners.test_energy import problem_of, tilted_wall

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def flat(parts: dict[str, list[list[float]]], fixed: set[str]) -> Assembly:
    made = tuple(Part(n, Polygon(np.array(p) * 1e-3), fixed=n in fixed) for n, p in parts.items())
    return Assembly("made", made)


def pin_in_a_hole() -> Assembly:
    ceiling = [[-40.0, 0], [-8, 0], [-8, 25], [8, 25], [8, 0], [40, 0], [40, 50], [-40, 50]]
    pin = [[-8.0, -30], [8, -30], [8, 25], [-8, 25]]
    return replace(flat({"ceiling": ceiling, "pin": pin}, {"ceiling"}), alpha_rad=None)


def block_on_a_slope(degrees: float) -> Assembly:
    t = np.tan(np.deg2rad(degrees))
    wedge = [[0.0, -20], [200, -20], [200, 200 * t], [0, 0]]
    low, high = np.array([60.0, 60 * t]), np.array([120.0, 120 * t])
    up = 20 * np.array([-t, 1.0]) / np.hypot(1, t)
    return flat({"wedge": wedge, "block": [*map(list, (low, high, high + up, low + up))]}, {"wedge"})


def heights(found: Design) -> list[float]:
    """Return how high every curved joint is, m."""
    return [max(abs(v) for k, v in j.parameters.items() if k[0] == "h") for j in found.joints if not j.is_planar]


@pytest.mark.parametrize("name", ["leaning_tower_10", "leaning_tower_20"])
def test_leaning_towers_need_fewer_and_shallower_joints_with_friction_and_stand_by_what_comes_about(name: str) -> None:
    config = load(CONFIGS / f"{name}.yaml")
    found = [design(config.assembly, replace(config.joints, friction=mu)) for mu in (0.0, 0.2, 0.4)]
    assert all(f.achieved for f in found)
    used = [heights(f.design) for f in found]
    assert len(used[0]) > len(used[1]) > len(used[2])
    assert sum(used[0]) > sum(used[1]) > sum(used[2])
    assert found[0].design.friction is None
    for counting in found[1:]:
        use = counting.design.friction
        assert use is not None and use.counted == pytest.approx(use.coefficient / 1.5)
        ways = {i.part: i.direction for i in counting.design.insertion}
        for mu in (use.counted, use.coefficient):
            check = verify(counting.design.assembly, friction=mu, directions=ways)
            assert [c.rubbing and c.rubbing.standing for c in check.cases] == [Standing.STANDS] * len(check.cases)
        assert check.assemblable


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_gradient_goes_through_friction_cones(friction: float) -> None:
    problem, start = problem_of(tilted_wall(0.6))
    options = replace(problem.shapes.options, friction=friction)
    problem = replace(problem, shapes=replace(problem.shapes, options=options))
    layout = UnknownsLayout.of(problem, start)
    here = linearised(problem, layout, start)
    assert here.result.total > 1e-6
    size, step = sum(layout.sizes), 1e-6
    for k in np.random.default_rng(0).choice(size, 25, replace=False):
        move = np.zeros(size)
        move[k] = step
        ahead, behind = (value_of(problem, layout.moved(start, s * move), None)[0] for s in (1.0, -1.0))
        numeric = (ahead - behind) / (2.0 * step)
        assert here.gradient[k] == pytest.approx(numeric, rel=1e-4, abs=1e-5 * np.abs(here.gradient).max())


@pytest.mark.parametrize("dimension", [2, 3])
def test_edges_lie_on_the_friction_cone_of_their_normal(dimension: int) -> None:
    rng = np.random.default_rng(1)
    contact = rng.standard_normal((6, dimension))
    contact /= np.linalg.norm(contact, axis=1)[:, None]
    normals = contact[:, None] + 0.9 * rng.uniform(-1, 1, (6, 5, dimension)) / np.sqrt(dimension)
    normals /= np.linalg.norm(normals, axis=2)[..., None]
    edges = cone_edges(contact, normals, 0.3).reshape(6, 5, -1, dimension)
    assert np.linalg.norm(edges, axis=3) == pytest.approx(np.ones(edges.shape[:3]), rel=1e-12)
    cosine = np.einsum("erkd,erd->erk", edges, normals)
    assert cosine == pytest.approx(np.full(cosine.shape, np.cos(np.arctan(0.3))), rel=1e-12)
    # Evenly around: the edges' mean is along the normal.
    mean = edges.mean(axis=2)
    assert mean == pytest.approx(cosine.mean(axis=2)[..., None] * normals, abs=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("angle_deg", [10.0, 70.0, 88.0, 95.0, 120.0])
def test_the_bound_s_fan_contains_every_direction_within_its_angle(dimension: int, angle_deg: float) -> None:
    from mocca_robot.geometry.cones import distance_to_cone

    angle = np.deg2rad(angle_deg)
    normal = np.eye(dimension)[-1]
    rays = np.concatenate([normal[None], fan(normal[None], [_around(angle, dimension == 2)])[0]])
    rng = np.random.default_rng(2)
    for _ in range(60):
        across = np.append(rng.standard_normal(dimension - 1), 0.0)
        lean = angle * rng.uniform()
        direction = np.cos(lean) * normal + np.sin(lean) * across / np.linalg.norm(across)
        assert distance_to_cone(rays, direction)[0] < 1e-9


def test_what_friction_alone_holds_gets_no_curved_joint() -> None:
    slope = block_on_a_slope(10.0)
    without, counting = design(slope), design(slope, JointOptions(friction=0.5))
    assert heights(without.design) and without.achieved
    assert counting.achieved and not heights(counting.design)
    assert counting.design.friction == CountedFriction(0.5, pytest.approx(0.5 / 1.5))


@pytest.mark.parametrize("friction", [0.01, 0.5])
def test_what_stands_only_clamped_does_not_count_on_friction(friction: float) -> None:
    pin = pin_in_a_hole()
    found = design(pin, JointOptions(friction=friction))
    assert found.design.friction is None
    assert any(f"joints.friction is {friction:g}" in note for note in found.design.notes)
    assert found.achieved == design(pin).achieved


def test_a_larger_safety_factor_asks_for_more_of_the_joints() -> None:
    config = load(CONFIGS / "leaning_tower_20.yaml")
    bold, careful = (
        sum(heights(design(config.assembly, replace(config.joints, friction=0.4, friction_safety=s)).design))
        for s in (1.0, 4.0)
    )
    assert bold < careful


def test_friction_counted_on_is_in_the_file_and_every_command_that_reads_it_uses_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = design(block_on_a_slope(10.0), JointOptions(friction=0.5))
    path = write_design(found.design, tmp_path)
    assert read_design(path).friction == found.design.friction
    assert load(path).friction == load(path).simulate.friction == 0.5
    assert main(["check", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["friction"] == 0.5
    assert main(["check", str(path), "--friction", "0", "--json"]) == 1
    capsys.readouterr()
    data = json.loads(path.read_text())
    old = {k: v for k, v in data.items() if k != "friction"}
    path.write_text(json.dumps(old))
    assert read_design(path).friction is None and load(path).friction == 0.0
    for wrong in ({"coefficient": 0.2, "counted": 0.3}, {"coefficient": -1, "counted": 0.0}, {"coefficient": 0.2}, 0.2):
        path.write_text(json.dumps({**old, "friction": wrong}))
        with pytest.raises(InputError, match="friction"):
            read_design(path)


def test_the_command_says_what_is_counted_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tower = str(CONFIGS / "leaning_tower_10.yaml")
    given = [tower, "--set", "joints.friction=0.4", "-o", str(tmp_path), "--json"]
    assert main(["design", *given]) == 0
    captured = capsys.readouterr()
    said = json.loads(captured.out)
    assert said["friction"] == {"coefficient": 0.4, "counted": pytest.approx(0.4 / 1.5)}
    assert all(case["standing"] == "stands" for case in said["cases"])
    assert "counts on friction of 0.267, where it is 0.4" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert main(["design", *given, "--set", "friction=0.1"]) == 2
    assert "joints.friction is 0.4, but friction says that it may be only 0.1" in capsys.readouterr().err
