"""Joints that a material bears: where a design is too weak, lower, blunter ones further from the edge are asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from mocca_robot.errors import InputError
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.strength.assess import assess
from mocca_robot.strength.options import StrengthOptions
from planners.cone_joints.outcome import Designed

STEPS = 4
"""Milder bounds that are tried, each on what the last one left."""
LOWER, BLUNTER, FURTHER_IN, FURTHEST_IN = 0.7, 0.85, 1.5, 0.3
"""Per step: factor on the height, on the slope, and on the distance to the edge, which stays below the last."""


def milder(options: JointOptions) -> JointOptions:
    """Return bounds one step milder: lower joints, less steep, further from the boundary."""
    return replace(
        options,
        max_height=LOWER * options.max_height,
        max_slope_rad=BLUNTER * options.max_slope_rad,
        margin=max(options.margin, min(FURTHER_IN * options.margin, FURTHEST_IN)),
    )


def reached(designed: Designed, strength: StrengthOptions, friction: float = 0.0) -> float:
    """Return how many times its loads a design bears by the fast estimate; 0 where they do not balance."""
    ways = {i.part: i.direction for i in designed.design.insertion}
    try:
        graph = PartsGraph.of(designed.design.assembly, insertion=ways)
        return assess(graph, strength, friction=friction, states=False).reached
    except InputError:
        return 0.0


def stronger(
    first: Designed,
    options: JointOptions,
    safety: float,
    again: Callable[[JointOptions], Designed],
    strength_of: Callable[[Designed], float],
) -> Designed:
    """Return the strongest of `first` and the designs that `again` makes within milder bounds.

    It ends at the first design that bears its loads `safety` times, or where milder bounds no longer hold the load
    cases: all other verdicts go first.
    """
    best, bears = first, strength_of(first)
    for _ in range(STEPS):
        if bears >= safety:
            break
        options = milder(options)
        found = again(options)
        if found.interrupted is not None or not found.achieved:
            break
        mine = strength_of(found)
        if mine > bears:
            best, bears = found, mine
    return best
