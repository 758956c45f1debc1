"""How much of a load stands in physics: closed forms, the frames that forces act in, and what a simulation tells."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from physics_models import semicircle
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation
from solids import box

from mocca_robot.actions import Action, AddedMass, BodyAcceleration, Combination, PointForce, Pressure, Wind
from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.design import Design
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report.data import ReportData
from mocca_robot.report.reserves import reserves
from mocca_robot.report.tilt_words import positive_words
from mocca_robot.statics.applied import Push
from mocca_robot.statics.load_factor import asked_combinations, load_factors
from mocca_robot.verdicts.physics import LoadVerdict, Verdict
from mocca_robot.verdicts.simulation_json import simulation_from_data, simulation_to_data
from mocca_robot.verdicts.verification import verify
from sim.coulomb import loading
from sim.coulomb.judge import rubbing
from sim.forces import forces_of
from sim.loads import load_verdict
from sim.questions import Questions
from sim.scene import compile_scene, with_gravity
from sim.shapes.contact_model import contact_model
from sim.simulate import simulate
from sim.stability import free_scene, judged

G = 9.80665


def rectangle(low: tuple[float, float], high: tuple[float, float]) -> Polygon:
    (a, b), (c, d) = low, high
    return Polygon(np.array([[a, b], [c, b], [c, d], [a, d]]), (), 1.0)


def verdicts(parts: tuple[Part, ...], *actions: Action, friction: float = 0.0, **more: object) -> list[LoadVerdict]:
    assembly = Assembly("loaded", parts, alpha_rad=None, actions=actions, **more)  # type: ignore[arg-type]
    graph = PartsGraph.of(assembly)
    asked = zip(asked_combinations(assembly), load_factors(graph, friction), strict=True)
    if friction > 0.0:
        return [loading.load_verdict(rubbing(graph, friction), *both) for both in asked]
    model = contact_model(assembly, graph.contacts)
    return [load_verdict(graph, model, *both) for both in asked]


GROUND = Part("ground", rectangle((-3.0, -1.0), (9.0, 0.0)), fixed=True)
PLANK = (
    Part("left", rectangle((1.0, 0.0), (1.2, 1.0)), fixed=True),
    Part("right", rectangle((3.0, 0.0), (3.2, 1.0)), fixed=True),
    Part("plank", rectangle((0.0, 1.0), (4.0, 1.1)), density=1000.0),
)
PLANK_3D = (
    Part("left", box((1.0, 0.0, 0.0), (1.2, 0.5, 1.0)), fixed=True),
    Part("right", box((3.0, 0.0, 0.0), (3.2, 0.5, 1.0)), fixed=True),
    Part("plank", box((0.0, 0.0, 1.0), (4.0, 0.5, 1.1)), density=1000.0),
)


def test_a_plank_tips_over_the_support_that_is_nearer_to_its_load() -> None:
    """400 kg of plank, 1.2 m inside of the support; the load 0.8 m outside: in the plane, and half as wide in space."""
    for parts, end, share in ((PLANK, [4.0, 1.1], 1.0), (PLANK_3D, [4.0, 0.25, 1.1], 0.5)):
        down = -np.eye(len(end))[-1]
        force = PointForce(name="force", part="plank", force=100.0 * down, at=np.array(end))
        mass = AddedMass(name="mass", part="plank", mass_kg=2.0, at=np.array(end))
        middle = replace(force, name="middle", at=None)
        use = Combination(name="use", gravity=1.35, factors={"force": 1.0, "mass": 2.0})
        found = verdicts(parts, force, mass, middle, combinations=(use,))
        weight = share * 400.0 * G
        assert found[0].factor == pytest.approx(weight * 1.2 / 80.0, rel=0.01)
        assert found[1].factor == pytest.approx(weight * 1.2 / (2.0 * G * 0.8), rel=0.01)
        assert np.isinf(found[2].factor) and found[2].tried > 10.0 * weight / 100.0 - 1.0
        assert found[3].factor == pytest.approx(1.35 * weight * 1.2 / ((100.0 + 4.0 * G) * 0.8), rel=0.01)
        assert all(f.apart == 0.0 and not f.failed for f in found)
        assert found[0].moved == ("plank",)


@pytest.mark.parametrize("pressure", [Wind, Pressure])
def test_a_wall_overturns_or_slides_in_the_wind(pressure: type[Wind] | type[Pressure]) -> None:
    wall = (GROUND, Part("wall", rectangle((0.0, 0.0), (0.5, 3.0)), density=2000.0))
    key, sign = ("towards", 1.0) if pressure is Wind else ("facing", -1.0)
    wind = pressure(name="wind", pressure_pa=1000.0, **{key: np.array([sign, 0.0])})  # type: ignore[arg-type]
    weight = 0.5 * 3.0 * 2000.0 * G
    (rough,), (smooth,) = verdicts(wall, wind, friction=0.9), verdicts(wall, wind, friction=0.1)
    assert rough.factor == pytest.approx(weight * 0.25 / (1000.0 * 3.0 * 1.5), rel=0.01)
    assert smooth.factor == pytest.approx(0.1 * weight / (1000.0 * 3.0), rel=0.01)


def test_a_block_on_a_slope_that_is_shaken() -> None:
    a, mu = np.deg2rad(10.0), 0.5
    shake = BodyAcceleration(name="quake", acceleration=np.array([G, 0.0]))
    block = (GROUND, Part("block", rectangle((0.0, 0.0), (1.0, 0.2)), density=500.0))
    (found,) = verdicts(block, shake, friction=mu, gravity=G * np.array([np.sin(a), -np.cos(a)]))
    assert found.factor == pytest.approx(mu * np.cos(a) - np.sin(a), rel=0.01)


@pytest.mark.parametrize(("mu", "expected"), [(0.2, 0.2 * 2.0), (0.9, 2.0 * 0.5 / 1.5)])
def test_stacked_blocks_under_a_side_force(mu: float, expected: float) -> None:
    """Two cubes of unit weight; a force on the upper one's middle: between them it slides, or both tip over."""
    cubes = (
        Part("ground", box((-3.0, -3.0, -1.0), (3.0, 3.0, 0.0)), fixed=True),
        Part("lower", box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), density=1.0 / G),
        Part("upper", box((0.0, 0.0, 1.0), (1.0, 1.0, 2.0)), density=1.0 / G),
    )
    push = PointForce(name="push", part="upper", force=np.array([1.0, 0.0, 0.0]))
    (found,) = verdicts(cubes, push, friction=mu)
    assert found.factor == pytest.approx(min(mu, expected, 0.5 / 0.5), rel=0.01)
    assert found.moved == (("upper",) if mu == 0.2 else ("lower", "upper"))


