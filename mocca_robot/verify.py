"""Verdicts from geometry alone: contacts are found anew, nothing of the design process is believed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np
import shapely

from mocca_robot.assembly import Array, Assembly, Goal, IntArray, Mesh, Polygon
from mocca_robot.contacts import Contact, find_contacts, to_shapely
from mocca_robot.executors import mapped
from mocca_robot.joints.joint import Joint, contact_rays, planar, spanning_rays
from mocca_robot.loads import LoadCase, case_wrenches, load_cases, tilted_gravity
from mocca_robot.parts_graph import PartMotion, part_motions
from mocca_robot.statics.equilibrium import EquilibriumResult, equilibrium
from mocca_robot.statics.tilt import critical_angle
from mocca_robot.sweep2d import free_half_angle_2d, sweep_blockers_2d

AWAY_DEG, OTHER_WAYS = (2.0, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0, 25.0, 30.0), 24
"""How far from the middle of a part's cone other ways in are looked for, and how many are tried."""


@dataclass(frozen=True, eq=False)
class CaseVerdict:
    """A load case, its result, and the names of the parts that move in the collapse motion."""

    case: LoadCase
    result: EquilibriumResult
    moving: tuple[str, ...]


def solve_case(assembly: Assembly, contacts: Sequence[Contact], case: LoadCase, friction: float = 0.0) -> CaseVerdict:
    """Return the equilibrium of one load case from the facets of `contacts`, with the parts that move.

    Contact forces come back one per corner of every contact, zero where a part is absent, or, without friction, where
    other corners can exert the same forces.
    """
    pairs, points, normals = contact_rays(contacts)
    there = case.present[pairs].all(axis=1)
    if friction == 0.0:
        there &= spanning_rays(tuple(contacts))
    result = solve_rays(assembly, contacts, case, (pairs[there], points[there], normals[there]), friction)
    forces = np.zeros((len(pairs), *result.forces.shape[1:]))
    forces[there] = result.forces
    full = EquilibriumResult(result.status, result.infeasibility, forces, result.motions, result.kkt)
    return CaseVerdict(case, full, () if result.stands else moving_parts(assembly, result.motions))


def solve_rays(
    assembly: Assembly,
    contacts: Sequence[Contact],
    case: LoadCase,
    rays: tuple[IntArray, Array, Array],
    friction: float = 0.0,
) -> EquilibriumResult:
    """Return the equilibrium of one load case on `rays` alone: pairs (C, 2), points (C, d) and normals (C, d).

    Motions are about the parts' centroids. `contacts` tell which pairs an interlocking case pushes apart.
    """
    result = equilibrium(
        *rays,
        case_wrenches(case, assembly, contacts),
        fixed=~case.free,
        friction=friction,
        about=np.array([p.centroid for p in assembly.parts]),
        length=assembly.size / 2,
    )
    assert isinstance(result, EquilibriumResult)
    return result


def solve_cases_on(
    executor: Executor | None,
    assembly: Assembly,
    contacts: Sequence[Contact],
    cases: Sequence[LoadCase],
    friction: float = 0.0,
) -> tuple[CaseVerdict, ...]:
    """Return `solve_case` of every case, in order, each computed on `executor`; here when there is none."""
    return tuple(mapped(executor, partial(solve_case, assembly, contacts, friction=friction), cases))


def critical_tilts(
    assembly: Assembly,
    contacts: Sequence[Contact],
    azimuths_rad: Sequence[float] | Array,
    friction: float = 0.0,
    executor: Executor | None = None,
) -> tuple[float, ...]:
    """Return `critical_tilt` towards every azimuth, in order, each computed on `executor`; here when there is none."""
    one = partial(critical_tilt, assembly, contacts, friction=friction)
    return tuple(mapped(executor, one, [float(a) for a in azimuths_rad]))


def moving_parts(assembly: Assembly, motions: Array) -> tuple[str, ...]:
    """Return the names of parts whose velocity exceeds 1 % of the fastest's, in assembly order."""
    d = assembly.dimension
    reach = assembly.size / 2
    speed = np.linalg.norm(motions[:, :d], axis=1) + reach * np.linalg.norm(motions[:, d:], axis=1)
    return tuple(p.name for p, s in zip(assembly.parts, speed) if s > 0.01 * speed.max(initial=0.0) > 0)


