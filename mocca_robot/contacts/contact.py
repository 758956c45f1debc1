"""What a contact is, and what a search for contacts reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mocca_robot.arrays import Array


@dataclass(frozen=True, eq=False)
class Contact:
    """A planar interface C_ij^k of the input assembly.

    Attributes:
        parts: (i, j), indices with i earlier in the sequence than j.
        polygon: corners: (2, 2) in 2D, along P_i's counter-clockwise boundary; (k, 3) in 3D,
            counter-clockwise seen from P_j.
        normal: unit vector from P_i into P_j, (2,) or (3,).
        k: number of this contact among those of the pair.
        holes: further boundary loops of a 3D contact, (m, 3) each, clockwise seen from P_j.
    """

    parts: tuple[int, int]
    polygon: Array
    normal: Array
    k: int = 0
    holes: tuple[Array, ...] = field(default=())

    @property
    def measure(self) -> float:
        """Return the length (2D, m) or area (3D, m²)."""
        if self.polygon.shape[1] == 2:
            return float(np.linalg.norm(self.polygon[1] - self.polygon[0]))
        area = 0.0
        for ring in (self.polygon, *self.holes):
            d = ring - ring[0]
            area += 0.5 * float(np.cross(d[:-1], d[1:]).sum(axis=0) @ self.normal)
        return abs(area)

    @property
    def centre(self) -> Array:
        """Return the mean of the corners, a point on the contact (for convex contacts inside it)."""
        return np.asarray(self.polygon.mean(axis=0))


@dataclass(frozen=True)
class NearMiss:
    """Two parallel faces that almost touch: `gap_m` apart over `extent` (m or m²)."""

    parts: tuple[str, str]
    gap_m: float
    extent: float


@dataclass(frozen=True)
class Overlap:
    """Two parts that penetrate each other, `depth_m` at the deepest, which is near `place_m`."""

    parts: tuple[str, str]
    depth_m: float
    place_m: tuple[float, ...]


@dataclass(frozen=True)
class Accepted:
    """Two parts that were taken as touching within the assembly's tolerance, though rounding does not explain it.

    They lie `overlap_m` inside each other at the deepest, and `gap_m` apart at the widest; one of them may be zero.
    """

    parts: tuple[str, str]
    overlap_m: float
    gap_m: float


@dataclass(frozen=True)
class ContactReport:
    """What `find_contacts` saw: contacts, and by part name near misses, overlaps and what its tolerance accepted."""

    contacts: tuple[Contact, ...]
    near_misses: tuple[NearMiss, ...] = ()
    overlaps: tuple[Overlap, ...] = ()
    accepted: tuple[Accepted, ...] = ()


def accepted_pairs(
    names: Sequence[str],
    rises: Mapping[tuple[int, int], tuple[float, float]],
    rounding: float,
    overlaps: Sequence[Overlap],
    tolerance: float,
) -> tuple[tuple[Overlap, ...], tuple[Accepted, ...]]:
    """Return the overlaps deeper than `tolerance`, and what it accepts beyond `rounding` (metres).

    `rises` are the least and the largest distance of the faces of each pair that touches, negative where they overlap.
    """
    deep = {o.parts: o.depth_m for o in overlaps}
    found: dict[tuple[str, str], tuple[float, float]] = {}
    for (i, j), (low, high) in rises.items():
        if max(-low, high) > rounding:
            found[names[i], names[j]] = max(-low, 0.0), max(high, 0.0)
    for pair, depth in deep.items():
        found[pair] = max(depth, found.get(pair, (0.0, 0.0))[0]), found.get(pair, (0.0, 0.0))[1]
    beyond = tuple(o for o in overlaps if o.depth_m > tolerance)
    order = {name: k for k, name in enumerate(names)}
    inside = sorted(set(found) - {o.parts for o in beyond}, key=lambda pair: (order[pair[0]], order[pair[1]]))
    return beyond, tuple(Accepted(pair, *found[pair]) for pair in inside)
