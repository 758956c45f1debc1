"""An order in which the parts can be placed one by one, found by taking the assembly apart.

Parts leave along straight lines. Removing parts only ever opens ways, so the parts that remain when nothing more can
leave are deadlocked for certain (among the directions tried), whatever the order. What is left to choose is which
removable part goes first: a best-first search over the states prefers those that stand, and counts the parts that
somebody would have to hold in the others.
"""

from __future__ import annotations

import heapq
import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from planners.order.exits import Exits, State
from planners.order.held_parts import LARGE, HeldParts

Progress = Callable[[str], None]
"""Told how many states were examined, and the supports of the best order so far."""
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


@dataclass(frozen=True, eq=False, kw_only=True)
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
        proven: of a DEADLOCKED result, whether no straight way out exists for any of the parts; else only those that
            were tried are barred.
    """

    status: SequenceStatus
    placements: tuple[Placement, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    falling: tuple[str, ...] = ()
    remaining: tuple[str, ...] = ()
    states: int = 0
    fewest: bool = False
    proven: bool = False

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
    graph: PartsGraph,
    *,
    holders: int | None = None,
    friction: float = 0.0,
    directions: int = 0,
    states: int = 2000,
    seconds: float | None = None,
    progress: Progress | None = None,
    key: str | None = None,
) -> SequenceResult:
    """Return an order in which every part goes in inside a cone of half-angle `graph.assembly.alpha_rad`.

    Among the orders the one that needs fewest supports (parts held, summed over the states) comes first; with
    `holders` no state may need more than that many at once. Besides the axis of each part's cone, `directions` evenly
    spread ones are tried (default 36 flat, 120 solid). A first order is found by taking away what lies highest; when it
    needs supports, others are searched until `states` states were seen, or for `seconds` once there is a first answer;
    then the best order so far is returned without a proof that it needs fewest. With none so far the answer is BUDGET.
    `seconds` makes the answer depend on the machine; without them it does not. `key` is placed last. InputError when
    `holders` or `seconds` is negative.
    """
    if holders is not None and holders < 0:
        raise InputError(f"holders is {holders}; give 0 or more.")
    if seconds is not None and seconds < 0.0:
        raise InputError(f"seconds is {seconds:g}; give 0 or more.")
    until = None if seconds is None else time.monotonic() + seconds
    assembly = graph.assembly
    last = None if key is None else assembly.index(key)
    exits = Exits(graph=graph, count=directions or (36 if assembly.dimension == 2 else 120), key=last)
    statics = HeldParts(graph, friction)
    locked = _deadlocked(exits)
    if locked:
        names = assembly.sequence
        obstacles = tuple(
            Obstacle(names[p], tuple(names[b] for b in exits.blockers(p, locked))) for p in sorted(locked)
        )
        return SequenceResult(
            status=SequenceStatus.DEADLOCKED,
            obstacles=obstacles,
            remaining=tuple(o.part for o in obstacles),
            proven=key is None and all(exits.proven[p] for p in locked),
        )
    return _search(assembly, exits, statics, holders, _Budget(states, until, progress))


@dataclass(frozen=True)
class _Budget:
    """How long others are searched: up to a number of states, and a moment of `time.monotonic`."""

    states: int
    until: float | None
    progress: Progress | None

    def used(self, seen: int) -> bool:
        """Return whether no further state may be examined."""
        return seen >= self.states or (self.until is not None and time.monotonic() >= self.until)

    def tell(self, seen: int, best: int | None) -> None:
        if self.progress is not None:
            order = "no order yet" if best is None else f"best order so far: {best} supports"
            self.progress(f"{seen} states, {order}")


def _deadlocked(exits: Exits) -> State:
    """Return the parts that stay when everything that can leave has left, in whatever order."""
    there = exits.free
    while True:
        leaving = next((p for p in sorted(there, reverse=True) if exits.way_out(p, there) is not None), None)
        if leaving is None:
            return there
        there = there - {leaving}


def _search(
    assembly: Assembly, exits: Exits, statics: HeldParts, holders: int | None, budget: _Budget
) -> SequenceResult:
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
        budget.tell(len(seen), best)
        if budget.used(len(seen)):
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


def _from_the_top(exits: Exits, statics: HeldParts, holders: int | None) -> tuple[int, ...] | None:
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
    names: Sequence[str], exits: Exits, statics: HeldParts, removed: tuple[int, ...], *, fewest: bool
) -> SequenceResult:
    placements = _placements(names, exits, statics, removed[::-1])
    return SequenceResult(status=SequenceStatus.FOUND, placements=placements, states=len(statics.known), fewest=fewest)


def _stopped(status: SequenceStatus, names: Sequence[str], statics: HeldParts, stuck: State) -> SequenceResult:
    return SequenceResult(
        status=status,
        remaining=_names(names, stuck),
        falling=_names(names, statics.held(stuck)),
        states=len(statics.known),
    )


def _names(names: Sequence[str], parts: State | tuple[int, ...]) -> tuple[str, ...]:
    return tuple(names[p] for p in sorted(parts))


def _placements(
    names: Sequence[str], exits: Exits, statics: HeldParts, order: tuple[int, ...]
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