def test_a_load_that_nothing_resists_falls_under_the_least_of_it() -> None:
    block = (GROUND, Part("block", rectangle((0.0, 0.0), (0.1, 0.1)), density=500.0))
    (found,) = verdicts(block, PointForce(name="push", part="block", force=np.array([1.0, 0.0])))
    assert found.statics == 0.0 and found.apart == 0.0 and found.factor < 0.02 * block[1].mass * G


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_weight_keeps_its_direction_and_a_pressure_turns_with_its_part(dimension: int) -> None:
    flat = dimension == 2
    shape = rectangle((0.0, 0.0), (1.0, 0.5)) if flat else box((0.0, 0.0, 0.0), (1.0, 0.4, 0.5))
    ground = GROUND if flat else Part("ground", box((-3.0, -3.0, -1.0), (3.0, 3.0, 0.0)), fixed=True)
    assembly = Assembly("turned", (ground, Part("block", shape)), alpha_rad=None)
    arm, force = np.array([0.3, 0.2] if flat else [0.3, -0.1, 0.2]), np.array([2.0, -5.0] if flat else [2.0, 1.0, -5.0])
    point = assembly.parts[1].centroid + arm
    scene = free_scene(assembly, contact_model(assembly, PartsGraph.of(assembly).contacts))
    for turns in (False, True):
        push = Push(part=1, force=force, point=point, turns=turns)
        compiled = with_gravity(compile_scene(scene), assembly.gravity, (push,))
        data, forces = mujoco.MjData(compiled.model), forces_of(compiled)
        assert forces is not None
        turn = Rotation.from_rotvec([0.0, -0.7, 0.0] if flat else [0.3, -0.5, 0.4])
        data.qpos[compiled.qpos[0]] = [0.0, 0.0, 0.7] if flat else [*point - arm, *np.roll(turn.as_quat(), 1)]
        mujoco.mj_forward(compiled.model, data)
        forces.put(data)
        spatial = [np.array([v[0], 0.0, v[1]]) if flat else v for v in (arm, force)]
        now = turn.apply(spatial[1]) if turns else spatial[1]
        body = compiled.model.body("block").id
        assert data.xfrc_applied[body] == pytest.approx(np.r_[now, np.cross(turn.apply(spatial[0]), now)], abs=1e-12)


def test_what_a_load_throws_over_has_fallen_and_gained_no_energy_out_of_nothing() -> None:
    """A push of ten times the weight far above the middle: the work that it does is no divergence."""
    block = Part("block", rectangle((0.0, 0.0), (0.1, 0.2)), density=500.0)
    assembly = Assembly("thrown", (GROUND, block), alpha_rad=None)
    scene = free_scene(assembly, contact_model(assembly, PartsGraph.of(assembly).contacts))
    push = Push(part=1, force=np.array([0.0, 10.0 * block.mass * G]), point=np.array([0.1, 0.2]))
    found = judged(with_gravity(compile_scene(scene), assembly.gravity, (push,)))
    assert found.verdict is Verdict.FELL and found.motion.failure is None


