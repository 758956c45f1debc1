"""How much a structure takes: closed forms, and an independent linear programme on structures drawn at random."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog
from solids import box

from benchmarks.random_assemblies import random_assembly, random_solid
from mocca_robot.actions import (
    Action,
    AddedMass,
    BodyAcceleration,
    Combination,
    LineForce,
    PointForce,
    Pressure,
    Wind,
    Worker,
)
from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.joints.joint import contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report.reserves import factor_words, factors_data
from mocca_robot.statics.applied import applied_wrenches, combined
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.exposed import standing_place
from mocca_robot.statics.load_factor import load_factors
from mocca_robot.statics.loads import gravity_wrenches, load_cases
from mocca_robot.statics.solver.system import ContactSystem

G = 9.80665


def rectangle(low: tuple[float, float], high: tuple[float, float], thickness: float = 1.0) -> Polygon:
    (a, b), (c, d) = low, high
    return Polygon(np.array([[a, b], [c, b], [c, d], [a, d]]), (), thickness)


def carrying(parts: tuple[Part, ...], *actions: Action, **changes: object) -> Assembly:
    return Assembly("loaded", parts, alpha_rad=None, actions=actions, **changes)  # type: ignore[arg-type]


def factors(assembly: Assembly, friction: float = 0.0) -> dict[str, float | None]:
    found = load_factors(PartsGraph.of(assembly), friction)
    return {f.name: f.factor for f in found}


PLANK = (
    Part("left", rectangle((1.0, 0.0), (1.2, 1.0)), fixed=True),
    Part("right", rectangle((3.0, 0.0), (3.2, 1.0)), fixed=True),
    Part("plank", rectangle((0.0, 1.0), (4.0, 1.1)), density=1000.0),
)
WALL = (
    Part("ground", rectangle((-1.0, -1.0), (2.0, 0.0)), fixed=True),
    Part("wall", rectangle((0.0, 0.0), (0.5, 3.0)), density=2000.0),
)
WEIGHT = 4.0 * 0.1 * 1000.0 * G


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e2])
def test_a_plank_tips_over_the_support_that_is_nearer_to_its_load(scale: float) -> None:
    parts = tuple(
        replace(p, shape=Polygon(p.shape.exterior * scale, (), 1.0))  # type: ignore[union-attr]
        for p in PLANK
    )
    end = PointForce(name="end", part="plank", force=np.array([0.0, -100.0]), at=np.array([4.0, 1.1]) * scale)
    middle = replace(end, name="middle", at=np.array([2.0, 1.1]) * scale)
    found = factors(carrying(parts, end, middle))
    assert found["end"] == pytest.approx(WEIGHT * scale**2 * (3.2 - 2.0) / (100.0 * (4.0 - 3.2)), rel=1e-6)
    assert found["middle"] == np.inf


def test_a_line_load_is_its_resultant_and_a_mass_its_weight() -> None:
    line = LineForce(
        name="line", part="plank", start=np.array([3.5, 1.1]), end=np.array([4.0, 1.1]), force=np.array([0.0, -40.0])
    )
    mass = AddedMass(name="mass", part="plank", mass_kg=2.0, at=np.array([4.0, 1.1]))
    found = factors(carrying(PLANK, line, mass))
    assert found["line"] == pytest.approx(WEIGHT * 1.2 / (20.0 * (3.75 - 3.2)), rel=1e-6)
    assert found["mass"] == pytest.approx(WEIGHT * 1.2 / (2.0 * G * 0.8), rel=1e-6)


def test_a_wall_overturns_or_slides_in_the_wind() -> None:
    wind = Wind(name="wind", pressure_pa=1000.0, towards=np.array([1.0, 0.0]))
    pressed = Pressure(name="pressed", pressure_pa=1000.0, facing=np.array([-1.0, 0.0]))
    wall, weight = carrying(WALL, wind, pressed), 0.5 * 3.0 * 2000.0 * G
    overturning, sliding = weight * 0.25 / (1000.0 * 3.0 * 1.5), 0.1 * weight / (1000.0 * 3.0)
    for name in ("wind", "pressed"):
        assert factors(wall, friction=0.9)[name] == pytest.approx(overturning, rel=1e-6)
        assert factors(wall, friction=0.1)[name] == pytest.approx(sliding, rel=1e-6)
        assert factors(wall)[name] == 0.0


def test_a_block_on_a_slope_that_is_shaken() -> None:
    """Along a slope of angle a, ground acceleration k·g: it slides where tan(a + arctan k) = μ."""
    a, mu = np.deg2rad(10.0), 0.5
    shake = BodyAcceleration(name="quake", acceleration=np.array([G, 0.0]))
    gravity = G * np.array([np.sin(a), -np.cos(a)])  # the slope lies level, gravity leans
    block = (WALL[0], Part("block", rectangle((0.0, 0.0), (1.0, 0.2)), density=500.0))
    found = factors(carrying(block, shake, gravity=gravity), friction=mu)["quake"]
    assert found == pytest.approx(mu * np.cos(a) - np.sin(a), rel=1e-6)


def test_a_worker_stands_on_what_was_placed_last() -> None:
    """On the nose of the upper block the worker tips it over the lower one's edge; on what follows nobody minds."""
    nose = np.array([[0.6, 0.5], [1.0, 0.5], [1.0, 0.95], [1.5, 0.95], [1.5, 1.0], [0.6, 1.0]])
    stack = (
        WALL[0],
        Part("lower", rectangle((0.0, 0.0), (1.0, 0.5)), density=100.0),
        Part("upper", Polygon(nose, (), 1.0), density=100.0),
        Part("beside", rectangle((0.0, 0.5), (0.5, 1.0)), density=100.0),
    )
    worker = Worker(name="worker", mass_kg=80.0)
    all_states = Combination(name="worker", factors={"worker": 1.0}, states="all")
    assembly = carrying(stack, worker, combinations=(all_states,))
    (found,) = load_factors(PartsGraph.of(assembly))
    upper = assembly.parts[2]
    assert found.placed == "upper" and found.moving == ("upper",)
    assert found.factor == pytest.approx(upper.mass * (1.0 - upper.centroid[0]) / (80.0 * (1.05 - 1.0)), rel=1e-6)
    assert [c.name for c in load_cases(PartsGraph.of(assembly))] == [
        "gravity",
        "load_worker_state_lower",
        "load_worker_state_upper",
        "load_worker_state_beside",
    ]


