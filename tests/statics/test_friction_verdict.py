"""Friction that does not lift what slides: closed forms, evidence recomputed from arrays, random assemblies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from benchmarks.agreement import LOCKED_FRICTIONS, LOCKED_KINDS, PLAIN_FRICTIONS
from benchmarks.cases import KINDS, arch
from benchmarks.random_assemblies import SOLID_KINDS, random_assembly, random_solid
from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.geometry.cones import cross
from mocca_robot.joints.joint import contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import case_at
from mocca_robot.statics.coulomb import standing
from mocca_robot.statics.coulomb_tilt import largest_tilt
from mocca_robot.statics.friction_cases import tilt_bound
from mocca_robot.statics.friction_verdict import FrictionVerdict, Standing
from mocca_robot.statics.frictional_contacts import FrictionalContacts
from mocca_robot.statics.loads import case_wrenches

SCALES = (1e-3, 1.0, 100.0)
STIFFNESSES = (1e3, 1e6, 1e9)


@dataclass(frozen=True)
class Scene:
    """Blocks on a ground, which is part 0: contact points, and every part's centre and weight."""

    pairs: Sequence[tuple[int, int]]
    points: Array
    normals: Array
    centres: Array
    weights: Array

    def contacts(self, friction: float | Array, **further: object) -> FrictionalContacts:
        free = np.arange(len(self.weights)) > 0
        about, size = self.centres, float(np.ptp(self.points, axis=0).max())
        made: Callable[..., FrictionalContacts] = FrictionalContacts.of
        return made(
            np.array(self.pairs), self.points, self.normals, free, friction, about=about, length=size, **further
        )

    def load(self, tilt: float = 0.0) -> Array:
        """Return weights under gravity tilted towards +x."""
        d = self.points.shape[1]
        down = np.zeros(d)
        down[0], down[-1] = np.sin(tilt), -np.cos(tilt)
        force = self.weights[:, None] * down
        return np.concatenate([force, cross(self.centres, force)], axis=1)


def scene(
    dimension: int, scale: float, contacts: Sequence[tuple[tuple[int, int], Sequence[Array], Array]], centres: Array
) -> Scene:
    """Return flat contacts (pair, ends, normal) in the plane x, z; in 3D as bands from y = −½ to ½, times scale."""
    pairs, points, normals = [], [], []
    for pair, ends, normal in contacts:
        for end in ends:
            if dimension == 2:
                pairs.append(pair)
                points.append(end)
                normals.append(normal)
            else:
                for y in (-0.5, 0.5):
                    pairs.append(pair)
                    points.append(np.array([end[0], y, end[1]]))
                    normals.append(np.array([normal[0], 0.0, normal[1]]))
    if dimension == 3:
        centres = np.stack([centres[:, 0], 0.0 * centres[:, 0], centres[:, 1]], axis=1)
    weights = np.r_[0.0, np.full(len(centres) - 1, 7.0 * scale**3)]
    return Scene(pairs, scale * np.array(points), np.array(normals), scale * centres, weights)


UP, RIGHT = np.array([0.0, 1.0]), np.array([1.0, 0.0])


def block(dimension: int, scale: float, width: float = 1.0, height: float = 0.4) -> Scene:
    ends = [np.array([-width / 2, 0.0]), np.array([width / 2, 0.0])]
    return scene(dimension, scale, [((0, 1), ends, UP)], np.array([[0.0, -1.0], [0.0, height / 2]]))


def between_walls(dimension: int, scale: float, taper: float = 0.0) -> Scene:
    """Return a unit block between two walls that close downwards by `taper` radians each."""
    c, s = np.cos(taper), np.sin(taper)
    left = [np.array([-0.5, 0.0]), np.array([-0.5 - np.tan(taper), 1.0])]
    right = [x * [-1.0, 1.0] for x in left]
    contacts = [((0, 1), left, np.array([c, s])), ((0, 1), right, np.array([-c, s]))]
    return scene(dimension, scale, contacts, np.array([[0.0, -1.0], [0.0, 0.5]]))


