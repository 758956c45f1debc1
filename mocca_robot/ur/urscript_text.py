"""Numbers, lists, poses and names as URScript reads them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError

LARGEST = 1000.0
"""No figure of a checked plan is larger; anything else is a unit mistake."""


def number(value: float) -> str:
    """Return a number as URScript reads it; InputError unless it is finite and of sensible size."""
    if not math.isfinite(value) or abs(value) > LARGEST:
        raise InputError(f"The number {value!r} cannot go into a robot program; limit ±{LARGEST:g}. Plan again.")
    return f"{value:.6f}"


def numbers(values: Sequence[float] | Array) -> str:
    """Return a list of numbers."""
    return "[" + ", ".join(number(float(v)) for v in values) + "]"


def pose(values: Sequence[float]) -> str:
    """Return a pose: place, then rotation vector."""
    return "p" + numbers(values)


def plain(text: str) -> str:
    """Return a name without anything that could end a string or a line of the program."""
    return "".join(c if (c.isascii() and c.isalnum()) or c in " _-." else "_" for c in text)[:60]
