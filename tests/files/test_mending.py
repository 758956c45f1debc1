"""Surfaces as other programs write them: each kind of fault in twenty shapes, sizes and orders gives the same part."""

from __future__ import annotations

import numpy as np
import pytest
from solids import BOX_FACES, box, rotation

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.files.mending import mended
from mocca_robot.geometry.polygon_cut import triangulated
from mocca_robot.geometry.surfaces import Edges
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import load_cases

SEEDS = range(20)
QUADS = [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
CUBE = box((0, 0, 0), (0.3, 0.2, 0.1))


def voxels(cells: list[tuple[int, int, int]]) -> tuple[Array, IntArray]:
    """Return the surface of unit cubes without the faces that two of them share."""
    vertices, faces = [], []
    for cell in cells:
        cube = box(cell, tuple(c + 1 for c in cell))  # type: ignore[arg-type]
        for k in range(0, 12, 2):
            quad = cube.vertices[BOX_FACES[k]]
            outward = np.cross(quad[1] - quad[0], quad[2] - quad[0])
            across = tuple(int(c + d) for c, d in zip(cell, np.sign(np.round(outward))))
            if across not in cells:
                faces += [BOX_FACES[k] + 8 * len(vertices), BOX_FACES[k + 1] + 8 * len(vertices)]
        vertices.append(cube.vertices)
    return np.concatenate(vertices), np.array(faces)


def shuffled(vertices: Array, faces: IntArray, seed: int) -> tuple[Array, IntArray, float]:
    """Return the surface turned, moved, scaled and with corners and triangles in another order; and its scale."""
    rng = np.random.default_rng(seed)
    scale = float(10 ** rng.uniform(-3, 3))
    order = rng.permutation(len(vertices))
    moved = np.empty_like(vertices)
    moved[order] = scale * (vertices @ rotation(seed).T + rng.uniform(-1, 1, 3))
    turned = np.array([np.roll(f, rng.integers(3)) for f in order[faces]])
    return moved, turned[rng.permutation(len(turned))], scale


def closed_volume(vertices: Array, faces: IntArray, seed: int, bodies: int = 1) -> tuple[float, tuple[str, ...]]:
    """Return the volume after mending, in units of the surface that was handed in, and what was said."""
    vertices, faces, scale = shuffled(vertices, faces, seed)
    found = mended("p", vertices, faces)
    assert len(found.bodies) == bodies
    for body in found.bodies:
        assert Edges(np.asarray(body.faces)).sound
        assert body.volume > 0
    return sum(b.volume for b in found.bodies) / scale**3, found.notes


@pytest.mark.parametrize("seed", SEEDS)
def test_faces_with_corners_of_their_own_are_welded(seed: int) -> None:
    rng = np.random.default_rng(seed)
    soup = CUBE.vertices[CUBE.faces].reshape(-1, 3)
    soup = soup + rng.uniform(-1, 1, soup.shape) * 10 ** rng.uniform(-9, -6.5)
    volume, notes = closed_volume(soup, np.arange(36).reshape(-1, 3), seed)
    assert volume == pytest.approx(0.006, rel=1e-4)
    assert any("welded" in n for n in notes)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sheet_never_passes_for_a_solid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0, 1, (4, 3)) * [1, 1, 0]
    corners = corners[np.argsort(np.arctan2(*(corners - corners.mean(axis=0)).T[1::-1]))]
    fan = np.array([[0, 1, 2], [0, 2, 3]])[: 1 + seed % 2]
    with pytest.raises(InputError, match=r"not closed|no volume"):
        mended("leaf", *shuffled(corners, fan, seed)[:2])