def pin(dimension: int, scale: float, eccentricity: float) -> Scene:
    """Return a pin of width 0.2 in a slot of height 1 that fits exactly; its weight acts to the right of it."""
    left = [np.array([-0.1, 0.0]), np.array([-0.1, 1.0])]
    right = [np.array([0.1, 0.0]), np.array([0.1, 1.0])]
    return scene(
        dimension, scale, [((0, 1), left, RIGHT), ((0, 1), right, -RIGHT)], np.array([[0.0, -1.0], [eccentricity, 0.5]])
    )


def overhang(dimension: int, scale: float, share: float) -> Scene:
    """Return five blocks of width 1, each as far over the one below as the harmonic sum allows, times `share`."""
    shifts = np.r_[0.0, share * 0.5 / np.arange(5, 0, -1)]  # bottom block over the ground first
    left = np.cumsum(shifts)[1:] - 0.5
    contacts = []
    for k in range(5):
        low, high = left[k], (left[k - 1] + 1.0 if k else 0.5)
        contacts.append(((k, k + 1), [np.array([low, 0.2 * k]), np.array([high, 0.2 * k])], UP))
    centres = np.array([[0.0, -1.0], *([x + 0.5, 0.2 * k + 0.1] for k, x in enumerate(left))])
    return scene(dimension, scale, contacts, centres)


def critical(made: Scene, friction: float, bound: float, stiffness: float = 1e6) -> float:
    contacts = made.contacts(friction)
    found = largest_tilt(lambda t, s: standing(contacts, made.load(t), start=s, stiffness=stiffness), bound, 2e-4)
    return found.critical_rad


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("scale", "stiffness"), list(zip(SCALES, STIFFNESSES)))
def test_a_block_slides_at_the_friction_angle_or_topples_over_its_edge(
    dimension: int, scale: float, stiffness: float
) -> None:
    assert critical(block(dimension, scale), 0.3, 1.0, stiffness) == pytest.approx(np.arctan(0.3), abs=2e-3)
    slender = block(dimension, scale, width=0.5, height=1.0)
    assert critical(slender, 0.8, 1.0, stiffness) == pytest.approx(np.arctan(0.5), abs=2e-3)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("friction", [0.01, 0.3, 2.0])
def test_a_block_between_parallel_walls_stands_only_clamped(dimension: int, friction: float) -> None:
    found = standing(between_walls(dimension, 0.1).contacts(friction), between_walls(dimension, 0.1).load())
    assert found.standing is Standing.STANDS_ONLY_CLAMPED
    assert found.clamped_forces is not None
    assert (found.clamped_forces @ np.eye(dimension)[-1]).sum() == pytest.approx(7e-3, rel=1e-5)
    assert found.motions[1, dimension - 1] < 0.0  # down
    assert np.abs(found.motions[1, : dimension - 1]).max() < 1e-6 * np.abs(found.motions[1]).max()  # not aside
    assert found.unbalanced == pytest.approx(1.0)  # nothing presses, nothing rubs


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("taper_deg", [0.5, 5.0])
@pytest.mark.parametrize("friction", [0.01, 0.4])
def test_a_block_between_tapering_walls_wedges_with_known_forces(
    dimension: int, taper_deg: float, friction: float
) -> None:
    taper = np.deg2rad(taper_deg)
    made = between_walls(dimension, 1.0, taper)
    found = standing(made.contacts(friction), made.load())
    assert found.standing is Standing.STANDS
    pressed = np.einsum("cd,cd->c", found.forces, made.normals).sum()
    assert pressed == pytest.approx(7.0 / (np.sin(taper) + friction * np.cos(taper)), rel=1e-6)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("friction", "scale"), [(0.2, 1e-3), (0.5, 1.0), (0.84, 100.0)])
