"""Contacts between polyhedra: closed forms, partial overlaps, T-junctions, holes, invariances, what nearly touches."""

from __future__ import annotations

import numpy as np
import pytest
from solids import box, rotation

from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.errors import InputError
from mocca_robot.generators import generate
from mocca_robot.geometry.facets import facets
from mocca_robot.joints.bicubic import bicubic_joint, largest_rectangle
from mocca_robot.joints.build import build_parts


def assembly(*meshes: Mesh) -> Assembly:
    return Assembly("test", tuple(Part(f"p{k}", m, fixed=k == 0) for k, m in enumerate(meshes)))


def vector_area(contact) -> np.ndarray:
    rings = (contact.polygon, *contact.holes)
    return sum(0.5 * np.cross(r - r[0], np.roll(r, -1, axis=0) - r[0]).sum(axis=0) for r in rings)


def prism(outline: np.ndarray, z0: float, z1: float) -> Mesh:
    import manifold3d

    rings = [outline] if isinstance(outline, np.ndarray) else outline
    body = manifold3d.Manifold.extrude(manifold3d.CrossSection(rings), z1 - z0).translate((0, 0, z0))
    mesh = body.to_mesh64()
    return Mesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts))


def test_two_boxes_share_the_overlap_of_their_faces():
    report = find_contacts(assembly(box((0, 0, 0), (2, 1, 1)), box((0.5, -1, 1), (3, 0.25, 2))))
    (contact,) = report.contacts
    assert contact.parts == (0, 1)
    assert contact.normal == pytest.approx([0, 0, 1])
    assert {tuple(p) for p in contact.polygon} == {(0.5, 0, 1), (2, 0, 1), (2, 0.25, 1), (0.5, 0.25, 1)}
    assert vector_area(contact) == pytest.approx([0, 0, 1.5 * 0.25])
    assert contact.measure == pytest.approx(1.5 * 0.25)


def test_normals_point_from_the_earlier_into_the_later_part():
    low, high = box((0, 0, 0), (1, 1, 1)), box((0, 0, 1), (1, 1, 2))
    assert find_contacts(assembly(low, high)).contacts[0].normal @ [0, 0, 1] == pytest.approx(1)
    assert find_contacts(assembly(high, low)).contacts[0].normal @ [0, 0, 1] == pytest.approx(-1)


def test_other_parts_swap_no_numbers_of_a_pair():
    """A table and a bridge with many feet on one face, alone and behind parts that change how the search runs."""
    table = box((0, 0, 0), (8, 2, 1))
    feet = [((x, 1), (x + 0.5, 1), (x + 0.5, 2), (x + 1, 2)) for x in range(8)]
    outline = np.array([*(corner for foot in feet for corner in foot), (8, 3), (0, 3)])
    bridge = prism(outline.astype(float), 0, 2)
    bridge = Mesh(bridge.vertices[:, [0, 2, 1]], bridge.faces[:, ::-1])

    def numbered(*others: Mesh) -> list[tuple[int, list[list[float]]]]:
        contacts = find_contacts(assembly(*others, table, bridge)).contacts
        return [(c.k, c.polygon.tolist()) for c in contacts if c.parts == (len(others), len(others) + 1)]

    alone = numbered()
    assert [k for k, _ in alone] == list(range(8))
    for count in range(1, 30, 4):
        tower = [box((20, 0, 9.0 * k), (21, 1, 9.0 * k + 1)) for k in range(count)]
        assert numbered(*tower) == alone
        assert numbered(*(Mesh(t.vertices[:, [2, 0, 1]], t.faces) for t in tower)) == alone


def test_an_ell_gives_two_contacts_and_a_non_convex_one():
    ell = prism(np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], float), 0, 1)
    report = find_contacts(assembly(ell, box((1, 1, 0), (2, 2, 1)), box((0, 0, 1), (3, 3, 2))))
    pairs = [c.parts for c in report.contacts]
    assert pairs == [(0, 1), (0, 1), (0, 2), (1, 2)]
    assert [c.k for c in report.contacts] == [0, 1, 0, 0]
    top = report.contacts[2]
    assert len(top.polygon) == 6
    assert top.measure == pytest.approx(5.0)


def test_a_contact_around_a_hole_keeps_the_hole():
    square = np.array([[-2, -2], [2, -2], [2, 2], [-2, 2]], float)
    ring = prism([square, 0.5 * square[::-1]], 0, 1)
    report = find_contacts(assembly(ring, box((-2, -2, 1), (2, 2, 2))))
    (contact,) = report.contacts
    assert contact.measure == pytest.approx(12.0)
    assert len(contact.holes) == 1
    assert vector_area(contact) == pytest.approx([0, 0, 12.0])


