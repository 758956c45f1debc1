"""What people hand in to be judged: an assembly, a design, what a design run or a file leaves, or a parts-graph."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Part
from mocca_robot.design import CountedFriction, Design, Insertion
from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph

TAKEN = "an Assembly, a Design, the outcome of design(), what read_design() or load() returns, or a PartsGraph"


class HasAssembly(Protocol):
    """A design, a stored one, a configuration, a parts-graph."""

    @property
    def assembly(self) -> Assembly:
        """Return the geometry to judge."""


class HasDesign(Protocol):
    """The outcome of a design run."""

    @property
    def design(self) -> Design:
        """Return what it designed."""


Judgeable: TypeAlias = Assembly | HasAssembly | HasDesign


@dataclass(frozen=True, eq=False, kw_only=True)
class HandedIn:
    """What there is to judge.

    Attributes:
        assembly: the geometry.
        graph: with its contacts, where they were handed in; None: they are to be found.
        directions: insertion axes (d,), unit, by part name.
        friction: Coulomb coefficient that belongs to it.
    """

    assembly: Assembly
    graph: PartsGraph | None = None
    directions: Mapping[str, Array] = field(default_factory=dict)
    friction: float = 0.0


def handed_in(what: Judgeable) -> HandedIn:
    """Return what is to be judged in `what`. Raises InputError, naming the type, for what holds no parts.

    A design brings its insertion directions and the friction that it counts on, a configuration those that it gives.
    """
    if isinstance(what, Assembly):
        return HandedIn(assembly=what)
    if isinstance(what, PartsGraph):
        return HandedIn(assembly=what.assembly, graph=_whole(what))
    if isinstance(inside := getattr(what, "design", None), Design):
        return handed_in(inside)
    if isinstance(assembly := getattr(what, "assembly", None), Assembly):
        ways, friction = getattr(what, "insertion", ()), getattr(what, "friction", None)
        return HandedIn(assembly=assembly, directions=_directions(ways), friction=_coefficient(friction))
    raise InputError(f"There are no parts to judge in {_said(what)}. {_remedy(what)}")


def _whole(graph: PartsGraph) -> PartsGraph:
    if graph.present.all():
        return graph
    missing = next(p.name for p in graph.assembly.parts if graph.assembly.index(p.name) not in graph.there)
    raise InputError(f"The parts-graph lacks '{missing}': it is a state of the sequence. Hand in the whole graph.")


def _directions(ways: object) -> Mapping[str, Array]:
    if isinstance(ways, Mapping):
        return ways
    return {i.part: i.direction for i in ways if isinstance(i, Insertion)} if isinstance(ways, tuple) else {}


def _coefficient(friction: object) -> float:
    if isinstance(friction, CountedFriction):
        return friction.coefficient
    return friction if isinstance(friction, float) else 0.0


def _said(what: object) -> str:
    if what is None:
        return "None"
    name = type(what).__name__
    return f"the {name} {what!r:.60}" if isinstance(what, str | int | float) else f"a value of type {name}"


def _remedy(what: object) -> str:
    if isinstance(what, str) or hasattr(what, "__fspath__"):
        return f"Read the file first: verify(load({str(what)!r}))."
    if isinstance(what, Part) or (isinstance(what, list | tuple) and what and isinstance(what[0], Part)):
        return "Put parts into an assembly first: verify(Assembly('name', (part, …)))."
    return f"Hand in {TAKEN}."
