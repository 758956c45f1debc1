"""Friction by material, and declared clamping: read, checked, and used by statics."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mocca_robot.config.config import load
from mocca_robot.contacts.friction import TANGENTIAL_RATIO, Friction, between, sprung, tangential_ratio
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import read_design, write_design
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.runtime.content_hash import content_hash
from mocca_robot.statics.cases import case_at, critical_tilt, solve_case
from mocca_robot.statics.friction_cases import standing_case
from planners.cone_joints.designer import design
from sim.coulomb.judge import rubbing


def box(x: float, y: float, width: float, height: float) -> list[list[float]]:
    return [[x, y], [x + width, y], [x + width, y + height], [x, y + height]]


PARTS = {"slab": box(0, 0, 100, 10), "low": box(20, 10, 60, 10), "high": box(20, 20, 60, 10)}
WALLS = {"left": box(-20, 0, 20, 100), "right": box(40, 0, 20, 100), "block": box(0, 20, 40, 40)}


def written(folder: Path, parts: dict[str, list[list[float]]], keys: str) -> Path:
    fixed = {"slab", "left", "right"}
    rows = [{"name": n, "polygon": p, "fixed": n in fixed} for n, p in parts.items()]
    data = {"format": "mocca-robot/assembly", "version": 1, "units": "mm", "dimension": 2, "name": "m", "parts": rows}
    (folder / "parts.json").write_text(json.dumps(data))
    path = folder / "made.yaml"
    path.write_text(f"model: parts.json\nalpha_deg: null\n{keys}")
    return path


def test_each_pair_of_materials_has_its_own_friction(tmp_path: Path) -> None:
    table = "friction: {wood-wood: 0.5, wood-steel: 0.2}\nmaterial: wood\nparts: {slab: {material: steel}}\n"
    config = load(written(tmp_path, PARTS, table))
    assert float(config.friction) == 0.5
    graph = PartsGraph.of(config.assembly)
    assert critical_tilt(graph, 0.0, config.friction) == pytest.approx(np.arctan(0.2), abs=2e-3)
    slides = solve_case(graph, case_at(config.assembly, np.arctan(0.3), 0.0), config.friction)
    assert slides.moving == ("low", "high")
    assert critical_tilt(graph, 0.0, 0.5) == pytest.approx(np.arctan(0.5), abs=2e-3)


def test_declared_clamping_holds_what_friction_alone_does_not(tmp_path: Path) -> None:
    for force, stands in ((0.5, True), (0.45, False)):
        wedged = ", ".join(f"{{parts: [{w}, block], force_n: {force}}}" for w in ("left", "right"))
        config = load(written(tmp_path, WALLS, f"friction: 0.4\nclamping: [{wedged}]\n"))
        assembly = config.assembly
        found = solve_case(PartsGraph.of(assembly), case_at(assembly, 0.0, 0.0), config.friction)
        # 38.4 g need 2 · 0.4 · N = 0.377 N, that is 0.471 N from either side.
        assert (found.result.stands, found.only_clamped) == (stands, not stands)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("friction: {wood-wood: -0.1}\nmaterial: wood\n", "wood-wood is -0.1"),
        ("friction: {wood-wood: .inf}\nmaterial: wood\n", "wood-wood is inf"),
        ("friction: {wood: 0.1}\nmaterial: wood\n", "'wood' is no pair of materials"),
        ("friction: {wod-wood: 0.1}\nmaterial: wood\n", "did you mean 'wood'"),
        ("friction: {wood-wood: 0.1, wood-wood : 0.2}\nmaterial: wood\n", "twice"),
        ("friction: {}\nmaterial: wood\n", "is empty"),
        ("friction: {wood-wood: 0.1}\n", "'slab', 'low', 'high' have none"),
        ("friction: 0.3\nclamping: [{parts: [slab], force_n: 1}]\n", "names 1 parts"),
        ("friction: 0.3\nclamping: [{parts: [slab, lwo], force_n: 1}]\n", "did you mean 'low'"),
        ("friction: 0.3\nclamping: [{parts: [slab, low], force_n: -1}]\n", "force_n"),
        ("friction: 0.3\nclamping: {parts: [slab, low]}\n", "must be a list"),
        ("friction: 0.3\nstiffness_ratio: 0\n", "stiffness_ratio is 0"),
        ("friction: 0.3\nstiffness_ratio: -1\n", "stiffness_ratio is -1"),
        ("friction: 0.3\nstiffness_ratio: .nan\n", "stiffness_ratio is nan"),
    ],
)
def test_wrong_tables_are_named(keys: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        load(written(tmp_path, PARTS, keys))


def test_a_pair_that_touches_must_be_in_the_table(tmp_path: Path) -> None:
    table = "friction: {wood-wood: 0.5}\nmaterial: wood\nparts: {slab: {material: steel}}\n"
    config = load(written(tmp_path, PARTS, table))
    with pytest.raises(InputError, match="'steel-wood' is missing, but 'slab' and 'low' touch"):
        critical_tilt(PartsGraph.of(config.assembly), 0.0, config.friction)


def test_parts_that_do_not_touch_cannot_be_clamped(tmp_path: Path) -> None:
    config = load(written(tmp_path, PARTS, "friction: 0.3\nclamping: [{parts: [slab, high], force_n: 1}]\n"))
    with pytest.raises(InputError, match=r"'slab' and 'high' do not touch.*'slab' touches 'low'"):
        critical_tilt(PartsGraph.of(config.assembly), 0.0, config.friction)


def test_a_table_is_a_number_and_more() -> None:
    rows = [(("wood", "steel"), 0.2), (("wood", "wood"), 0.5)]
    table = Friction(0.0, rows)
    again: Any = pickle.loads(pickle.dumps(table))
    assert again == table and again.table == table.table and hash(again) == hash(0.5)
    assert table != 0.5 and Friction(0.5) == 0.5
    assert content_hash((table,)) != content_hash((0.5,)) != content_hash((Friction(0.5, [(("a", "b"), 0.5)]),))
    assert between(0.5, (), np.zeros((0, 2), dtype=np.int64)) == 0.5


SPRUNG = "friction: 0.3\nstiffness_ratio: 0.2\n"


def test_the_stiffness_of_contacts_reaches_both_engines(tmp_path: Path) -> None:
    config, plain = (load(written(tmp_path, PARTS, keys)) for keys in (SPRUNG, "friction: 0.3\n"))
    assert tangential_ratio(config.friction) == tangential_ratio(config.simulate.friction) == 0.2
    assert config.friction != 0.3 and plain.friction == 0.3
    graph = PartsGraph.of(config.assembly)
    assert rubbing(graph, config.friction).whole.contacts.tangential == pytest.approx(0.2)
    assert rubbing(graph, plain.friction).whole.contacts.tangential == pytest.approx(1.0)
    tilted = case_at(config.assembly, np.deg2rad(10.0), 0.0)
    soft, stiff = (np.abs(standing_case(graph, tilted, c.friction).displacements[:, 0]).max() for c in (config, plain))
    assert soft > 2.0 * stiff


def test_without_friction_stiffness_says_nothing() -> None:
    assert Friction(0.0, tangential_ratio=3.0) == 0.0
    assert sprung(0.3, TANGENTIAL_RATIO) == 0.3 and type(sprung(0.3, TANGENTIAL_RATIO)) is float
    again = pickle.loads(pickle.dumps(sprung(Friction(0.3, (), [(("a", "b"), 2.0)]), 0.5)))
    assert (tangential_ratio(again), again.clamping) == (0.5, ((("a", "b"), 2.0),))


def test_a_design_keeps_the_stiffness_that_it_was_judged_with(tmp_path: Path) -> None:
    keys = "goal: equilibrium\njoints: {friction: 0.5}\nstiffness_ratio: 0.5\n"
    config = load(written(tmp_path, PARTS, keys))
    designed = design(config.assembly, config.joints)
    assert designed.achieved and tangential_ratio(designed.design.judged_friction) == 0.5
    path = write_design(designed.design, tmp_path / "out")
    assert read_design(path).friction == designed.design.friction
    assert tangential_ratio(load(path).friction) == 0.5
