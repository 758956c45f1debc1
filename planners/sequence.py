"""An order in which the parts can be placed one by one, found by taking the assembly apart.

Parts leave along straight lines. Removing parts only ever opens ways, so the parts that remain when nothing more can
leave are deadlocked for certain (among the directions tried), whatever the order. What is left to choose is which
removable part goes first: a best-first search over the states prefers those that stand, and counts the parts that
somebody would have to hold in the others.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterator, Sequence
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

LARGE = 20
"""With more free parts the first order found is kept, and parts to hold are chosen by how much they move."""
CANDIDATES = 6
"""Parts that could leave next, highest first, of which the best is taken."""


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
        fewest: whether no other order needs fewer supports, among the ways out and holders that were tried.
    """

    status: SequenceStatus
    placements: tuple[Placement, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    falling: tuple[str, ...] = ()
    remaining: tuple[str, ...] = ()
    states: int = 0
    fewest: bool = False

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
    spread ones are tried (default 36 flat, 120 solid). A first order is found by taking away what lies highest; when it
    needs supports, others are searched until `states` states were seen, then the best order so far is returned without
    a proof that it needs fewest; with none so far the answer is BUDGET.
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
    """Return the better of what taking away from the top finds and of a uniform-cost search from the whole assembly to
    its fixed parts, the cost being the supports of all states passed.

    A state's supports are counted only when it is its turn; until then its parent's cost stands for it, which is never
    more. Among equal costs the deepest state goes on first, and what lies highest leaves first.
    """
    names = assembly.sequence
    order = _from_the_top(exits, statics, holders)
    best = None if order is None else sum(len(statics.held(s)) for s in _states(exits.free, order))
    if best == 0 or (order is not None and len(exits.free) > LARGE):
        assert order is not None
        return _found(names, exits, statics, order, fewest=best == 0)
    ticket = itertools.count()
    whole = exits.free
    queue: list[tuple[int, int, int, bool, State, tuple[int, ...]]] = [(0, len(whole), next(ticket), False, whole, ())]
    stuck: State = whole
    seen: set[State] = set()
    while queue:
        cost, _, _, counted, there, removed = heapq.heappop(queue)
        if there in seen:
            continue
        if len(seen) >= budget:
            if order is not None:
                return _found(names, exits, statics, order, fewest=False)
            return _stopped(SequenceStatus.BUDGET, names, statics, stuck)
        need = len(statics.held(there))
        if holders is not None and need > holders:
            seen.add(there)
            if len(there) < len(stuck) or stuck == whole:
                stuck = there
            continue
        if not counted and need:
            heapq.heappush(queue, (cost + need, len(there), next(ticket), True, there, removed))
            continue
        seen.add(there)
        if not there:
            return _found(names, exits, statics, removed, fewest=True)
        for part in exits.from_the_top(there):
            after = there - {part}
            if after not in seen and exits.way_out(part, there) is not None:
                heapq.heappush(queue, (cost, len(after), next(ticket), False, after, (*removed, part)))
    return _stopped(SequenceStatus.FALLS, names, statics, stuck)


def _states(whole: State, removed: Sequence[int]) -> Iterator[State]:
    """Yield the states passed while `removed` leave one after the other, the whole one first."""
    there = whole
    yield there
    for part in removed:
        there = there - {part}
        yield there


def _from_the_top(exits: _Exits, statics: _Statics, holders: int | None) -> tuple[int, ...] | None:
    """Return an order of removal without going back: the highest part that can leave, unless another one of the first
    few leaves a state behind that needs fewer holders; None when `holders` do not suffice somewhere.
    """
    there, removed = exits.free, []
    held = statics.held(there)
    if holders is not None and len(held) > holders:
        return None
    while there:
        best: tuple[int, int] | None = None
        tried = 0
        for part in exits.from_the_top(there):
            if exits.way_out(part, there) is None:
                continue
            need = len(statics.held(there - {part}, held))
            if best is None or need < best[0]:
                best = need, part
            tried += 1
            if best[0] <= sum(h != part for h in held) or tried >= CANDIDATES:
                break
        if best is None or (holders is not None and best[0] > holders):
            return None
        there = there - {best[1]}
        removed.append(best[1])
        held = statics.held(there)
    return tuple(removed)


def _found(
    names: Sequence[str], exits: _Exits, statics: _Statics, removed: tuple[int, ...], *, fewest: bool
) -> SequenceResult:
    placements = _placements(names, exits, statics, removed[::-1])
    return SequenceResult(SequenceStatus.FOUND, placements, states=len(statics.known), fewest=fewest)


def _stopped(status: SequenceStatus, names: Sequence[str], statics: _Statics, stuck: State) -> SequenceResult:
    return SequenceResult(
        status,
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
        # Removing parts only opens ways: the one that was found still counts when looking anew finds none.
        out = exits.exact_way_out(part, there) or exits.way_out(part, there)
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
    open: dict[int, tuple[State, tuple[Array, float]]] = field(default_factory=dict)
    barred: dict[int, State] = field(default_factory=dict)

    def __post_init__(self) -> None:
        parts = self.assembly.parts
        self.fixed = frozenset(np.flatnonzero(self.assembly.fixed).tolist())
        self.free: State = frozenset(range(len(parts))) - self.fixed
        self.alpha = self.assembly.alpha_rad or 0.0
        self.spread = spread_directions(self.assembly.dimension, self.count)
        self.last: dict[int, Assembly] = {}
        down = self.assembly.gravity
        self.height = -np.array([p.centroid for p in parts]) @ down / max(float(np.linalg.norm(down)), 1e-12)
        self.normals: dict[int, list[tuple[int, Array]]] = {p: [] for p in self.free}
        for contact in self.contacts:
            i, j = contact.parts
            if j in self.normals:
                self.normals[j].append((i, contact.normal))
            if i in self.normals:
                self.normals[i].append((j, -contact.normal))

    def from_the_top(self, there: State) -> list[int]:
        """Return the parts of a state, the highest first; at one height the one placed last in the given order."""
        return sorted(there, key=lambda p: (-round(float(self.height[p]), 9), -p))

    def way_out(self, part: int, there: State) -> tuple[Array, float] | None:
        """Return a unit direction (d,) along which `part` leaves the free parts `there`, with the room around it at
        least. What is known is used again: a way stays free when others have left, and stays barred while what bars it
        is there.
        """
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
        d = self.assembly.dimension
        touching = [(other, n) for other, n in self.normals[part] if other in others]
        normals = np.array([n for _, n in touching]).reshape(-1, d)
        barring = {other for other, _ in touching}
        room, axis = largest_cone(normals)
        if room >= self.alpha - 1e-9:
            slack = np.arcsin(np.clip((self.spread @ normals.T).min(axis=1, initial=1.0), -1.0, 1.0))
            order = np.argsort(-slack, kind="stable")
            for way, free in [(axis, room), *((self.spread[k], float(slack[k])) for k in order)]:
                if free < self.alpha - 1e-9:
                    break
                met = self._meets(part, way) & others
                if not met:
                    return way, free
                barring |= met
        self.barred[part] = frozenset(barring)
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

    def __post_init__(self) -> None:
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
        verdict = solve_case(self.assembly, self.contacts, case, self.friction)
        if verdict.result.stands:
            return 0.0, ()
        d = self.assembly.dimension
        power = verdict.result.motions[:, :d] @ self.assembly.gravity * self.mass
        moving = [self.assembly.index(n) for n in verdict.moving]
        free = [p for p in moving if not fixed[p]] or [p for p in sorted(there) if not fixed[p]]
        return float(verdict.result.infeasibility), tuple(sorted(free, key=lambda p: (-float(power[p]), p)))
