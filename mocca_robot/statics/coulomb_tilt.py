"""The largest tilt at which a structure stands with Coulomb friction, between two that were tried.

From above, the bound (`tilt`) says where no forces would hold it. Below, what falls tells how far off it is: the share
of the load that stays unbalanced goes to zero about evenly towards the critical tilt, so that two falls point at it.
From below, each standing tilt starts from the displacements of the last, and the way up has no step longer than a
stride.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.statics.friction_verdict import FrictionVerdict, Standing

RESOLUTION_RAD = 8e-4
"""Width of the bracket that ends the search: 0.046°."""
MOST_TRIES = 60
STRIDE_RAD = float(np.deg2rad(10.0))
"""Longest step on the way up: what falls at one tilt may stand again further on, leaning on something else."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FrictionTilt:
    """Between which tilts a structure stops standing.

    Attributes:
        stands_rad: the largest tilt that was seen to stand; 0 if it does not stand upright.
        fails_rad: the smallest tilt above it at which it was not seen to stand.
        falls_rad: the smallest tilt above it at which it was seen to fall; the bound if it was at none.
        bound_rad: up to where some friction forces would hold it, with nothing that brings them about.
        failure: the verdict at `fails_rad`; None where it stands up to `bound_rad`.
        tries: problems solved.
    """

    stands_rad: float
    fails_rad: float
    falls_rad: float
    bound_rad: float
    failure: FrictionVerdict | None
    tries: int

    @property
    def undecided(self) -> bool:
        """Return whether tilts lie between the two at which neither rest nor a fall was found."""
        return self.failure is not None and self.falls_rad > self.fails_rad

    @property
    def critical_rad(self) -> float:
        """Return the middle of the bracket, or the bound where it stands up to it."""
        return self.bound_rad if self.failure is None else 0.5 * (self.stands_rad + self.fails_rad)


def largest_tilt(
    decide: Callable[[float, Array | None], FrictionVerdict],
    bound_rad: float,
    resolution_rad: float = RESOLUTION_RAD,
    upright: FrictionVerdict | None = None,
) -> FrictionTilt:
    """Return where a structure stops standing.

    Args:
        decide: tilt in radians, and the `state` of a verdict at a smaller tilt → verdict.
        bound_rad: no tilt above it stands.
        resolution_rad: width of the bracket to reach.
        upright: the verdict without a tilt, if it is known.
    """
    upright = decide(0.0, None) if upright is None else upright
    if not upright.stands:
        return FrictionTilt(stands_rad=0.0, fails_rad=0.0, falls_rad=0.0, bound_rad=bound_rad, failure=upright, tries=1)
    low, high, state, failure, tries = 0.0, bound_rad, upright.state, None, 1
    falls: list[tuple[float, float]] = []
    widths, surely = [high], bound_rad
    ahead = [float(a) for a in np.arange(STRIDE_RAD, bound_rad - resolution_rad, STRIDE_RAD)]
    angle = max(bound_rad - 0.9 * resolution_rad, 0.5 * bound_rad)
    while high - low > resolution_rad and tries < MOST_TRIES:
        if ahead:
            angle = ahead.pop(0)
        found = decide(angle, state)
        tries += 1
        if found.stands:
            low, state = angle, found.state
        else:
            high, failure, ahead = angle, found, []
            if found.standing is not Standing.UNDECIDED:
                falls, surely = [*falls[-1:], (angle, found.unbalanced)], angle
        widths.append(high - low)
        angle = _next(low, high, falls, widths, resolution_rad) if failure else max(high - 0.9 * resolution_rad, low)
    return FrictionTilt(
        stands_rad=low, fails_rad=high, falls_rad=surely, bound_rad=bound_rad, failure=failure, tries=tries
    )


def _next(low: float, high: float, falls: list[tuple[float, float]], widths: list[float], resolution: float) -> float:
    """Return the tilt to try next: where falls point at, or the middle where that has not helped lately."""
    middle = 0.5 * (low + high)
    slow = len(widths) > 3 and widths[-1] > 0.5 * widths[-4]
    if len(falls) < 2 or slow:
        return middle
    (far, much), (near, little) = falls
    if not (0.0 < little < much and near < far):
        return middle
    target = near - little * (far - near) / (much - little)
    return min(max(target - 0.45 * resolution, low + 0.9 * resolution), max(middle, high - 0.9 * resolution))