@pytest.mark.parametrize("seed", SEEDS)
def test_an_edge_that_four_faces_share_is_split(seed: int) -> None:
    cells = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1)]
    rng = np.random.default_rng(seed)
    while len(cells) < 8:
        x, y, z = cells[rng.integers(len(cells))]
        dx, dy, dz = np.eye(3, dtype=int)[rng.integers(3)] * rng.choice([-1, 1])
        if (new := (int(x + dx), int(y + dy), int(z + dz))) not in cells:
            cells.append(new)
    vertices, faces = voxels(cells)
    assert closed_volume(vertices, faces, seed)[0] == pytest.approx(8.0, rel=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_bodies_that_touch_are_told_apart(seed: int) -> None:
    step = np.array([[1, 1, 0], [1, 1, 1], [1, 0, 0]][seed % 3], dtype=float)
    one = box((0, 0, 0), (1, 1, 1))
    vertices = np.concatenate([one.vertices, one.vertices + step])
    faces = np.concatenate([one.faces, one.faces + 8])
    assert closed_volume(vertices, faces, seed, bodies=2)[0] == pytest.approx(2.0, rel=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_flipped_doubled_and_empty_triangles_are_mended_and_said(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices, faces = CUBE.vertices, np.array(CUBE.faces)
    flipped = rng.choice(12, 1 + seed % 5, replace=False)
    faces[flipped] = faces[flipped][:, ::-1]
    volume, notes = closed_volume(vertices, faces, seed)
    assert volume == pytest.approx(0.006)
    assert any("turned" in n for n in notes)

    doubled = np.concatenate([CUBE.faces, CUBE.faces[flipped], [[1, 1, 2]]])
    volume, notes = closed_volume(vertices, doubled, seed)
    assert volume == pytest.approx(0.006)
    assert any("say another one again" in n for n in notes)
    assert any("two equal corners" in n for n in notes)

    two_sided = np.concatenate([CUBE.faces, CUBE.faces[:, ::-1]])
    assert closed_volume(vertices, two_sided, seed)[0] == pytest.approx(0.006)


@pytest.mark.parametrize("seed", SEEDS)
def test_walls_inside_are_taken_out(seed: int) -> None:
    rng = np.random.default_rng(seed)
    share = rng.uniform(0.2, 0.8)
    low, high = box((0, 0, 0), (1, 1, share)), box((0, 0, share), (1, 1, 1))
    vertices = np.concatenate([low.vertices, high.vertices])
    wall = [k for k in range(12) if (low.vertices[low.faces[k], 2] == share).all()]
    floor = [k for k in range(12) if (high.vertices[high.faces[k], 2] == share).all()]
    faces = np.concatenate([np.delete(low.faces, wall, axis=0), np.delete(high.faces, floor, axis=0) + 8])
    volume, notes = closed_volume(vertices, np.concatenate([faces, low.faces[wall]]), seed)
    assert volume == pytest.approx(1.0)
    assert any("walls inside" in n for n in notes)


@pytest.mark.parametrize("seed", SEEDS)
def test_corners_on_a_neighbours_edge_join_it(seed: int) -> None:
    share = np.random.default_rng(seed).uniform(0.2, 0.8)
    vertices = np.concatenate([CUBE.vertices, [(1 - share) * CUBE.vertices[0] + share * CUBE.vertices[1]]])
    at = next(k for k, f in enumerate(CUBE.faces.tolist()) if (0, 1) in zip(f, f[1:] + f[:1]))
    a, b, c = np.roll(CUBE.faces[at], -CUBE.faces[at].tolist().index(0))
    faces = np.concatenate([np.delete(CUBE.faces, at, axis=0), [[a, 8, c], [8, b, c]]])
    volume, notes = closed_volume(vertices, faces, seed)
    assert volume == pytest.approx(0.006)
    assert any("cut at corners" in n for n in notes)


@pytest.mark.parametrize("seed", SEEDS)
def test_cavities_belong_to_what_they_are_in(seed: int) -> None:
    outer, inner = box((0, 0, 0), (3, 3, 3)), box((1, 1, 1), (2, 2, 2))
    vertices = np.concatenate([outer.vertices, inner.vertices])
    hollow = np.concatenate([outer.faces, inner.faces[:, ::-1] + 8])
    assert closed_volume(vertices, hollow, seed)[0] == pytest.approx(26.0)


def cut_of(vertices: Array, face: list[int]) -> set[frozenset[int]]:
    return {frozenset(t) for t in triangulated(vertices, [face])[0].tolist()}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("corners", [4, 5, 7])
def test_a_warped_polygon_is_cut_alike_from_either_side(corners: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    points = np.stack([np.cos(turn), np.sin(turn), rng.uniform(-0.1, 0.1, corners)], axis=1) @ rotation(seed).T
    points *= 10 ** rng.uniform(-3, 3)
    first = cut_of(points, list(range(corners)))
    again = points * (1 + rng.uniform(-1, 1, points.shape) * 1e-9)
    for start in range(corners):
        there = np.roll(np.arange(corners), start)
        assert cut_of(again, there.tolist()) == first
        assert cut_of(again, there[::-1].tolist()) == first
    assert len(first) == corners - 2


@pytest.mark.parametrize("seed", SEEDS)
def test_parts_that_share_a_warped_face_touch_whatever_corner_each_begins_with(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = np.array(box((0, 0, 0), (1, 1, 1)).vertices)
    low[4:, 2] += [0, 0.02, 0, 0.02]
    high = np.concatenate([low[4:], low[4:] + np.array([0, 0, 1])])
    high[4:, 2] = 2
    scale = 10 ** rng.uniform(-3, 3)
    parts = []
    for name, corners in (("low", low), ("high", high)):
        faces = [np.roll(q, rng.integers(4)).tolist() for q in QUADS]
        jittered = corners * (1 + rng.uniform(-1, 1, corners.shape) * 1e-9)
        triangles, _ = triangulated(jittered, [faces[k] for k in rng.permutation(6)])
        (body,) = mended(name, jittered * scale, triangles).bodies
        parts.append(Part(name, body, fixed=name == "low"))
    assembly = Assembly("pair", tuple(parts), alpha_rad=None)
    report = find_contacts(assembly)
    assert not report.overlaps
    assert sum(c.measure for c in report.contacts) == pytest.approx(scale**2, rel=1e-2)
    graph = PartsGraph.of(assembly, report.contacts)
    (case,) = load_cases(graph)
    assert solve_case(graph, case, 0.5).result.stands


def test_flat_polygons_keep_every_corner_and_bend_in() -> None:
    ring = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 2, 0], [1, 2, 0], [1, 1, 0], [0, 1, 0]]
    points = np.array(ring, dtype=float)
    cut, owner = triangulated(points, [list(range(7)), [0, 1, 5, 6], [0, 1]])
    assert owner.tolist() == [0] * 5 + [1] * 2
    corners = points[cut[:5]]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2
    assert areas.sum() == pytest.approx(3.0)
    assert (areas > 1e-9).all()


def test_a_sound_surface_stays_bit_for_bit() -> None:
    vertices = CUBE.vertices * np.pi
    found = mended("p", vertices, CUBE.faces)
    assert found.notes == ()
    (body,) = found.bodies
    assert {tuple(v) for v in body.vertices} == {tuple(v) for v in vertices}
    assert body.volume == pytest.approx(Mesh(vertices, CUBE.faces).volume, rel=1e-15)


@pytest.mark.parametrize("seed", SEEDS)
def test_bodies_that_touch_along_whole_faces_stay_as_many_as_the_file_has(seed: int) -> None:
    # Coordinates of few digits: the shared walls are no longer flat, and cut along other diagonals on either side.
    rng = np.random.default_rng(seed)
    corners = np.round(np.stack(np.meshgrid([0.0, 1, 2], [0.0, 1, 2], [0.0, 1], indexing="ij"), -1) @ rotation(seed), 3)
    vertices, faces, volume = [], [], 0.0
    for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)):
        cell = corners[i : i + 2, j : j + 2].reshape(8, 3)[[0, 4, 6, 2, 1, 5, 7, 3]]
        mesh = Mesh(cell, BOX_FACES if rng.integers(2) else np.roll(BOX_FACES, 1, axis=1))
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + 8 * len(faces))
        volume += mesh.volume
    found = mended("ring", np.concatenate(vertices), np.concatenate(faces))
    assert len(found.bodies) == 4 and found.notes == ()
    assert found.whole.volume == pytest.approx(volume)
