"""An order found together with the joints: orders that may have joints, most promising first, until one is designed.

Whether joints can hold a half-built assembly is not known before they are designed. Formally a joint is what friction
is to a flat contact, so orders are looked for in which every state stands with more and more of it: the first needs the
least of its joints. Among these, orders in which every part has more room than α to go in come first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.assembly import Assembly, Interlocking, SupportFree
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.contacts.find import find_contacts
from mocca_robot.motion.parts_graph import PartsGraph
from planners.cone_joints.outcome import Designed
from planners.order.sequence import Progress, SequenceResult, SequenceStatus, find_sequence, reordered

SLOPES_DEG = (0.0, 20.0)
"""How far the forces may lean that a state may need of its joints, in the orders that are looked for."""
MORE_ROOM = float(np.deg2rad(5.0))
"""Room beyond α that orders have which are looked for first."""
SECONDS = 6.0
"""How long orders with fewer supports are looked for, each time."""
FEW_PARTS = 40
"""Up to so many free parts several orders are tried; every one of more parts takes minutes."""

Design = Callable[[Assembly], Designed]
"""Designs joints for an assembly in its order."""
Watch = Callable[[], AbstractContextManager[Progress]]
"""Surrounds every search for an order; what it gives is told how far the search has come."""


@contextmanager
def _unwatched() -> Iterator[Progress]:
    yield lambda _: None


@dataclass(frozen=True, eq=False, kw_only=True)
class OrderedDesign:
    """A design in the order that was found with it.

    Attributes:
        assembly: the input in that order; in its own where no order exists.
        designed: the design in it; None where no order exists.
        sequence: the order, or why there is none; None where the order was given.
        tried: how many orders joints were designed for.
    """

    assembly: Assembly
    designed: Designed | None
    sequence: SequenceResult | None
    tried: int


def design_in_found_order(
    assembly: Assembly,
    design: Design,
    *,
    contacts: ContactReport | None = None,
    friction: float = 0.0,
    seconds: float | None = SECONDS,
    watch: Watch = _unwatched,
) -> OrderedDesign:
    """Return a design that is achieved in an order found for it, or the first one where none is.

    `design` makes joints for the assembly in its order; an interrupted one ends the trying. `friction` is that of the
    half-built states. Every search for an order runs inside `watch`, and is told what it finds. With `seconds` the
    orders depend on the machine; without them they do not. The key of an interlocking goal is placed last.
    """
    report = contacts or find_contacts(assembly)
    first: OrderedDesign | None = None
    tried = 0
    for found in _orders(assembly, report, friction, seconds, watch):
        if found.status is not SequenceStatus.FOUND:
            return first or OrderedDesign(assembly=assembly, designed=None, sequence=found, tried=0)
        tried += 1
        ordered = reordered(assembly, [p.part for p in found.placements])
        outcome = OrderedDesign(assembly=ordered, designed=design(ordered), sequence=found, tried=tried)
        assert outcome.designed is not None
        if outcome.designed.achieved or outcome.designed.interrupted is not None:
            return outcome
        first = first or outcome
    assert first is not None
    return replace(first, tried=tried)


def _orders(
    assembly: Assembly, report: ContactReport, friction: float, seconds: float | None, watch: Watch
) -> Iterator[SequenceResult]:
    """Yield different orders, most promising first; where there is none at all, the evidence alone."""
    few = sum(not p.fixed for p in assembly.parts) <= FEW_PARTS
    alpha = assembly.alpha_rad
    wanted: list[float | None] = [alpha]
    if alpha is not None and few:
        wanted = [min(alpha + MORE_ROOM, float(np.pi / 2)), alpha]
    needs_states = any(isinstance(g, SupportFree) for g in assembly.goals)
    late: list[SequenceResult] = []
    seen: set[tuple[str, ...]] = set()
    exists = False
    for slope in SLOPES_DEG if needs_states and few else SLOPES_DEG[:1]:
        mu = float(np.tan(np.arctan(friction) + np.deg2rad(slope)))
        for room in wanted:
            graph = PartsGraph.of(replace(assembly, alpha_rad=room), report.contacts)
            key = next((g.key for g in assembly.goals if isinstance(g, Interlocking)), None)
            with watch() as tell:
                found = find_sequence(graph, friction=mu, seconds=seconds, progress=tell, key=key)
            order = tuple(p.part for p in found.placements)
            if found.status is not SequenceStatus.FOUND:
                if room == alpha and not exists:
                    yield found
                    return
                continue
            exists = True
            if order in seen:
                continue
            seen.add(order)
            if needs_states and found.supports and few:
                late.append(found)
                continue
            yield found
    yield from sorted(late, key=lambda f: f.supports)
