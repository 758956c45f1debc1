"""Orders of assembly: every step of one can be done, the fewest supports are found, and a deadlock is named."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.random_assemblies import random_assembly
from mocca_robot.assembly import Assembly, Mesh, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.errors import InputError
from mocca_robot.files.assembly_json import read_assembly, write_assembly
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.motion.ways_out import insertion_rim, sweep_blockers
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import state_cases
from planners.order.sequence import SequenceResult, SequenceStatus, find_sequence, reordered


def box(name: str, x: float, y: float, w: float, h: float, fixed: bool = False) -> Part:
    corners = np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])
    return Part(name, Polygon(corners), fixed=fixed)


def flat(*parts: Part, alpha: float | None = None) -> Assembly:
    return Assembly("flat", parts, alpha_rad=alpha)


def cube(name: str, low: Sequence[float], size: Sequence[float], fixed: bool = False) -> Part:
    import trimesh

    mesh = trimesh.creation.box(extents=size)
    return Part(name, Mesh(mesh.vertices + np.array(low) + np.array(size) / 2, mesh.faces), fixed=fixed)


def require_buildable(assembly: Assembly, found: SequenceResult) -> None:
    """Check every placement anew: the sweep out is free, and the state stands with what is held."""
    assert found.status is SequenceStatus.FOUND
    built = reordered(assembly, [p.part for p in found.placements])
    graph = PartsGraph.of(built)
    for placement, case in zip(found.placements, state_cases(graph), strict=True):
        part = built.index(placement.part)
        assert not sweep_blockers(built, part, insertion_rim(-placement.direction, built.alpha_rad or 0.0))
        held = np.array(case.held)
        held[[built.index(n) for n in placement.held]] = True
        assert case.present[[built.index(n) for n in placement.held]].all()
        if (case.present & ~held).any():
            assert solve_case(graph, replace(case, held=held)).result.stands, placement.part


def test_a_tower_given_upside_down_is_built_from_below() -> None:
    tower = [box(f"b{k}", 0, 0.02 + 0.02 * k, 0.04, 0.02) for k in range(4)]
    assembly = flat(box("ground", -0.05, 0, 0.15, 0.02, True), *reversed(tower), alpha=np.deg2rad(5))
    found = find_sequence(PartsGraph.of(assembly))
    assert [p.part for p in found.placements] == ["b0", "b1", "b2", "b3"]
    assert found.supports == 0
    require_buildable(assembly, found)


@pytest.mark.parametrize("kind", ["stack", "wall", "arch", "voronoi"])
def test_every_step_of_an_order_can_be_done(kind: str) -> None:
    assembly = replace(random_assembly(kind, 3), alpha_rad=None)
    found = find_sequence(PartsGraph.of(assembly), states=60)
    if found.status is SequenceStatus.FOUND:
        require_buildable(assembly, found)
    else:
        assert found.obstacles or found.status is SequenceStatus.BUDGET


def ring_with_core() -> Assembly:
    ring = Polygon(
        np.array([[0, 0.02], [0.06, 0.02], [0.06, 0.08], [0, 0.08]]),
        (np.array([[0.02, 0.04], [0.02, 0.06], [0.04, 0.06], [0.04, 0.04]]),),
    )
    return flat(box("ground", -0.05, 0, 0.15, 0.02, True), Part("ring", ring), box("core", 0.02, 0.04, 0.02, 0.02))


def test_a_part_inside_another_is_deadlocked_by_name() -> None:
    assembly = ring_with_core()
    found = find_sequence(PartsGraph.of(assembly))
    assert found.status is SequenceStatus.DEADLOCKED
    assert not found.placements
    # The ring cannot leave without its core, nor the core without the ring.
    assert {o.part: o.blockers[0] for o in found.obstacles} == {"ring": "core", "core": "ring"}


def bridge() -> Assembly:
    """A beam on two posts whose left end hangs over until a weight keeps the right end down."""
    return flat(
        box("post", 0.0, 0.0, 0.02, 0.06, True),
        box("beam", -0.10, 0.06, 0.14, 0.02),
        box("weight", 0.0, 0.08, 0.04, 0.12),
    )


def test_a_state_that_falls_asks_for_a_holder() -> None:
    found = find_sequence(PartsGraph.of(bridge()))
    assert found.status is SequenceStatus.FOUND
    assert found.supports >= 1
    require_buildable(bridge(), found)
    assert find_sequence(PartsGraph.of(bridge()), holders=found.holders).status is SequenceStatus.FOUND
    none = find_sequence(PartsGraph.of(bridge()), holders=0)
    assert none.status is SequenceStatus.FALLS
    assert none.falling and set(none.falling) <= set(none.remaining)


def test_fewest_supports_among_all_orders() -> None:
    assembly = flat(
        box("ground", 0, 0, 0.2, 0.02, True),
        box("left", 0.02, 0.02, 0.02, 0.04),
        box("slab", 0.02, 0.06, 0.12, 0.02),
        box("right", 0.12, 0.02, 0.02, 0.04),
    )
    found = find_sequence(PartsGraph.of(assembly))
    fewest = None
    for order in itertools.permutations(["left", "slab", "right"]):
        built = reordered(assembly, order)
        graph = PartsGraph.of(built)
        if all(solve_case(graph, c).result.stands for c in state_cases(graph)):
            fewest = 0
    assert fewest == 0 == found.supports
    assert found.placements[-1].part == "slab"


def test_solid_blocks_come_from_below_to_above() -> None:
    assembly = Assembly(
        "solid",
        (
            cube("ground", (-0.05, -0.05, 0), (0.15, 0.15, 0.02), True),
            cube("top", (0, 0, 0.06), (0.04, 0.04, 0.04)),
            cube("bottom", (0, 0, 0.02), (0.04, 0.04, 0.04)),
        ),
        alpha_rad=np.deg2rad(5),
    )
    found = find_sequence(PartsGraph.of(assembly))
    assert [p.part for p in found.placements] == ["bottom", "top"]
    require_buildable(assembly, found)


def test_orders_and_holders_that_make_no_sense_are_refused() -> None:
    with pytest.raises(InputError, match="weight"):
        reordered(bridge(), ["beam"])
    with pytest.raises(InputError, match="holders is -1"):
        find_sequence(PartsGraph.of(bridge()), holders=-1)


def test_a_shuffled_tower_comes_back_in_an_order_that_can_be_built() -> None:
    tower = [box(f"b{k}", 0.004 * (k % 2), 0.02 + 0.02 * k, 0.04, 0.02) for k in range(9)]
    mixed = [tower[k] for k in np.random.default_rng(3).permutation(9)]
    assembly = flat(box("ground", -0.05, 0, 0.15, 0.02, True), *mixed, alpha=np.deg2rad(5))
    found = find_sequence(PartsGraph.of(assembly), holders=0)
    assert [p.part for p in found.placements] == [f"b{k}" for k in range(9)]
    assert found.fewest
    require_buildable(assembly, found)


def test_a_ring_of_a_dome_closes_with_a_last_block_or_names_those_that_bar_it() -> None:
    from pathlib import Path

    from mocca_robot.generators import generate

    few = generate("dome", {"blocks": [6], "thickness": 0.2}, Path())
    found = find_sequence(PartsGraph.of(few))
    require_buildable(few, found)
    # With 10° of room asked for, blocks of a closed ring are wedged between their neighbours or go in as before.
    wide = find_sequence(PartsGraph.of(replace(few, alpha_rad=np.deg2rad(40))))
    assert wide.status is SequenceStatus.DEADLOCKED
    names = {o.part for o in wide.obstacles}
    assert all(o.blockers and set(o.blockers) <= names | set(few.sequence) for o in wide.obstacles)


def test_upright_tenons_deadlock_a_ball_and_say_who_locks_whom() -> None:
    from pathlib import Path

    from mocca_robot.config.config import load
    from mocca_robot.joints.build import build_parts
    from planners.baselines.tenons import upright_tenons

    config = load(Path(__file__).parents[2] / "configs" / "sphere.yaml")
    ball = build_parts(config.assembly, upright_tenons(PartsGraph.of(config.assembly), config.joints))
    found = find_sequence(PartsGraph.of(replace(ball, alpha_rad=None)))
    assert found.status is SequenceStatus.DEADLOCKED
    locked = {o.part: set(o.blockers) for o in found.obstacles}
    assert len(locked) >= 2
    assert all(locked.values())


def test_what_is_known_about_ways_out_stays_true_when_parts_leave() -> None:
    from planners.order.exits import Exits

    assembly = random_assembly("wall", 3)
    exits = Exits(graph=PartsGraph.of(assembly), count=36)
    there = exits.free
    while there:
        leaving = [p for p in exits.from_the_top(there) if exits.way_out(p, there) is not None]
        fresh = Exits(graph=exits.graph, count=36)
        assert leaving == [p for p in fresh.from_the_top(there) if fresh.exact_way_out(p, there) is not None]
        if not leaving:
            break
        there = there - {leaving[0]}


@pytest.mark.long
def test_a_tower_of_139_parts_is_ordered() -> None:
    from pathlib import Path

    from mocca_robot.config.config import load

    assembly = load(Path(__file__).parents[2] / "configs" / "lilium_tower.yaml").assembly
    free = [p.name for p in assembly.parts if not p.fixed]
    mixed = reordered(assembly, [free[k] for k in np.random.default_rng(0).permutation(len(free))])
    found = find_sequence(PartsGraph.of(mixed))
    assert found.status is SequenceStatus.FOUND
    assert sorted(p.part for p in found.placements) == sorted(free)


def test_the_order_found_can_be_written_and_gone_on_with(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tower = [box(f"b{k}", 0, 0.02 + 0.02 * k, 0.04, 0.02) for k in range(3)]
    upside_down = write_assembly(
        flat(box("ground", -0.05, 0, 0.15, 0.02, True), *reversed(tower)), tmp_path / "upside_down.json"
    )
    written = tmp_path / "tower.json"
    assert main(["sequence", str(upside_down), "-o", str(written)]) == 0
    said = capsys.readouterr().out
    assert str(written) in said and "-0.000" not in said
    assert read_assembly(written).assembly.sequence == ("ground", "b0", "b1", "b2")
    locked = write_assembly(ring_with_core(), tmp_path / "locked.json")
    assert main(["sequence", str(locked), "-o", str(tmp_path / "none.json")]) == 1
    assert not (tmp_path / "none.json").exists()


def test_a_search_that_runs_out_of_time_returns_the_best_order_so_far_without_a_proof() -> None:
    told: list[str] = []
    whole = find_sequence(PartsGraph.of(bridge()), progress=told.append)
    assert told and all("states" in line for line in told)
    first = find_sequence(PartsGraph.of(bridge()), seconds=0.0)
    assert first.status is SequenceStatus.FOUND
    assert not first.fewest
    assert first.supports >= whole.supports
    assert len(first.placements) == len(whole.placements)


def test_time_that_is_up_is_no_proof_that_there_is_no_order() -> None:
    # In no time at all nothing but the first order is looked at, which needs somebody.
    none = find_sequence(PartsGraph.of(bridge()), holders=0, seconds=0.0)
    assert none.status is SequenceStatus.BUDGET
    assert none.placements == ()
    with pytest.raises(InputError, match="seconds is -1"):
        find_sequence(PartsGraph.of(bridge()), seconds=-1.0)
