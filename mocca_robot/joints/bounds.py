"""Bounds on joints by the key that sets them, and which of them a designed joint has reached."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Bound(StrEnum):
    """A bound on a joint, by the key of the configuration that sets it."""

    SLOPE = "joints.max_slope_deg"
    ALPHA = "alpha_deg"
    HEIGHT = "joints.max_height"
    ROOM = "joints.margin"
    RADIUS = "joints.min_radius"
    FLAT = "flat"
    """The contact cannot become a joint: it is too small, or lies across its pair's direction."""


@dataclass(frozen=True)
class TightJoint:
    """A joint by the names of its parts, earlier one first, and the bounds that it has reached."""

    parts: tuple[str, str]
    bounds: tuple[Bound, ...]