def test_a_simulation_tells_load_factors_and_keeps_them() -> None:
    end = PointForce(name="end", part="plank", force=np.array([0.0, -100.0]), at=np.array([4.0, 1.1]))
    nothing = Pressure(
        name="nothing", pressure_pa=10.0, facing=np.array([0.0, -1.0]), within=np.array([[1, 0], [1.2, 2]])
    )
    middle = replace(end, name="middle", at=None)
    assembly = Assembly("plank", PLANK, alpha_rad=None, actions=(end, nothing, middle))
    found = simulate(assembly, questions=Questions(stages=("loads",), threads=1))
    assert [f.name for f in found.loads] == ["end", "middle"]
    assert found.loads[0].factor == pytest.approx(58.84, rel=0.01)
    data = simulation_to_data(found, assembly)
    assert data["disagreements"] == []
    assert simulation_from_data(data, "simulation").loads == found.loads
    wrong = replace(found, loads=(replace(found.loads[0], statics=62.0, scale=62.0),))
    (said,) = simulation_to_data(wrong, assembly)["disagreements"]
    assert "'end'" in said and "62 times by statics" in said


def thrust_line_factor(assembly: Assembly, loaded: int, force: np.ndarray) -> float:
    """Return the load factor of an arch whose joints cannot slide, as Heyman has it: some line of thrust fits into it.

    Unknown are, at every joint, the two normal forces at its ends, a shear force, and the factor (linear programme).
    """
    stones = [p for p in assembly.parts if not p.fixed]
    rings = [p.shape.exterior for p in stones]  # type: ignore[union-attr]
    inner = np.array([rings[0][0], *(r[1] for r in rings)])
    outer = np.array([rings[0][3], *(r[2] for r in rings)])
    count = len(stones)
    balance = np.zeros((3 * count, 3 * (count + 1) + 1))
    rest = np.zeros(3 * count)

    def wrench(direction: np.ndarray, point: np.ndarray) -> np.ndarray:
        return np.r_[direction, point[0] * direction[1] - point[1] * direction[0]]

    for k in range(count + 1):
        along = (outer[k] - inner[k]) / np.linalg.norm(outer[k] - inner[k])
        onward = np.array([along[1], -along[0]])
        for stone, sign in ((k, 1.0), (k - 1, -1.0)):
            if 0 <= stone < count:
                columns = ((onward, inner[k]), (onward, outer[k]), (along, inner[k]))
                for c, (direction, point) in enumerate(columns):
                    balance[3 * stone : 3 * stone + 3, 3 * k + c] = sign * wrench(direction, point)
    for k, part in enumerate(stones):
        rest[3 * k : 3 * k + 3] = -wrench(np.array([0.0, -part.mass * G]), part.centroid)
    balance[3 * loaded : 3 * loaded + 3, -1] = wrench(force, stones[loaded].centroid)
    bounds = [(0, None), (0, None), (None, None)] * (count + 1) + [(0, None)]
    best = linprog(np.r_[np.zeros(3 * (count + 1)), -1.0], A_eq=balance, b_eq=rest, bounds=bounds, method="highs")
    return float(best.x[-1])


def test_an_arch_of_27_voussoirs_under_a_load_at_its_quarter_point() -> None:
    """The limit by lines of thrust; statics meets it to a millionth, physics within 1 %."""
    arch, force = semicircle(0.2), np.array([0.0, -1000.0])
    stone = [p.name for p in arch.parts if not p.fixed].index("v6")
    load = PointForce(name="load", part="v6", force=force)
    (found,) = verdicts(arch.parts, load, friction=3.0)
    assert found.statics == pytest.approx(thrust_line_factor(arch, stone, force), rel=1e-6)
    assert found.factor == pytest.approx(found.statics, rel=0.01)
    assert len(found.moved) > 20


def test_the_report_says_how_much_it_takes_by_statics_and_in_physics() -> None:
    end = PointForce(name="end", part="plank", force=np.array([0.0, -100.0]), at=np.array([4.0, 1.1]))
    middle = replace(end, name="middle", at=None)
    assembly = Assembly("plank", PLANK, alpha_rad=None, actions=(end, middle))
    found = simulate(assembly, questions=Questions(stages=("loads",), threads=1))
    design = Design(source=assembly, assembly=assembly, joints=(), insertion=(), load_cases=())
    after = verify(assembly)
    page = reserves(ReportData(design=design, before=after, after=after, states=(), simulation=found))
    assert "58.84 ± 0.1" in page and "over 392" in page and "∞" in page
    silent = replace(after.load_factors[0], factor=None)
    assert positive_words(None, [silent]) == "every verdict is positive; how much it takes of 'end' is not decided"
