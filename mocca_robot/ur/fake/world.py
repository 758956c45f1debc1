"""What the fake arm can touch, and what can go wrong: contact forces from a plan's geometry, and faults on demand."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError, nearest
from mocca_robot.plan.plan import MoveKind, Plan, insertion_axis
from mocca_robot.plan.pose import transform

FINGERS_GIVE_M = 1e-4
"""How much narrower than the part fingers may stand without colliding."""
MOVES_M_S = 1e-4
"""What is slower stands still: it neither rubs nor runs into anything."""

SEAT_STIFFNESS_N_M = 20_000.0
"""Of the place where a part ends up: force control in steps of 30 ms stays stable on it."""
SEAT_PLAY_M = 2e-4
SLIDING_N = 2.0
WALL_PLAY_M, WALL_SLOPE, WALL_STIFFNESS_N_M = 2e-4, 0.15, 5_000.0
"""A joint is a cone: wide at its mouth, and at its end a part has this play."""
EARLY_STIFFNESS_N_M = 2_000.0
LINE_RADIUS_M = 0.01
ASIDE_M, MOUTH_M, RIM_M = 6e-4, 3.5e-4, 5e-4
"""How far aside a misplaced seat is, how far beside it its mouth still takes a part, and how deep its rim is."""
PART_TOP_M = 0.005


class Fault(StrEnum):
    """Everything that can be made to go wrong."""

    CONNECTION_DROPPED = "connection_dropped"
    CONNECTION_BLIP = "connection_blip"
    """RTDE connections are cut once, and accepted again at once."""
    RTDE_SILENT = "rtde_silent"
    PROTECTIVE_STOP = "protective_stop"
    EMERGENCY_STOP = "emergency_stop"
    SAFEGUARD_STOP = "safeguard_stop"
    PROGRAM_STOPPED = "program_stopped"
    OTHER_PROGRAM = "other_program"
    """Somebody else sends a program: the controller drops ours for it and goes on playing."""
    SLIDER_ZERO = "slider_zero"
    NAN = "nan"
    STALE = "stale"
    JAM = "jam"
    JAM_ONCE = "jam_once"
    """A jam that is gone when force mode begins again: what a retry is for."""
    MISPLACED = "misplaced"
    """Every seat is 0.6 mm aside: a part meets the rim unless it is pushed in nearly there."""
    STUCK = "stuck"
    PAYLOAD_IGNORED = "payload_ignored"
    TCP_IGNORED = "tcp_ignored"
    CONTACT = "contact"
    FORCE = "force"
    PART_MISSING = "part_missing"
    FINGERS_STUCK = "fingers_stuck"
    """The gripper says that it has moved, and its fingers stay where they are."""
    PART_LOST = "part_lost"
    """The part falls off the cup."""
    PART_STICKS = "part_sticks"
    """The vacuum under the cup does not go."""
    UNSAFE_POSE = "unsafe_pose"
    LOCAL_CONTROL = "local_control"


MODES = ("any", "servo", "force", "grip")


@dataclass
class Trigger:
    """A fault and its moment: the `nth` time that `mode` begins, `delay_s` of robot time later."""

    fault: Fault
    mode: str = "any"
    nth: int = 1
    delay_s: float = 0.0
    armed_at: float | None = None

    @classmethod
    def parse(cls, text: str) -> Trigger:
        """Return the trigger in `FAULT[@MODE[:NTH[:DELAY_S]]]`, such as `jam@force:2` or `nan@servo:1:0.5`."""
        name, _, moment = text.partition("@")
        if name not in set(Fault):
            raise InputError(f"Unknown fault '{name}'; {nearest(name, Fault)}")
        mode, *rest = moment.split(":") if moment else ["any"]
        if mode not in MODES:
            raise InputError(f"Unknown moment '{mode}' of fault '{text}'; {nearest(mode, MODES)}")
        try:
            nth, delay = int(rest[0]) if rest else 1, float(rest[1]) if len(rest) > 1 else 0.0
        except ValueError:
            raise InputError(f"Fault '{text}': write FAULT@MODE:NTH:DELAY_S, such as jam@force:2:0.5.") from None
        return cls(Fault(name), mode, nth, delay)


@dataclass(frozen=True)
class SeatStop:
    """Where a part slides in: a line that ends on a stiff stop; the `planned` one, or an alternative."""

    start: Array
    axis: Array
    depth_m: float
    planned: bool = True

    def distance(self, position: Array) -> float:
        """Return how far a point is from the line, which ends at the start and at the stop."""
        offset = position - self.start
        along = min(max(float(offset @ self.axis), 0.0), self.depth_m)
        return float(np.linalg.norm(offset - along * self.axis))

    @property
    def sideways(self) -> Array:
        """Return a unit direction (3,) across the line, the one nearest to the base's x."""
        across = np.array([1.0, 0.0, 0.0]) - self.axis[0] * self.axis
        return np.asarray(across / np.linalg.norm(across))

    def guide(self, offset: Array) -> Array:
        """Return the force (3,) with which the joint's walls lead a part inwards that is `offset` from the start."""
        along = float(offset @ self.axis)
        aside = offset - along * self.axis
        gap = float(np.linalg.norm(aside))
        beyond = gap - WALL_PLAY_M - WALL_SLOPE * max(self.depth_m - along, 0.0)
        return np.zeros(3) if along <= 0.0 or beyond <= 0.0 else -aside / gap * (WALL_STIFFNESS_N_M * beyond)


