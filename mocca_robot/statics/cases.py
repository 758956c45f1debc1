"""Verdicts on load cases and tilts, from nothing but the contacts of an assembly."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Assembly
from mocca_robot.joints.joint import contact_rays, spanning_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.runtime.executors import mapped
from mocca_robot.statics.equilibrium import equilibrium
from mocca_robot.statics.friction_cases import as_equilibrium, present_corners, standing_case, tilt_with_friction
from mocca_robot.statics.friction_verdict import FrictionVerdict, Standing
from mocca_robot.statics.loads import LoadCase, case_wrenches, tilted_gravity
from mocca_robot.statics.solution import EquilibriumResult, solve_system
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.statics.tilt import critical_angle


@dataclass(frozen=True, eq=False)
class CaseVerdict:
    """A load case, its result, and the names of the parts that move in the collapse motion.

    With friction `rubbing` is the verdict that `result` stands for; None without.
    """

    case: LoadCase
    result: EquilibriumResult
    moving: tuple[str, ...]
    rubbing: FrictionVerdict | None = None

    def __repr__(self) -> str:
        moves = f", {len(self.moving)} of {len(self.case.present)} parts would move" if self.moving else ""
        status = str(self.result.status).replace("_", " ")
        return f"<CaseVerdict {self.case.name!r}: {status}, E/|w|² = {self.result.infeasibility:.2g}{moves}>"

    @property
    def only_clamped(self) -> bool:
        """Return whether some friction forces would hold it, but nothing brings them about."""
        return self.rubbing is not None and self.rubbing.standing is Standing.STANDS_ONLY_CLAMPED


def solve_case(graph: PartsGraph, case: LoadCase, friction: float = 0.0) -> CaseVerdict:
    """Return the equilibrium of one load case from the facets of all contacts, with the parts that move.

    Contact forces come back one per corner of every contact, zero where a part is absent, or, without friction, where
    other corners can exert the same forces. With friction they are vectors, and those that really come about: see
    `mocca_robot.statics.coulomb`.
    """
    rubbing: FrictionVerdict | None = None
    if friction == 0.0:
        system, there = _system(graph, case.present.tobytes(), case.free.tobytes())
        result = solve_system(system, system.scaled(case_wrenches(case, graph)))
    else:
        there = present_corners(graph, case.present)
        rubbing = standing_case(graph, case, friction)
        result = as_equilibrium(rubbing)
    forces = np.zeros((len(there), *result.forces.shape[1:]))
    forces[there] = result.forces
    full = EquilibriumResult(result.status, result.infeasibility, forces, result.motions, result.kkt)
    return CaseVerdict(case, full, () if result.stands else moving_parts(graph.assembly, result.motions), rubbing)


@lru_cache(maxsize=4)
def _system(graph: PartsGraph, present: bytes, free: bytes) -> tuple[ContactSystem, BoolArray]:
    """Return what all loads on the same parts have in common, and which of all contact rays (C,) it has.

    `present` and `free` are masks (N,) as bytes.
    """
    whole = _whole_system(graph)
    there = spanning_rays(graph.contacts) & np.frombuffer(present, dtype=np.bool_)[whole.pairs].all(axis=1)
    return whole.subset(there).holding(np.frombuffer(free, dtype=np.bool_)), there


@lru_cache(maxsize=4)
def _whole_system(graph: PartsGraph) -> ContactSystem:
    assembly = graph.assembly
    about = np.array([p.centroid for p in assembly.parts])
    return ContactSystem.build(*contact_rays(graph.contacts), ~assembly.fixed, about, assembly.size / 2)


def solve_rays(
    graph: PartsGraph, case: LoadCase, rays: tuple[IntArray, Array, Array], friction: float = 0.0
) -> EquilibriumResult:
    """Return the equilibrium of one load case on `rays` alone: pairs (C, 2), points (C, d) and normals (C, d).

    With friction it tells whether some forces hold the load, which nothing need bring about.
    Motions are about the parts' centroids. The graph's contacts tell which pairs an interlocking case pushes apart.
    """
    assembly = graph.assembly
    result = equilibrium(
        *rays,
        case_wrenches(case, graph),
        fixed=~case.free,
        friction=friction,
        about=np.array([p.centroid for p in assembly.parts]),
        length=assembly.size / 2,
    )
    assert isinstance(result, EquilibriumResult)
    return result


def solve_cases_on(
    executor: Executor | None, graph: PartsGraph, cases: Sequence[LoadCase], friction: float = 0.0
) -> tuple[CaseVerdict, ...]:
    """Return `solve_case` of every case, in order, each computed on `executor`; here when there is none."""
    return tuple(mapped(executor, partial(solve_case, graph, friction=friction), cases))


def critical_tilts(
    graph: PartsGraph,
    azimuths_rad: Sequence[float] | Array,
    friction: float = 0.0,
    executor: Executor | None = None,
) -> tuple[float, ...]:
    """Return `critical_tilt` towards every azimuth, in order, each computed on `executor`; here when there is none."""
    one = partial(critical_tilt, graph, friction=friction)
    return tuple(mapped(executor, one, [float(a) for a in azimuths_rad]))


def moving_parts(assembly: Assembly, motions: Array) -> tuple[str, ...]:
    """Return the names of parts whose velocity exceeds 1 % of the fastest's, in assembly order."""
    d = assembly.dimension
    reach = assembly.size / 2
    speed = np.linalg.norm(motions[:, :d], axis=1) + reach * np.linalg.norm(motions[:, d:], axis=1)
    return tuple(p.name for p, s in zip(assembly.parts, speed) if s > 0.01 * speed.max(initial=0.0) > 0)


def critical_tilt(graph: PartsGraph, azimuth_rad: float, friction: float = 0.0) -> float:
    """Return the largest tilt (radians, at most π/2) towards an azimuth at which the structure stands.

    Zero when it does not stand upright either. See `mocca_robot.statics.tilt` for the method, and `coulomb_tilt` for
    that with friction.
    """
    if friction > 0.0:
        return tilt_with_friction(graph, azimuth_rad, friction).critical_rad
    assembly = graph.assembly
    down = case_at(assembly, 0.0, azimuth_rad)
    if not solve_case(graph, down).result.stands:
        return 0.0
    masses = np.array([p.mass for p in assembly.parts])
    level = tilted_gravity(assembly.gravity, np.pi / 2, azimuth_rad)

    def solve(angle_rad: float) -> EquilibriumResult:
        return solve_case(graph, case_at(assembly, angle_rad, azimuth_rad)).result

    return critical_angle(solve, masses, assembly.gravity, level)[0]


def case_at(assembly: Assembly, angle_rad: float, azimuth_rad: float) -> LoadCase:
    """Return the whole assembly under gravity tilted by `angle_rad` towards `azimuth_rad`."""
    present = np.ones(len(assembly.parts), dtype=np.bool_)
    gravity = tilted_gravity(assembly.gravity, angle_rad, azimuth_rad)
    return LoadCase(f"tilt_{np.rad2deg(azimuth_rad):03.0f}", gravity, present, assembly.fixed)
