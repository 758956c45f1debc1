"""Which parts somebody has to hold for a partly built assembly to stand."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mocca_robot.arrays import BoolArray
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import LoadCase
from planners.order.exits import State

LARGE = 20
"""With more free parts the first order found is kept, and parts to hold are chosen by how much they move."""


@dataclass
class HeldParts:
    """Which parts have to be held in a state, remembered."""

    graph: PartsGraph
    friction: float
    known: dict[State, tuple[int, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.assembly = self.graph.assembly
        self.mass = np.array([p.mass for p in self.assembly.parts])

    def held(self, there: State, near: tuple[int, ...] | None = None) -> tuple[int, ...]:
        """Return parts that, held, let the state stand: few, and not always fewest.

        One after the other is added: the one that helps most, or, in large states, the one that moves most, after
        those of a state `near`; then those are left out that are not needed after all.
        """
        if there not in self.known:
            large = len(there) > LARGE
            held = tuple(p for p in near or () if p in there) if large else ()
            given = len(held)
            moving = self._moving(there, held)[1]
            while moving:
                if large:
                    held = (*held, moving[0])
                else:
                    held = (*held, min(moving, key=lambda p: (self._moving(there, (*held, p))[0], p)))
                moving = self._moving(there, held)[1]
            for p in held[given:-1] if large else ():
                fewer = tuple(h for h in held if h != p)
                if not self._moving(there, fewer)[1]:
                    held = fewer
            self.known[there] = tuple(sorted(held))
        return self.known[there]

    def _moving(self, there: State, held: tuple[int, ...]) -> tuple[float, tuple[int, ...]]:
        """Return how far the state is from equilibrium, and which parts move, the fastest falling weights first."""
        present: BoolArray = np.array(self.assembly.fixed)
        present[list(there)] = True
        fixed: BoolArray = np.array(self.assembly.fixed)
        fixed[list(held)] = True
        if not (present & ~fixed).any():
            return 0.0, ()
        case = LoadCase("state", self.assembly.gravity, present, fixed)
        verdict = solve_case(self.graph, case, self.friction)
        if verdict.result.stands:
            return 0.0, ()
        d = self.assembly.dimension
        power = verdict.result.motions[:, :d] @ self.assembly.gravity * self.mass
        moving = [self.assembly.index(n) for n in verdict.moving]
        free = [p for p in moving if not fixed[p]] or [p for p in sorted(there) if not fixed[p]]
        return float(verdict.result.infeasibility), tuple(sorted(free, key=lambda p: (-float(power[p]), p)))
