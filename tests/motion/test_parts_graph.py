"""The parts-graph: what its nodes and edges carry, and states as sub-graphs."""

import pickle

import networkx as nx
import numpy as np
import pytest
from helpers.physics_models import bump, rectangle

from benchmarks.random_assemblies import random_assembly, random_solid
from mocca_robot.assembly import Assembly, Part
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.loads import state_cases

GROUND, LEFT, RIGHT, LINTEL = range(4)
RANDOM = [(random_assembly, kind, seed) for kind in ("wall", "arch", "voronoi") for seed in (0, 1, 2)]
RANDOM += [(random_solid, kind, seed) for kind in ("blocks", "peaks", "notched") for seed in (0, 1)]


def gate() -> Assembly:
    """Return two blocks side by side on the ground, and a lintel across both."""
    return Assembly(
        "gate",
        (
            Part("ground", rectangle(0.0, -0.1, 1.0, 0.1), fixed=True),
            Part("left", rectangle(0.0, 0.0, 0.5, 0.2)),
            Part("right", rectangle(0.5, 0.0, 0.5, 0.2)),
            Part("lintel", rectangle(0.2, 0.2, 0.6, 0.1)),
        ),
    )


def test_a_gate_edge_by_edge() -> None:
    graph = PartsGraph.of(gate(), insertion={"lintel": np.array([0.0, -1.0])})
    up, right = np.array([0.0, 1.0]), np.array([1.0, 0.0])
    expected = {
        (LEFT, GROUND): (up, 0.5),
        (RIGHT, GROUND): (up, 0.5),
        (RIGHT, LEFT): (right, 0.2),
        (LINTEL, LEFT): (up, 0.3),
        (LINTEL, RIGHT): (up, 0.3),
    }
    assert set(graph.network.edges) == set(expected)
    assert list(graph.network.nodes) == [GROUND, LEFT, RIGHT, LINTEL]
    for (later, earlier), (normal, length) in expected.items():
        meeting = graph.meeting(earlier, later)
        assert meeting is not None and meeting is graph.network.edges[later, earlier]["meeting"]
        ((contact,), (joint,)) = meeting.contacts, meeting.joints
        assert contact.normal == pytest.approx(normal) and contact.measure == pytest.approx(length)
        assert joint.is_planar and joint.contact is contact
        assert meeting.motion_cone.contains(np.r_[normal, 0.0])
        assert not meeting.motion_cone.contains(np.r_[-normal, 0.0])
        # A turn about one end of the contact opens the other one way, and presses it in the other way.
        lever = contact.polygon[0] - graph.assembly.parts[later].centroid
        about_an_end = np.array([lever[1], -lever[0], 1.0])
        assert meeting.motion_cone.contains(about_an_end) != meeting.motion_cone.contains(-about_an_end)
    assert graph.meeting(GROUND, LINTEL) is None
    assert [graph.neighbours_before(p) for p in range(4)] == [(), (GROUND,), (GROUND, LEFT), (LEFT, RIGHT)]
    assert [graph.neighbours_after(p) for p in range(4)] == [(LEFT, RIGHT), (RIGHT, LINTEL), (LINTEL,), ()]
    assert graph.neighbours(RIGHT) == (GROUND, LEFT, LINTEL)


def test_nodes_know_their_place_their_cone_and_how_they_go_in() -> None:
    graph = PartsGraph.of(gate(), insertion={"lintel": np.array([0.6, -0.8])})
    assert [graph.placed(p).part.name for p in range(4)] == ["ground", "left", "right", "lintel"]
    assert graph.free == (LEFT, RIGHT, LINTEL)
    assert graph.motion(LEFT).alpha_rad == pytest.approx(np.pi / 2)
    assert graph.motion(RIGHT).alpha_rad == pytest.approx(np.pi / 4), "between the ground and its neighbour"
    assert graph.motion(RIGHT).blockers == (GROUND, LEFT)
    assert graph.placed(RIGHT).direction == pytest.approx(-np.sqrt(0.5) * np.ones(2))
    assert graph.placed(LINTEL).direction == pytest.approx([0.6, -0.8]), "as somebody chose"
    assert set(graph.chosen) == {"lintel"}
    assert graph.motion(LINTEL).room(np.array([-0.6, 0.8])) == pytest.approx(np.arcsin(0.8))