def test_an_eccentric_pin_jams_from_a_known_eccentricity(dimension: int, friction: float, scale: float) -> None:
    jams = 1.0 / (2.0 * friction)
    for share, verdict in ((1.005, Standing.STANDS), (0.995, Standing.STANDS_ONLY_CLAMPED)):
        made = pin(dimension, scale, share * jams)
        assert standing(made.contacts(friction), made.load()).standing is verdict


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("scale", SCALES)
def test_an_overhang_reaches_the_harmonic_sum(dimension: int, scale: float) -> None:
    for share, verdict in ((0.999, Standing.STANDS), (1.001, Standing.FALLS)):
        made = overhang(dimension, scale, share)
        assert standing(made.contacts(0.5), made.load()).standing is verdict


def test_an_arch_of_27_voussoirs_needs_a_known_thickness() -> None:
    for thickness, verdict in ((0.1075 * 1.005, Standing.STANDS), (0.1075 * 0.99, Standing.FALLS)):
        case = arch(27, thickness=thickness)
        contacts = FrictionalContacts.of(
            case.pairs, case.points, case.normals, case.free, 0.55, about=case.centroids, length=case.length
        )
        assert standing(contacts, case.wrenches()).standing is verdict


def test_clamping_holds_what_friction_needs() -> None:
    made = between_walls(2, 0.1)
    for force, verdict in ((1.02, Standing.STANDS), (0.98, Standing.STANDS_ONLY_CLAMPED)):
        # Both walls press with the same force N; 2 μ N carries the weight of 7e-3 N.
        contacts = made.contacts(0.4, clamping={(0, 1): 2.0 * force * 7e-3 / (2.0 * 0.4)})
        assert standing(contacts, made.load()).standing is verdict


def test_every_point_has_its_own_friction() -> None:
    made = block(2, 1.0)
    for friction, verdict in (
        ([0.0, 0.5], Standing.STANDS),
        ([0.0, 0.1], Standing.FALLS),
        ([0.0, 0.0], Standing.FALLS),
    ):
        assert standing(made.contacts(np.array(friction)), made.load(0.1)).standing is verdict


@pytest.mark.parametrize("dimension", [2, 3])
def test_parts_that_touch_nothing_that_could_hold_them_fall(dimension: int) -> None:
    made = scene(dimension, 1.0, [((0, 1), [np.zeros(2), np.array([1.0, 0.0])], UP)], np.zeros((3, 2)))
    free = np.array([False, False, True])
    contacts = FrictionalContacts.of(np.array(made.pairs), made.points, made.normals, free, 0.6)
    found = standing(contacts, made.load())
    assert found.standing is Standing.FALLS and found.motions[2, dimension - 1] < 0.0
    assert standing(contacts, 0.0 * made.load()).standing is Standing.STANDS


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"friction": -0.1}, "friction is -0.1"),
        ({"friction": np.nan}, "friction is nan"),
        ({"friction": [0.1] * 5}, "one for each of 2 contact points"),
        ({"weights": [1.0, 0.0]}, "weights is 0"),
        ({"tangential_ratio": 0.0}, "k_t/k_n is 0"),
        ({"clamping": {(0, 2): 1.0}}, "do not touch"),
        ({"clamping": {(0, 1): -1.0}}, "clamping force"),
    ],
)
def test_wrong_numbers_are_named(wrong: dict[str, object], words: str) -> None:
    given: dict[str, object] = {"friction": 0.3, **wrong}
    with pytest.raises(InputError, match=words):
        block(2, 1.0).contacts(**given)  # type: ignore[arg-type]


def test_a_stiffness_must_be_positive_and_loads_finite() -> None:
    made = block(2, 1.0)
    with pytest.raises(InputError, match="stiffness"):
        standing(made.contacts(0.3), made.load(), stiffness=0.0)
    with pytest.raises(InputError, match="wrenches"):
        standing(made.contacts(0.3), made.load() * np.nan)


