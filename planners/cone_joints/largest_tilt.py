"""The largest tilt up to which an assembly can be designed to stand, and what is known beyond it.

Angle by angle, each design starting from the joints of the one before: long steps while they succeed, halved where
they do not. Beyond the last success stands either a proof, that no joint within the bounds holds the load (the convex
bound of `planners.cone_joints.kinematic`), or only that the search ended: both angles are told.
"""

from __future__ import annotations

from collections.abc import Mapping
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
from planners.cone_joints.designer import Designed, design, joint_contacts, joint_shapes
from planners.cone_joints.energy import Loads
from planners.cone_joints.kinematic import bound
from planners.cone_joints.search import Progress

FIRST_STEP = float(np.deg2rad(5.0))
RESOLUTION = float(np.deg2rad(1.0))
"""Step below which the climb ends, and to which the proven bound is narrowed down."""
STEEPEST = float(np.deg2rad(85.0))


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
    report = contacts or find_contacts(assembly)
    first = max(goals, key=lambda g: g.angle_rad)
    best = design(assembly, options, insertion=insertion, contacts=report, progress=progress)
    rungs = [_rung(first.angle_rad, best)]
    angle, failed, step = first.angle_rad, None, FIRST_STEP
    # In 3D the ways in come from sweeps, which tilting the ground does not change.
    ways = {i.part: i.direction for i in best.design.insertion} if assembly.dimension == 3 else dict(insertion or {})
    ceiling = _proven(assembly, first, report, options, ways) if best.achieved else None
    while best.achieved and best.interrupted is None and step >= RESOLUTION:
        target = angle + step
        if target >= min(x for x in (ceiling, failed, STEEPEST) if x is not None) - 1e-9:
            step /= 2.0
            continue
        goal = replace(first, angle_rad=target)
        tilted = replace(assembly, goals=tuple(goal if g is first else g for g in assembly.goals))

        def show(what: str, worst: float, degrees: float = float(np.rad2deg(target))) -> None:
            if progress is not None:
                progress(f"{degrees:.1f}°: {what}", worst)

        ahead = design(tilted, options, insertion=ways, contacts=report, progress=show, near=best.searched)
        if ahead.interrupted is not None:
            best = replace(best, interrupted=f"{np.rad2deg(target):.1f}°")
            break
        rungs.append(_rung(target, ahead))
        if ahead.achieved:
            best, angle = ahead, target
        else:
            failed, step = target, step / 2.0
    return LargestTilt(best, angle if best.achieved else None, failed, ceiling, tuple(rungs))


def _rung(angle_rad: float, found: Designed) -> Rung:
    worst = max((c.infeasibility_after for c in found.design.load_cases), default=0.0)
    return Rung(angle_rad, found.achieved, worst)


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
