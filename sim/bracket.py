"""Where on a line of tilts or loads something stops standing: a search that begins at a guess."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def bracket(
    stands: Callable[[float], bool], guess: float, width: float, stood: float = -1.0, end: float = np.pi / 2
) -> tuple[float, float]:
    """Return the largest tilt that stood and the smallest that fell, at most `width` apart; 0, 0 when none stands.

    `stood` is a tilt that is known to stand; nothing from `end` on is tried. All in radians, or in shares of a load.
    """
    low, high = max(stood, -width), end
    for angle in _probes(guess, width, end):
        if low < angle < high:
            low, high = (angle, high) if stands(angle) else (low, angle)
    if low < 0.0:
        low, high = (0.0, high) if stands(0.0) else (0.0, 0.0)
    while high - low > width:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stands(middle) else (low, middle)
    return low, float(high)


def _probes(guess: float, width: float, end: float) -> list[float]:
    """Return tilts that bracket `guess` ever more widely, first as narrowly as is asked for.

    Never the guess itself: exactly at the critical tilt a fall takes longest to tell.
    """
    out = []
    for spread in (0.49, 4.0, 16.0, 64.0):
        out += [guess - spread * width, guess + spread * width]
    return [a for a in out if 0.0 < a < end]
