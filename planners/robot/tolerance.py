"""How much of a part's cone the arm can use: other straight ways in, farther and farther from the axis."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.motion.ways_out import insertion_rim, sweep_blockers
from mocca_robot.plan.plan import Waypoint
from planners.robot.bench import Bench
from planners.robot.seat import Seat
from planners.robot.trajectory import line_motion, reversed_motion

FRACTIONS = (1.0, 0.75, 0.5, 0.25)
"""Shares of the cone's half-angle that are tried as tolerance."""
RIM, RETRIES = 8, 4
"""Directions of the rim that are looked at, and that are offered for another try."""


def tolerance(
    bench: Bench, index: int, direction: Array, cone_rad: float, seat: Seat, q_seat: Array, depth_m: float
) -> tuple[float, tuple[tuple[Waypoint, ...], ...]]:
    """Return how far from the cone's axis the arm could insert on every side, and the ways in at half of that.

    A way counts when the part's own sweep is free, the arm can follow it, and neither arm nor tool touches anything.
    """
    bench.scene.assign(absent=(bench.site.assembly.parts[index].name,))
    for fraction in FRACTIONS:
        usable = fraction * cone_rad
        ways = insertion_rim(-direction @ bench.site.turn, usable, RIM)[1:]
        if not len(ways) or sweep_blockers(bench.site.assembly, index, ways):
            continue
        if all(_way_in(bench, way, seat, q_seat, depth_m) for way in ways):
            inner = insertion_rim(-direction @ bench.site.turn, 0.5 * usable, RETRIES)[1:]
            free = [way for way in inner if not sweep_blockers(bench.site.assembly, index, way[None])]
            paths = [_way_in(bench, way, seat, q_seat, depth_m) for way in free]
            return usable, tuple(p for p in paths if p)
    return 0.0, ()


def _way_in(bench: Bench, way_out: Array, seat: Seat, q_seat: Array, depth_m: float) -> tuple[Waypoint, ...]:
    """Return the timed way in against `way_out` (d,), design frame; empty where arm or tool cannot go."""
    limits = bench.cell.limits
    travel = depth_m * (bench.site.turn @ way_out)
    path, reason = line_motion(
        bench.cell, seat.flange, travel, q_seat, limits.insert_speed_m_s, limits.insert_acceleration_m_s2
    )
    blocked = reason or next((r for w in path if (r := bench.free(np.array(w.q), seat.grasp.width_m))), "")
    return () if blocked else reversed_motion(path)
