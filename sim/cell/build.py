"""What is built at each moment: which parts are held, which stand by themselves, and in which phase a move happens."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.plan.plan import MoveKind, Plan, Step
from sim.cell.cell_model import Moment, Phase, Pose, Workplace, seat
from sim.cell.world import CellWorld


class Build:
    """The structure as it grows. A part that its support takes over is held where it is then, or, in a cradle, drawn to
    its place; what is pushed in beside it can press it aside, as far as the support gives.

    Attributes:
        held: parts that are built and held: fixed ones, and those that something holds.
    """

    def __init__(self, place: Workplace, plan: Plan) -> None:
        parts = place.assembly.parts
        self.held = {k for k, p in enumerate(parts) if p.fixed}
        self._free: set[int] = set()
        self._supported = {place.assembly.index(name) for name in plan.supports}
        self._cradled = {k: seat(parts[k]) for k in map(place.assembly.index, plan.cradles)}
        self._taken: dict[int, Pose] = {}
        self._beside: dict[int, set[int]] = {k: set() for k in range(len(parts))}
        for contact in place.contacts:
            a, b = contact.parts
            self._beside[a].add(b)
            self._beside[b].add(a)

    @property
    def free(self) -> tuple[int, ...]:
        """Return the parts that are built and held by nothing but the structure."""
        return tuple(sorted(self._free))

    def at(self, phase: Phase, moving: int | None) -> Moment:
        """Return the moment with what is built now."""
        beside = self._beside[moving] if moving is not None and phase == "insert" else set()
        yielding = {k: p for k, p in sorted(self._taken.items()) if k in beside and k in self.held}
        return Moment(phase, moving, self.free, tuple(sorted(self.held - set(yielding))), tuple(yielding.items()))

    def release(self, part: int, pose: Pose) -> Moment:
        """Return the moment in which `part` is let go at `pose`: a support holds it there, a cradle draws it home."""
        if part not in self._supported:
            return self.at("rest", part)
        self._taken[part] = self._cradled.get(part, pose)
        if part in self._cradled:
            return Moment("rest", None, self.free, tuple(sorted(self.held)), ((part, self._taken[part]),))
        self.held.add(part)
        return self.at("rest", None)

    def set_down(self, part: int) -> Moment:
        """Return the moment in which `part` counts as built: held by its support if it has one."""
        (self.held if part in self._supported else self._free).add(part)
        return self.at("rest", None)

    def remove_supports(self) -> Moment:
        """Return the moment in which the supports are taken away."""
        self._free |= self.held & self._supported
        self.held -= self._supported
        return self.at("rest", None)

    def hold_key(self, parts: Sequence[int]) -> None:
        """Hold those of `parts` that are built: the design of the finished structure asks for it."""
        there = set(parts) & (self.held | self._free)
        self.held |= there
        self._free -= there
        self._supported -= there


def settle(world: CellWorld, longest_s: float, resting: Callable[[], bool]) -> float:
    """Leave everything alone until `resting`, 0.2 s at least and `longest_s` at most; return the seconds it took."""
    started, goal = world.time_s, np.array(world.data.qpos[:6])
    while world.time_s - started < longest_s:
        world.advance(goal, np.zeros(6))
        world.remember()
        if world.time_s - started >= 0.2 and resting():
            break
    return world.time_s - started


def speeds(world: CellWorld, parts: Sequence[int]) -> Array:
    """Return (F,) how fast parts move, m/s: of their centres, and of their outermost points by turning."""
    return np.array([world.speed(k) for k in parts])


def phases(step: Step) -> tuple[Phase, ...]:
    """Return the phase of the build in which each move of `step` happens.

    A part meets its neighbours from the guarded approach before its insertion on, and rests once it is released.
    """
    kinds = [m.kind for m in step.moves]
    insert = kinds.index(MoveKind.INSERT) if MoveKind.INSERT in kinds else len(kinds)
    near = insert
    while near > 0 and kinds[near - 1] is MoveKind.APPROACH:
        near -= 1
    release = next((k for k in range(insert, len(kinds)) if kinds[k] is MoveKind.RELEASE), len(kinds))
    return tuple("fetch" if k < near else "insert" if k < release else "rest" for k in range(len(kinds)))