def test_corners_are_those_of_the_meshes_bit_for_bit():
    a = generate("dome", {"blocks": [9, 8, 7, 5], "snap": 0.2})
    contacts = find_contacts(a).contacts
    for contact in contacts:
        i, j = (a.parts[p].shape.vertices for p in contact.parts)
        known = {tuple(v) for v in np.concatenate([i, j])}
        assert all(tuple(p) in known for p in contact.polygon)
        assert vector_area(contact) @ contact.normal == pytest.approx(contact.measure)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 50.0])
def test_contacts_do_not_depend_on_pose_and_scale(scale):
    a = generate("dome", {"blocks": [9, 8, 7, 5], "key_lean_deg": 10, "door_deg": 40, "door_rings": 1})
    turn = rotation(3)
    moved = a.with_shapes([Mesh(scale * (p.shape.vertices @ turn.T + [3, -1, 2]), p.shape.faces) for p in a.parts])
    before, after = find_contacts(a).contacts, find_contacts(moved).contacts
    assert [c.parts for c in before] == [c.parts for c in after]
    for x, y in zip(before, after):
        assert y.measure == pytest.approx(scale**2 * x.measure, rel=1e-6)
        assert y.normal == pytest.approx(turn @ x.normal, abs=1e-6)


def test_digits_lost_in_a_file_do_not_lose_contacts():
    a = generate("dome", {"blocks": [9, 8, 7, 5]})
    rounded = a.with_shapes([Mesh(np.round(p.shape.vertices, 6), p.shape.faces) for p in a.parts])
    noisy = np.random.default_rng(0)
    shaken = a.with_shapes(
        [Mesh(p.shape.vertices + noisy.uniform(-1e-6, 1e-6, p.shape.vertices.shape), p.shape.faces) for p in a.parts]
    )
    exact = {c.parts: c.measure for c in find_contacts(a).contacts}
    for other in (rounded, shaken):
        report = find_contacts(other)
        area: dict = {}
        for c in report.contacts:
            area[c.parts] = area.get(c.parts, 0.0) + c.measure
        assert area.keys() == exact.keys()
        assert all(area[k] == pytest.approx(exact[k], rel=1e-3) for k in exact)
        assert not report.overlaps


def test_built_joints_are_found_again_triangle_by_triangle():
    a = generate("wall", {"courses": 3, "columns": 2})
    before = find_contacts(a).contacts
    joints = []
    for contact in before:
        rectangle = largest_rectangle(contact, 0.01)
        joints.append(bicubic_joint(contact, rectangle, 0.2 * rectangle.l2, contact.normal))
    report = find_contacts(build_parts(a, joints))
    assert not report.overlaps
    assert len(report.contacts) > 50 * len(before)
    for contact in before:
        mine = [c for c in report.contacts if c.parts == contact.parts]
        # Same boundary, same vector area; more area.
        total = sum(vector_area(c) for c in mine)
        assert total == pytest.approx(contact.measure * contact.normal, abs=1e-9)
        assert sum(c.measure for c in mine) > contact.measure


def test_near_misses_and_overlaps_are_named():
    base = box((0, 0, 0), (1, 1, 1))
    near = find_contacts(assembly(base, box((0, 0, 1.002), (1, 1, 2))))
    assert not near.contacts
    (miss,) = near.near_misses
    assert miss.parts == ("p0", "p1")
    assert miss.gap_m == pytest.approx(0.002)
    with pytest.raises(InputError, match=r"'p1' floats free.*2 mm"):
        require_sound(assembly(base, box((0, 0, 1.002), (1, 1, 2))), near)

    deep = assembly(base, box((0.2, 0.2, 0.97), (0.8, 0.8, 2)))
    (overlap,) = find_contacts(deep).overlaps
    assert overlap.parts == ("p0", "p1")
    assert overlap.depth_m == pytest.approx(0.03, rel=1e-6)
    with pytest.raises(InputError, match="overlap by 30 mm"):
        require_sound(deep, find_contacts(deep))


def test_parts_that_share_an_edge_only_have_no_contact():
    report = find_contacts(assembly(box((0, 0, 0), (1, 1, 1)), box((1, 0, 1), (2, 1, 2))))
    assert not report.contacts
    assert not report.overlaps


def test_facets_are_the_faces_that_a_person_counts():
    assert len(facets([box((0, 0, 0), (1, 2, 3))], 1e-6).count) == 6
    ell = prism(np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], float), 0, 1)
    found = facets([ell], 1e-6)
    assert len(found.count) == 8
    assert np.linalg.norm(found.normals, axis=1) == pytest.approx(np.ones(8))
