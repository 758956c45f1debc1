"""Verdicts with friction on load cases and tilts of an assembly, from its contacts."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.contacts.friction import between, clamped, sprung, tangential_ratio
from mocca_robot.joints.joint import contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.coulomb_tilt import RESOLUTION_RAD, FrictionTilt, largest_tilt
from mocca_robot.statics.friction_verdict import FrictionVerdict, Standing
from mocca_robot.statics.frictional_contacts import FrictionalContacts
from mocca_robot.statics.loads import LoadCase, case_wrenches, tilted_gravity
from mocca_robot.statics.solution import EquilibriumResult, Status
from mocca_robot.statics.tilt import critical_angle

TANGENTIAL_BAND = (0.3, 3.0)
"""Ratios k_t/k_n between which those of real contacts lie."""
STATUS = {
    Standing.STANDS: Status.EQUILIBRIUM,
    Standing.STANDS_ONLY_CLAMPED: Status.NOT_IN_EQUILIBRIUM,
    Standing.FALLS: Status.NOT_IN_EQUILIBRIUM,
    Standing.UNDECIDED: Status.INACCURATE,
}


def standing_case(
    graph: PartsGraph,
    case: LoadCase,
    friction: float,
    *,
    start: Array | None = None,
) -> FrictionVerdict:
    """Return the verdict on one load case with friction; forces are those of the corners that are present.

    Motions are about the parts' centroids. `start` is the `state` of a verdict on the same parts under a similar load.
    """
    from mocca_robot.statics.coulomb import standing  # compiled code: loaded where it is used

    touching = _touching(graph, case.present.tobytes(), case.free.tobytes(), friction)
    return standing(touching, case_wrenches(case, graph), start=start)


def present_corners(graph: PartsGraph, present: BoolArray) -> BoolArray:
    """Return (C,) which of `contact_rays` are between parts that are there, for `present` (N,)."""
    return np.asarray(present[contact_rays(graph.contacts)[0]].all(axis=1))


def as_equilibrium(found: FrictionVerdict) -> EquilibriumResult:
    """Return the verdict as the result of Eq. 8 that it stands for: what no force balances, which forces, which motion.

    What stands only clamped is not in equilibrium.
    """
    return EquilibriumResult(
        STATUS[found.standing], 0.5 * found.unbalanced**2, found.forces, found.motions, found.complementarity
    )


def tilt_with_friction(
    graph: PartsGraph,
    azimuth_rad: float,
    friction: float,
    *,
    resolution_rad: float = RESOLUTION_RAD,
) -> FrictionTilt:
    """Return where an assembly stops standing that is tilted towards an azimuth, and the bound beside it."""
    assembly = graph.assembly
    present = np.ones(len(assembly.parts), dtype=np.bool_)

    def decide(angle_rad: float, start: Array | None) -> FrictionVerdict:
        gravity = tilted_gravity(assembly.gravity, angle_rad, azimuth_rad)
        case = LoadCase("tilt", gravity, present, assembly.fixed)
        return standing_case(graph, case, friction, start=start)

    upright = decide(0.0, None)
    if not upright.stands:
        return FrictionTilt(stands_rad=0.0, fails_rad=0.0, falls_rad=0.0, bound_rad=0.0, failure=upright, tries=1)
    bound = tilt_bound(graph, azimuth_rad, friction)
    return largest_tilt(decide, bound, resolution_rad, upright)


def tilt_of_case(
    graph: PartsGraph, case: LoadCase, azimuth_rad: float, friction: float, beyond_rad: float
) -> FrictionTilt:
    """Return where a load case under gravity stops standing that is tilted, and that does not stand at `beyond_rad`."""
    gravity = case.gravity
    assert gravity is not None

    def decide(angle_rad: float, start: Array | None) -> FrictionVerdict:
        tilted = replace(case, gravity=tilted_gravity(gravity, angle_rad, azimuth_rad))
        return standing_case(graph, tilted, friction, start=start)

    return largest_tilt(decide, beyond_rad)


def tilt_band(graph: PartsGraph, azimuth_rad: float, friction: float) -> tuple[float, float]:
    """Return the least and the largest critical tilt for tangential springs as of `TANGENTIAL_BAND` and as given."""
    tilts = [
        tilt_with_friction(graph, azimuth_rad, sprung(friction, ratio)).critical_rad
        for ratio in (tangential_ratio(friction), *TANGENTIAL_BAND)
    ]
    return min(tilts), max(tilts)


def tilt_bound(graph: PartsGraph, azimuth_rad: float, friction: float) -> float:
    """Return the largest tilt (radians, at most π/2) at which some friction forces would hold an assembly.

    Nothing need bring those forces about: see `tilt_with_friction` for the tilt at which it stops standing.
    """
    assembly = graph.assembly
    present = np.ones(len(assembly.parts), dtype=np.bool_)
    touching = _touching(graph, present.tobytes(), (~assembly.fixed).tobytes(), friction)

    def solve(angle_rad: float) -> EquilibriumResult:
        gravity = tilted_gravity(assembly.gravity, angle_rad, azimuth_rad)
        return touching.bound(case_wrenches(LoadCase("tilt", gravity, present, assembly.fixed), graph))

    masses = np.array([p.mass for p in assembly.parts])
    return critical_angle(solve, masses, assembly.gravity, tilted_gravity(assembly.gravity, np.pi / 2, azimuth_rad))[0]


@lru_cache(maxsize=4)
def _touching(
    graph: PartsGraph,
    present: bytes,
    free: bytes,
    friction: float,
) -> FrictionalContacts:
    """Return what all loads on the same parts have in common; `present` and `free` are masks (N,) as bytes."""
    assembly = graph.assembly
    there = present_corners(graph, np.frombuffer(present, dtype=np.bool_))
    pairs, points, normals = contact_rays(graph.contacts)
    about = np.array([p.centroid for p in assembly.parts])
    here = {tuple(map(int, pair)) for pair in np.unique(pairs[there], axis=0)}
    clamping = {p: f for p, f in clamped(friction, assembly.parts, pairs).items() if p in here or p[::-1] in here}
    rough = between(friction, assembly.parts, pairs[there])
    moves = np.frombuffer(free, dtype=np.bool_)
    return FrictionalContacts.of(
        pairs[there], points[there], normals[there], moves, rough, about=about, length=assembly.size / 2,
        tangential_ratio=tangential_ratio(friction), clamping=clamping,
    )  # fmt: skip
