"""Parts and assemblies: what a user hands in. Metres, kilograms and radians inside; conversion happens at load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from mocca_robot.actions import Action, Combination
from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.errors import InputError, nearest
from mocca_robot.tolerances import ON_GROUND

STANDARD_GRAVITY = 9.80665
DEFAULT_DENSITY = 1200.0
"""kg/m³, about that of acrylic and PLA."""
DEFAULT_THICKNESS = 0.02
"""Metres; the depth of a flat part when none is given."""


@dataclass(frozen=True, eq=False)
class Polygon:
    """A flat shape with straight edges in the x–y plane (y is up), of constant thickness.

    Attributes:
        exterior: (n, 2) corners, counter-clockwise, first corner not repeated, metres.
        holes: each (m, 2), clockwise.
        thickness: depth in metres, only used for mass.
    """

    exterior: Array
    holes: tuple[Array, ...] = ()
    thickness: float = DEFAULT_THICKNESS

    def __post_init__(self) -> None:
        exterior = np.asarray(self.exterior, dtype=np.float64)
        if signed_area(exterior) < 0:
            exterior = exterior[::-1]
        holes = [np.asarray(h, dtype=np.float64) for h in self.holes]
        holes = [h[::-1] if signed_area(h) > 0 else h for h in holes]
        object.__setattr__(self, "exterior", read_only(exterior))
        object.__setattr__(self, "holes", tuple(read_only(h) for h in holes))

    dimension = 2

    @property
    def rings(self) -> tuple[Array, ...]:
        """Return the exterior and the holes; the solid lies to the left of every edge."""
        return (self.exterior, *self.holes)

    @cached_property
    def area_moments(self) -> tuple[float, Array]:
        """Return the area (m²) and the centroid (2,)."""
        area, first = 0.0, np.zeros(2)
        origin = self.exterior[0]
        for ring in self.rings:
            a, m = _ring_moments(ring - origin)
            area, first = area + a, first + m
        return area, origin + first / area

    @property
    def volume(self) -> float:
        """Return area times thickness, m³."""
        return self.area_moments[0] * self.thickness

    @property
    def centroid(self) -> Array:
        """Return the centre of area, (2,)."""
        return self.area_moments[1]

    @cached_property
    def bounds(self) -> Array:
        """Return [[min x, min y], [max x, max y]]."""
        return read_only([self.exterior.min(axis=0), self.exterior.max(axis=0)])


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed, outward-oriented triangle mesh (z is up).

    Attributes:
        vertices: (V, 3), metres.
        faces: (F, 3) vertex indices, counter-clockwise seen from outside.
    """

    vertices: Array
    faces: IntArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", read_only(self.vertices))
        object.__setattr__(self, "faces", read_only(self.faces, np.int64))

    dimension = 3

    @cached_property
    def volume_moments(self) -> tuple[float, Array]:
        """Return the volume (m³) and the centroid (3,), by the divergence theorem.

        Without volume the centroid is the mean of the vertices.
        """
        origin = self.vertices.mean(axis=0)
        a, b, c = (self.vertices[self.faces[:, k]] - origin for k in range(3))
        six_v = np.einsum("ij,ij->i", a, np.cross(b, c))
        volume = six_v.sum() / 6.0
        first = (six_v[:, None] * (a + b + c)).sum(axis=0) / 24.0
        return float(volume), origin + first / volume if volume else origin

    @property
    def volume(self) -> float:
        """Return the volume, m³."""
        return self.volume_moments[0]

    @property
    def centroid(self) -> Array:
        """Return the centre of volume, (3,)."""
        return self.volume_moments[1]

    @cached_property
    def bounds(self) -> Array:
        """Return [[min], [max]], (2, 3)."""
        return read_only([self.vertices.min(axis=0), self.vertices.max(axis=0)])


Shape: TypeAlias = Polygon | Mesh


def signed_area(ring: Array) -> float:
    """Return the area of a closed ring (n, 2): positive when counter-clockwise."""
    return _ring_moments(ring - ring[0])[0]


def _ring_moments(ring: Array) -> tuple[float, Array]:
    following = np.roll(ring, -1, axis=0)
    cross = ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]
    return 0.5 * float(cross.sum()), ((ring + following) * cross[:, None]).sum(axis=0) / 6.0


@dataclass(frozen=True, eq=False)
class Part:
    """A rigid part P_i. Fixed parts touch the ground and never move; `material` is its name in tables of friction."""

    name: str
    shape: Shape
    density: float = DEFAULT_DENSITY
    fixed: bool = False
    material: str = ""

    @property
    def mass(self) -> float:
        """Return the mass in kilograms."""
        return self.density * self.shape.volume

    @property
    def centroid(self) -> Array:
        """Return the centre of mass, (2,) or (3,)."""
        return self.shape.centroid


@dataclass(frozen=True)
class Equilibrium:
    """Goal: the finished structure stands under gravity."""

    kind = "equilibrium"


@dataclass(frozen=True)
class SupportFree:
    """Goal: every intermediate state of the sequence stands by itself."""

    kind = "support_free"


