"""Deadlock and looseness: closed forms, invariance, agreement with statics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Interlocking, Mesh, Part, Polygon
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import load_cases
from mocca_robot.statics.mobility import mobility

TRIANGLE = np.array([[1.0, 1.0], [3.0, 1.0], [2.0, 2.5]])
FRAME = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])


def flat(*shapes: Polygon) -> Assembly:
    return Assembly("a", tuple(Part(f"p{k}", s, fixed=k == 0) for k, s in enumerate(shapes)))


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    import trimesh

    made = trimesh.creation.box(bounds=[low, high])
    return Mesh(made.vertices, made.faces)


def turned(points: Array, angle: float, shift: tuple[float, float]) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + shift)


@given(angle=st.floats(0, 6.3), x=st.floats(-50, 50), scale=st.floats(0.01, 100))
def test_a_part_inside_its_own_hole_is_locked_wherever_it_is(angle: float, x: float, scale: float) -> None:
    frame, hole = turned(FRAME, angle, (x, 0.0)) * scale, turned(TRIANGLE, angle, (x, 0.0)) * scale
    assembly = flat(Polygon(frame, (hole[::-1],)), Polygon(hole))
    found = mobility(PartsGraph.of(assembly))
    assert found.locked and not found.motions.any()


@pytest.fixture(params=["small", "large"])
def any_size(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Large structures are pulled at before the linear program is asked; the answers are the same."""
    if request.param == "large":
        monkeypatch.setattr("mocca_robot.statics.mobility.MANY", 0)


@pytest.mark.usefixtures("any_size")
def test_a_drawer_slides_without_opening_a_contact() -> None:
    """A block between two walls of one part: interlocked by pushes, and yet it slides."""
    channel = np.array([[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]], dtype=float)
    walls = np.array([[1, 1.5], [2, 1.5], [2, 2.5], [1, 2.5]])
    assembly = flat(Polygon(channel), Polygon(walls))
    found = mobility(PartsGraph.of(assembly))
    assert found.moving == ("p1",) and not found.opens
    way = found.motions[1] / np.linalg.norm(found.motions[1])
    assert np.abs(way) == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)


@pytest.mark.usefixtures("any_size")
def test_a_block_on_the_ground_lifts() -> None:
    ground = np.array([[-2, -1], [3, -1], [3, 0], [-2, 0]], dtype=float)
    assembly = flat(Polygon(ground), Polygon(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)))
    found = mobility(PartsGraph.of(assembly))
    assert found.opens and found.moving == ("p1",)


def test_holding_the_part_itself_leaves_nothing_to_move() -> None:
    ground = np.array([[-2, -1], [3, -1], [3, 0], [-2, 0]], dtype=float)
    assembly = flat(Polygon(ground), Polygon(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)))
    graph = PartsGraph.of(assembly)
    assert mobility(graph, np.array([True, True])).locked


@pytest.mark.usefixtures("any_size")
def test_whatever_is_locked_interlocks_in_statics_too() -> None:
    """Locked means more than interlocked: every push that separates contacts is held."""
    assembly = flat(Polygon(FRAME, (TRIANGLE[::-1],)), Polygon(TRIANGLE))
    graph = PartsGraph.of(assembly)
    held = np.array([True, False])
    assert mobility(graph, held).locked
    (case,) = load_cases(graph, (Interlocking("p0"),))
    assert solve_case(graph, case).result.stands


@pytest.mark.usefixtures("any_size")
def test_solids() -> None:
    floor, block = box((0, 0, 0), (3, 3, 1)), box((1, 1, 1), (2, 2, 2))
    assembly = Assembly("b", (Part("floor", floor, fixed=True), Part("block", block)))
    assert mobility(PartsGraph.of(assembly)).moving == ("block",)
    lid = box((0, 0, 2), (3, 3, 3))
    caught = Assembly("c", (Part("floor", floor, fixed=True), Part("block", block), Part("lid", lid, fixed=True)))
    found = mobility(PartsGraph.of(caught))
    assert found.moving == ("block",) and not found.opens  # it slides between floor and lid


@pytest.mark.usefixtures("any_size")
def test_motions_never_penetrate() -> None:
    from mocca_robot.joints.joint import contact_rays

    ground = np.array([[-2, -1], [3, -1], [3, 0], [-2, 0]], dtype=float)
    assembly = flat(Polygon(ground), Polygon(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)))
    graph = PartsGraph.of(assembly)
    contacts = graph.contacts
    found = mobility(graph)
    pairs, points, normals = contact_rays(contacts)
    at = [np.array([p.centroid for p in assembly.parts])[pairs[:, k]] for k in (0, 1)]
    speed = []
    for k in (0, 1):
        v = found.motions[pairs[:, k]]
        r = points - at[k]
        speed.append(v[:, :2] + v[:, 2:] * np.stack([-r[:, 1], r[:, 0]], axis=1))
    assert np.einsum("cd,cd->c", normals, speed[1] - speed[0]).min() >= -1e-9