def test_states_are_sub_graphs_in_which_nothing_is_worked_out_again() -> None:
    graph = PartsGraph.of(gate())
    assert list(graph.states) == [LEFT, RIGHT, LINTEL]
    for part, state in graph.states.items():
        assert state.there == frozenset(range(part + 1))
        assert nx.utils.graphs_equal(state.network, nx.DiGraph(graph.network.subgraph(range(part + 1))))
        assert all(state.motion(p) is graph.motion(p) for p in state.free)
        assert all(max(c.parts) <= part for c in state.contacts)
    cases = state_cases(graph)
    assert [c.name for c in cases] == ["state_left", "state_right", "state_lintel"]
    assert [c.present.tolist() for c in cases] == [s.present.tolist() for s in graph.states.values()]
    assert graph.states[LINTEL].contacts == graph.contacts


def test_without_a_neighbour_a_part_can_move_further() -> None:
    graph = PartsGraph.of(gate())
    left_out = graph.without(LEFT)
    assert set(left_out.network.edges) == {(RIGHT, GROUND), (LINTEL, RIGHT)}
    assert left_out.motion(RIGHT).alpha_rad == pytest.approx(np.pi / 2)
    assert graph.motion(RIGHT).alpha_rad == pytest.approx(np.pi / 4), "the whole graph is as it was"
    assert left_out.motion(LINTEL).blockers == (RIGHT,)
    assert graph.around(LINTEL).there == {LEFT, RIGHT, LINTEL}
    # Taking apart: what lies on a part bars it as well.
    assert graph.leaving(LEFT, [GROUND]).alpha_rad == pytest.approx(np.pi / 2)
    assert graph.leaving(LEFT, [GROUND, LINTEL]).alpha_rad == pytest.approx(0.0)


@pytest.mark.parametrize(("make", "kind", "seed"), RANDOM, ids=lambda v: getattr(v, "__name__", str(v)))
@pytest.mark.parametrize("curved", [False, True])
def test_part_motion_cones_are_what_the_edges_leave_in_common(make, kind: str, seed: int, curved: bool) -> None:
    """Eq. 11: x ∈ V_j exactly when x ∈ T(V_ij) for every neighbour placed before."""
    assembly = make(kind, seed)
    contacts = find_contacts(assembly).contacts
    curved = curved and assembly.dimension == 2
    graph = PartsGraph.joined(assembly, [bump(c, 0.15) for c in contacts]) if curved else PartsGraph.of(assembly)
    rng = np.random.default_rng(seed)
    ways = rng.normal(size=(400, assembly.dimension))
    inside = 0
    for part, motion in graph.motions():
        cones = [graph.meeting(other, part).motion_cone.translational() for other in graph.neighbours_before(part)]
        for way in [*ways, motion.axis]:
            slack = (motion.normals @ way).min(initial=np.inf)
            if abs(slack) > 1e-9:
                assert (slack > 0.0) == all(cone.contains(way) for cone in cones)
                inside += slack > 0.0
        free = motion.alpha_rad > 1e-9
        assert free == all((cone.normals @ motion.axis).min() > 0.0 for cone in cones) or abs(motion.alpha_rad) < 1e-9
    assert inside, "some direction is free: the property is not empty"


@pytest.mark.parametrize(("make", "kind", "seed"), RANDOM[::3], ids=lambda v: getattr(v, "__name__", str(v)))
def test_contacts_and_joints_come_back_in_the_order_they_were_found(make, kind: str, seed: int) -> None:
    assembly = make(kind, seed)
    contacts = find_contacts(assembly).contacts
    graph = PartsGraph.of(assembly, contacts)
    assert graph.contacts == contacts
    assert [j.contact for j in graph.joints] == list(contacts)
    shuffled = tuple(contacts[k] for k in np.random.default_rng(seed).permutation(len(contacts)))
    assert PartsGraph.of(assembly, shuffled).contacts == shuffled
    for part in range(len(assembly.parts)):
        others, normals = graph.touching(part)
        assert sorted(set(others.tolist())) == list(graph.neighbours(part))
        towards = [c.normal if c.parts[1] == part else -c.normal for c in contacts if part in c.parts]
        assert np.allclose(normals, np.reshape(towards, (-1, assembly.dimension)))


def test_another_process_works_out_the_same() -> None:
    graph = PartsGraph.of(gate(), insertion={"left": np.array([0.0, -1.0])})
    before = {p: m.alpha_rad for p, m in graph.motions()}
    again = pickle.loads(pickle.dumps(graph.without(LINTEL)))
    assert "motion" not in vars(again.placed(LEFT)), "what is worked out is not sent"
    assert {p: m.alpha_rad for p, m in again.motions()} == {p: before[p] for p in (LEFT, RIGHT)}
    assert set(again.chosen) == {"left"}


def test_a_direction_for_nobody_is_refused() -> None:
    with pytest.raises(InputError, match="No part is called 'lintl'"):
        PartsGraph.of(gate(), insertion={"lintl": np.array([0.0, -1.0])})
