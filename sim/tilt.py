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
from mocca_robot.verdicts.physics import TiltVerdict, Verdict
from sim.bracket import bracket
from sim.disagreement import cause
from sim.scene import Compiled, compile_scene, with_gravity
from sim.shapes.contact_model import ContactModel, PairRays, facet_pairs, holding_model
from sim.stability import (
    LIMITS,
    StabilityLimits,
    StabilityReport,
    at_once,
    confirmed,
    contact_points,
    free_scene,
)

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

    Falls are believed without finer steps first and only the smallest tilt that fell is confirmed; when finer steps
    hold it, the search goes on above it with every fall confirmed. A fall below statics' tilt by more than the two may
    differ has to survive all finer steps and the finest; where it does not, the search goes on with falls that do,
    from the least tilt that agrees, in steps of `DOUBTED_RESOLUTION`. What then disagrees is told with its cause.
    """
    scene = compiled.scene
    if resolution_rad is None:
        resolution_rad = float(RESOLUTION if contact_points(compiled) <= limits.finest_points else COARSE_RESOLUTION)
    guess = critical_tilt(graph, azimuth_rad) if guess_rad is None else guess_rad
    quick: dict[float, StabilityReport] = {}
    sure: dict[float, StabilityReport] = {}
    doubted: dict[float, StabilityReport] = {}

    def scene_at(angle: float) -> Compiled:
        return with_gravity(compiled, tilted_gravity(scene.assembly.gravity, angle, azimuth_rad))

    def stands_at_once(angle: float) -> bool:
        if angle not in quick:
            quick[angle] = at_once(scene_at(angle), limits)
        return quick[angle].stands

    def stands(angle: float) -> bool:
        if not stands_at_once(angle) and angle not in sure:
            sure[angle] = confirmed(scene_at(angle), quick[angle], limits)
        return sure.get(angle, quick[angle]).stands

    def stands_after_all(angle: float) -> bool:
        if not stands_at_once(angle) and angle not in doubted:
            doubted[angle] = sure[angle] = confirmed(scene_at(angle), quick[angle], limits, doubted=True)
        return doubted.get(angle, quick[angle]).stands

    def early(angle: float) -> bool:
        return guess - angle > TILT_AGREEMENT_RAD[scene.assembly.dimension] - resolution_rad

    low, high = bracket(stands_at_once, guess, resolution_rad)
    if early(high) and stands_after_all(high):
        as_late_as_agrees = guess - TILT_AGREEMENT_RAD[scene.assembly.dimension]
        doubtful = max(resolution_rad, float(DOUBTED_RESOLUTION))
        low, high = bracket(stands_after_all, as_late_as_agrees, doubtful, high)
    if not early(high) and high < np.pi / 2:
        if stands(high):
            low, high = bracket(stands, guess, resolution_rad, high)
        elif high - low > resolution_rad:
            low, high = bracket(stands, guess, resolution_rad, low)
    moved = sure[high].moved if high in sure else ()
    failed = tuple(a for a, found in sure.items() if found.verdict is Verdict.FAILED)
    if high >= np.pi / 2:
        return TiltVerdict(
            azimuth_rad=azimuth_rad,
            critical_rad=np.pi / 2,
            statics_rad=guess,
            friction=0.0,
            moved=moved,
            failed=failed,
        )
    why = ""
    if early(high) and sure[high].verdict is Verdict.FELL:
        why = cause(scene_at(high), sure[high])
    return TiltVerdict(
        azimuth_rad=azimuth_rad,
        critical_rad=0.5 * (low + high),
        statics_rad=guess,
        friction=0.0,
        moved=moved,
        failed=failed,
        within_rad=0.5 * (high - low),
        cause=why,
    )
