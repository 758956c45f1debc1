"""An order in which the parts can be placed one by one, found by taking the assembly apart.

Parts leave along straight lines. Removing parts only ever opens ways, so the parts that remain when nothing more can
leave are deadlocked for certain (among the directions tried), whatever the order. What is left to choose is which
removable part goes first: a best-first search over the states prefers those that stand, and counts the parts that
somebody would have to hold in the others.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from mocca_robot.assembly import Array, Assembly, BoolArray
from mocca_robot.contacts import Contact, find_contacts
from mocca_robot.errors import InputError
from mocca_robot.loads import LoadCase
from mocca_robot.motion_cone import largest_cone
from mocca_robot.verify import insertion_rim, solve_case, sweep_blockers
from mocca_robot.ways_out import spread_directions

State = frozenset[int]


class SequenceStatus(StrEnum):
    """What the search found."""

    FOUND = "found"
    DEADLOCKED = "deadlocked"
    """Some parts lock each other: no straight way out for any of them."""
    FALLS = "falls"
    """Every order passes a state that needs more holders than there are."""
    BUDGET = "budget"
    """The search ended before all states were seen; an order may still exist."""


@dataclass(frozen=True, eq=False)
class Placement:
    """One part of the order.

    Attributes:
        part: its name.
        direction: (d,), unit; how it moves as it goes in.
        alpha_rad: how far from `direction` its contacts let it go in (π/2 when it touches nothing yet).
        held: parts that have to be held, once this one is placed and until the next one is.
    """

    part: str
    direction: Array
    alpha_rad: float
    held: tuple[str, ...] = ()


@dataclass(frozen=True)
class Obstacle:
    """Why a part cannot leave: the parts that bar every direction tried, those that bar most first."""

    part: str
    blockers: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SequenceResult:
    """An order, or why there is none.

    Attributes:
        status: see SequenceStatus.
        placements: free parts in the order of building; empty unless FOUND.
        obstacles: the deadlocked parts and what bars them; empty unless DEADLOCKED.
        falling: the parts that nobody is left to hold in the state that stopped the search; empty unless FALLS/BUDGET.
        remaining: the parts of that state.
        states: how many states were examined.
    """

    status: SequenceStatus
    placements: tuple[Placement, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    falling: tuple[str, ...] = ()
    remaining: tuple[str, ...] = ()
    states: int = 0

    @property
    def supports(self) -> int:
        """Return how many parts have to be held, summed over all states."""
        return sum(len(p.held) for p in self.placements)

    @property
    def holders(self) -> int:
        """Return how many parts have to be held at once, at most."""
        return max((len(p.held) for p in self.placements), default=0)


def reordered(assembly: Assembly, order: Sequence[str]) -> Assembly:
    """Return `assembly` with its free parts in `order`; InputError when `order` is not a permutation of them."""
    free = [p.name for p in assembly.parts if not p.fixed]
    if sorted(order) != sorted(free):
        odd = sorted(set(free).symmetric_difference(order)) or [n for n in order if list(order).count(n) > 1]
        raise InputError(f"The order must name every free part once; look at '{odd[0]}'.")
    fixed = [p for p in assembly.parts if p.fixed]
    return replace(assembly, parts=(*fixed, *(assembly.parts[assembly.index(n)] for n in order)))


def find_sequence(
    assembly: Assembly,
    contacts: Sequence[Contact] | None = None,
    *,
    holders: int | None = None,
    friction: float = 0.0,
    directions: int = 0,
    states: int = 2000,
) -> SequenceResult:
    """Return an order in which every part goes in inside a cone of half-angle `assembly.alpha_rad`.

    Among the orders the one that needs fewest supports (parts held, summed over the states) comes first; with
    `holders` no state may need more than that many at once. Besides the axis of each part's cone, `directions` evenly
    spread ones are tried (default 36 flat, 120 solid). After `states` states the search gives up with BUDGET.
    InputError when `holders` is negative.
    """
    if holders is not None and holders < 0:
        raise InputError(f"holders is {holders}; give 0 or more.")
    if contacts is None:
        contacts = find_contacts(assembly).contacts
    exits = _Exits(assembly, contacts, directions or (36 if assembly.dimension == 2 else 120))
    statics = _Statics(assembly, contacts, friction)
    locked = _deadlocked(exits)
    if locked:
        names = assembly.sequence
        obstacles = tuple(
            Obstacle(names[p], tuple(names[b] for b in exits.blockers(p, locked))) for p in sorted(locked)
        )
        return SequenceResult(
            SequenceStatus.DEADLOCKED, obstacles=obstacles, remaining=tuple(o.part for o in obstacles)
        )
    return _search(assembly, exits, statics, holders, states)


def _deadlocked(exits: _Exits) -> State:
    """Return the parts that stay when everything that can leave has left, in whatever order."""
    there = exits.free
    while True:
        leaving = next((p for p in sorted(there, reverse=True) if exits.way_out(p, there) is not None), None)
        if leaving is None:
            return there
        there = there - {leaving}


def _search(assembly: Assembly, exits: _Exits, statics: _Statics, holders: int | None, budget: int) -> SequenceResult:
    """Uniform-cost search from the whole assembly to its fixed parts; the cost is the supports of all states passed.

    Among equal costs the deepest state goes on first, and the part placed last in the given order leaves first.
    """
    names = assembly.sequence
    ticket = itertools.count()
    whole = exits.free
    first = statics.held(whole)
    queue: list[tuple[int, int, int, State, tuple[int, ...]]] = []
    stuck: State = whole
    if holders is None or len(first) <= holders:
        queue.append((len(first), len(whole), next(ticket), whole, ()))
    seen: set[State] = set()
    while queue:
        cost, _, _, there, removed = heapq.heappop(queue)
        if there in seen:
            continue
        seen.add(there)
        if not there:
            return SequenceResult(
                SequenceStatus.FOUND, _placements(names, exits, statics, removed[::-1]), states=len(statics.known)
            )
        if len(seen) > budget:
            return SequenceResult(
                SequenceStatus.BUDGET,
                remaining=_names(names, stuck),
                falling=_names(names, statics.held(stuck)),
                states=len(statics.known),
            )
        for part in sorted(there, reverse=True):
            after = there - {part}
            if after in seen or exits.way_out(part, there) is None:
                continue
            held = statics.held(after)
            if holders is not None and len(held) > holders:
                if len(after) < len(stuck) or stuck == whole:
                    stuck = after
                continue
            heapq.heappush(queue, (cost + len(held), len(after), next(ticket), after, (*removed, part)))
    return SequenceResult(
        SequenceStatus.FALLS,
        remaining=_names(names, stuck),
        falling=_names(names, statics.held(stuck)),
        states=len(statics.known),
    )


def _names(names: Sequence[str], parts: State | tuple[int, ...]) -> tuple[str, ...]:
    return tuple(names[p] for p in sorted(parts))


def _placements(
    names: Sequence[str], exits: _Exits, statics: _Statics, order: tuple[int, ...]
) -> tuple[Placement, ...]:
    placements = []
    for k, part in enumerate(order):
        there = frozenset(order[: k + 1])
        out = exits.way_out(part, there)
        assert out is not None
        axis, alpha = out
        held = _names(names, statics.held(there))
        placements.append(Placement(names[part], -axis, alpha, held))
    return tuple(placements)


@dataclass
class _Exits:
    """Ways out of parts, remembered: which parts a direction meets does not depend on the state."""

    assembly: Assembly
    contacts: Sequence[Contact]
    count: int
    met: dict[tuple[int, tuple[float, ...]], State] = field(default_factory=dict)
    ways: dict[tuple[int, State], tuple[Array, float] | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        parts = self.assembly.parts
        self.fixed = frozenset(np.flatnonzero(self.assembly.fixed).tolist())
        self.free: State = frozenset(range(len(parts))) - self.fixed
        self.alpha = self.assembly.alpha_rad or 0.0
        self.spread = spread_directions(self.assembly.dimension, self.count)
        self.last: dict[int, Assembly] = {}
        self.normals: dict[int, list[tuple[int, Array]]] = {p: [] for p in self.free}
        for contact in self.contacts:
            i, j = contact.parts
            if j in self.normals:
                self.normals[j].append((i, contact.normal))
            if i in self.normals:
                self.normals[i].append((j, -contact.normal))

    def way_out(self, part: int, there: State) -> tuple[Array, float] | None:
        """Return a unit direction (d,) along which `part` leaves the free parts `there`, with the room around it."""
        others = (there | self.fixed) - {part}
        key = (part, others)
        if key not in self.ways:
            self.ways[key] = self._way_out(part, others)
        return self.ways[key]

    def _way_out(self, part: int, others: State) -> tuple[Array, float] | None:
        d = self.assembly.dimension
        normals = np.array([n for other, n in self.normals[part] if other in others]).reshape(-1, d)
        room, axis = largest_cone(normals)
        if room < self.alpha - 1e-9:
            return None
        slack = np.arcsin(np.clip((self.spread @ normals.T).min(axis=1, initial=1.0), -1.0, 1.0))
        order = np.argsort(-slack, kind="stable")
        for way, free in [(axis, room), *((self.spread[k], float(slack[k])) for k in order)]:
            if free >= self.alpha - 1e-9 and not self._meets(part, way) & others:
                return way, free
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
            barring = {o for o, n in self.normals[part] if o in others and n @ way < np.sin(self.alpha) - 1e-9}
            barring |= self._meets(part, way) & others if not barring else set()
            for other in barring:
                votes[other] += 1
        return tuple(sorted((o for o in others if votes[o]), key=lambda o: -votes[o]))


@dataclass
class _Statics:
    """Which parts have to be held in a state, remembered."""

    assembly: Assembly
    contacts: Sequence[Contact]
    friction: float
    known: dict[State, tuple[int, ...]] = field(default_factory=dict)

    def held(self, there: State) -> tuple[int, ...]:
        """Return parts that, held, let the state stand. One after the other, the one that helps most: few, and not
        always fewest.
        """
        if there not in self.known:
            held: tuple[int, ...] = ()
            moving = self._moving(there, held)[1]
            while moving:
                best = min(moving, key=lambda p: (self._moving(there, (*held, p))[0], p))
                held = (*held, best)
                moving = self._moving(there, held)[1]
            self.known[there] = tuple(sorted(held))
        return self.known[there]

    def _moving(self, there: State, held: tuple[int, ...]) -> tuple[float, tuple[int, ...]]:
        """Return how far the state is from equilibrium, and which parts move."""
        present: BoolArray = np.array(self.assembly.fixed)
        present[list(there)] = True
        fixed: BoolArray = np.array(self.assembly.fixed)
        fixed[list(held)] = True
        if not (present & ~fixed).any():
            return 0.0, ()
        case = LoadCase("state", self.assembly.gravity, present, fixed)
        verdict = solve_case(self.assembly, self.contacts, case, self.friction)
        if verdict.result.stands:
            return 0.0, ()
        moving = [self.assembly.index(n) for n in verdict.moving]
        free = [p for p in moving if not fixed[p]] or [p for p in sorted(there) if not fixed[p]]
        return float(verdict.result.infeasibility), tuple(free)
