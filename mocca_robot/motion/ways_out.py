"""Ways out that are really free: inside a part's motion cone, and clear of everything placed before it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.geometry.frames import tangents
from mocca_robot.geometry.sliding import sliding_ways
from mocca_robot.motion.parts_graph import PartMotion, PartsGraph
from mocca_robot.motion.sweep2d import free_half_angle_2d, sweep_blockers_2d

HALF_ANGLE_STEP = float(np.deg2rad(1.0))
"""How finely a solid part's free half-angle is searched."""
RIM_INSET = float(np.deg2rad(0.25))
"""Cones that are tried end this far inside the limit that contacts set: exactly on it, rounding decides."""


def ways_out(graph: PartsGraph, *, room_rad: float = 0.0, samples: int = 600) -> dict[int, Array]:
    """Return a unit direction (d,) per free part, by index, along which it leaves what was placed before it; a part
    that no tried direction frees is absent.

    The axis a of the part's widest cone comes first: it has most room among the neighbours, but it may lead
    through parts further away. Then `samples` directions spread evenly, those with most room first, as long as
    all contact normals keep n̂·x ≥ sin(α + `room_rad`). Where no cone is asked for, the directions along which a part
    slides come last. A direction is free when the sweep along it and along the rim of K(x, α) hits nothing. Insertion
    runs along −x.
    """
    assembly = graph.assembly
    alpha = assembly.alpha_rad or 0.0
    spread = spread_directions(assembly.dimension, samples)
    found: dict[int, Array] = {}
    for part, motion in graph.motions():
        tried = (*([motion.axis] if motion.alpha_rad >= alpha else []), *roomiest(spread, motion, alpha + room_rad))
        slides = () if alpha > 0.0 else sliding_ways(motion.normals)[0]
        way = first_free(assembly, part, (*tried, *slides))
        if way is not None:
            found[part] = way
    return found


def roomiest(ways: Array, motion: PartMotion, least_rad: float) -> Array:
    """Return those of `ways` (m, d) that a part's own contacts leave free by `least_rad`, most room first."""
    slack = (ways @ motion.normals.T).min(axis=1) if len(motion.normals) else np.ones(len(ways))
    order = np.argsort(-slack, kind="stable")
    return np.asarray(ways[order[slack[order] >= np.sin(least_rad)]])


def first_free(assembly: Assembly, part: int, ways: Iterable[Array]) -> Array | None:
    """Return the first of `ways` (d,) along which, and along whose rim of K(x, α), `part` hits nothing; else None."""
    for axis in ways:
        rim = insertion_rim(axis, assembly.alpha_rad or 0.0)
        # Most directions that are not free are blocked along their axis already.
        if not sweep_blockers(assembly, part, rim[:1]) and not sweep_blockers(assembly, part, rim[1:]):
            return np.asarray(axis)
    return None


def insertion_rim(axis: Array, alpha_rad: float, count: int = 8) -> Array:
    """Return (1 + m, d) ways out: the axis, then directions on the rim of K(axis, α); two in 2D, `count` in 3D."""
    if alpha_rad <= 0.0:
        return np.asarray(axis[None])
    if len(axis) == 2:
        (side,) = tangents(axis)
        rim = [np.cos(alpha_rad) * axis + s * np.sin(alpha_rad) * side for s in (1.0, -1.0)]
        return np.array([axis, *rim])
    first, second = tangents(axis)
    turns = 2 * np.pi * np.arange(count) / count
    ring = np.cos(turns)[:, None] * first + np.sin(turns)[:, None] * second
    return np.concatenate([axis[None], np.cos(alpha_rad) * axis + np.sin(alpha_rad) * ring])


def sweep_blockers(assembly: Assembly, part: int, ways_out: Array) -> tuple[int, ...]:
    """Return the earlier parts that `part` hits on its way out along any of `ways_out` (m, d).

    The sweep is long enough to clear everything. Touching is not hitting: an overlap counts when it is deeper than
    parts at rest may overlap.
    """
    if not len(ways_out):
        return ()
    if assembly.dimension == 3:
        from mocca_robot.motion.sweep3d import sweep_blockers_3d

        return sweep_blockers_3d(assembly, part, ways_out)
    return sweep_blockers_2d(assembly, part, ways_out)


def free_half_angle(assembly: Assembly, part: int, way_out: Array, widest_rad: float) -> float:
    """Return the half-angle (radians), at most `widest_rad`, of a cone about `way_out` (d,) in which `part` leaves
    freely: clear of its neighbours' far ends and of parts further away as well. Zero when the axis is blocked.

    Exact for flat parts. For solid ones an angle whose axis and rings were swept, at most `HALF_ANGLE_STEP` less.
    """
    if assembly.dimension == 2:
        return min(widest_rad, free_half_angle_2d(assembly, part, way_out))

    def free(angle: float) -> bool:
        ways = [insertion_rim(way_out, share * angle)[1:] for share in (1.0, 0.5)]
        return not sweep_blockers(assembly, part, np.concatenate(ways))

    if widest_rad <= 0.0 or sweep_blockers(assembly, part, way_out[None]):
        return 0.0
    if free(widest_rad):
        return widest_rad
    low, high = 0.0, widest_rad
    while high - low > HALF_ANGLE_STEP:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if free(middle) else (low, middle)
    return low


def spread_directions(dimension: int, count: int) -> Array:
    """Return (count, d) unit directions spread evenly: around the circle, or along a spiral over the sphere."""
    k = np.arange(count)
    if dimension == 2:
        turn = 2 * np.pi * k / count
        return np.stack([np.cos(turn), np.sin(turn)], axis=1)
    height = 1.0 - (2.0 * k + 1.0) / count
    turn = k * np.pi * (3.0 - np.sqrt(5.0))
    around = np.sqrt(1.0 - height**2)
    return np.stack([around * np.cos(turn), around * np.sin(turn), height], axis=1)