def test_combinations_are_load_cases_with_their_factors() -> None:
    load = PointForce(name="person", part="plank", force=np.array([0.0, -100.0]), at=np.array([4.0, 1.1]))
    limit = WEIGHT * 1.2 / 80.0
    for factor, stands in ((0.99 * limit, True), (1.01 * limit, False)):
        both = Combination(name="use", gravity=1.35, factors={"person": 1.35 * factor})
        assembly = carrying(PLANK, load, combinations=(both,))
        graph = PartsGraph.of(assembly)
        (_, case) = load_cases(PartsGraph.of(assembly))
        assert case.name == "load_use"
        assert solve_case(graph, case).result.stands is stands
        assert factors(assembly)["use"] == pytest.approx(limit / factor, rel=1e-6)


def test_pressure_acts_on_exposed_faces_only() -> None:
    """Snow on a stair of two blocks: what the upper one covers carries none, nor what lies outside the region."""
    stair = (
        WALL[0],
        Part("lower", rectangle((0.0, 0.0), (2.0, 0.5))),
        Part("upper", rectangle((0.0, 0.5), (0.75, 1.0))),
    )
    graph = PartsGraph.of(carrying(stair))
    snow = Pressure(name="snow", pressure_pa=1000.0, facing=np.array([0.0, 1.0]))
    everywhere = applied_wrenches(graph, snow)
    assert everywhere == pytest.approx(
        np.array([[0.0, 0.0, 0.0], [0.0, -1250.0, -1250.0 * 1.375], [0.0, -750.0, -750.0 * 0.375]])
    )
    region = replace(snow, within=np.array([[0.5, 0.0], [1.0, 2.0]]))
    assert applied_wrenches(graph, region)[:, 1] == pytest.approx([0.0, -250.0, -250.0])
    assert applied_wrenches(graph.state(1), snow)[:, 1] == pytest.approx([0.0, -2000.0, 0.0])


