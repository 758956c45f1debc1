"""How time and memory of a design grow with the number of parts, joints and load cases."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.design_baseline import leaning_wall
from benchmarks.measurement import Measurement, ToolAnswer, measure
from mocca_robot.assembly import Assembly, Lateral
from mocca_robot.contacts.find import find_contacts
from mocca_robot.generators import generate
from planners.cone_joints.designer import design

SIZES = (50, 100, 200, 400, 800, 2000)
QUICK_SIZES = (50,)
CASES = (1, 2, 4, 8, 16, 32)
QUICK_CASES = (1, 4)
LIMIT_S = 3000.0


def long_wall(parts: int) -> Assembly:
    """Return a wall of five courses of solid bricks on a bed that leans by 10°, as long as it takes; α is 5°."""
    columns = max(2, round((parts - 2) / 5))
    found = generate("wall", {"courses": 5, "columns": columns, "tilt_deg": 10.0, "size": [0.2, 0.1, 0.1]}, Path())
    return replace(found, alpha_rad=float(np.deg2rad(5.0)))


def dome(parts: int) -> Assembly:
    """Return a dome in running bond, rings and blocks per ring growing alike; α is 2°."""
    rings = max(3, round(float(np.sqrt(parts / 4.4))))
    polar = np.deg2rad(np.linspace(90.0, 18.0, rings + 1))
    share = np.sin(0.5 * (polar[1:] + polar[:-1]))
    blocks = [max(5, round(x)) for x in share / share.sum() * (parts - 1)]
    found = generate("dome", {"blocks": blocks, "thickness": 0.15, "snap": 0.2, "shift": 0.49}, Path())
    return replace(found, alpha_rad=float(np.deg2rad(2.0)))


STRUCTURES = {"flat wall": leaning_wall, "long wall": long_wall, "dome": dome}


def growth(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield the design of growing structures, contacts included, then of one dome under more and more load cases."""
    for size in QUICK_SIZES if quick else SIZES:
        for name, make in STRUCTURES.items():
            case = f"{name}-{size}"
            if _wanted(case, only):
                yield measure("growth", case, "ours", partial(_designed, make, size), limit_s=LIMIT_S, repeats=1)
    for count in QUICK_CASES if quick else CASES:
        case = f"load cases-{count}"
        if _wanted(case, only):
            yield measure("growth", case, "ours", partial(_under_cases, count), limit_s=LIMIT_S, repeats=1)


def _wanted(case: str, only: str | None) -> bool:
    """Return whether `only` allows a case: its whole name, or a part without a number ('dome-200' is not 2000)."""
    return only is None or only == case or (only in case and not only[-1].isdigit())


def _designed(make: object, size: int) -> ToolAnswer:
    assembly = make(size)  # type: ignore[operator]
    return _outcome(assembly)


def _under_cases(count: int) -> ToolAnswer:
    tilted = Lateral(float(np.deg2rad(5.0)), count)
    return _outcome(replace(dome(50), goals=(tilted,)))


def _outcome(assembly: Assembly) -> ToolAnswer:
    started = time.perf_counter()
    report = find_contacts(assembly)
    contacts_s = time.perf_counter() - started
    found = design(assembly, contacts=report)
    holds = "holds" if found.achieved else "falls short"
    return ToolAnswer(
        f"{holds}; {len(assembly.parts)} parts, {len(report.contacts)} joints, {len(found.cases)} cases required, "
        f"{time.perf_counter() - started:.1f} s by the clock, {contacts_s:.2f} s of them contacts"
    )