@dataclass(frozen=True)
class TrayPart:
    """A part that fingers along `tool_axis` grip at `where`; it is as wide up to `PART_TOP_M` above that."""

    where: Array
    width_m: float
    tool_axis: Array

    def depth(self, position: Array) -> float:
        """Return how deep closed fingertips at `position` would have to be inside the part."""
        offset = self.where - position
        above = float(offset @ self.tool_axis)
        beside = float(np.linalg.norm(offset - above * self.tool_axis))
        return max(PART_TOP_M - above, 0.0) if beside < LINE_RADIUS_M and above > -PART_TOP_M else 0.0


@dataclass
class World:
    """Seats, parts in their trays, and the faults that are active now.

    Attributes:
        parts: what lies in the tray; taken: which of it was gripped since.
    """

    seats: list[SeatStop] = field(default_factory=list)
    parts: list[TrayPart] = field(default_factory=list)
    taken: set[int] = field(default_factory=set)
    active: set[Fault] = field(default_factory=set)
    _early_point: Array | None = None
    _early_direction: Array | None = None

    @classmethod
    def of_plan(cls, plan: Plan) -> World:
        """Return the world that a plan expects: a part at every pick, a seat at the end of every insertion."""
        world = cls()
        for step in plan.steps:
            for move in step.moves:
                if move.kind is MoveKind.PICK:
                    tool = transform(move.path[-1].tcp)
                    world.parts.append(TrayPart(tool[:3, 3], step.grasp.width_m, tool[:3, 2]))
                if move.kind is MoveKind.INSERT:
                    for path in (move.path, *move.alternatives):
                        axis, depth = insertion_axis(path)
                        world.seats.append(SeatStop(np.array(path[0].tcp[:3]), axis, depth, path is move.path))
        return world

    def force(
        self,
        position: Array,
        velocity: Array,
        push: Array | None,
        push_n: float = 0.0,
        opening_m: float | None = None,
    ) -> Array:
        """Return the wrench (6,) that the tool feels, base frame.

        `push` is the force-mode axis or None, `push_n` its force: a jam answers it and no more. `opening_m` is between
        fingers, if there are any: they collide with a part that does not fit between them.
        """
        out = np.zeros(6)
        for k, part in enumerate(self.parts):
            if opening_m is not None and k not in self.taken and opening_m < part.width_m - FINGERS_GIVE_M:
                deep = part.depth(position)
                out[:3] -= part.tool_axis * (EARLY_STIFFNESS_N_M * deep)
        speed = float(np.linalg.norm(velocity))
        if push is not None:
            if (seat := self._seat_at(position, push)) is not None:
                offset = position - seat.start
                if Fault.MISPLACED in self.active:
                    offset = offset - ASIDE_M * seat.sideways
                along = float(offset @ seat.axis)
                aside = float(np.linalg.norm(offset - along * seat.axis))
                if Fault.MISPLACED in self.active and aside > MOUTH_M and 0.0 < along < RIM_M:
                    out[:3] -= push * push_n
                beyond = along - seat.depth_m - SEAT_PLAY_M
                out[:3] -= seat.axis * (SEAT_STIFFNESS_N_M * max(beyond, 0.0))
                if along > 0 and speed > MOVES_M_S:
                    out[:3] -= seat.axis * SLIDING_N
                out[:3] += seat.guide(offset)
            if self.jammed:
                out[:3] -= push * push_n
        if Fault.CONTACT in self.active:
            if self._early_point is None and speed > MOVES_M_S:
                self._early_point, self._early_direction = position.copy(), velocity / speed
            if self._early_point is not None and self._early_direction is not None:
                depth = float((position - self._early_point) @ self._early_direction)
                out[:3] -= self._early_direction * (EARLY_STIFFNESS_N_M * max(depth, 0.0))
        if Fault.FORCE in self.active:
            out[:3] += np.array([0.0, 30.0, 0.0])
        return out

    def _seat_at(self, position: Array, push: Array) -> SeatStop | None:
        """Return the seat that is pushed towards: the nearest line, and of those the one most in this direction."""
        here = [s for s in self.seats if s.planned or Fault.MISPLACED not in self.active]
        towards = [s for s in here if float(s.axis @ push) > 0.99]
        near = [(round(s.distance(position), 4), -float(s.axis @ push)) for s in towards]
        nearest = min(zip(near, towards, strict=True), key=lambda pair: pair[0], default=(None, None))[1]
        return nearest if nearest is not None and nearest.distance(position) < LINE_RADIUS_M else None

    @property
    def jammed(self) -> bool:
        """Return whether a pushed part cannot move."""
        return Fault.JAM in self.active or Fault.JAM_ONCE in self.active

    def clear(self, faults: Iterable[Fault]) -> None:
        """Remove faults."""
        self.active.difference_update(faults)
        if Fault.CONTACT not in self.active:
            self._early_point = self._early_direction = None

    def part_at(self, position: Array) -> bool:
        """Return whether a cup at `position` finds a part."""
        missing = Fault.PART_MISSING in self.active
        return not missing and any(np.linalg.norm(part.where - position) < 0.01 for part in self.parts)

    def grip_width(self, position: Array, wanted_m: float) -> tuple[float, bool]:
        """Return the opening that closing fingers reach at `position`, and whether a part stopped them."""
        if Fault.PART_MISSING in self.active:
            return wanted_m, False
        for k, part in enumerate(self.parts):
            if np.linalg.norm(part.where - position) < 0.01 and wanted_m <= part.width_m:
                self.taken.add(k)
                return part.width_m, True
        return wanted_m, False