def test_what_stands_in_front_shelters_from_the_wind() -> None:
    rows = (
        Part("ground", rectangle((-1.0, -1.0), (9.0, 0.0)), fixed=True),
        Part("front", rectangle((0.0, 0.0), (0.5, 1.0))),
        Part("back", rectangle((5.0, 0.0), (5.5, 3.0))),
    )
    graph = PartsGraph.of(carrying(rows))
    wind = Wind(name="wind", pressure_pa=10.0, towards=np.array([1.0, 0.0]))
    found = applied_wrenches(graph, wind)
    assert found[1] == pytest.approx([10.0, 0.0, -5.0])
    assert found[2] == pytest.approx([20.0, 0.0, -20.0 * 2.0])
    against = applied_wrenches(graph, replace(wind, towards=np.array([-1.0, 0.0])))
    assert against[1] == pytest.approx([0.0, 0.0, 0.0])
    assert against[2] == pytest.approx([-30.0, 0.0, 45.0])


def test_a_load_that_meets_nothing_is_not_said_to_be_carried() -> None:
    """The ground covers the face that looks down: 'any amount stands' would be a verdict about nothing."""
    (found,) = load_factors(
        PartsGraph.of(carrying(WALL, Pressure(name="p", pressure_pa=1e3, facing=np.array([0.0, -1.0]))))
    )
    assert found.steps == 0 and "presses on nothing" in factor_words(found)
    (found,) = load_factors(
        PartsGraph.of(carrying(WALL, Pressure(name="p", pressure_pa=1e3, facing=np.array([0.0, 1.0]))))
    )
    assert found.steps > 0 and "any amount stands" in factor_words(found)


@pytest.mark.parametrize("towards", [0.0, 30.0, 45.0, 90.0])
@pytest.mark.parametrize("mu", [0.2, 0.5])
def test_solids_with_friction_take_what_they_slide_or_tip_at(towards: float, mu: float) -> None:
    """A table on two legs, with a block on it: the top carries a weight at its end, and everything slides at μ g."""
    table = (
        Part("left", box((0.0, 0.0, 0.0), (0.2, 0.4, 0.8)), fixed=True),
        Part("right", box((1.8, 0.0, 0.0), (2.0, 0.4, 0.8)), fixed=True),
        Part("top", box((-0.4, 0.0, 0.8), (2.4, 0.4, 0.9)), density=1000.0),
        Part("block", box((0.8, 0.1, 0.9), (1.2, 0.3, 1.1)), density=1000.0),
    )
    way = np.array([np.cos(np.radians(towards)), np.sin(np.radians(towards)), 0.0])
    quake = BodyAcceleration(name="quake", acceleration=way)
    end = AddedMass(name="end", part="top", mass_kg=100.0, at=np.array([2.4, 0.2, 0.9]))
    found = factors(carrying(table, quake, end), friction=mu)
    assert found["quake"] == pytest.approx(mu * G, rel=2e-3)
    assert found["end"] == pytest.approx((112.0 + 16.0) * 1.0 / (100.0 * 0.4), rel=2e-3)


@pytest.mark.parametrize("pressure", [Wind, Pressure])
def test_solids_carry_what_the_same_flat_parts_do(pressure: type[Wind] | type[Pressure]) -> None:
    solid = Assembly(
        "solid",
        (
            Part("ground", box((-1.0, -0.5, -1.0), (2.0, 0.5, 0.0)), fixed=True),
            Part("wall", box((0.0, -0.5, 0.0), (0.5, 0.5, 3.0)), density=2000.0),
        ),
        alpha_rad=None,
    )
    flat = carrying(WALL)
    looks: dict[str, object] = {"name": "p", "pressure_pa": 700.0}
    key, sign = ("towards", 1.0) if pressure is Wind else ("facing", -1.0)
    in_plane = pressure(**looks, **{key: np.array([sign, 0.0])})  # type: ignore[arg-type]
    in_space = pressure(**looks, **{key: np.array([sign, 0.0, 0.0])})  # type: ignore[arg-type]
    plane = applied_wrenches(PartsGraph.of(flat), in_plane)[1]
    spatial = applied_wrenches(PartsGraph.of(solid), in_space)[1]
    assert spatial[[0, 2]] == pytest.approx(plane[:2])
    assert spatial[4] == pytest.approx(-plane[2])
    assert spatial[[1, 3, 5]] == pytest.approx(np.zeros(3))


