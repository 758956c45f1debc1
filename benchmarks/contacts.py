"""Contact detection and verdict of whole walls, against compas_cra where an interpreter that has it is named."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.measurement import Measurement, Outcome, measure
from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.contacts import find_contacts
from mocca_robot.loads import load_cases
from mocca_robot.verify import solve_case

COMPAS_PYTHON = "MOCCA_COMPAS_PYTHON"
"""Environment variable: a Python interpreter that has compas_cra; it needs its own environment."""
FRICTION = 0.6


def contacts(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield rows for running-bond walls: contacts found out of how many, and the verdict with friction 0.6."""
    for blocks in (20, 150) if quick else (20, 150, 500):
        assembly, expected = box_wall(blocks)
        name = f"wall-{blocks}"
        if only and only not in name:
            continue

        def ours(assembly: Assembly = assembly, expected: int = expected) -> Outcome:
            found = find_contacts(assembly).contacts
            result = solve_case(assembly, found, load_cases(assembly)[0], FRICTION).result
            return Outcome(f"{result.status.value}, {len(found)} of {expected} contacts", result.kkt)

        yield measure("contacts", name, "ours", ours, repeats=3)
        python = os.environ.get(COMPAS_PYTHON)
        if python and blocks <= 150:
            yield _compas(name, python, assembly, expected)


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


def _compas(name: str, python: str, assembly: Assembly, expected: int) -> Measurement:
    """Return compas_cra's row: it detects and solves in its own process and reports its own CPU time."""
    boxes: list[list[list[float]]] = [_mesh(p).vertices.tolist() for p in assembly.parts]
    request = json.dumps({"boxes": boxes, "friction": FRICTION})
    script = Path(__file__).with_name("compas_peer.py")
    try:
        done = subprocess.run(
            [python, str(script)], input=request, capture_output=True, text=True, timeout=120, check=True
        )
        answer = json.loads(done.stdout.splitlines()[-1])
    except (subprocess.SubprocessError, OSError, ValueError, IndexError) as error:
        return Measurement("contacts", name, "compas_cra", np.nan, 0, f"failed: {type(error).__name__}", np.nan, np.nan)
    verdict = f"{answer['verdict']}, {answer['contacts']} of {expected} contacts"
    return Measurement("contacts", name, "compas_cra", answer["seconds"], 1, verdict, np.nan, answer["memory_mb"])


def _mesh(part: Part) -> Mesh:
    assert isinstance(part.shape, Mesh)
    return part.shape
