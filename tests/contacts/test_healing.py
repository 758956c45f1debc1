"""Parts that nearly touch: what a tolerance accepts, and copies whose neighbours share their faces exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from solids import box, dome, rotation, wall

from mocca_robot.assembly import Assembly, Mesh, Part, Polygon
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.contacts.find import find_contacts, require_exact, require_sound
from mocca_robot.contacts.healing import heal
from mocca_robot.errors import InputError, NearlyTouching
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.joint import planar
from mocca_robot.tolerances import Tolerances

SHARE = 2e-4
STRICT = Tolerances(contact_gap=1e-10)
"""Faces that touch by this are the same plane; what corners share beside edges stays within the usual rounding."""
MODES = ("grown", "sized", "shifted", "jittered")


def arch(stones: int = 7) -> Assembly:
    """Return a half ring of flat stones over a slab."""
    parts = [Part("slab", Polygon(np.array([[-1.5, -0.2], [1.5, -0.2], [1.5, 0.0], [-1.5, 0.0]])), fixed=True)]
    turn = np.linspace(0.0, np.pi, stones + 1)
    for k in range(stones):
        rim = [
            [r * np.cos(a), r * np.sin(a)]
            for r, a in zip((1, 1.3, 1.3, 1), (turn[k], turn[k], turn[k + 1], turn[k + 1]))
        ]
        parts.append(Part(f"s{k}", Polygon(np.array(rim))))
    return Assembly("arch", tuple(parts))


def igloo() -> Assembly:
    """Return a dome whose lowest ring is one rigid part of many bodies."""
    whole = dome(3, 9)
    ring = [p.shape for p in whole.parts if p.fixed and isinstance(p.shape, Mesh)]
    offset = np.cumsum([0] + [len(m.vertices) for m in ring])
    boundary = Mesh(
        np.concatenate([m.vertices for m in ring]), np.concatenate([m.faces + o for m, o in zip(ring, offset)])
    )
    return Assembly("igloo", (Part("boundary", boundary, fixed=True), *(p for p in whole.parts if not p.fixed)))


def voxels() -> Assembly:
    """Return a puzzle of 3 × 3 × 2 unit cubes, in five parts of one to six."""
    cells = {"base": [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (0, 2, 0), (1, 2, 0)], "b": [(1, 1, 0), (2, 1, 0)]}
    cells |= {"c": [(2, 2, 0)], "d": [(0, 0, 1), (0, 1, 1)], "e": [(1, 1, 1), (1, 0, 1), (2, 1, 1)]}
    parts = []
    for name, mine in cells.items():
        whole = sum(
            (_solid(box(c, (c[0] + 1, c[1] + 1, c[2] + 1))) for c in mine[1:]), start=_solid(box(*_unit(mine[0])))
        )
        mesh = whole.to_mesh64()
        shape = Mesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, dtype=np.int64))
        parts.append(Part(name, shape, fixed=name == "base"))
    return Assembly("voxels", tuple(parts))


def _unit(cell: tuple[int, int, int]) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    return cell, (cell[0] + 1, cell[1] + 1, cell[2] + 1)


def _solid(mesh: Mesh):  # type: ignore[no-untyped-def]
    from mocca_robot.contacts.penetration import solid

    return solid(mesh)


def disturbed(assembly: Assembly, mode: str, seed: int, share: float = SHARE) -> Assembly:
    """Return an assembly as sloppy drawing leaves it: parts too large, of uneven size, shifted, or every corner off."""
    rng = np.random.default_rng(seed)
    shapes = []
    for part in assembly.parts:
        shape = part.shape
        points = shape.vertices if isinstance(shape, Mesh) else shape.exterior
        middle, size = points.mean(axis=0), float(np.linalg.norm(np.ptp(points, axis=0)))
        if mode == "grown":
            points = middle + (points - middle) * (1.0 + share)
        elif mode == "sized":
            points = middle + (points - middle) * (1.0 + share * rng.uniform(-1, 1))
        elif mode == "shifted":
            points = points + 0.5 * share * size * rng.uniform(-1, 1, points.shape[1])
        else:
            points = points + 0.25 * share * size * rng.uniform(-1, 1, points.shape)
        shapes.append(Mesh(points, shape.faces) if isinstance(shape, Mesh) else Polygon(points))
    return assembly.with_shapes(shapes)


def within(assembly: Assembly, tolerance: float) -> Assembly:
    return replace(assembly, tolerance_m=tolerance)


def pairs(report: ContactReport) -> set[tuple[int, int]]:
    return {c.parts for c in report.contacts}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("make", [wall, lambda: dome(3, 9), igloo, voxels, arch])
def test_neighbours_share_faces_exactly_after_healing(make, mode):  # type: ignore[no-untyped-def]
    exact = make()
    # A ring of one part is longer than each of the blocks on it.
    share = SHARE / 3.0 if exact.name == "igloo" else SHARE
    part = max(float(np.linalg.norm(np.ptp(p.shape.bounds, axis=0))) for p in exact.parts)
    for seed in range(2 if mode != "grown" else 1):
        sloppy = within(disturbed(exact, mode, seed, share), 2.0 * share * part)
        healed = heal(sloppy)
        assert healed.left == ()
        found = find_contacts(healed.assembly, STRICT)
        assert pairs(found) == pairs(find_contacts(exact)) and found.overlaps == ()
        # What joints are cut into closes again.
        build_parts(healed.assembly, [planar(c) for c in find_contacts(healed.assembly).contacts])
        assert max(healed.moved_m) < 4.0 * sloppy.tolerance_m
        assert max(map(abs, healed.volume_change)) < 100.0 * share


def test_what_is_exact_already_stays_as_it_is():
    for exact in (wall(), arch()):
        healed = heal(within(exact, 1e-4))
        assert max(healed.moved_m) < 1e-15 and healed.cut == ()


def test_a_tolerance_finds_the_contacts_of_the_exact_parts_and_names_what_it_accepts():
    for exact in (wall(), arch(), voxels()):
        sloppy = disturbed(exact, "grown", 0)
        report = find_contacts(within(sloppy, 1e-3))
        assert pairs(report) == pairs(find_contacts(exact)) and report.overlaps == ()
        assert {tuple(exact.index(n) for n in a.parts) for a in report.accepted} >= pairs(report)
        assert all(0.0 < a.overlap_m < 1e-3 for a in report.accepted)


def test_the_depth_and_the_gap_are_those_of_the_geometry():
    slab = Part("slab", box((0, 0, -1), (3, 1, 0)), fixed=True)
    deep, apart = Part("deep", box((0, 0, -0.002), (1, 1, 1))), Part("apart", box((2, 0, 0.001), (3, 1, 1)))
    report = find_contacts(Assembly("two", (slab, deep, apart), tolerance_m=0.005))
    by_pair = {a.parts[1]: a for a in report.accepted}
    assert by_pair["deep"].overlap_m == pytest.approx(0.002) and by_pair["deep"].gap_m == 0.0
    assert by_pair["apart"].gap_m == pytest.approx(0.001) and by_pair["apart"].overlap_m == 0.0
    again = find_contacts(Assembly("two", (slab, deep, apart), tolerance_m=0.0015))
    assert [o.parts for o in again.overlaps] == [("slab", "deep")]


def test_a_rigid_motion_and_a_change_of_size_change_nothing():
    sloppy = disturbed(dome(2, 7), "shifted", 3)
    turn = rotation(5)
    for factor in (1e-3, 1.0, 1e3):
        other = sloppy.with_shapes(
            [Mesh(p.shape.vertices @ turn.T * factor, p.shape.faces) for p in sloppy.parts if isinstance(p.shape, Mesh)]
        )
        one, two = find_contacts(within(sloppy, 5e-4)), find_contacts(within(other, 5e-4 * factor))
        assert pairs(one) == pairs(two) and len(one.accepted) == len(two.accepted)
        assert heal(within(other, 5e-4 * factor)).left == ()


def test_joints_and_physics_ask_for_exact_parts():
    sloppy = within(disturbed(wall(), "grown", 0), 1e-3)
    report = find_contacts(sloppy)
    require_sound(sloppy, report)
    with pytest.raises(NearlyTouching, match=r"overlap by .* mm .*share their faces exactly"):
        require_exact(sloppy, report)
    with pytest.raises(NearlyTouching, match="overlap by") as raised:
        require_sound(within(sloppy, 0.0), find_contacts(within(sloppy, 0.0)))
    assert find_contacts(within(sloppy, raised.value.tolerance_m)).overlaps == ()


def test_a_deep_overlap_is_no_slip():
    slab = Part("slab", box((0, 0, -1), (3, 1, 0)), fixed=True)
    sunk = Assembly("sunk", (slab, Part("block", box((1, 0, -0.5), (2, 1, 0.5)))))
    with pytest.raises(InputError, match="overlap by 500 mm") as raised:
        require_sound(sunk, find_contacts(sunk))
    assert not isinstance(raised.value, NearlyTouching)