def random_case(name: str) -> tuple[FrictionalContacts, Callable[[float], Array], float]:
    """Return contacts, load by tilt and the bound of a case of the agreement table."""
    kind, number = name.rsplit("-", 1)
    seed = int(number)
    rng = np.random.default_rng((seed, len(kind)))
    assembly = random_solid(kind, seed) if kind in SOLID_KINDS else random_assembly(kind, seed)
    azimuth = float(rng.choice([0.0, np.pi]) if assembly.dimension == 2 else rng.uniform(0.0, 2.0 * np.pi))
    frictions = LOCKED_FRICTIONS if kind in (*LOCKED_KINDS, "peaks") else PLAIN_FRICTIONS
    friction = frictions[seed % len(frictions)]
    graph = PartsGraph.of(assembly)
    about = np.array([p.centroid for p in assembly.parts])
    made = FrictionalContacts.of(
        *contact_rays(graph.contacts), ~assembly.fixed, friction, about=about, length=assembly.size / 2
    )

    def load(tilt: float) -> Array:
        return case_wrenches(case_at(assembly, tilt, azimuth), graph)

    return made, load, tilt_bound(graph, azimuth, friction)


TILTS = {
    "notched-11": 41.8, "notched-17": 18.1, "notched-23": 83.9, "solid_notched-9": 24.5, "solid_voronoi-3": 33.8,
}  # fmt: skip


@pytest.mark.parametrize("name", TILTS)
def test_random_assemblies_fall_where_exact_springs_say(name: str) -> None:
    contacts, load, bound = random_case(name)
    found = largest_tilt(lambda t, s: standing(contacts, load(t), start=s), bound)
    assert np.rad2deg(found.critical_rad) == pytest.approx(TILTS[name], abs=0.3)
    assert np.rad2deg(found.fails_rad - found.stands_rad) < 0.05
    assert found.stands_rad < bound - 0.01
    assert found.failure is not None and not found.undecided
    obeys_coulomb(contacts, load(found.stands_rad), standing(contacts, load(found.stands_rad)))
    goes_on_falling(contacts, load(found.fails_rad + 0.01), standing(contacts, load(found.fails_rad + 0.01)))


def test_what_stands_again_further_on_has_fallen_before() -> None:
    """It falls from 24° on, and on its side, at 90°, it would stand: the way there leads through the fall."""
    contacts, load, bound = random_case("solid_notched-3")
    found = largest_tilt(lambda t, s: standing(contacts, load(t), start=s), bound)
    assert standing(contacts, load(bound)).stands
    assert np.rad2deg(found.critical_rad) == pytest.approx(24.0, abs=0.3)


@pytest.mark.parametrize(
    ("kind", "blocks", "stands_deg", "falls_deg"), [("wall", 150, 23.1, 23.4), ("dome", 140, 24.7, 26.2)]
)
def test_large_structures_are_decided_close_to_the_tilt_at_which_they_fall(
    kind: str, blocks: int, stands_deg: float, falls_deg: float
) -> None:
    case = KINDS[kind](blocks)
    contacts = FrictionalContacts.of(case.pairs, case.points, case.normals, case.free, 0.6, about=case.centroids)
    upright, near, past = (case.wrenches(np.deg2rad(tilt)) for tilt in (0.0, stands_deg, falls_deg))
    obeys_coulomb(contacts, upright, standing(contacts, upright))
    obeys_coulomb(contacts, near, standing(contacts, near))
    found = standing(contacts, past)
    goes_on_falling(contacts, past, found)
    assert found.standing is Standing.STANDS_ONLY_CLAMPED and contacts.bound(past).stands


@pytest.mark.parametrize("ratio", [0.3, 3.0])
def test_tangential_stiffness_matters_little(ratio: float) -> None:
    made = pin(2, 1.0, 1.1)
    assert standing(made.contacts(0.5, tangential_ratio=ratio), made.load()).stands
    assert not standing(pin(2, 1.0, 0.9).contacts(0.5, tangential_ratio=ratio), pin(2, 1.0, 0.9).load()).stands


