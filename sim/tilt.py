"""The tilt table without friction: by how much can the ground tilt towards an azimuth before something moves?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import case_at, critical_tilt
from mocca_robot.statics.loads import tilt_azimuths, tilted_gravity
from mocca_robot.verdicts.agreement import TILT_AGREEMENT_DEG
from mocca_robot.verdicts.physics import TiltVerdict
from sim.critical import Search, critical
from sim.scene import Compiled, compile_scene, with_gravity
from sim.shapes.contact_model import ContactModel, PairRays, facet_pairs, holding_model
from sim.stability import LIMITS, StabilityLimits, contact_points, free_scene

RESOLUTION, COARSE_RESOLUTION = np.deg2rad(0.1), np.deg2rad(0.5)
"""Width at which the bisection ends; with more contact points than `finest_points` a run takes minutes."""
DOUBTED_RESOLUTION = 2.5 * RESOLUTION
"""The same where every fall is confirmed by the finest step, which takes seconds."""
HELD_BELOW_RAD = float(np.deg2rad(0.25))
"""Contact points that are chosen for a tilt hold up to this much below statics' critical one, or more."""
TILT_AGREEMENT_RAD = {d: float(np.deg2rad(deg)) for d, deg in TILT_AGREEMENT_DEG.items()}


def azimuths(assembly: Assembly, count: int) -> Array:
    """Return `count` azimuths in radians; flat assemblies know right and left only.

    Raises InputError for a count below 1.
    """
    if count < 1:
        raise InputError(f"{count} azimuths were asked for; the tilt table needs at least 1 (2 in flat assemblies).")
    return tilt_azimuths(assembly.dimension, count)


def tilt_scene(assembly: Assembly, model: ContactModel) -> Compiled:
    """Return the finished assembly, compiled once for all tilts."""
    return compile_scene(free_scene(assembly, model))


def detailed_scene(
    graph: PartsGraph,
    rays: Sequence[PairRays],
    azimuth_rad: float,
    critical_rad: float,
) -> Compiled:
    """Return the finished assembly with contact points for one azimuth, at which statics' critical tilt is given."""
    assembly = graph.assembly
    if critical_rad == 0.0:  # nothing to hold
        return tilt_scene(assembly, facet_pairs(r.reduced for r in rays))
    case = case_at(assembly, max(0.0, critical_rad - HELD_BELOW_RAD), azimuth_rad)
    return tilt_scene(assembly, holding_model(graph, rays, case))


def detailed_tilt(graph: PartsGraph, rays: Sequence[PairRays], azimuth_rad: float) -> TiltVerdict:
    """Return the critical tilt of an assembly of so many contact points that they are chosen for this azimuth."""
    guess = critical_tilt(graph, azimuth_rad)
    compiled = detailed_scene(graph, rays, azimuth_rad, guess)
    return physical_tilt(compiled, graph, azimuth_rad, guess_rad=guess)


def physical_tilt(
    compiled: Compiled,
    graph: PartsGraph,
    azimuth_rad: float,
    *,
    limits: StabilityLimits = LIMITS,
    resolution_rad: float | None = None,
    guess_rad: float | None = None,
) -> TiltVerdict:
    """Return the critical tilt of a compiled scene, each tilt from a fresh start under fixed rotated gravity.

    Statics gives the first guess (`guess_rad`, when it is known already); every bracket is then confirmed by runs of
    its own, so a wrong guess costs time, not truth. (A ramp or a hinged platform overshoots by 0.4° to 2°: inertia
    holds parts back.)
    What else makes a fall believed: see `sim.critical`.
    """
    scene = compiled.scene
    if resolution_rad is None:
        resolution_rad = float(RESOLUTION if contact_points(compiled) <= limits.finest_points else COARSE_RESOLUTION)
    guess = critical_tilt(graph, azimuth_rad) if guess_rad is None else guess_rad

    def scene_at(angle: float) -> Compiled:
        return with_gravity(compiled, tilted_gravity(scene.assembly.gravity, angle, azimuth_rad))

    search = Search(
        guess=guess,
        agreement=TILT_AGREEMENT_RAD[scene.assembly.dimension],
        resolution=resolution_rad,
        doubtful=float(DOUBTED_RESOLUTION),
    )
    found = critical(scene_at, search, limits)
    never = found.high >= np.pi / 2
    return TiltVerdict(
        azimuth_rad=azimuth_rad,
        critical_rad=np.pi / 2 if never else 0.5 * (found.low + found.high),
        statics_rad=guess,
        friction=0.0,
        moved=found.moved,
        failed=found.failed,
        within_rad=0.0 if never else 0.5 * (found.high - found.low),
        cause=found.cause,
    )
