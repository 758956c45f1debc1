"""Support-free verdicts: every state of a dome of 73 parts while it is built, with friction, contacts given."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.measurement import Measurement, ToolAnswer, measure, side_by_side
from benchmarks.statics import compile_now
from mocca_robot.generators import generate
from mocca_robot.joints.joint import contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.equilibrium import equilibrium
from mocca_robot.statics.loads import LoadCase, case_wrenches, state_cases
from mocca_robot.statics.solution import EquilibriumResult

FRICTION = 0.55
RINGS = (16, 15, 13, 11, 9, 8)
"""Blocks per ring; with the cap they are 73 parts."""


def states(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield rows for single states, some that stand and some that fall, and one for all states together."""
    compile_now()
    assembly = generate("dome", {"blocks": list(RINGS), "thickness": 0.15, "snap": 0.2}, Path())
    graph = PartsGraph.of(assembly)
    cases = state_cases(graph)
    for number in range(len(cases) - 1, 0, -19 if quick else -7):
        name = f"dome-{len(assembly.parts)}-{cases[number].name}"
        if only is None or only in name:
            solvers = (("ours", "interior_point"), ("clarabel", "clarabel"))
            tools = {tool: partial(_judged, graph, [cases[number]], solver) for tool, solver in solvers}
            yield from side_by_side("states", name, tools, repeats=9)
    name = f"dome-{len(assembly.parts)}-all"
    if only is None or only in name:
        yield measure("states", name, "ours", partial(_judged, graph, cases, "interior_point"))


def _judged(graph: PartsGraph, cases: Sequence[LoadCase], solver: str) -> ToolAnswer:
    """Return the verdict of the last state, or how many of several stand, and the largest residual."""
    assembly, (pairs, points, normals) = graph.assembly, contact_rays(graph.contacts)
    results = []
    for case in cases:
        there = case.present[pairs].all(axis=1)
        result = equilibrium(
            pairs[there],
            points[there],
            normals[there],
            case_wrenches(case, graph),
            fixed=~case.free,
            friction=FRICTION,
            about=np.array([p.centroid for p in assembly.parts]),
            length=assembly.size / 2,
            solver=solver,
        )
        assert isinstance(result, EquilibriumResult)
        results.append(result)
    standing = sum(r.stands for r in results)
    verdict = results[0].status.value if len(results) == 1 else f"{standing} of {len(results)} stand"
    return ToolAnswer(verdict, max(r.kkt for r in results))