def obeys_coulomb(
    contacts: FrictionalContacts, wrenches: Array, found: FrictionVerdict, stiffness: float = 1e6
) -> None:
    """Assert from arrays alone that forces hold the load, and come of the displacements by Coulomb's law."""
    assert found.standing is Standing.STANDS
    balance = wrenches.copy()
    push = np.concatenate([found.forces, cross(contacts.points, found.forces)], axis=1)
    np.add.at(balance, contacts.pairs[:, 1], push)
    np.subtract.at(balance, contacts.pairs[:, 0], push)
    assert np.abs(balance[contacts.free]).max() <= 1e-7 * np.abs(wrenches).max()
    normal = np.einsum("cd,cd->c", found.forces, contacts.normals)
    friction = found.forces - normal[:, None] * contacts.normals
    strength, hard = np.linalg.norm(friction, axis=1), normal.max()
    assert (normal >= 0.0).all() and (strength <= contacts.friction * normal + 1e-9 * hard).all()
    moved = relative(contacts, found.displacements)
    far = np.abs(moved).max()
    gap = np.einsum("cd,cd->c", moved, contacts.normals)
    assert np.abs(np.minimum(gap, 0.0) * stiffness + normal).max() <= 1e-6 * hard
    slip = moved - gap[:, None] * contacts.normals + friction / stiffness
    assert np.abs(slip - found.slip).max() <= 1e-6 * far
    sliding = np.linalg.norm(slip, axis=1) > 1e-6 * far
    pressed = sliding & (normal > 1e-9 * hard)
    against = np.einsum("cd,cd->c", friction, slip)[pressed]
    full = (contacts.friction * normal * np.linalg.norm(slip, axis=1))[pressed]
    assert np.abs(against + full).max(initial=0.0) <= 1e-6 * hard * far


def goes_on_falling(contacts: FrictionalContacts, wrenches: Array, found: FrictionVerdict) -> None:
    """Assert from arrays alone that the load drives the motion against full friction, and that nothing is lifted."""
    assert found.standing in (Standing.FALLS, Standing.STANDS_ONLY_CLAMPED)
    rate = relative(contacts, found.motions)
    opening = np.einsum("cd,cd->c", rate, contacts.normals)
    normal = np.einsum("cd,cd->c", found.forces, contacts.normals)
    fastest = np.linalg.norm(rate, axis=1).max()
    pressed = normal > 1e-6 * normal.max()
    assert opening.min() >= -0.02 * fastest  # parts do not penetrate
    assert np.abs(opening[pressed]).max(initial=0.0) <= 0.02 * fastest  # what rubs is not lifted
    sliding = np.linalg.norm(rate - opening[:, None] * contacts.normals, axis=1)
    lost = float((contacts.friction * normal * sliding).sum())
    d = contacts.points.shape[1]
    about, turned = found.motions[:, :d], found.motions[:, d:]
    torque = wrenches[:, d:] - cross(contacts.about, wrenches[:, :d])
    gained = float((about * wrenches[:, :d]).sum() + (turned * torque).sum())
    assert gained > lost


def relative(contacts: FrictionalContacts, motions: Array) -> Array:
    """Return (C, d) how part j moves against part i at every contact point."""
    d = contacts.points.shape[1]
    out = []
    for side in (1, 0):
        part = contacts.pairs[:, side]
        arm, turn = contacts.points - contacts.about[part], motions[part, d:]
        turned = turn * np.stack([-arm[:, 1], arm[:, 0]], axis=1) if d == 2 else np.cross(turn, arm)
        out.append(motions[part, :d] + turned)
    return np.asarray(out[0] - out[1])


def test_a_tilt_that_cannot_be_decided_counts_as_failing_and_is_told() -> None:
    made = block(2, 1.0)
    contacts = made.contacts(0.3)

    def decide(tilt: float, start: Array | None) -> FrictionVerdict:
        found = standing(contacts, made.load(tilt), start=start)
        return replace(found, standing=Standing.UNDECIDED) if tilt > 0.2 else found

    found = largest_tilt(decide, 1.0, 1e-3)
    assert found.undecided and found.critical_rad == pytest.approx(0.2, abs=1e-3)
    assert (found.stands_rad, found.falls_rad) == (pytest.approx(0.2, abs=1e-3), 1.0)
