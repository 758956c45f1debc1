"""The drawn parts-graph: every part, every pair, in both formats."""

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from helpers.physics_models import bump, rectangle

from benchmarks.random_assemblies import random_assembly
from mocca_robot.assembly import Assembly, Part
from mocca_robot.cli.parser import main
from mocca_robot.contacts.find import find_contacts
from mocca_robot.files.assembly_json import write_assembly
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report.graph_drawing import HIGHEST, graph_dot, graph_svg

SVG = "{http://www.w3.org/2000/svg}"


def mixed() -> PartsGraph:
    """Return a wall in which every other contact is curved."""
    assembly = random_assembly("wall", 1)
    flat = PartsGraph.of(assembly)
    joints = [bump(j.contact, 0.15) if k % 2 else j for k, j in enumerate(flat.joints)]
    return PartsGraph.joined(assembly, joints)


def titles(svg: str) -> list[str]:
    return [title.text or "" for title in ElementTree.fromstring(svg).iter(f"{SVG}title")]


def test_the_picture_has_every_part_and_every_pair_with_its_joints() -> None:
    graph = mixed()
    whole, *told = titles(graph_svg(graph))
    names = graph.assembly.sequence
    assert whole.startswith(f"Parts-graph of {graph.assembly.name}: {len(names)} parts")
    pairs = [t for t in told if " → " in t]
    assert len(pairs) == graph.network.number_of_edges()
    for meeting in graph.meetings:
        (said,) = [t for t in pairs if t.startswith(f"{names[meeting.later]} → {names[meeting.earlier]}: ")]
        assert all(joint.kind in said for joint in meeting.joints)
    assert [t.split(":")[0] for t in told if " → " not in t] == list(names), "in the order in which they are placed"


def test_a_long_sequence_stays_a_strip() -> None:
    blocks = tuple(Part(f"b{k}", rectangle(0.1 * k, 0.0, 0.1, 0.1), fixed=k == 0) for k in range(60))
    beam = Part("beam", rectangle(0.0, 0.1, 6.0, 0.05))
    svg = graph_svg(PartsGraph.of(Assembly("row", (*blocks, beam))))
    height = float(ElementTree.fromstring(svg).get("height", "0"))
    assert HIGHEST < height < HIGHEST + 150.0
    assert ">60<" in svg and ">60 b59<" not in svg, "so many parts have numbers only"


def test_dot_lists_nodes_and_edges_and_keeps_odd_names() -> None:
    assembly = Assembly(
        'a "wall"',
        (
            Part("ground\\floor", rectangle(0.0, -0.1, 1.0, 0.1), fixed=True),
            Part('the "stone"', rectangle(0.2, 0.0, 0.4, 0.2)),
        ),
    )
    dot = graph_dot(PartsGraph.of(assembly, insertion={'the "stone"': np.array([0.0, -1.0])}))
    assert dot.startswith('digraph "a \\"wall\\"" {')
    assert '1 [label="1 ground\\\\floor\\nfixed"' in dot
    assert '2 [label="2 the \\"stone\\"\\n±90' in dot
    assert '2 -> 1 [label="planar", style=dashed];' in dot
    graph = mixed()
    found = {(int(a), int(b)) for a, b in re.findall(r"(\d+) -> (\d+)", graph_dot(graph))}
    assert found == {(j + 1, i + 1) for j, i in graph.network.edges}


@pytest.mark.parametrize("kind", ["dot", "graph-svg"])
def test_export_writes_it_from_an_assembly(kind: str, tmp_path: Path) -> None:
    assembly = random_assembly("arch", 2)
    file = write_assembly(assembly, tmp_path / "arch.json")
    target = tmp_path / f"out.{kind}"
    assert main(["export", str(file), "--format", kind, "-o", str(target)]) == 0
    graph = PartsGraph.of(assembly, find_contacts(assembly).contacts)
    text = target.read_text(encoding="utf-8")
    assert text == (graph_dot(graph) if kind == "dot" else graph_svg(graph))
