"""Families of solid joints: the surfaces that designing sees are those that are built, read back, held and let go."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from solids import box, flat_contact

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Part
from mocca_robot.contacts.find import find_contacts
from mocca_robot.design import Design
from mocca_robot.files.design_json import read_design, write_design
from mocca_robot.files.stored_joints import joints_of
from mocca_robot.joints.bicubic import bicubic_joint
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.families.heights import Heights
from mocca_robot.joints.families.known import family_named, further_families
from mocca_robot.joints.families.outline import OutlineFrustum
from mocca_robot.joints.families.ring import CORNERS, ring_of, round_ring
from mocca_robot.joints.families.sites import JointSite
from mocca_robot.joints.options import FURTHER, JointOptions
from mocca_robot.joints.rectangle import largest_rectangle
from mocca_robot.motion.parts_graph import PartsGraph
from planners.cone_joints.designer import joint_contacts, joint_shapes, start_axes
from planners.cone_joints.shapes3d import Shapes3D

DRAWN = JointOptions(profile=((0.2, 1.0, 0.2), (-0.4, 0.6, -0.4)))
FAMILIES = ("n", "frustum", *further_families(JointOptions()), "heights_3", "heights_4", "drawn")
UP = np.array([0.0, 0.0, 1.0])


def pile() -> Assembly:
    """Return two blocks side by side on a base: three contacts, two of them on one plane."""
    parts = (
        Part("base", box((0, 0, 0), (1, 1, 1)), fixed=True),
        Part("left", box((0, 0, 1), (0.5, 1, 2))),
        Part("right", box((0.5, 0, 1), (1, 1, 2))),
    )
    return Assembly("pile", parts)


def shapes_of(names: tuple[str, ...], options: JointOptions = DRAWN, assembly: Assembly | None = None) -> Shapes3D:
    """Return the joints of an assembly, of these families in turn."""
    assembly = assembly or pile()
    graph = PartsGraph.of(assembly, joint_contacts(assembly, find_contacts(assembly)))
    shapes = joint_shapes(graph, options, start_axes(graph))
    assert isinstance(shapes, Shapes3D)
    numbers = max(max(family_named(n, options).heights) for n in names) + 1
    kinds = [names[e % len(names)] for e in range(len(shapes.kinds))]
    return replace(shapes, numbers=max(2, numbers)).with_kinds(kinds)


def some_rows(shapes: Shapes3D, seed: int = 0) -> Array:
    """Return rows within their bounds, heights of either sign."""
    low, top = shapes.bounds()
    rows = np.random.default_rng(seed).uniform(-0.15, 0.15, low.shape)
    rows = np.clip(rows, low, top)
    rows[:, 1] = 0.4 * low[:, 1] + 0.6 * top[:, 1]
    return rows


@pytest.mark.parametrize("pieces", [False, True])
@pytest.mark.parametrize(
    "names", [*((n,) for n in FAMILIES), ("n", "outline", "free"), ("frustum", "heights_4", "rib")]
)
def test_what_designing_sees_is_what_is_built(names: tuple[str, ...], pieces: bool) -> None:
    shapes = shapes_of(names, replace(DRAWN, piecewise_planar=pieces))
    rows = some_rows(shapes)
    u = shapes.directions(np.full((len(shapes.pair_normal), 2), 0.05))
    surface = shapes.surface(rows, u)
    _, told = shapes.rays(surface)
    points, every = shapes.all_rays(surface)
    volume, moment = shapes.transferred(surface)
    for e in range(len(rows)):
        joint = shapes.joint(e, rows[e], u[e])
        assert not joint.is_planar
        apart = np.abs(joint.facet_normals[:, None] - every[e]).sum(axis=2)
        assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-8
        assert np.abs(told[e][:, None] - every[e]).sum(axis=2).min(axis=1).max() < 1e-9, "rays that no facet has"
        away = np.abs(joint.vertices[:, None] - points[e]).sum(axis=2).min(axis=1)
        assert away.max() < 1e-9
        a, b, c = (joint.vertices[joint.facets[:, k]] - joint.contact.centre for k in range(3))
        six_v = np.einsum("fd,fd->f", a, np.cross(b, c))
        assert volume[e] == pytest.approx(six_v.sum() / 6.0, abs=1e-12)
        first = (six_v[:, None] * (a + b + c)).sum(axis=0) / 24.0 + volume[e] * joint.contact.centre
        np.testing.assert_allclose(moment[e], first, atol=1e-12)


@pytest.mark.parametrize("name", FAMILIES)
def test_motion_cones_are_those_of_sampled_normals_and_open_along_the_way_out(name: str) -> None:
    shapes = shapes_of((name,))
    rows = some_rows(shapes, 1)
    u = shapes.directions(np.zeros((len(shapes.pair_normal), 2)))
    rng = np.random.default_rng(2)
    for e in range(len(rows)):
        joint = shapes.joint(e, rows[e], u[e])
        cone = joint.motion_cone()
        assert cone.contains(np.array([*u[e], 0.0, 0.0, 0.0])), "a height field leaves along its direction"
        # Points all over the facets, each with the normal of the surface there, by differences of its own corners.
        corners = joint.vertices[joint.facets]
        weights = rng.dirichlet(np.ones(3), (4, len(corners)))
        at = np.einsum("sfk,fkd->sfd", weights, corners)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        moved = rng.standard_normal((400, 6))
        moved[:, :3] += 2.0 * u[e]
        speed = moved[:, None, None, :3] + np.cross(moved[:, None, None, 3:], at[None])
        apart = np.einsum("msfd,fd->msf", speed, normals / np.linalg.norm(normals, axis=1)[:, None])
        allowed = apart.reshape(len(moved), -1).min(axis=1)
        inside = np.array([cone.contains(v) for v in moved])
        assert inside.any() and not inside.all()
        assert (allowed[inside] >= -1e-9).all(), "the cone allows what a sampled normal forbids"
        # The facets' corners bound all their points: what every sample clearly allows is nearly in the cone.
        assert inside[allowed > 0.5].all()


@pytest.mark.parametrize("name", [n for n in FAMILIES if n not in ("n", "frustum")])
def test_every_family_comes_back_from_its_file(name: str, tmp_path: Path) -> None:
    shapes = shapes_of((name,))
    u = shapes.directions(np.full((len(shapes.pair_normal), 2), -0.04))
    joints = tuple(shapes.joint(e, row, u[e]) for e, row in enumerate(some_rows(shapes, 3)))
    source = pile()
    design = Design(source=source, assembly=build_parts(source, joints), joints=joints, insertion=(), load_cases=())
    stored = read_design(write_design(design, tmp_path))
    assert stored.source is not None
    for mine, again in zip(joints, joints_of(stored, find_contacts(stored.source).contacts)):
        assert again.kind == mine.kind == name and again.parameters == mine.parameters
        np.testing.assert_allclose(again.vertices, mine.vertices, atol=1e-12)
        np.testing.assert_array_equal(again.facets, mine.facets)


@pytest.mark.parametrize("name", FAMILIES)
def test_joints_keep_to_their_room_slope_and_radius(name: str) -> None:
    """Whatever a row says, constraints tell when the surface leaves its room or bends more than the tool can."""
    options = replace(DRAWN, min_radius=0.01)
    shapes = shapes_of((name,), options)
    rows = some_rows(shapes, 4)
    u = shapes.directions(np.zeros((len(shapes.pair_normal), 2)))
    room, radius = np.split(shapes.violations(shapes.surface(rows, u), rows), [2], axis=1)
    assert (room <= 0.0).all()
    family = family_named(name, options)
    if not family.sharp:
        steeper = rows.copy()
        steeper[:, list(family.heights)] *= 40.0
        more = shapes.violations(shapes.surface(steeper, u), steeper)[:, 2]
        assert (more > radius[:, 0]).all() and more.max() > 0.0
    assert further_families(options) == tuple(n for n in further_families(DRAWN) if n != "outline")


def test_four_equal_heights_are_the_plain_bump() -> None:
    contact = flat_contact([(0, 0), (0.3, 0), (0.3, 0.2), (0, 0.2)])
    rectangle = largest_rectangle(contact, 0.01)
    assert rectangle is not None
    free = Heights(2).joint(JointSite(contact, rectangle, 0.01), Heights(2).row(np.full(4, 0.2)), UP)
    plain = bicubic_joint(contact, rectangle, 0.2 * rectangle.l2, UP)
    distance = np.abs(plain.vertices[:, None] - free.vertices).sum(axis=2).min(axis=1)
    assert distance.max() < 1e-12


@pytest.mark.parametrize("direction", ["saddle", "z_x", "z_y"])
def test_the_four_heights_make_saddles_and_z_in_both_directions(direction: str) -> None:
    signs = {"saddle": (1, -1, -1, 1), "z_x": (1, -1, 1, -1), "z_y": (1, 1, -1, -1)}[direction]
    contact = flat_contact([(0, 0), (0.3, 0), (0.3, 0.3), (0, 0.3)])
    rectangle = largest_rectangle(contact, 0.01)
    assert rectangle is not None
    joint = Heights(2).joint(JointSite(contact, rectangle, 0.01), Heights(2).row(0.1 * np.array(signs)), UP)
    height = (joint.vertices - contact.centre) @ UP
    local = (joint.vertices - contact.centre) @ np.stack([rectangle.axis_x, rectangle.axis_y], axis=1)
    for x in (0, 1):
        for y in (0, 1):
            mine = (local[:, 0] * (2 * x - 1) > 1e-6) & (local[:, 1] * (2 * y - 1) > 1e-6)
            assert signs[2 * y + x] * height[mine].sum() > 0.0


def test_an_outline_is_followed_and_where_it_cannot_be_a_round_one_stands_in_the_rectangle() -> None:
    triangle = flat_contact([(0, 0), (0.4, 0), (0.2, 0.3)])
    rectangle = largest_rectangle(triangle, 0.01)
    assert rectangle is not None
    site = JointSite(triangle, rectangle, 0.01)
    joint = OutlineFrustum().joint(site, np.array([0.2, 0.3]), UP)
    ring = joint.vertices[3 : 3 + CORNERS, :2]
    area = 0.5 * np.abs(np.sum(ring[:, 0] * np.roll(ring[:, 1], -1) - ring[:, 1] * np.roll(ring[:, 0], -1)))
    assert area > 1.6 * rectangle.area, "a triangle's rectangle has at most half of its area"
    slopes = np.unique(np.round(joint.facet_normals @ UP, 6))
    assert len(slopes) <= 4, "one slope per side, and flat"
    comb = [(0, 0), (0.4, 0), (0.4, 0.3), (0.22, 0.3), (0.22, 0.1), (0.2, 0.1), (0.2, 0.3), (0, 0.3)]
    bent = flat_contact(comb)
    rectangle = largest_rectangle(bent, 0.005)
    assert rectangle is not None
    np.testing.assert_array_equal(ring_of(bent, rectangle, 0.005), round_ring())


def test_kinds_decide_what_is_tried() -> None:
    assert further_families(JointOptions(kinds=("n", "frustum"))) == ()
    assert further_families(JointOptions(kinds=("rib",))) == ("rib", "rib_across")
    assert further_families(JointOptions(kinds=("free", "heights"), control_heights=2)) == ("free",)
    assert set(FURTHER) - set(JointOptions().kinds) == {"heights"}
