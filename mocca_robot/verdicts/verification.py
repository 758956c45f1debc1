"""Verdicts from geometry alone: contacts are found anew, nothing of the design process is believed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Goal, Mesh, Polygon
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.motion.insertion import InsertionVerdict, insertion_verdicts
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import CaseVerdict, solve_cases_on
from mocca_robot.statics.load_factor import LoadFactor, load_factors
from mocca_robot.statics.loads import load_cases
from mocca_robot.statics.moving_support import support_factors
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.handed_in import Judgeable, handed_in


@dataclass(frozen=True, eq=False)
class Verification:
    """Everything statics and geometry say about an assembly as it stands.

    Attributes:
        graph: the parts and their contacts, found anew from the geometry.
        cases: every load case that the goals ask for.
        insertions: one per free part, in assembly order.
        part_overlap: the largest overlap of two parts, as a share of the smaller one.
        load_factors: how much of every load and combination it takes.
    """

    graph: PartsGraph
    cases: tuple[CaseVerdict, ...]
    insertions: tuple[InsertionVerdict, ...]
    part_overlap: float
    load_factors: tuple[LoadFactor, ...] = ()

    def __repr__(self) -> str:
        held = sum(c.result.stands for c in self.cases)
        cases = f"{self.standing} ({held} of {len(self.cases)} load cases held)"
        way = "can be put together" if self.assemblable else "cannot be put together as asked"
        return f"<Verification of {self.graph.assembly.name!r}: {self.graph.assembly.said}, {cases}, {way}>"

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Return all contacts, in the order in which they were found."""
        return self.graph.contacts

    @property
    def stands(self) -> bool:
        """Return whether every load case is in equilibrium."""
        return all(c.result.stands for c in self.cases)

    @property
    def standing(self) -> str:
        """Return the verdict in words: 'stands', 'does not stand', or 'not decided' where the solver was inaccurate."""
        if self.stands:
            return "stands"
        falls = any(c.result.status is Status.NOT_IN_EQUILIBRIUM for c in self.cases)
        return "does not stand" if falls else "not decided"

    @property
    def assemblable(self) -> bool:
        """Return whether every part can be inserted as asked."""
        return all(i.assemblable for i in self.insertions)


def verify(
    what: Judgeable,
    *,
    goals: Sequence[Goal] | None = None,
    friction: float | None = None,
    directions: Mapping[str, Array] | None = None,
    executor: Executor | None = None,
) -> Verification:
    """Return the verdicts on `what` from its geometry alone; its contacts are found anew.

    Raises InputError, naming the type, for anything else than what is listed here.

    Args:
        what: an Assembly, a Design (its built parts), the outcome of `design`, what `read_design` or `load` returns;
            or a PartsGraph, which is judged with the contacts that it holds.
        goals: default to the assembly's own.
        friction: Coulomb coefficient; by default the one that a design counts on or a configuration gives, else 0.
        directions: insertion axes (d,), unit, by part name; by default the design's, else the axis of each part's
            widest cone.
        executor: where load cases are solved; None: here.
    """
    found = handed_in(what)
    mu = found.friction if friction is None else friction
    graph = found.graph
    if graph is None or directions is not None:
        contacts = None if graph is None else graph.contacts
        graph = PartsGraph.of(found.assembly, contacts, found.directions if directions is None else directions)
    cases = solve_cases_on(executor, graph, load_cases(graph, goals), mu)
    factors = (*load_factors(graph, mu), *support_factors(graph, mu))
    return Verification(graph, cases, insertion_verdicts(graph), part_overlap(found.assembly), factors)


def part_overlap(assembly: Assembly) -> float:
    """Return the largest overlap of two parts, as a share of the smaller part's area (2D) or volume (3D)."""
    if assembly.dimension == 3:
        from mocca_robot.motion.sweep3d import mesh_overlap

        return mesh_overlap([p.shape for p in assembly.parts if isinstance(p.shape, Mesh)])
    shapes = np.array([to_shapely(p.shape) for p in assembly.parts if isinstance(p.shape, Polygon)])
    a, b = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    keep = a < b
    if not keep.any():
        return 0.0
    common = shapely.area(shapely.intersection(shapes[a[keep]], shapes[b[keep]]))
    smaller = np.minimum(shapely.area(shapes[a[keep]]), shapely.area(shapes[b[keep]]))
    return float((common / smaller).max())
