"""Contacts between outlines: closed forms, holes, numbering of a pair, invariances, near misses, overlaps."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.find import find_contacts

FRAME = [(0, 0), (6, 0), (6, 4), (0, 4)]
POCKET = [(1, 1), (5, 1), (5, 3), (1, 3)]
TABLE = [(0, 0), (6, 0), (6, 1), (0, 1)]
BRIDGE = [(1, 1), (2, 1), (2, 2), (4, 2), (4, 1), (5, 1), (5, 3), (1, 3)]
"""Two feet, so two contacts with the table on one edge."""
BYSTANDERS = {
    "rising": [(20, 0), (21, 1), (20, 2)],
    "falling": [(20, 5), (21, 4), (21, 5)],
    "square": [(-9, -9), (-8, -9), (-8, -8), (-9, -8)],
}


def turning(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def outline(corners: object, *holes: object) -> Polygon:
    return Polygon(np.array(corners, float), tuple(np.array(h, float) for h in holes))


def assembly(**shapes: Polygon) -> Assembly:
    return Assembly("test", tuple(Part(name, shape, fixed=k == 0) for k, (name, shape) in enumerate(shapes.items())))


def described(made: Assembly, names: tuple[str, str]) -> list[tuple[int, list[list[float]], list[float]]]:
    """Return number, corners and normal of every contact of one pair, in the order found."""
    contacts = find_contacts(made).contacts
    of_pair = [c for c in contacts if tuple(made.parts[p].name for p in c.parts) == names]
    return [(c.k, c.polygon.tolist(), c.normal.tolist()) for c in of_pair]


def only(made: Assembly) -> Contact:
    (contact,) = find_contacts(made).contacts
    return contact


def test_two_outlines_share_the_stretch_that_their_edges_have_in_common() -> None:
    contact = only(assembly(low=outline(TABLE), high=outline([(4, 1), (9, 1), (9, 2), (4, 2)])))
    assert contact.parts == (0, 1)
    assert contact.polygon.tolist() == [[6, 1], [4, 1]], "counter-clockwise along the earlier part"
    assert contact.normal.tolist() == [0, 1]
    assert contact.measure == 2.0
    assert contact.centre.tolist() == [5, 1]


def test_normals_point_from_the_earlier_into_the_later_part() -> None:
    low, high = outline(TABLE), outline([(0, 1), (1, 1), (1, 2), (0, 2)])
    assert only(assembly(low=low, high=high)).normal.tolist() == [0, 1]
    assert only(assembly(high=high, low=low)).normal.tolist() == [0, -1]


def test_a_part_in_a_hole_touches_all_sides_of_it() -> None:
    contacts = find_contacts(assembly(frame=outline(FRAME, POCKET), core=outline(POCKET))).contacts
    assert [c.k for c in contacts] == [0, 1, 2, 3]
    assert sorted(c.measure for c in contacts) == [2, 2, 4, 4]
    for contact in contacts:
        assert (contact.centre - [3, 2]) @ contact.normal < 0, "normals point out of the frame, into the core"


def test_corners_that_meet_are_no_contact() -> None:
    report = find_contacts(assembly(one=outline(TABLE), other=outline([(6, 1), (7, 1), (7, 2), (6, 2)])))
    assert (report.contacts, report.near_misses, report.overlaps) == ((), (), ())


def test_contacts_come_along_the_boundary_of_the_earlier_part() -> None:
    right, left = [[5, 1], [4, 1]], [[2, 1], [1, 1]]
    pair = described(assembly(table=outline(TABLE), bridge=outline(BRIDGE)), ("table", "bridge"))
    assert pair == [(0, right, [0, 1]), (1, left, [0, 1])], "the table's upper edge runs to the left"


@pytest.mark.parametrize("turn", [0.0, 0.4, 1.7, 3.0, -2.2])
def test_numbering_turns_with_the_parts(turn: float) -> None:
    back = turning(turn)
    turned = assembly(table=outline(np.array(TABLE) @ back.T), bridge=outline(np.array(BRIDGE) @ back.T))
    contacts = find_contacts(turned).contacts
    assert [c.k for c in contacts] == [0, 1]
    assert np.stack([c.polygon @ back for c in contacts]) == pytest.approx(
        np.array([[(5, 1), (4, 1)], [(2, 1), (1, 1)]])
    )


@pytest.mark.parametrize("before", [p for n in range(4) for p in permutations(BYSTANDERS, n)], ids="-".join)
def test_other_parts_leave_a_pair_as_it_is(before: tuple[str, ...]) -> None:
    alone = described(assembly(table=outline(TABLE), bridge=outline(BRIDGE)), ("table", "bridge"))
    others = {name: outline(BYSTANDERS[name]) for name in before}
    slab = outline([(-3, 1), (1, 1), (1, 3), (-3, 3)])
    among = assembly(**others, table=outline(TABLE), bridge=outline(BRIDGE), slab=slab)
    assert described(among, ("table", "bridge")) == alone


@pytest.mark.parametrize("angle", np.linspace(0.0, 2 * np.pi, 9).tolist())
def test_a_contact_found_earlier_swaps_no_numbers_of_another_pair(angle: float) -> None:
    pair = {"table": outline(TABLE), "bridge": outline(BRIDGE)}
    low, high = (outline(np.array([(x, y + up) for x, y in TABLE]) @ turning(angle).T + (30, 0)) for up in (0, 1))
    made = assembly(low=low, high=high, **pair)
    assert len(described(made, ("low", "high"))) == 1
    assert described(made, ("table", "bridge")) == described(assembly(**pair), ("table", "bridge"))


def test_names_decide_nothing() -> None:
    shapes = [outline(TABLE), outline(BRIDGE), outline([(2, 1), (4, 1), (4, 2), (2, 2)])]

    def found(*names: str) -> list[tuple[tuple[int, int], int, list[list[float]]]]:
        contacts = find_contacts(assembly(**dict(zip(names, shapes)))).contacts
        return [(c.parts, c.k, c.polygon.tolist()) for c in contacts]

    assert found("a", "b", "c") == found("z", "y", "x") == found("m", "a", "z")
    assert len(found("a", "b", "c")) == 6


def test_a_gap_within_the_tolerance_touches_and_a_wider_one_is_a_near_miss() -> None:
    def lifted(gap: float) -> Assembly:
        return assembly(low=outline(TABLE), high=outline([(0, 1 + gap), (2, 1 + gap), (2, 2), (0, 2)]))

    size = lifted(0.0).size
    assert len(find_contacts(lifted(0.5e-5 * size)).contacts) == 1
    report = find_contacts(lifted(1e-3 * size))
    (miss,) = report.near_misses
    assert (report.contacts, miss.parts) == ((), ("low", "high"))
    assert (miss.gap_m, miss.extent) == (pytest.approx(1e-3 * size), pytest.approx(2.0))
    assert find_contacts(lifted(1e-2 * size)).near_misses == ()


def test_edges_that_lean_towards_each_other_are_no_near_miss() -> None:
    wedge = outline([(0, 1.005), (0.1, 1.02), (0.1, 2), (0, 2)])
    report = find_contacts(assembly(low=outline(TABLE), high=wedge))
    assert (report.contacts, report.near_misses) == ((), ())


@pytest.mark.parametrize("depth", [1e-3, 0.1, 0.4])
def test_overlaps_are_told_with_their_depth(depth: float) -> None:
    sunk = outline([(1, 1 - depth), (5, 1 - depth), (5, 3), (1, 3)])
    report = find_contacts(assembly(low=outline(TABLE), high=sunk))
    (overlap,) = report.overlaps
    assert overlap.parts == ("low", "high")
    assert overlap.depth_m == pytest.approx(depth, rel=0.02)


def test_a_part_within_another_overlaps_it() -> None:
    (overlap,) = find_contacts(assembly(solid=outline(FRAME), core=outline(POCKET))).overlaps
    assert overlap.depth_m == pytest.approx(2.0, rel=0.02)
