"""`sequence: auto`: an order for which joints exist, whatever the order that the parts come in."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Interlocking, Part, Polygon, SupportFree
from mocca_robot.cli import main
from mocca_robot.config.config import load
from mocca_robot.files.assembly_json import write_assembly
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.verdicts.verification import verify
from planners.cone_joints.designer import design
from planners.order.found_order import design_in_found_order
from planners.order.sequence import find_sequence

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def block(name: str, x: float, y: float, w: float, h: float, fixed: bool = False) -> Part:
    """Return a flat rectangle."""
    corners = np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])
    return Part(name, Polygon(corners, (), 0.02), fixed=fixed)


def column() -> Assembly:
    """Return three blocks on top of each other, listed from the top down: an order that nobody can build in."""
    parts = (
        block("ground", 0, 0, 1, 0.2, fixed=True),
        block("top", 0.35, 0.8, 0.3, 0.3),
        block("middle", 0.3, 0.5, 0.4, 0.3),
        block("low", 0.25, 0.2, 0.5, 0.3),
    )
    return Assembly("column", parts, goals=(SupportFree(),), alpha_rad=float(np.deg2rad(5.0)))


def test_parts_in_a_wrong_order_are_put_into_one_that_stands_at_every_step() -> None:
    assembly = column()
    found = design_in_found_order(assembly, design, seconds=None)
    assert found.designed is not None and found.designed.achieved and found.tried == 1
    assert found.assembly.sequence == ("ground", "low", "middle", "top")
    assert found.sequence is not None and found.sequence.supports == 0
    built = found.designed.design
    assert verify(built.assembly, directions={i.part: i.direction for i in built.insertion}).assemblable


def test_the_key_is_placed_last_and_the_sphere_interlocks_in_an_order_that_was_found() -> None:
    config = load(CONFIGS / "sphere.yaml")
    graph = PartsGraph.of(config.assembly)
    goal = next(g for g in config.assembly.goals if isinstance(g, Interlocking))
    found = find_sequence(graph, key=goal.key, states=50)
    assert [p.part for p in found.placements][-1] == goal.key


def test_where_no_order_exists_the_evidence_is_handed_over() -> None:
    """A block in a closed box: nobody can put it in, whatever the order."""
    outer = np.array([[0.0, 0.0], [0.4, 0.0], [0.4, 0.4], [0.0, 0.4]])
    hole = np.array([[0.1, 0.1], [0.1, 0.3], [0.3, 0.3], [0.3, 0.1]])
    parts = (Part("shell", Polygon(outer, (hole,), 0.02), fixed=True), block("core", 0.1, 0.1, 0.2, 0.2))
    found = design_in_found_order(Assembly("nut", parts), design, seconds=None)
    assert found.designed is None and found.tried == 0
    assert found.sequence is not None and found.sequence.obstacles[0].part == "core"


def test_of_orders_without_joints_the_most_promising_one_is_handed_back() -> None:
    tried: list[tuple[str, ...]] = []

    def never(ordered: Assembly):  # type: ignore[no-untyped-def]
        tried.append(ordered.sequence)
        return replace(first, achieved=False)

    first = design(column())
    found = design_in_found_order(column(), never, seconds=None)
    assert len(tried) == len(set(tried)) == found.tried
    assert found.assembly.sequence == tried[0]
    assert found.designed is not None and not found.designed.achieved


def test_the_configuration_says_auto(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_assembly(column(), tmp_path / "column.json")
    text = "model: column.json\nsequence: auto\ngoal: {kind: support_free}\n"
    (tmp_path / "c.yaml").write_text(text, encoding="utf-8")
    assert load(tmp_path / "c.yaml").finds_order
    assert main(["design", str(tmp_path / "c.yaml"), "-o", str(tmp_path / "out"), "--json"]) == 0
    capsys.readouterr()
    data = json.loads((tmp_path / "out" / "design.json").read_text(encoding="utf-8"))
    assert data["sequence"] == ["ground", "low", "middle", "top"]
