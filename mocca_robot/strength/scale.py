"""How large may it be built in its materials? Weight grows with the size; loads, pushes and grips keep their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.strength.assess import assess
from mocca_robot.strength.options import StrengthOptions
from mocca_robot.strength.settings import TINY
from mocca_robot.strength.uses import AssemblyStrength

RANGE = (1e-3, 1e4)
"""Scales that are looked at where something acts besides weight."""
TRIES = 29
"""Scales over that range, tried from the largest on."""
CLOSE = 1e-3


def largest_scale(
    graph: PartsGraph, options: StrengthOptions, found: AssemblyStrength, *, friction: float = 0.0
) -> float:
    """Return how many times as large an assembly bears its loads as often as asked; 0 where no size does.

    `found` is its strength as it is. Under weight alone stresses grow with the size, so this is the safety that is
    reached over the one asked. Otherwise the fast estimate, corrected by what elements said of the present size, is
    asked at other sizes.
    """
    if not graph.assembly.combinations and options.insertion_force == 0.0 and options.grip_force == 0.0:
        return found.reached / found.safety

    def reached(scale: float) -> float:
        sized = replace(options, grip_force=options.grip_force / scale**2)
        try:
            return assess(graph, sized, friction=friction, states=False, scale=scale).reached
        except InputError:  # weight and loads no longer balance
            return 0.0

    correction = found.reached / max(reached(1.0), TINY)
    scales = np.geomspace(*RANGE, TRIES)[::-1]
    above = np.inf
    for scale in scales:
        if correction * reached(float(scale)) >= found.safety:
            return _between(float(scale), above, lambda s: correction * reached(s) >= found.safety)
        above = float(scale)
    return 0.0


def _between(low: float, high: float, holds: Callable[[float], bool]) -> float:
    """Return the largest scale that holds, from one that does and one that does not."""
    if not np.isfinite(high):
        return np.inf
    while high / low > 1.0 + CLOSE:
        middle = float(np.sqrt(low * high))
        if holds(middle):
            low = middle
        else:
            high = middle
    return low
