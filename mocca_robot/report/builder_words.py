"""What a builder reads of a part: which way it goes in, and what it weighs."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.report.markup import significant


def way_words(direction: Array) -> str:
    """Return an insertion direction in words: steepness, and the side it goes to."""
    down = float(np.degrees(np.arccos(np.clip(-direction[-1], -1.0, 1.0))))
    if down < 5.0:
        return "straight down"
    if down > 175.0:
        return "straight up"
    if len(direction) == 2:
        side = "to the right" if direction[0] > 0 else "to the left"
    else:
        side = f"towards azimuth {np.degrees(np.arctan2(direction[1], direction[0])) % 360:.0f}°"
    if abs(down - 90.0) < 5.0:
        return f"level, {side}"
    return f"{'down' if down < 90 else 'up'}, {min(down, 180 - down):.0f}° from vertical, {side}"


def kilograms(mass: float) -> str:
    """Return a mass in kilograms with three significant digits."""
    return f"{significant(mass)} kg"