def critical_tilt(assembly: Assembly, contacts: Sequence[Contact], azimuth_rad: float, friction: float = 0.0) -> float:
    """Return the largest tilt (radians, at most π/2) towards an azimuth at which the structure stands.

    Zero when it does not stand upright either. See `mocca_robot.statics.tilt` for the method, with and without
    friction.
    """
    down = case_at(assembly, 0.0, azimuth_rad)
    if not solve_case(assembly, contacts, down, friction).result.stands:
        return 0.0
    masses = np.array([p.mass for p in assembly.parts])
    level = tilted_gravity(assembly.gravity, np.pi / 2, azimuth_rad)

    def solve(angle_rad: float) -> EquilibriumResult:
        return solve_case(assembly, contacts, case_at(assembly, angle_rad, azimuth_rad), friction).result

    return critical_angle(solve, masses, assembly.gravity, level)[0]


def case_at(assembly: Assembly, angle_rad: float, azimuth_rad: float) -> LoadCase:
    """Return the whole assembly under gravity tilted by `angle_rad` towards `azimuth_rad`."""
    present = np.ones(len(assembly.parts), dtype=np.bool_)
    gravity = tilted_gravity(assembly.gravity, angle_rad, azimuth_rad)
    return LoadCase(f"tilt_{np.rad2deg(azimuth_rad):03.0f}", gravity, present, assembly.fixed)


@dataclass(frozen=True, eq=False)
class InsertionVerdict:
    """Whether a part can be inserted along every direction of its cone.

    Attributes:
        part: name.
        alpha_rad: half-angle of the widest cone about its way in that is free, negative when its earlier contacts
            block the way itself. Flat parts: free of everything. Solid parts: as far as their own contacts tell
            (see PartMotion); `collides` tells of all others, within the cone that was asked for.
        required_rad: what was asked for; None when nothing was.
        blockers: names of earlier parts that are hit while inserting along the axis or the rim, or that leave
            the cone too narrow.
        collides: the sweep along the axis or rim hits a part that is not (or not only) limiting the cone.
    """

    part: str
    alpha_rad: float
    required_rad: float | None
    blockers: tuple[str, ...]
    collides: bool

    @property
    def assemblable(self) -> bool:
        """Return whether the part can be inserted as asked."""
        wide_enough = self.alpha_rad >= (self.required_rad or 0.0) - 1e-9
        return wide_enough and not self.collides


@dataclass(frozen=True, eq=False)
class Verification:
    """Everything statics and geometry say about an assembly as it stands.

    Attributes:
        contacts: found anew from the geometry.
        cases: every load case that the goals ask for.
        insertions: one per free part, in assembly order.
        part_overlap: the largest overlap of two parts, as a share of the smaller one.
    """

    contacts: tuple[Contact, ...]
    cases: tuple[CaseVerdict, ...]
    insertions: tuple[InsertionVerdict, ...]
    part_overlap: float

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
    contacts = find_contacts(assembly).contacts
    cases = solve_cases_on(executor, assembly, contacts, load_cases(assembly, goals), friction)
    return Verification(
        contacts, cases, insertion_verdicts(assembly, contacts, directions or {}), part_overlap(assembly)
    )


def insertion_verdicts(
    assembly: Assembly, contacts: Sequence[Contact], directions: dict[str, Array]
) -> tuple[InsertionVerdict, ...]:
    """Return one verdict per free part: its cone, and a swept collision check along the axis and the rim."""
    joints: list[Joint] = [planar(c) for c in contacts]
    verdicts = []
    for part, motion in part_motions(assembly, joints).items():
        name = assembly.parts[part].name
        alpha = motion.alpha_rad
        axis = motion.axis
        if name in directions and len(motion.normals):
            axis = -directions[name]
            alpha = _half_angle(motion, axis)
        hit = sweep_blockers(assembly, part, insertion_rim(axis, assembly.alpha_rad or 0.0)) if alpha > -1e-9 else ()
        if hit and name not in directions:
            # Others than those it touches bar the middle of its cone: another way may be free and wide enough.
            for way in _other_ways(motion, assembly.alpha_rad or 0.0):
                if not sweep_blockers(assembly, part, insertion_rim(way, assembly.alpha_rad or 0.0)):
                    axis, alpha, hit = way, _half_angle(motion, way), ()
                    break
        if assembly.dimension == 2 and alpha > 0.0 and not hit:
            alpha = min(alpha, free_half_angle_2d(assembly, part, axis))
        narrow = alpha < (assembly.alpha_rad or 0.0) - 1e-9
        blockers = {assembly.parts[b].name for b in motion.blockers} if narrow else set()
        blockers |= {assembly.parts[b].name for b in hit}
        ordered = tuple(n for n in assembly.sequence if n in blockers)
        verdicts.append(InsertionVerdict(name, alpha, assembly.alpha_rad, ordered, bool(hit)))
    return tuple(verdicts)


