"""Ways out of a partly built assembly: along which straight line can a part leave, and which parts bar it?"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.geometry.sliding import sliding_ways
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.motion.ways_out import insertion_rim, spread_directions, sweep_blockers
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD, EXACT, ROUNDING

State = frozenset[int]
"""The free parts that are there, by their numbers."""


@dataclass(kw_only=True)
class Exits:
    """Ways out of parts, remembered: which parts a direction meets does not depend on the state."""

    graph: PartsGraph
    count: int
    key: int | None = None
    """The part that is placed last: while it is there, no other one leaves."""
    met: dict[tuple[int, tuple[float, ...]], State] = field(default_factory=dict)
    open: dict[int, tuple[State, tuple[Array, float]]] = field(default_factory=dict)
    barred: dict[int, State] = field(default_factory=dict)
    proven: dict[int, bool] = field(default_factory=dict)
    """Of the parts in `barred`: whether every direction was tried, not only some of many."""

    def __post_init__(self) -> None:
        self.assembly = self.graph.assembly
        self.free: State = frozenset(self.graph.free)
        self.fixed = self.graph.there - self.free
        self.alpha = self.assembly.alpha_rad or 0.0
        self.spread = spread_directions(self.assembly.dimension, self.count)
        self.last: dict[int, Assembly] = {}
        down = self.assembly.gravity
        self.height = (
            -np.array([p.centroid for p in self.assembly.parts]) @ down / max(float(np.linalg.norm(down)), EXACT)
        )

    def from_the_top(self, there: State) -> list[int]:
        """Return the parts of a state, the highest first; at one height the one placed last in the given order."""
        return sorted(there, key=lambda p: (-round(float(self.height[p]), 9), -p))

    def way_out(self, part: int, there: State) -> tuple[Array, float] | None:
        """Return a unit direction (d,) along which `part` leaves the free parts `there`, with the room around it at
        least. What is known is used again: a way stays free when others have left, and stays barred while what bars it
        is there.
        """
        if self.key is not None and part != self.key and self.key in there:
            return None
        others = (there | self.fixed) - {part}
        if part in self.open and others <= self.open[part][0]:
            return self.open[part][1]
        if part in self.barred and self.barred[part] <= others:
            return None
        found = self.exact_way_out(part, there)
        if found is not None:
            self.open[part] = others, found
        return found

    def exact_way_out(self, part: int, there: State) -> tuple[Array, float] | None:
        """Return the same, looked for anew."""
        others = (there | self.fixed) - {part}
        motion = self.graph.leaving(part, others)
        room, axis, normals = motion.alpha_rad, motion.axis, motion.normals
        barring = set(others.intersection(self.graph.neighbours(part)))
        if room >= self.alpha - ANGLE_ROUNDING_RAD:
            slack = np.arcsin(np.clip((self.spread @ normals.T).min(axis=1, initial=1.0), -1.0, 1.0))
            order = np.argsort(-slack, kind="stable")
            for way, free in [(axis, room), *((self.spread[k], float(slack[k])) for k in order)]:
                if free < self.alpha - ANGLE_ROUNDING_RAD:
                    break
                met = self._meets(part, way) & others
                if not met:
                    return way, free
                barring |= met
        proven = room < self.alpha - ANGLE_ROUNDING_RAD
        if self.alpha <= 0.0:
            # What slides leaves along lines and planes, which no spread of directions meets.
            slides, proven = sliding_ways(normals)
            for way in slides:
                met = self._meets(part, way) & others
                if not met:
                    return way, 0.0
                barring |= met
        self.barred[part] = frozenset(barring)
        self.proven[part] = proven
        return None

    def _meets(self, part: int, way: Array) -> State:
        key = (part, tuple(np.round(way, 9).tolist()))
        if key not in self.met:
            if part not in self.last:
                parts = self.assembly.parts
                others = (*parts[:part], *parts[part + 1 :])
                self.last[part] = replace(self.assembly, goals=(), parts=(*others, parts[part]))
            hit = sweep_blockers(self.last[part], len(self.assembly.parts) - 1, insertion_rim(way, self.alpha))
            self.met[key] = frozenset(h if h < part else h + 1 for h in hit)
        return self.met[key]

    def blockers(self, part: int, there: State) -> tuple[int, ...]:
        """Return the parts present that bar `part`, those that bar most of the directions first."""
        others = (there | self.fixed) - {part}
        votes = dict.fromkeys(others, 0)
        for way in self.spread:
            neighbours, normals = self.graph.touching(part)
            barring = others.intersection(neighbours[normals @ way < np.sin(self.alpha) - ROUNDING].tolist())
            barring = barring or self._meets(part, way) & others
            for other in barring:
                votes[other] += 1
        return tuple(sorted((o for o in others if votes[o]), key=lambda o: -votes[o]))
