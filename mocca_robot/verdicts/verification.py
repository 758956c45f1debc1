"""Verdicts from geometry alone: contacts are found anew, nothing of the design process is believed."""

from __future__ import annotations

from collections.abc import Sequence
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

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Return all contacts, in the order in which they were found."""
        return self.graph.contacts

    @property
    def stands(self) -> bool:
        """Return whether every load case is in equilibrium."""
        return all(c.result.stands for c in self.cases)

    @property
    def assemblable(self) -> bool:
        """Return whether every part can be inserted as asked."""
        return all(i.assemblable for i in self.insertions)


def verify(
    assembly: Assembly,
    *,
    goals: Sequence[Goal] | None = None,
    friction: float = 0.0,
    directions: dict[str, Array] | None = None,
    executor: Executor | None = None,
) -> Verification:
    """Return the verdicts on `assembly` from its geometry alone.

    `goals` default to the assembly's own; `directions` are insertion axes by part name, by default the axis of
    each part's widest cone. Load cases are solved on `executor`, or here.
    """
    graph = PartsGraph.of(assembly, insertion=directions)
    cases = solve_cases_on(executor, graph, load_cases(graph, goals), friction)
    factors = (*load_factors(graph, friction), *support_factors(graph, friction))
    return Verification(
        graph,
        cases,
        insertion_verdicts(graph),
        part_overlap(assembly),
        factors,
    )


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
