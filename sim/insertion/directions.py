"""Which ways of inserting a part are worth trying: through its cone, on its rim, and just outside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.geometry.frames import tangents
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.motion.ways_out import RIM_INSET, free_half_angle
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD

OUTSIDE = float(np.deg2rad(3.0))
"""How far outside the realised motion cone the negative controls run."""
WIDEST = float(np.deg2rad(60.0))
"""Widest cone tried where no α was asked for: beyond, a part slides along its contacts for its whole length."""


@dataclass(frozen=True, eq=False)
class InsertionCone:
    """What a part's earlier contacts allow.

    Attributes:
        part: index.
        axis: (d,) way the part moves as it goes in.
        normals: (m, d) of its contacts with earlier parts, pointing into the part: it may leave along x when
            normals·x ≥ 0.
        realised_rad: half-angle of the widest circular cone about the axis; negative when the axis is blocked.
        tried_rad: half-angle of the cone that trials cover: what the design promises, or, when nothing was
            promised, what is realised and free of obstacles farther away.
    """

    part: int
    axis: Array
    normals: Array
    realised_rad: float
    tried_rad: float


@dataclass(frozen=True, eq=False)
class Direction:
    """A way in (d,), unit; `kind` is 'axis', 'interior', 'rim' or 'outside'."""

    kind: str
    vector: Array


def insertion_cone(graph: PartsGraph, part: int, alpha_rad: float | None = None) -> InsertionCone:
    """Return the cone of `part` about the direction that was chosen for it (default: the axis of its widest cone)."""
    assembly, motion, chosen = graph.assembly, graph.motion(part), graph.placed(part).chosen
    realised, way_out = motion.alpha_rad, motion.axis
    if chosen is not None and len(motion.normals):
        way_out = -chosen
        realised = motion.room(way_out)
    promised = assembly.alpha_rad if alpha_rad is None else alpha_rad
    if promised is not None:
        tried = min(promised, realised)
    else:
        tried = free_half_angle(assembly, part, way_out, min(WIDEST, max(0.0, realised - RIM_INSET)))
    return InsertionCone(part, -way_out, motion.normals, realised, tried)


def directions(cone: InsertionCone, count: int) -> tuple[Direction, ...]:
    """Return about `count` ways in that cover the cone, then negative controls `OUTSIDE` the realised cone.

    None are inside when the axis itself is blocked. In 2D the inside ones spread evenly from rim to rim.
    """
    inside: list[Direction] = []
    if cone.realised_rad >= -ANGLE_ROUNDING_RAD:
        inside = _inside_2d(cone, count) if len(cone.axis) == 2 else _inside_3d(cone, count)
    return (*inside, *_outside(cone))


def _inside_2d(cone: InsertionCone, count: int) -> list[Direction]:
    out = [Direction("axis", cone.axis)]
    if cone.tried_rad <= 0.0:
        return out
    for angle in np.linspace(-cone.tried_rad, cone.tried_rad, max(2, count - 1)):
        kind = "rim" if np.isclose(abs(angle), cone.tried_rad) else "interior"
        out.append(Direction(kind, _turned(cone.axis, angle, 0.0)))
    return out


def _inside_3d(cone: InsertionCone, count: int) -> list[Direction]:
    out = [Direction("axis", cone.axis)]
    if cone.tried_rad <= 0.0:
        return out
    rim = max(3, (2 * (count - 1)) // 3)
    rings = (("rim", cone.tried_rad, rim), ("interior", 0.5 * cone.tried_rad, max(0, count - 1 - rim)))
    for kind, angle, number in rings:
        out += [Direction(kind, _turned(cone.axis, angle, 2 * np.pi * k / number)) for k in range(number)]
    return out


def _outside(cone: InsertionCone) -> list[Direction]:
    """Return ways whose reverse enters an earlier part by `OUTSIDE`, in 2 (2D) or 8 azimuths about the axis."""
    if not len(cone.normals):
        return []
    azimuths = [0.0, np.pi] if len(cone.axis) == 2 else list(2 * np.pi * np.arange(8) / 8)
    angles = np.linspace(0.0, np.pi, 1441)
    found = []
    for azimuth in azimuths:
        ways = _turned(cone.axis, angles, azimuth)
        clearance = np.arcsin(np.clip((-ways @ cone.normals.T).min(axis=1), -1.0, 1.0))
        blocked = np.flatnonzero(clearance <= -OUTSIDE)
        if len(blocked):
            found.append(Direction("outside", ways[blocked[0]]))
    return found


def _turned(axis: Array, angle: float | Array, azimuth: float) -> Array:
    """Return (..., d) the axis turned by every angle (...) towards the azimuth about it."""
    c, s = np.cos(angle)[..., np.newaxis], np.sin(angle)[..., np.newaxis]
    first, *others = tangents(axis)
    if not others:
        return np.asarray(c * axis + (s if np.cos(azimuth) > 0 else -s) * first)
    (second,) = others
    return np.asarray(c * axis + s * (np.cos(azimuth) * first + np.sin(azimuth) * second))
