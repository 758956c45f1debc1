"""Ways out that are lines and planes: slots, cheeks and drawers are free whichever way they are turned."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from solids import box, rotation

from mocca_robot.assembly import Assembly, Mesh, Part, Polygon
from mocca_robot.geometry.polygon_cut import triangulated
from mocca_robot.geometry.sliding import sliding_ways
from mocca_robot.motion.insertion import insertion_verdicts
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.motion.ways_out import ways_out
from planners.order.sequence import SequenceStatus, find_sequence

SEEDS = range(20)
FLOOR, LID = box((-1, -1, -1), (2, 5, 0)), box((-1, -1, 1), (2, 5, 2))
LEFT, RIGHT = box((-1, -1, 0), (0, 5, 1)), box((1, -1, 0), (2, 5, 1))
BACK, FRONT = box((0, -1, 0), (1, 0, 1)), box((0, 1, 0), (1, 2, 1))
INSIDE = box((0, 0, 0), (1, 1, 1))
AROUND = {
    "cheeks": ([LEFT, RIGHT], 2),
    "slot": ([LEFT, RIGHT, FLOOR], 2),
    "tunnel": ([LEFT, RIGHT, FLOOR, LID], 1),
    "drawer": ([LEFT, RIGHT, FLOOR, LID, BACK], 1),
    "drawer the other way": ([LEFT, RIGHT, FLOOR, LID, FRONT], 1),
    "closed": ([LEFT, RIGHT, FLOOR, LID, BACK, FRONT], 0),
}


def placed(kind: str, seed: int) -> Assembly:
    """Return a unit cube among its walls, turned, moved and scaled, its corners jittered by rounding."""
    rng = np.random.default_rng(seed)
    turn, scale, shift = rotation(seed), 10 ** rng.uniform(-3, 3), rng.uniform(-1, 1, 3)

    def moved(mesh: Mesh) -> Mesh:
        return Mesh(np.round(scale * (mesh.vertices @ turn.T + shift), 7 - round(np.log10(scale))), mesh.faces)

    walls = [Part(f"wall{k}", moved(w), fixed=True) for k, w in enumerate(AROUND[kind][0])]
    order = rng.permutation(len(walls))
    return Assembly(kind, (*(walls[k] for k in order), Part("inside", moved(INSIDE))), alpha_rad=None)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", AROUND)
def test_what_slides_is_found_free_and_what_is_locked_is_proven(kind: str, seed: int) -> None:
    free = AROUND[kind][1] > 0
    graph = PartsGraph.of(placed(kind, seed))
    part = len(graph.assembly.parts) - 1
    assert (part in ways_out(graph)) == free
    (verdict,) = insertion_verdicts(graph)
    assert verdict.assemblable == free
    found = find_sequence(graph)
    assert found.status is (SequenceStatus.FOUND if free else SequenceStatus.DEADLOCKED)
    assert found.proven != free
    normals = graph.motion(part).normals
    ways, whole = sliding_ways(normals)
    assert whole == (AROUND[kind][1] <= 1)
    assert (len(ways) > 0) == free
    assert (ways @ normals.T).min(initial=0.0) > -2e-6


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("upside_down", [False, True])
def test_a_flat_tongue_leaves_its_groove_whichever_way_it_opens(upside_down: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle, scale = rng.uniform(0, 2 * np.pi), 10 ** rng.uniform(-3, 3)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) * scale
    groove = np.array([[0, 0], [9, 0], [9, 6], [6, 6], [6, 2], [3, 2], [3, 6], [0, 6]], dtype=float)
    tongue = np.array([[3, 2.5], [6, 2.5], [6, 9], [3, 9]])
    if upside_down:
        groove, tongue = groove * [1, -1], tongue * [1, -1]
    parts = Part("base", Polygon(groove @ turn.T), fixed=True), Part("tongue", Polygon(tongue @ turn.T))
    graph = PartsGraph.of(Assembly("groove", parts, alpha_rad=None))
    assert 1 in ways_out(graph)
    assert find_sequence(graph).status is SequenceStatus.FOUND
    assert insertion_verdicts(graph)[0].assemblable


def prism(outline: list[list[float]]) -> Mesh:
    n = len(outline)
    points = np.array([[x, y, z] for y in (0.0, 5.0) for x, z in outline])
    sides = [[k, n + k, n + (k + 1) % n, (k + 1) % n] for k in range(n)]
    faces, _ = triangulated(points, [list(range(n)), list(range(2 * n - 1, n - 1, -1)), *sides])
    mesh = Mesh(points, faces)
    return mesh if mesh.volume > 0 else Mesh(points, mesh.faces[:, ::-1])


def test_walls_of_a_slot_cut_alike_give_no_warning() -> None:
    outer = [[0, 0], [3, 0], [3, 3], [2, 3], [2, 1.5], [2, 1], [1, 1], [1, 1.5], [1, 3], [0, 3]]
    channel, board = prism(outer), prism([[1, 1.5], [2, 1.5], [2, 3], [1, 3]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        graph = PartsGraph.of(
            Assembly("slot", (Part("channel", channel, fixed=True), Part("board", board)), alpha_rad=None)
        )
        assert 1 in ways_out(graph)
