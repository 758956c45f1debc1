"""Built solids: closed, exact, shared bit for bit, whatever lies on whose edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from solids import box, dome, hexahedron, rotation, wall

from mocca_robot.assembly import Assembly, Lateral, Mesh, Part
from mocca_robot.contacts.contact import Contact, ContactReport
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.joints.bicubic import bicubic_joint, largest_rectangle
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.build3d import build_parts_3d, joints_to_cut
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.verdicts.verification import verify


def tilted(assembly: Assembly) -> Assembly:
    turn = rotation(5)
    return assembly.with_shapes(
        [Mesh(p.shape.vertices @ turn.T + [1.0, -2.0, 0.5], p.shape.faces) for p in assembly.parts]
    )


def notched() -> Assembly:
    """Two blocks that meet in two planes and a third one in the corner: several contacts per pair, T-junctions."""
    low = box((0, 0, 0), (1, 1, 0.3))
    step = box((0, 0, 0.3), (0.5, 1, 0.6))
    ell = trimesh.Trimesh(*_arrays(low)).union(trimesh.Trimesh(*_arrays(step)))
    return Assembly(
        "notched",
        (
            Part("ell", Mesh(np.round(ell.vertices, 6), ell.faces), fixed=True),
            Part("corner", box((0.5, 0, 0.3), (1, 0.6, 0.6))),
            Part("rest", box((0.5, 0.6, 0.3), (1, 1, 0.7))),
        ),
    )


def _arrays(mesh: Mesh):
    return np.array(mesh.vertices), np.array(mesh.faces)


def curved_joints(assembly: Assembly, seed: int = 0) -> list[Joint]:
    rng = np.random.default_rng(seed)
    joints = []
    for contact in find_contacts(assembly).contacts:
        rectangle = largest_rectangle(contact, 0.1 * np.sqrt(contact.measure))
        u = contact.normal + rng.uniform(-0.1, 0.1) * rectangle.axis_x + rng.uniform(-0.1, 0.1) * rectangle.axis_y
        joints.append(bicubic_joint(contact, rectangle, rng.choice([-0.1, 0.1]) * rectangle.l2, u))
    return joints


CASES = {"wall": wall(), "tilted wall": tilted(wall()), "dome": dome(), "notched": notched()}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("kind", ["planar", "curved"])
def test_every_part_is_a_closed_solid_and_volume_is_conserved(name, kind):
    assembly = CASES[name]
    graph = PartsGraph.of(assembly)
    joints = curved_joints(assembly) if kind == "curved" else graph.joints
    built = build_parts(assembly, joints)
    for part in built.parts:
        mesh = trimesh.Trimesh(*_arrays(part.shape), process=False)
        assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
        assert mesh.area_faces.min() > 1e-12
        edges = np.sort(mesh.edges, axis=1)
        assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    before, after = (sum(p.shape.volume for p in a.parts) for a in (assembly, built))
    assert after == pytest.approx(before, rel=1e-12)
    if kind == "planar":
        for old, new in zip(assembly.parts, built.parts):
            assert new.shape.volume == pytest.approx(old.shape.volume, rel=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_neighbours_share_the_same_triangles_bit_for_bit(name):
    assembly = CASES[name]
    joints = curved_joints(assembly, 3)
    built = build_parts_3d(assembly, joints)

    def triangles(part: int, sense: int) -> set[frozenset[tuple[float, ...]]]:
        mesh = built.parts[part].shape
        corners = mesh.vertices[mesh.faces[:, ::sense]]
        rolled = [np.roll(c, -int(np.lexsort(c.T[::-1])[0]), axis=0) for c in corners]
        return {tuple(map(tuple, c)) for c in rolled}

    for i, j in {joint.contact.parts for joint in joints}:
        area = sum(
            np.linalg.norm(np.cross(np.subtract(b, a), np.subtract(c, a))) / 2
            for a, b, c in triangles(i, 1) & triangles(j, -1)
        )
        corners = [joint.vertices[joint.facets] for joint in joints if joint.contact.parts == (i, j)]
        wanted = sum(np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]), axis=1).sum() / 2 for c in corners)
        assert area == pytest.approx(wanted, rel=1e-9)


def test_contacts_found_again_are_the_joints_surfaces():
    assembly = wall(2, 2)
    joints = curved_joints(assembly)
    found = find_contacts(build_parts_3d(assembly, joints))
    assert not found.overlaps and not found.near_misses
    for pair in {j.contact.parts for j in joints}:
        again = np.sum([c.measure * c.normal for c in found.contacts if c.parts == pair], axis=0)
        before = np.sum([j.contact.measure * j.contact.normal for j in joints if j.contact.parts == pair], axis=0)
        assert again == pytest.approx(before, abs=1e-12), "same boundary, same vector area"
    flattest = min(float(j.facet_normals @ j.contact.normal @ np.ones(len(j.facets)) / len(j.facets)) for j in joints)
    assert flattest < 0.999, "the joints are curved"


def test_a_sloppy_input_is_welded_shut():
    exact = wall(2, 2)
    rng = np.random.default_rng(4)
    sloppy = exact.with_shapes(
        [Mesh(p.shape.vertices + rng.uniform(-1, 1, p.shape.vertices.shape) * 2e-7, p.shape.faces) for p in exact.parts]
    )
    built = build_parts_3d(sloppy, PartsGraph.of(sloppy).joints)
    again = find_contacts(built)
    assert len(again.contacts) >= len(find_contacts(exact).contacts) and not again.overlaps
    total = sum(p.shape.volume for p in built.parts)
    assert total == pytest.approx(sum(p.shape.volume for p in exact.parts), rel=1e-4)


def test_a_contact_that_is_not_on_its_part_is_refused_by_name():
    assembly = wall(1, 1)
    contact = find_contacts(assembly).contacts[0]
    moved = Contact(contact.parts, contact.polygon + np.array([0.15, 0.0, 0.0]), contact.normal)
    with pytest.raises(InputError, match="b00"):
        build_parts_3d(assembly, [planar(moved)])


def test_a_block_enclosed_by_one_face_leaves_a_ring_around_it():
    post = hexahedron(
        np.array([[x, y, z] for z in (0.0, 0.4) for x, y in ((-0.1, -0.1), (0.1, -0.1), (0.2, 0.2), (-0.1, 0.1))])
    )
    assembly = Assembly("post", (Part("slab", box((-1, -1, -0.2), (1, 1, 0)), fixed=True), Part("post", post)))
    (contact,) = find_contacts(assembly).contacts
    built = build_parts_3d(assembly, [bicubic_joint(contact, largest_rectangle(contact, 0.02), -0.05, contact.normal)])
    assert all(trimesh.Trimesh(*_arrays(p.shape), process=False).is_watertight for p in built.parts)
    assert built.parts[0].shape.volume < assembly.parts[0].shape.volume


@pytest.mark.parametrize("cells", [[(0, 0), (1, 1)], [(0, 0), (0, 1), (1, 0)], [(0, 0), (1, 1), (2, 0), (1, -1)]])
def test_contacts_that_touch_in_a_corner_or_enclose_a_gap(cells):
    parts = [Part("slab", box((0, -1, -0.2), (3, 2, 0)), fixed=True)]
    parts += [Part(f"b{x}{y}", box((x, y, 0), (x + 1, y + 1, 0.5))) for x, y in cells]
    assembly = Assembly("checkers", tuple(parts))
    built = build_parts_3d(assembly, curved_joints(assembly))
    assert all(trimesh.Trimesh(*_arrays(p.shape), process=False).is_watertight for p in built.parts)
    assert sum(p.shape.volume for p in built.parts) == pytest.approx(1.8 + 0.5 * len(cells), rel=1e-12)
    assert not find_contacts(built).overlaps


def with_one_that_overlaps() -> tuple[Assembly, ContactReport, Contact]:
    """Return a wall, and its contacts with a further one that lies inside another."""
    assembly = wall(2, 2)
    report = find_contacts(assembly)
    under = next(c for c in report.contacts if assembly.parts[c.parts[1]].name == "b00")
    inside = replace(under, polygon=under.centre + 0.5 * (under.polygon - under.centre), k=1)
    return assembly, replace(report, contacts=(*report.contacts, inside)), inside


def test_a_contact_that_cannot_be_cut_is_found_and_leaves_no_trace() -> None:
    assembly, report, inside = with_one_that_overlaps()
    usable = joints_to_cut(assembly, tuple(planar(c) for c in report.contacts))
    assert [c for c, good in zip(report.contacts, usable) if not good] == [inside]
    built = build_parts(assembly, [planar(c) for c in report.contacts])
    assert [p.shape.volume for p in built.parts] == pytest.approx([p.shape.volume for p in assembly.parts])


def test_a_design_goes_on_around_a_contact_that_cannot_be_cut() -> None:
    from planners.cone_joints.designer import contacts_left_planar, design

    assembly, report, _ = with_one_that_overlaps()
    assembly = replace(assembly, goals=(Lateral(np.deg2rad(3.0), 2),), alpha_rad=None)
    (said,) = contacts_left_planar(assembly, report)
    assert "'slab' and 'b00' stays planar" in said
    found = design(assembly, JointOptions(), contacts=report)
    assert said in found.design.notes
    assert sum(j.kind != "planar" for j in found.design.joints) > 0
    assert verify(found.design.assembly).part_overlap < 1e-6
