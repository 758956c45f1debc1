"""Loads that a structure is asked to carry besides its own weight, and combinations of them.

Building codes call them actions. Newtons, pascals, kilograms and metres; vectors have two numbers in 2D (y is up) and
three in 3D (z is up). What they come to on each part is worked out in `mocca_robot.statics.applied`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class PointForce:
    """A force on one part.

    Attributes:
        name: unique among the loads.
        part: the part it acts on.
        force: (d,) newtons.
        at: (d,) where it acts, on or in the part; None = at the centre of mass.
    """

    name: str
    part: str
    force: Array
    at: Array | None = None
    kind: ClassVar[str] = "force"


@dataclass(frozen=True, eq=False, kw_only=True)
class LineForce:
    """A force spread evenly along a straight line over one part.

    Attributes:
        start, end: (d,) ends of the line.
        force: (d,) newtons per metre.
    """

    name: str
    part: str
    start: Array
    end: Array
    force: Array
    kind: ClassVar[str] = "line"


@dataclass(frozen=True, eq=False, kw_only=True)
class Pressure:
    """A pressure on the exposed faces of parts, square to each face and inwards. Faces in contact are not exposed.

    Attributes:
        pressure_pa: pascals.
        facing: (d,) unit; only faces that look that way, within 45°; None = every exposed face.
        parts: names; empty = every free part.
        within: (2, d) corners of a box, low and high, outside of which nothing acts; None = everywhere.
    """

    name: str
    pressure_pa: float
    facing: Array | None = None
    parts: tuple[str, ...] = ()
    within: Array | None = None
    kind: ClassVar[str] = "pressure"


@dataclass(frozen=True, eq=False, kw_only=True)
class Wind:
    """Wind towards a direction: it presses on faces that look into it and that nothing shelters.

    The pressure on a face is `pressure_pa` times the cosine of the angle between its normal and the wind.

    Attributes:
        towards: (d,) unit, the way the air moves.
    """

    name: str
    pressure_pa: float
    towards: Array
    kind: ClassVar[str] = "wind"


@dataclass(frozen=True, eq=False, kw_only=True)
class AddedMass:
    """A mass that stands on one part, with weight and inertia.

    Attributes:
        at: (d,) where it is; None = at the part's centre of mass.
    """

    name: str
    part: str
    mass_kg: float
    at: Array | None = None
    kind: ClassVar[str] = "mass"


@dataclass(frozen=True, eq=False, kw_only=True)
class Worker:
    """Somebody's weight on top of whatever was placed last, in every state of the sequence."""

    name: str
    mass_kg: float
    kind: ClassVar[str] = "worker"


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyAcceleration:
    """An acceleration that every part feels as further gravity: an earthquake, a vehicle that brakes.

    Attributes:
        acceleration: (d,) m/s²; forces are mass times it.
    """

    name: str
    acceleration: Array
    kind: ClassVar[str] = "acceleration"


@dataclass(frozen=True, eq=False, kw_only=True)
class SupportMove:
    """A support that settles, spreads or turns. How far it may go is found; no joint is designed for it.

    Attributes:
        part: a fixed part.
        shift: (d,) metres.
        turn_rad: counter-clockwise, in the plane.
        about: (d,) what it turns about; None = its centre.
    """

    name: str
    part: str
    shift: Array
    turn_rad: float = 0.0
    about: Array | None = None
    kind: ClassVar[str] = "support"


Action: TypeAlias = SupportMove | PointForce | LineForce | Pressure | Wind | AddedMass | Worker | BodyAcceleration


@dataclass(frozen=True, kw_only=True)
class Combination:
    """Loads that act together, each with a factor.

    Attributes:
        name: unique among combinations.
        factors: load's name → factor.
        gravity: factor on the parts' own weight.
        states: whether it acts on the finished structure or in every state of the sequence.
    """

    name: str
    factors: Mapping[str, float] = field(default_factory=dict)
    gravity: float = 1.0
    states: Literal["finished", "all"] = "finished"
