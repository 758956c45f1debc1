"""Contact detection, and verdicts, of walls and domes; against COMPAS where an interpreter that has it is named."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.growth import dome
from benchmarks.measurement import Measurement, ToolAnswer, measure
from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.contacts.find import find_contacts
from mocca_robot.geometry.facets import facets
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import load_cases
from mocca_robot.tolerances import TOLERANCES

COMPAS_PYTHON = "MOCCA_COMPAS_PYTHON"
"""Environment variable: a Python interpreter that has compas_cra; `make compas` makes one."""
PEERS = ("compas_assembly", "compas_cra")
FRICTION = 0.6
PEER_PARTS = {"quick": 160, "all": 520}
"""Parts up to which peers are asked: their time grows fast."""
PEER_LIMIT_S = 120.0


def contacts(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield rows for detection alone, with the pairs found out of how many, and with the verdict (friction 0.6)."""
    for name in (
        ("wall-20", "wall-150", "dome-140")
        if quick
        else (
            *(f"wall-{n}" for n in (20, 150, 500, 1000)),
            *(f"dome-{n}" for n in (140, 1000)),
        )
    ):
        if only and only not in name:
            continue
        kind, size = name.split("-")
        assembly, expected = box_wall(int(size)) if kind == "wall" else (dome(int(size)), None)
        yield measure("contacts", name, "ours, contacts", partial(_detected, assembly, expected), repeats=3)
        yield measure("contacts", name, "ours", partial(_judged, assembly, expected), repeats=3)
        python = os.environ.get(COMPAS_PYTHON)
        if python and int(size) <= PEER_PARTS["quick" if quick else "all"]:
            yield from (_peer(name, python, assembly, expected, tool, None) for tool in PEERS)
            yield _peer(name, python, assembly, expected, "compas_cra", FRICTION)


def _detected(assembly: Assembly, expected: int | None) -> ToolAnswer:
    return ToolAnswer(_pairs({c.parts for c in find_contacts(assembly).contacts}, expected))


def _judged(assembly: Assembly, expected: int | None) -> ToolAnswer:
    graph = PartsGraph.of(assembly)
    result = solve_case(graph, load_cases(graph)[0], FRICTION).result
    return ToolAnswer(f"{result.status.value}, {_pairs({c.parts for c in graph.contacts}, expected)}", result.kkt)


def _pairs(found: set[tuple[int, int]], expected: int | None) -> str:
    return _words(len(found), expected)


def _words(count: int, expected: int | None) -> str:
    return f"{count} pairs in contact" if expected is None else f"{count} of {expected} pairs in contact"


def box_wall(blocks: int) -> tuple[Assembly, int]:
    """Return a running-bond wall of 2 × 1 × 1 m boxes on a slab, ten to a course, and its number of contacts."""
    width, rows = 10, blocks // 10
    boxes, names = [_box(-1.0, -1.0, 2.0 * width + 2.0, 0.0, y=1.0)], ["ground"]
    for r in range(rows):
        for c in range(width):
            x = 2.0 * c + 0.8 * (r % 2)
            boxes.append(_box(x, float(r), x + 2.0, r + 1.0, y=0.5))
            names.append(f"b{r}_{c}")
    parts = tuple(Part(n, b, 1000.0, fixed=n == "ground") for n, b in zip(names, boxes))
    return Assembly("wall", parts), rows * (width - 1) + width + (rows - 1) * (2 * width - 1)


def _box(x0: float, z0: float, x1: float, z1: float, y: float = 0.5) -> Mesh:
    corners = np.array([[x, b, z] for z in (z0, z1) for b in (-y, y) for x in (x0, x1)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return Mesh(corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))


def _peer(
    name: str, python: str, assembly: Assembly, expected: int | None, tool: str, friction: float | None
) -> Measurement:
    """Return a peer's row: it detects (and solves) in its own process and reports its own CPU time."""
    fixed = [k for k, part in enumerate(assembly.parts) if part.fixed]
    request = {"solids": _polyhedra(assembly), "fixed": fixed, "tool": tool, "friction": friction}
    script = Path(__file__).with_name("compas_peer.py")
    row = f"{tool}, contacts" if friction is None else tool
    try:
        done = subprocess.run(
            [python, str(script)],
            input=json.dumps(request),
            capture_output=True,
            text=True,
            timeout=PEER_LIMIT_S,
            check=True,
        )
        answer = json.loads(done.stdout.splitlines()[-1])
    except subprocess.TimeoutExpired:
        return Measurement(
            bench="contacts",
            case=name,
            tool=row,
            seconds=PEER_LIMIT_S,
            repeats=0,
            verdict="timeout",
            kkt=np.nan,
            memory_mb=np.nan,
        )
    except subprocess.CalledProcessError as error:
        reason = (error.stderr.strip().splitlines() or [""])[-1]
        return Measurement(
            bench="contacts",
            case=name,
            tool=row,
            seconds=np.nan,
            repeats=0,
            verdict=f"failed: {reason[:80]}",
            kkt=np.nan,
            memory_mb=np.nan,
        )
    except (subprocess.SubprocessError, OSError, ValueError, IndexError) as error:
        return Measurement(
            bench="contacts",
            case=name,
            tool=row,
            seconds=np.nan,
            repeats=0,
            verdict=f"failed: {type(error).__name__}",
            kkt=np.nan,
            memory_mb=np.nan,
        )
    if "failed" in answer:
        return Measurement(
            bench="contacts",
            case=name,
            tool=row,
            seconds=np.nan,
            repeats=0,
            verdict=f"failed: {answer['failed'][:160]}",
            kkt=np.nan,
            memory_mb=np.nan,
        )
    said = _words(answer["pairs"], expected)
    verdict = said if friction is None else f"{answer['verdict']}, {said}"
    return Measurement(
        bench="contacts",
        case=name,
        tool=row,
        seconds=answer["seconds"],
        repeats=1,
        verdict=verdict,
        kkt=np.nan,
        memory_mb=answer["memory_mb"],
    )


def _polyhedra(assembly: Assembly) -> list[dict[str, object]]:
    """Return vertices and polygonal faces of every part: what COMPAS expects, where we take triangles."""
    meshes = [p.shape for p in assembly.parts if isinstance(p.shape, Mesh)]
    whole = facets(meshes, TOLERANCES.contact_gap * assembly.size)
    solids: list[dict[str, object]] = []
    for part in range(len(meshes)):
        vertices: list[list[float]] = []
        faces = []
        for facet in np.flatnonzero(whole.facet_part == part):
            loop = whole.vertices[whole.loops(int(facet))[0]]
            faces.append(list(range(len(vertices), len(vertices) + len(loop))))
            vertices += loop.tolist()
        solids.append({"vertices": vertices, "faces": faces})
    return solids
