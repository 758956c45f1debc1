"""The engine with friction against closed forms, at three scales, and against known values of random assemblies."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from physics_models import rectangle
from solids import box

from benchmarks.agreement import friction_of, random_probe
from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.contacts.friction import Friction
from mocca_robot.joints.joint import contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import case_at
from sim.coulomb.judge import CoulombVerdict, Rubbing, standing
from sim.coulomb.settle import Course, SettlingOutcome, settle
from sim.coulomb.springs import Springs
from sim.coulomb.tilting import tilt_bracket

SCALES = (1e-3, 1.0, 100.0)
"""Metres: a thing of a millimetre, of a metre, of a hundred."""


def rubbing(parts: list[Part], friction: float) -> Rubbing:
    assembly = Assembly("rubbing", tuple(parts))
    return Rubbing(PartsGraph.of(assembly), friction)


def upright(parts: list[Part], friction: float) -> CoulombVerdict:
    rubs = rubbing(parts, friction)
    return standing(rubs, case_at(rubs.graph.assembly, 0.0, 0.0))


def critical_deg(rubs: Rubbing, azimuth_rad: float = 0.0, guess_deg: float = 45.0) -> float:
    found = tilt_bracket(rubs, azimuth_rad, np.deg2rad(guess_deg))
    assert found.fell is None or found.fell.standing.settled.outcome is SettlingOutcome.FALLS
    return float(np.rad2deg(found.critical_rad))


def ground(scale: float, dimension: int) -> Part:
    low, high = np.full(3, -9.0 * scale), np.array([9.0, 9.0, 0.0]) * scale
    shape = rectangle(-9 * scale, -scale, 18 * scale, scale) if dimension == 2 else box(tuple(low), tuple(high))
    return Part("ground", shape, fixed=True)


def block(scale: float, dimension: int, height: float) -> Part:
    half = 0.5 * scale
    if dimension == 2:
        return Part("block", rectangle(-half, 0.0, scale, height * scale))
    return Part("block", box((-half, -half, 0.0), (half, half, height * scale)))


def arch(thickness: float, radius: float, voussoirs: int = 27) -> list[Part]:
    """Return a semicircular arch; `thickness` is a share of the radius of its centre line."""
    inner, outer = radius * (1.0 - 0.5 * thickness), radius * (1.0 + 0.5 * thickness)
    turns = np.linspace(0.0, np.pi, voussoirs + 1)
    ends = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    foot = 0.1 * radius
    parts = [
        Part(f"springer {s:+d}", Polygon(np.array([[s * r, y] for r, y in corners])), fixed=True)
        for s in (1, -1)
        for corners in [((inner, 0.0), (outer, 0.0), (outer, -foot), (inner, -foot))]
    ]
    wedges = (Polygon(np.array([inner * a, outer * a, outer * b, inner * b])) for a, b in itertools.pairwise(ends))
    return parts + [Part(f"v{k}", wedge) for k, wedge in enumerate(wedges)]


def pin(eccentricity: float, scale: float) -> list[Part]:
    """Return a pin in an exactly fitting slot of height `scale` with an arm that puts its weight off the middle."""
    half = 0.1 * scale

    def shape(reach: float) -> Polygon:
        low, high = 1.5 * scale, 1.55 * scale
        return Polygon(np.array([[-half, 0], [half, 0], [half, low], [reach, low], [reach, high], [-half, high]]))

    short, long = half, 60.0 * scale
    for _ in range(60):
        middle = 0.5 * (short + long)
        off = shape(middle).centroid[0] < eccentricity * scale
        short, long = (middle, long) if off else (short, middle)
    left, right = rectangle(-2 * scale, 0.0, 2 * scale - half, scale), rectangle(half, 0.0, 2 * scale - half, scale)
    return [Part("left", left, fixed=True), Part("right", right, fixed=True), Part("pin", shape(short))]


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("friction", [0.1, 0.6])
def test_a_block_slides_down_a_slope_at_atan_of_friction(scale: float, dimension: int, friction: float) -> None:
    rubs = rubbing([ground(scale, dimension), block(scale, dimension, 0.8)], friction)
    assert critical_deg(rubs, 0.4) == pytest.approx(np.rad2deg(np.arctan(friction)), abs=0.1)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_slender_block_topples_at_atan_of_width_over_height(scale: float, dimension: int) -> None:
    rubs = rubbing([ground(scale, dimension), block(scale, dimension, 3.0)], 0.9)
    assert critical_deg(rubs) == pytest.approx(np.rad2deg(np.arctan(1.0 / 3.0)), abs=0.1)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("friction", [0.01, 0.5, 2.0])
def test_a_block_between_parallel_walls_falls_whatever_the_friction(scale: float, friction: float) -> None:
    walls = [Part(f"w{x}", rectangle(x * scale, 0, scale, 3 * scale), fixed=True) for x in (-1, 1)]
    found = upright([*walls, Part("block", rectangle(0.0, scale, scale, scale))], friction)
    assert found.settled.outcome is SettlingOutcome.FALLS
    assert found.moved == ("block",)
    assert found.settled.motions[-1, 1] < 0.0
    assert found.settled.power > 0.0


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("friction", [0.2, 0.5, 0.84])
def test_a_pin_holds_from_the_eccentricity_that_clamps_it(scale: float, friction: float) -> None:
    """Two forces in opposite corners of the slot, each at the border of its cone: e/H = 1/(2μ)."""
    needed = 1.0 / (2.0 * friction)
    assert upright(pin(0.99 * needed, scale), friction).settled.outcome is SettlingOutcome.FALLS
    assert upright(pin(1.01 * needed, scale), friction).stands


@pytest.mark.parametrize("scale", SCALES)
def test_an_arch_of_27_stands_from_the_thickness_of_a_thrust_line_inside_it(scale: float) -> None:
    """0.1075 for arches cut anywhere; hinges form only where voussoirs meet, so that 27 stand with a little less."""
    assert upright(arch(0.1075, scale), 0.55).stands
    assert upright(arch(0.1065, scale), 0.55).settled.outcome is SettlingOutcome.FALLS


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("share", "stands"), [(0.99, True), (1.01, False)])
def test_five_blocks_overhang_by_the_harmonic_sum(scale: float, share: float, stands: bool) -> None:
    left = -0.5 * scale - 0.5 * scale  # the lowest block's middle stands half a block behind the edge
    parts = [Part("ground", rectangle(-3 * scale, -scale, 3 * scale, scale), fixed=True)]
    for k in range(5):
        left += share * 0.5 * scale / (5 - k)
        parts.append(Part(f"b{k}", rectangle(left, 0.2 * k * scale, scale, 0.2 * scale)))
    assert upright(parts, 0.5).stands is stands


def test_forces_of_what_stands_balance_the_weights_inside_their_cones() -> None:
    rubs = rubbing(arch(0.12, 1.0), 0.55)
    found = standing(rubs, case_at(rubs.graph.assembly, 0.0, 0.0)).settled
    pairs, _, normals = contact_rays(rubs.graph.contacts)
    pressed = (found.forces * normals).sum(axis=1)
    across = np.linalg.norm(found.forces - pressed[:, None] * normals, axis=1)
    assert (pressed >= 0.0).all()
    assert (across <= 0.55 * pressed + 1e-9 * pressed.max()).all()
    weight = sum(p.mass for p in rubs.graph.assembly.parts if not p.fixed) * 9.80665
    on_springers = found.forces[rubs.graph.assembly.fixed[pairs].any(axis=1)].sum(axis=0)
    assert abs(on_springers[1]) == pytest.approx(weight, rel=1e-5)
    assert found.unbalanced < 1e-6


@pytest.mark.parametrize("ratio", [0.1, 10.0])
def test_soft_or_stiff_shear_changes_no_slope(ratio: float) -> None:
    rubs = rubbing([ground(1.0, 3), block(1.0, 3, 0.8)], Friction(0.6, tangential_ratio=ratio))
    assert critical_deg(rubs, 0.4) == pytest.approx(np.rad2deg(np.arctan(0.6)), abs=0.1)


@pytest.mark.parametrize("factor", [1e-6, 1e-3, 1e3, 1e6])
def test_neither_stiffness_nor_weight_changes_anything(factor: float) -> None:
    pairs = np.array([[0, 1], [0, 1]])
    points, normals = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.0, 1.0], [0.0, 1.0]])
    wrenches = np.array([[0.0, 0.0, 0.0], [0.29, -1.0, -0.5 - 0.29]])

    def settled(stiffness: float, weight: float) -> Array:
        springs = Springs.build(
            pairs,
            points,
            normals,
            friction=0.3,
            free=np.array([False, True]),
            about=np.array([[0.0, -1.0], [0.5, 1.0]]),
            length=1.0,
            stiffness=np.full(2, stiffness),
        )
        found = settle(springs, weight * wrenches)
        assert found.outcome is SettlingOutcome.STANDS
        return found.forces / weight

    assert settled(factor, 1.0) == pytest.approx(settled(1.0, 1.0), rel=1e-9)
    assert settled(1.0, factor) == pytest.approx(settled(1.0, 1.0), rel=1e-9)


def test_parts_that_nothing_joins_to_the_ground_fall() -> None:
    lone = [ground(1.0, 2), Part("low", rectangle(0, 1, 1, 1)), Part("high", rectangle(0, 2, 1, 1))]
    found = upright(lone, 0.5)
    assert found.settled.outcome is SettlingOutcome.FALLS
    assert found.moved == ("low", "high")


def test_nothing_free_stands() -> None:
    assert upright([ground(1.0, 2), Part("wall", rectangle(0, 0, 1, 1), fixed=True)], 0.5).stands


def test_a_run_that_is_cut_short_gives_no_verdict() -> None:
    rubs = rubbing([ground(1.0, 2), block(1.0, 2, 0.8)], 0.5)
    found = standing(rubs, case_at(rubs.graph.assembly, 0.0, 0.0), Course(most=1000))
    assert found.settled.outcome is SettlingOutcome.UNDECIDED
    assert not found.stands


@pytest.mark.parametrize(
    ("kind", "seed", "known_deg"),
    [
        ("notched", 11, 41.8),
        ("notched", 17, 18.1),
        ("notched", 20, 22.6),
        ("notched", 23, 83.9),
        ("notched", 5, 25.0),
        ("solid_notched", 11, 44.0),
        ("solid_notched", 5, 31.3),
        ("solid_notched", 7, 13.7),
        ("solid_notched", 9, 24.5),
        ("solid_voronoi", 3, 33.8),
    ],
)
def test_random_assemblies_fall_where_they_are_known_to(kind: str, seed: int, known_deg: float) -> None:
    """Forces that could hold them exist up to 76° beyond; the values are of elastic contact solved as cone programs."""
    assembly, azimuth = random_probe(kind, seed)
    rubs = Rubbing(PartsGraph.of(assembly), friction_of(kind, seed))
    assert critical_deg(rubs, azimuth, known_deg) == pytest.approx(known_deg, abs=0.4)


def test_what_is_clamped_between_walls_holds_from_the_force_that_friction_needs() -> None:
    """Two faces press with N each and hold 2 μ N: half a weight over μ."""
    walls = [Part(f"w{x}", rectangle(x, 0, 1, 3), fixed=True) for x in (-1, 1)]
    assembly = Assembly("clamped", (*walls, Part("block", rectangle(0.0, 1.0, 1.0, 1.0))))
    weight = assembly.parts[-1].mass * 9.80665

    def found(share: float) -> CoulombVerdict:
        force = share * 0.5 * weight / 0.4
        declared = Friction(0.4, (), tuple((("block", w.name), force) for w in walls))
        return standing(Rubbing(PartsGraph.of(assembly), declared), case_at(assembly, 0.0, 0.0))

    assert found(1.02).stands
    assert found(0.98).settled.outcome is SettlingOutcome.FALLS


def test_each_pair_of_materials_rubs_as_the_table_says() -> None:
    """A block on a plank on the ground: what slides is the smoother pair."""
    ice, wood = replace(block(1.0, 2, 0.5), name="top", material="ice"), block(1.0, 2, 0.5)
    plank = replace(wood, name="plank", shape=rectangle(-2.0, -0.2, 4.0, 0.2), material="wood")
    floor = replace(ground(1.0, 2), shape=rectangle(-9.0, -1.2, 18.0, 1.0), material="wood")
    graph = PartsGraph.of(Assembly("table", (floor, plank, ice)))
    rough = Friction(0.0, ((("wood", "wood"), 0.6), (("ice", "wood"), 0.2)))
    found = tilt_bracket(Rubbing(graph, rough), 0.0, 0.2)
    assert np.rad2deg(found.critical_rad) == pytest.approx(np.rad2deg(np.arctan(0.2)), abs=0.1)
    assert found.fell is not None and found.fell.standing.moved == ("top",)