def _half_angle(motion: PartMotion, way_out: Array) -> float:
    """Return the half-angle of the widest cone about a way out that the part's own contacts leave."""
    return float(np.arcsin(np.clip((motion.normals @ way_out).min(), -1.0, 1.0)))


def _other_ways(motion: PartMotion, least_rad: float) -> Iterator[Array]:
    """Yield unit ways out that its own contacts leave free by `least_rad`, each as far as can be from those before."""
    if not len(motion.normals):
        return
    rings = [insertion_rim(motion.axis, float(np.deg2rad(off)), 36)[1:] for off in AWAY_DEG]
    ways = np.concatenate(rings)
    ways = ways[(ways @ motion.normals.T).min(axis=1) >= np.sin(least_rad) - 1e-9]
    apart = np.linalg.norm(ways - motion.axis, axis=1)
    for _ in range(min(OTHER_WAYS, len(ways))):
        way = ways[apart.argmax()]
        yield way
        apart = np.minimum(apart, np.linalg.norm(ways - way, axis=1))


def insertion_rim(axis: Array, alpha_rad: float, count: int = 8) -> Array:
    """Return (1 + m, d) ways out: the axis, then directions on the rim of K(axis, α); two in 2D, `count` in 3D."""
    if alpha_rad <= 0.0:
        return np.asarray(axis[None])
    if len(axis) == 2:
        side = np.array([-axis[1], axis[0]])
        rim = [np.cos(alpha_rad) * axis + s * np.sin(alpha_rad) * side for s in (1.0, -1.0)]
        return np.array([axis, *rim])
    seed = np.eye(3)[np.abs(axis).argmin()]
    first = np.cross(axis, seed)
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    turns = 2 * np.pi * np.arange(count) / count
    ring = np.cos(turns)[:, None] * first + np.sin(turns)[:, None] * second
    return np.concatenate([axis[None], np.cos(alpha_rad) * axis + np.sin(alpha_rad) * ring])


def sweep_blockers(assembly: Assembly, part: int, ways_out: Array) -> tuple[int, ...]:
    """Return the earlier parts that `part` hits on its way out along any of `ways_out` (m, d).

    The sweep is long enough to clear everything. Touching is not hitting: an overlap counts when it is deeper than
    parts at rest may overlap.
    """
    if not len(ways_out):
        return ()
    if assembly.dimension == 3:
        from mocca_robot.sweep3d import sweep_blockers_3d

        return sweep_blockers_3d(assembly, part, ways_out)
    return sweep_blockers_2d(assembly, part, ways_out)


def part_overlap(assembly: Assembly) -> float:
    """Return the largest overlap of two parts, as a share of the smaller part's area (2D) or volume (3D)."""
    if assembly.dimension == 3:
        from mocca_robot.sweep3d import mesh_overlap

        return mesh_overlap([p.shape for p in assembly.parts if isinstance(p.shape, Mesh)])
    shapes = np.array([to_shapely(p.shape) for p in assembly.parts if isinstance(p.shape, Polygon)])
    a, b = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    keep = a < b
    if not keep.any():
        return 0.0
    common = shapely.area(shapely.intersection(shapes[a[keep]], shapes[b[keep]]))
    smaller = np.minimum(shapely.area(shapes[a[keep]]), shapely.area(shapes[b[keep]]))
    return float((common / smaller).max())


__all__ = [
    "CaseVerdict",
    "InsertionVerdict",
    "PartMotion",
    "Verification",
    "critical_tilt",
    "critical_tilts",
    "insertion_verdicts",
    "part_overlap",
    "solve_case",
    "solve_cases_on",
    "sweep_blockers",
    "verify",
]
