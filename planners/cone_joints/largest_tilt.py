"""The largest tilt up to which an assembly can be designed to stand, and what is known beyond it.

Angle by angle, each design starting from the joints of the one before: long steps while they succeed, halved where
they do not. Beyond the last success stands either a proof, that no joint within the bounds holds the load (the convex
bound of `planners.cone_joints.kinematic`), or only that the search ended: both angles are told. What is climbed is the
angle of a lateral goal, or the reserve that every required state has beyond its load.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Lateral
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.loads import load_cases
from mocca_robot.statics.tilt_reserve import tilt_reserve
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD
from planners.cone_joints.designer import design, joint_contacts, joint_shapes
from planners.cone_joints.energy import Loads
from planners.cone_joints.kinematic import bound
from planners.cone_joints.outcome import Designed
from planners.cone_joints.search import FoundJoints, Progress

FIRST_STEP = float(np.deg2rad(5.0))
RESOLUTION = float(np.deg2rad(1.0))
"""Step below which the climb ends, and to which the proven bound is narrowed down."""
ENOUGH = float(np.deg2rad(5.0))
"""Angle below which small gains are worth another, shorter step."""
STEEPEST = float(np.deg2rad(85.0))
AZIMUTHS = 8
"""Sides towards which the reserve of solids is measured."""


@dataclass(frozen=True)
class Rung:
    """One angle that was tried: whether a design was found, and the largest E/|w|² of its load cases."""

    angle_rad: float
    achieved: bool
    infeasibility: float


@dataclass(frozen=True, eq=False)
class LargestTilt:
    """How far an assembly can be tilted.

    Attributes:
        designed: the design at the largest angle; the failed one at the first angle when none was found.
        angle_rad: the largest angle for which a design was found; None when not even the goal's own was reached.
        failed_rad: the smallest angle at which the search ended without one; None when it never did.
        impossible_rad: an angle at which no joint within the bounds can hold the load, proven; None when the proof
            fails up to `STEEPEST`.
        rungs: every angle tried, in order.
    """

    designed: Designed
    angle_rad: float | None
    failed_rad: float | None
    impossible_rad: float | None
    rungs: tuple[Rung, ...]


def largest_tilt(
    assembly: Assembly,
    options: JointOptions | None = None,
    *,
    insertion: Mapping[str, Array] | None = None,
    contacts: ContactReport | None = None,
    progress: Progress | None = None,
) -> LargestTilt:
    """Return the design at the largest tilt that is found, climbing from the assembly's lateral goal.

    Arguments as of `design`. Ctrl-C ends the climb with what it has. Raises InputError without a lateral goal.
    """
    goals = [g for g in assembly.goals if isinstance(g, Lateral)]
    if not goals:
        raise InputError(
            f"'{assembly.name}' has no lateral goal to climb from; add goal: {{kind: lateral, angle_deg: 20}}."
        )
    options = options or JointOptions()
    if np.isinf(options.tilt_margin_rad):
        raise InputError(
            "The largest angle and the largest reserve are not looked for together; set joints.tilt_margin_deg: 0."
        )
    report = contacts or find_contacts(assembly)
    first = max(goals, key=lambda g: g.angle_rad)
    best = design(assembly, options, insertion=insertion, contacts=report, progress=progress)
    ways = _ways(assembly, best, insertion)
    ceiling = _proven(assembly, first, report, options, ways) if best.achieved else None

    def tilted(target: float, near: FoundJoints | None, show: Progress | None) -> tuple[Designed, float]:
        goal = replace(first, angle_rad=target)
        leaning = replace(assembly, goals=tuple(goal if g is first else g for g in assembly.goals))
        found = design(leaning, options, insertion=ways, contacts=report, progress=show, near=near)
        return found, target if found.achieved else -np.inf

    return _climbed(best, first.angle_rad, ceiling, tilted, progress)


def design_as_asked(
    assembly: Assembly,
    options: JointOptions | None = None,
    *,
    insertion: Mapping[str, Array] | None = None,
    contacts: ContactReport | None = None,
    progress: Progress | None = None,
) -> Designed:
    """Return `design`, or, where the tilt margin asked for is infinite, that with the largest reserve that is found.

    Arguments as of `design`. Ctrl-C ends the climb with what it has.
    """
    options = options or JointOptions()
    if np.isfinite(options.tilt_margin_rad):
        return design(assembly, options, insertion=insertion, contacts=contacts, progress=progress)
    report = contacts or find_contacts(assembly)
    modest = replace(options, tilt_margin_rad=JointOptions().tilt_margin_rad)
    first = design(assembly, modest, insertion=insertion, contacts=report, progress=progress)
    ways = _ways(assembly, first, insertion)

    def reserve(found: Designed) -> float:
        measured = tilt_reserve(PartsGraph.of(found.design.assembly), 0.0, AZIMUTHS) if found.achieved else None
        return -np.inf if measured is None else measured.reserve_rad

    def braced(target: float, near: FoundJoints | None, show: Progress | None) -> tuple[Designed, float]:
        start = None if near is None else near.all_curved()
        asked = replace(modest, tilt_margin_rad=target)
        found = design(
            assembly, asked, insertion=ways, contacts=report, progress=show, near=start, alone=start is not None
        )
        return found, reserve(found)

    begun = reserve(first)
    return first if np.isinf(begun) else _climbed(first, begun, None, braced, progress).designed


def _ways(assembly: Assembly, found: Designed, insertion: Mapping[str, Array] | None) -> dict[str, Array]:
    """Return the ways in to keep: in 3D they come from sweeps, which tilting the ground does not change."""
    if assembly.dimension == 3:
        return {i.part: i.direction for i in found.design.insertion}
    return dict(insertion or {})


def _climbed(
    best: Designed,
    angle: float,
    ceiling: float | None,
    ahead: Callable[[float, FoundJoints | None, Progress | None], tuple[Designed, float]],
    progress: Progress | None,
) -> LargestTilt:
    """Return where a climb from `angle` ends.

    `ahead` returns the design for a larger angle, from the joints of the best one so far, and the angle it reaches:
    one that falls short of its target may still be the best. From `ENOUGH` on the climb ends where that gains less than
    `RESOLUTION`.
    """
    rungs = [_rung(angle, best, best.achieved)]
    failed, step = None, FIRST_STEP
    while best.achieved and best.interrupted is None and step >= RESOLUTION:
        target = angle + step
        if target >= min(x for x in (ceiling, failed, STEEPEST) if x is not None) - ANGLE_ROUNDING_RAD:
            step /= 2.0
            continue

        def show(what: str, worst: float, degrees: float = float(np.rad2deg(target))) -> None:
            if progress is not None:
                progress(f"{degrees:.1f}°: {what}", worst)

        found, reached = ahead(target, best.searched, show)
        if found.interrupted is not None:
            best = replace(best, interrupted=f"{np.rad2deg(target):.1f}°")
            break
        rungs.append(_rung(target, found, reached >= target))
        gained = reached - angle
        if gained > 0.0:
            best, angle = found, reached
        if reached < target:
            failed, step = target, step / 2.0
            if 0.0 < gained < RESOLUTION and angle >= ENOUGH:
                break
    return LargestTilt(best, angle if best.achieved else None, failed, ceiling, tuple(rungs))


def _rung(angle_rad: float, found: Designed, achieved: bool) -> Rung:
    worst = max((c.infeasibility_after for c in found.design.load_cases), default=0.0)
    return Rung(angle_rad, achieved, worst)


def _proven(
    assembly: Assembly, goal: Lateral, report: ContactReport, options: JointOptions, ways: Mapping[str, Array]
) -> float | None:
    """Return an angle, within `RESOLUTION` of the smallest one, from which the bound proves that no joint holds."""
    graph = PartsGraph.of(assembly, joint_contacts(assembly, report))
    axis = np.zeros((len(assembly.parts), assembly.dimension))
    axis[:, -1] = 1.0
    for name, way in ways.items():
        axis[assembly.index(name)] = -way
    can_curve = joint_shapes(graph, options, axis).can_curve

    def impossible(angle_rad: float) -> bool:
        cases = load_cases(graph, (replace(goal, angle_rad=angle_rad),))
        loads = Loads.of(graph, cases)
        return bound(graph, can_curve, options, loads, len(cases)) is not None

    low, high = goal.angle_rad, STEEPEST
    if not impossible(high):
        return None
    while high - low > RESOLUTION:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if impossible(middle) else (middle, high)
    return high