@pytest.mark.parametrize(
    ("kind", "seed"),
    [*(("stack", k) for k in range(3)), *(("wall", k) for k in range(3)), ("notched", 1), ("solid", 2), ("solid", 5)],
)
def test_a_linear_programme_finds_the_same_factors(kind: str, seed: int) -> None:
    """max λ subject to A f = −(w₀ + λ w₁), f ≥ 0, by HiGHS: nothing in common with the search but the contacts."""
    assembly = random_solid("notched", seed) if kind == "solid" else random_assembly(kind, seed)
    rng = np.random.default_rng(seed)
    free = [p.name for p in assembly.parts if not p.fixed]
    weight = sum(p.mass for p in assembly.parts) * G
    loads = tuple(
        PointForce(name=f"l{k}", part=str(rng.choice(free)), force=0.1 * weight * rng.normal(size=assembly.dimension))
        for k in range(3)
    )
    graph = PartsGraph.of(replace(assembly, actions=loads))
    system = ContactSystem.build(*contact_rays(graph.contacts), ~assembly.fixed, None, assembly.size)
    for load, found in zip(loads, load_factors(graph), strict=True):
        single = Combination(name=load.name, factors={load.name: 1.0})
        steady = system.scaled(gravity_wrenches(assembly, assembly.gravity))
        growing = system.scaled(combined(graph, single)[1])
        matrix = np.c_[system.matrix.toarray().T, growing]
        best = linprog(np.r_[np.zeros(matrix.shape[1] - 1), -1.0], A_eq=matrix, b_eq=-steady, method="highs")
        expected = 0.0 if best.status == 2 else np.inf if best.status == 3 else float(best.x[-1])
        assert found.factor == pytest.approx(expected, rel=1e-5, abs=1e-7), load.name


def test_a_load_that_meets_nothing_is_not_called_unlimited() -> None:
    push = PointForce(name="push", part="plank", force=np.array([0.0, -10.0]), at=np.array([2.0, 1.1]))
    graph = PartsGraph.of(carrying(PLANK, push))
    (stands,) = load_factors(graph)
    assert [d["unlimited"] for d in factors_data([stands, replace(stands, steps=0)])] == [True, False]


def test_what_stands_only_with_its_load_stands_with_none_of_it() -> None:
    """A plank that is too far out, and a counterweight: any amount of that holds it down, but none of it does not."""
    parts = (PLANK[0], replace(PLANK[2], shape=rectangle((1.1, 1.0), (4.0, 1.1))))
    weight = AddedMass(name="counterweight", part="plank", mass_kg=1e4, at=np.array([1.15, 1.1]))
    (found,) = load_factors(PartsGraph.of(carrying(parts, weight)))
    assert found.factor == 0.0 and found.moving == ("plank",)


def test_a_worker_stands_on_the_upper_faces_of_a_part_not_over_its_middle() -> None:
    """An L whose back rises beside its seat is stood on where its upper faces balance, at the height that is there."""
    l_shape = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 0.5], [1.0, 0.5], [1.0, 2.0], [0.0, 2.0]])
    wedge = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    spike = np.array([[0.0, 0.0], [1.0, 0.0], [0.4, 3.0]])
    for corners, place in ((l_shape, [1.5, 0.5]), (wedge, [1.0, 0.5]), (spike, [0.4, 3.0])):
        assert standing_place(Part("part", Polygon(corners, (), 1.0)), 20.0) == pytest.approx(np.array(place))