@dataclass(frozen=True)
class Lateral:
    """Goal: the finished structure stands when the ground tilts by `angle_rad` towards each azimuth.

    In 2D the azimuths are left and right whatever `azimuths` says; in 3D they are spread evenly from +x.
    """

    angle_rad: float
    azimuths: int = 8
    kind = "lateral"


@dataclass(frozen=True)
class Interlocking:
    """Goal: with the part `key` held, no part can move relative to another."""

    key: str
    kind = "interlocking"


Goal: TypeAlias = Equilibrium | SupportFree | Lateral | Interlocking


@dataclass(frozen=True, eq=False)
class StatedInterface:
    """Where a file says that two solid parts touch: their names, and flat polygons (k, 3), metres, that cover it."""

    parts: tuple[str, str]
    polygons: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Assembly:
    """Parts in assembly order, with what is asked of them.

    Attributes:
        name: for files and reports.
        parts: in assembly order; fixed parts come first.
        goals: what the finished design has to satisfy; gravity equilibrium is always among it, unless the
            only goal is interlocking.
        alpha_rad: half-angle of the assemblability cone K(d, α); None = assemblability is not asked for.
        gravity: acceleration vector, (2,) or (3,), m/s².
        actions: loads besides self-weight.
        combinations: which of them act together; every one is a load case of the design.
        tolerance_m: faces this far apart, or this deep inside each other, are taken as touching; 0: only as far as
            rounding goes (`mocca_robot.tolerances`).
        interfaces: where solid parts touch, as their file says; then contacts are these and no others. New shapes have
            none.
    """

    name: str
    parts: tuple[Part, ...]
    goals: tuple[Goal, ...] = (Equilibrium(),)
    alpha_rad: float | None = np.deg2rad(5.0)
    gravity: Array = field(default_factory=lambda: np.zeros(0))
    actions: tuple[Action, ...] = ()
    combinations: tuple[Combination, ...] = ()
    tolerance_m: float = 0.0
    interfaces: tuple[StatedInterface, ...] = ()

    def __post_init__(self) -> None:
        if not self.parts:
            raise InputError(f"Assembly '{self.name}' has no parts; give at least one fixed and one free part.")
        dimensions = {p.shape.dimension for p in self.parts}
        if len(dimensions) > 1:
            raise InputError(f"Assembly '{self.name}' mixes flat and solid parts; use one kind only.")
        names = [p.name for p in self.parts]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"Part name '{name}' is used {names.count(name)} times; names must differ.")
        ordered = tuple(sorted(self.parts, key=lambda p: not p.fixed))
        object.__setattr__(self, "parts", ordered)
        gravity = np.asarray(self.gravity, dtype=np.float64)
        if gravity.size == 0:
            gravity = np.zeros(self.dimension)
            gravity[-1] = -STANDARD_GRAVITY
        object.__setattr__(self, "gravity", read_only(gravity))
        for goal in self.goals:
            if isinstance(goal, Interlocking):
                self.index(goal.key)

    def __repr__(self) -> str:
        return f"<Assembly {self.name!r}: {self.said}>"

    @property
    def said(self) -> str:
        """Return what there is: '3D, 7 parts (2 fixed)'."""
        count, fixed = len(self.parts), int(self.fixed.sum())
        return f"{self.dimension}D, {count} part{'' if count == 1 else 's'} ({fixed} fixed)"

    @property
    def dimension(self) -> int:
        """Return 2 or 3."""
        return self.parts[0].shape.dimension

    @property
    def dof(self) -> int:
        """Return the length of a rigid motion: 3 in 2D, 6 in 3D."""
        return 3 if self.dimension == 2 else 6

    @cached_property
    def fixed(self) -> BoolArray:
        """Return (N,) booleans: which parts touch the ground."""
        return read_only([p.fixed for p in self.parts], np.bool_)

    @cached_property
    def size(self) -> float:
        """Return the diagonal of the bounding box, metres: the scale of every tolerance."""
        bounds = np.array([p.shape.bounds for p in self.parts])
        return float(np.linalg.norm(bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)))

    @property
    def sequence(self) -> tuple[str, ...]:
        """Return the part names in assembly order."""
        return tuple(p.name for p in self.parts)

    def index(self, name: str) -> int:
        """Return the position of part `name`. Raises InputError with the nearest name when unknown."""
        for i, part in enumerate(self.parts):
            if part.name == name:
                return i
        raise InputError(f"No part is called '{name}'; {nearest(name, self.sequence)}")

    def with_shapes(self, shapes: Sequence[Shape]) -> Assembly:
        """Return the same assembly with new shapes, one per part."""
        parts = tuple(replace(p, shape=s) for p, s in zip(self.parts, shapes, strict=True))
        return replace(self, parts=parts, interfaces=())


def on_the_ground(parts: Sequence[Part]) -> list[str]:
    """Return the parts whose lowest point is within 1/1000 of the height above the lowest of all; never all of them."""
    lowest = np.array([p.shape.bounds[0, -1] for p in parts])
    highest = max(float(p.shape.bounds[1, -1]) for p in parts)
    down = [p.name for p, low in zip(parts, lowest) if low <= lowest.min() + ON_GROUND * (highest - lowest.min())]
    return down if len(down) < len(parts) else down[:1]
