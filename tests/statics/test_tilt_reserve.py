"""The smallest reserve against tilting: closed forms with and without further forces, and every state one by one."""

from __future__ import annotations

import numpy as np
import pytest

from mocca_robot import load
from mocca_robot.actions import Combination, PointForce
from mocca_robot.assembly import Assembly, Equilibrium, Goal, Interlocking, Lateral, Part, Polygon
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import critical_tilt, solve_case
from mocca_robot.statics.loads import state_cases, tilt_azimuths, tilted_gravity
from mocca_robot.statics.tilt_reserve import tilt_reserve
from planners.cone_joints.designer import design

UPRIGHT = Equilibrium()
MARGIN = float(np.deg2rad(1.0))


def groove(slope_deg: float, push: float = 0.0, goal: Goal = UPRIGHT) -> Assembly:
    """Return a block in a V-shaped groove of this slope, pushed to the right by a share of its weight."""
    rise = float(np.tan(np.deg2rad(slope_deg)))
    bed = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, rise], [0.0, 0.0], [-1.0, rise]])
    body = np.array([[0.0, 0.0], [1.0, rise], [1.0, rise + 0.1], [-1.0, rise + 0.1], [-1.0, rise]])
    parts = (Part("bed", Polygon(bed), fixed=True), Part("block", Polygon(body)))
    whole = Assembly("groove", parts, goals=(goal,))
    if not push:
        return whole
    force = np.array([push * whole.parts[1].mass * np.linalg.norm(whole.gravity), 0.0])
    pushed = PointForce(name="push", part="block", force=force)
    combination = Combination(name="push", factors={"push": 1.0})
    return Assembly("groove", parts, goals=(goal,), actions=(pushed,), combinations=(combination,))


@pytest.mark.parametrize("slope_deg", [5.0, 20.0, 45.0])
def test_a_block_leaves_a_groove_when_its_weight_leans_beyond_a_flank(slope_deg: float) -> None:
    found = tilt_reserve(PartsGraph.of(groove(slope_deg)), MARGIN)
    assert found is not None and not found.missed
    assert found.critical_rad == pytest.approx(np.deg2rad(slope_deg), abs=2e-5)
    assert found.moving == ("block",) and found.pairs == (("bed", "block"),)


@pytest.mark.parametrize("push", [0.05, 0.2, 0.5])
def test_a_push_that_stays_takes_its_share_of_the_reserve(push: float) -> None:
    """(F + W sin θ) / (W cos θ) = tan β, so θ = β − arcsin(F cos β / W), towards the side that is pushed to."""
    slope = np.deg2rad(40.0)
    found = tilt_reserve(PartsGraph.of(groove(40.0, push)), MARGIN)
    assert found is not None
    assert found.case == "load_push" and found.azimuth_rad == 0.0
    assert found.critical_rad == pytest.approx(slope - np.arcsin(push * np.cos(slope)), abs=2e-5)


def test_a_reserve_counts_beyond_what_a_lateral_goal_asks_for() -> None:
    graph = PartsGraph.of(groove(20.0, goal=Lateral(float(np.deg2rad(19.5)))))
    found = tilt_reserve(graph, MARGIN)
    assert found is not None and found.missed
    assert found.reserve_rad == pytest.approx(np.deg2rad(0.5), abs=2e-5)
    enough = tilt_reserve(graph, float(np.deg2rad(0.4)))
    assert enough is not None and not enough.missed


def test_nothing_is_said_of_what_only_has_to_interlock() -> None:
    assert tilt_reserve(PartsGraph.of(groove(20.0, goal=Interlocking("block"))), MARGIN) is None


@pytest.mark.parametrize("name", ["deer", "leaning_tower_support_free", "m"])
def test_it_is_the_least_of_every_state_on_every_side(name: str) -> None:
    config = load(f"configs/{name}.yaml")
    graph = PartsGraph.of(design(config.assembly, config.joints).design.assembly)
    found = tilt_reserve(graph, MARGIN)
    assert found is not None
    sides = tilt_azimuths(2, 2)
    assert found.critical_rad <= min(critical_tilt(graph, float(a)) for a in sides) + 2e-5
    for case in state_cases(graph):
        if case.name != found.case and found.case == "gravity":
            continue
        for side in sides:
            just_below = tilted_gravity(graph.assembly.gravity, found.critical_rad - 1e-4, float(side))
            at = type(case)(case.name, just_below, case.present, case.held)
            assert solve_case(graph, at).result.stands
    beyond = tilted_gravity(graph.assembly.gravity, found.critical_rad + 1e-4, found.azimuth_rad)
    weakest = [c for c in state_cases(graph) if c.name == found.case] or [state_cases(graph)[-1]]
    fallen = solve_case(graph, type(weakest[0])(found.case, beyond, weakest[0].present, weakest[0].held))
    assert not fallen.result.stands and set(fallen.moving) == set(found.moving)


def test_friction_adds_its_angle_to_the_reserve_of_a_groove() -> None:
    graph = PartsGraph.of(groove(20.0))
    dry, rubbed = (tilt_reserve(graph, MARGIN, friction=mu) for mu in (0.0, 0.2))
    assert dry is not None and rubbed is not None
    assert (dry.friction, rubbed.friction) == (0.0, 0.2)
    assert rubbed.critical_rad - dry.critical_rad == pytest.approx(np.arctan(0.2), abs=1e-3)
    assert rubbed.moving == dry.moving and rubbed.pairs == dry.pairs
