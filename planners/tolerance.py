"""How much of a part's cone the arm can use: other straight ways in, farther and farther from the axis."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mocca_robot.assembly import Array
from mocca_robot.ur.plan import Waypoint
from mocca_robot.verify import insertion_rim, sweep_blockers
from planners.bench import Bench
from planners.seat import Seat
from planners.trajectory import line_motion, reversed_motion

FRACTIONS = (1.0, 0.75, 0.5, 0.25)
"""Shares of the cone's half-angle that are tried as tolerance."""
RIM = 4
"""Directions of the rim that are looked at."""


def tolerance(
    bench: Bench, index: int, direction: Array, cone_rad: float, seat: Seat, q_seat: Array, depth_m: float
) -> tuple[float, tuple[tuple[Waypoint, ...], ...]]:
    """Return how far from the cone's axis the arm could insert on every side, and the ways in at half of that.

    A way counts when the part's own sweep is free, the arm can follow it, and neither arm nor tool touches anything.
    """
    bench.scene.roles(absent=(bench.site.assembly.parts[index].name,))
    for fraction in FRACTIONS:
        if all(_rim(bench, index, direction, fraction * cone_rad, seat, q_seat, depth_m)):
            usable = fraction * cone_rad
            paths = list(_rim(bench, index, direction, 0.5 * usable, seat, q_seat, depth_m))
            return usable, tuple(p for p in paths if p)
    return 0.0, ()


def _rim(
    bench: Bench, index: int, direction: Array, angle_rad: float, seat: Seat, q_seat: Array, depth_m: float
) -> Iterator[tuple[Waypoint, ...]]:
    """Yield the way in along each direction of the cone's rim: empty where it is blocked."""
    cell, turn = bench.cell, bench.site.turn
    limits = cell.limits
    if angle_rad <= 0.0:
        return
    for way in insertion_rim(-direction @ turn, angle_rad, RIM)[1:]:
        if sweep_blockers(bench.site.assembly, index, way[None]):
            yield ()
            continue
        path, reason = line_motion(
            cell, seat.flange, depth_m * (turn @ way), q_seat, limits.insert_speed_m_s, limits.insert_acceleration_m_s2
        )
        blocked = reason or next((r for w in path if (r := bench.free(np.array(w.q), seat.grasp.width_m))), "")
        yield () if blocked else reversed_motion(path)
