"""Whether every part can be put where it belongs: a cone of ways in, and nothing on the way along its axis and rim."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.geometry.sliding import SLIDE, sliding_ways
from mocca_robot.motion.parts_graph import PartMotion, PartsGraph
from mocca_robot.motion.sweep2d import free_half_angle_2d
from mocca_robot.motion.ways_out import first_free, insertion_rim, spread_directions, sweep_blockers
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD

DENSE, OTHER_WAYS = 20_000, 24
"""Directions among which other ways are looked for where the middle of a part's cone is barred; how many are tried."""


@dataclass(frozen=True, eq=False)
class InsertionVerdict:
    """Whether a part can be inserted along every direction of its cone.

    Attributes:
        part: name.
        alpha_rad: half-angle of the widest cone about its way in that is free, negative when its earlier contacts
            block the way itself. Flat parts: free of everything. Solid parts: as far as their own contacts tell
            (see PartMotion); `collides` tells of all others, within the cone that was asked for.
        required_rad: what was asked for; None when nothing was.
        blockers: names of earlier parts that are hit while inserting along the axis or the rim, or that leave
            the cone too narrow.
        collides: the sweep along the axis or rim hits a part that is not (or not only) limiting the cone.
    """

    part: str
    alpha_rad: float
    required_rad: float | None
    blockers: tuple[str, ...]
    collides: bool

    @property
    def assemblable(self) -> bool:
        """Return whether the part can be inserted as asked."""
        wide_enough = self.alpha_rad >= (self.required_rad or 0.0) - ANGLE_ROUNDING_RAD
        return wide_enough and not self.collides


def insertion_verdicts(graph: PartsGraph) -> tuple[InsertionVerdict, ...]:
    """Return one verdict per free part: its cone, and a swept collision check along the axis and the rim.

    The cone is about the direction that was chosen for the part; where none was, about the axis of its widest one.
    """
    assembly, verdicts = graph.assembly, []
    for part, motion in graph.motions():
        chosen = graph.placed(part).chosen
        alpha, axis = motion.alpha_rad, motion.axis
        if chosen is not None and len(motion.normals):
            axis = -chosen
            alpha = motion.room(axis)
        rim = insertion_rim(axis, assembly.alpha_rad or 0.0)
        open_there = alpha > -ANGLE_ROUNDING_RAD
        hit = sweep_blockers(assembly, part, rim) if open_there else ()
        if (hit or not open_there) and chosen is None:
            # Others than those it touches bar the middle of its cone: another way may be free and wide enough.
            other = first_free(assembly, part, _other_ways(motion, assembly.alpha_rad or 0.0))
            if other is not None:
                room = motion.room(other)
                axis, alpha, hit = other, 0.0 if abs(room) <= SLIDE else room, ()
        if assembly.dimension == 2 and alpha > 0.0 and not hit:
            alpha = min(alpha, free_half_angle_2d(assembly, part, axis))
        narrow = alpha < (assembly.alpha_rad or 0.0) - ANGLE_ROUNDING_RAD
        blockers = {assembly.parts[b].name for b in motion.blockers} if narrow else set()
        blockers |= {assembly.parts[b].name for b in hit}
        ordered = tuple(n for n in assembly.sequence if n in blockers)
        verdicts.append(InsertionVerdict(assembly.parts[part].name, alpha, assembly.alpha_rad, ordered, bool(hit)))
    return tuple(verdicts)


def _other_ways(motion: PartMotion, least_rad: float) -> Iterator[Array]:
    """Yield unit ways out that its own contacts leave free by `least_rad`, each as far as can be from those before;
    then, where no cone is asked for, those along which the part slides.
    """
    ways = spread_directions(len(motion.axis), DENSE)
    ways = ways[(ways @ motion.normals.T).min(axis=1, initial=1.0) >= np.sin(least_rad) - ANGLE_ROUNDING_RAD]
    apart = np.linalg.norm(ways - motion.axis, axis=1)
    for _ in range(min(OTHER_WAYS, len(ways))):
        way = ways[apart.argmax()]
        yield way
        apart = np.minimum(apart, np.linalg.norm(ways - way, axis=1))
    if least_rad <= 0.0:
        yield from sliding_ways(motion.normals)[0]
