"""Which states of the sequence fall when the gripper lets go, and who would have to be held."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from mocca_robot.assembly import Assembly
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import LoadCase, state_cases


@dataclass(frozen=True)
class FallingState:
    """A state that falls when the gripper lets go: after `part` was placed, `moving` move."""

    part: str
    moving: tuple[str, ...]


def falls(assembly: Assembly, friction: float = 0.0, supports: Collection[str] = ()) -> tuple[FallingState, ...]:
    """Return the states of the sequence that do not stand once the part is released; `supports` name parts that
    something holds from the moment they are placed.
    """
    held_always = np.array([p.fixed or p.name in supports for p in assembly.parts])
    if held_always.all():
        return ()
    graph = PartsGraph.of(assembly)
    found = []
    for case, part in zip(state_cases(graph), graph.free, strict=True):
        held = case.held | held_always
        if not (case.present & ~held).any():
            continue
        verdict = solve_case(graph, LoadCase(case.name, case.gravity, case.present, held), friction)
        if not verdict.result.stands:
            found.append(FallingState(assembly.parts[part].name, verdict.moving))
    return tuple(found)
