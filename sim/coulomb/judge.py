"""Does an assembly, or a state of it, stand with friction?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.friction import between, clamped, tangential_ratio
from mocca_robot.joints.joint import contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.loads import LoadCase, case_wrenches
from sim.coulomb.settle import COURSE, Course, Settled, SettlingOutcome, settle
from sim.coulomb.springs import Springs
from sim.motion import reach
from sim.shapes.contact_model import telling_rays

MOVED = 0.05
"""Way of a part, relative to the farthest, from which it takes part in a fall; what stands gives by less."""

Points = tuple[IntArray, Array, Array]
"""Contact points: pairs (K, 2) of parts, points (K, d) in metres, and unit normals (K, d) from the earlier part."""
MOST_POINTS = 5000
"""Contact points from which on a structure stands on those that carry nearly the same, as in MuJoCo."""


@dataclass(frozen=True, eq=False)
class Rubbing:
    """An assembly whose contacts rub.

    Attributes:
        graph: parts where they belong, with their contacts.
        friction: Coulomb coefficient, or more: a table, stiffness, what is clamped (`mocca_robot.contacts.friction`).
        points: where the parts touch; by default every corner of every contact, as in statics.
    """

    graph: PartsGraph
    friction: float
    points: Points | None = None

    @cached_property
    def whole(self) -> Springs:
        """Return the springs of the finished assembly."""
        return self.springs(np.ones(len(self.graph.assembly.parts), dtype=np.bool_), self.graph.assembly.fixed)

    def springs(self, present: BoolArray, held: BoolArray) -> Springs:
        """Return the springs between the parts that are there; `present` and `held` are (N,)."""
        pairs, points, normals = contact_rays(self.graph.contacts) if self.points is None else self.points
        there = present[pairs].all(axis=1)
        return Springs.build(
            pairs[there],
            points[there],
            normals[there],
            friction=between(self.friction, self.graph.assembly.parts, pairs[there]),
            clamping=_clamping(clamped(self.friction, self.graph.assembly.parts, pairs), pairs)[there],
            free=present & ~held,
            about=np.array([p.centroid for p in self.graph.assembly.parts]),
            length=self.graph.assembly.size / 2,
            shear_ratio=tangential_ratio(self.friction),
        )


def rubbing(graph: PartsGraph, friction: float) -> Rubbing:
    """Return an assembly that rubs at every corner of its contacts, or at the telling ones where they are too many."""
    rays = None
    if corners(graph) > MOST_POINTS:
        rays = telling_rays(graph.assembly, graph.contacts, friction)
    if rays is None:
        return Rubbing(graph, friction)
    kept = [r.reduced for r in rays]
    pairs = np.concatenate([np.tile(np.array(k.pair), (len(k.points), 1)) for k in kept])
    points, normals = np.concatenate([k.points for k in kept]), np.concatenate([k.normals for k in kept])
    return Rubbing(graph, friction, (pairs, points, normals))


def corners(graph: PartsGraph) -> int:
    """Return how many corners the contacts have in all."""
    return sum(len(c.polygon) for c in graph.contacts)


def _clamping(forces: Mapping[tuple[int, int], float], pairs: IntArray) -> Array:
    """Return (K,) newtons at every contact point of pairs of parts that press on each other with `forces`."""
    out = np.zeros(len(pairs))
    for pair, force in forces.items():
        theirs = ((pairs == pair) | (pairs == pair[::-1])).all(axis=1)
        out[theirs] = force / theirs.sum()
    return out


@dataclass(frozen=True, eq=False)
class CoulombVerdict:
    """What a load case does.

    Attributes:
        settled: the verdict with its evidence.
        moved: names of the parts that fall, in assembly order; none where it stands.
    """

    settled: Settled
    moved: tuple[str, ...]

    @property
    def stands(self) -> bool:
        """Return whether it stands; false also where there is no verdict."""
        return self.settled.outcome is SettlingOutcome.STANDS


def standing(rubbing: Rubbing, case: LoadCase, course: Course = COURSE) -> CoulombVerdict:
    """Return whether the parts that are there stand when the load of `case` grows from zero."""
    springs = rubbing.springs(case.present, case.held)
    return told(rubbing.graph.assembly, settle(springs, case_wrenches(case, rubbing.graph), course))


def told(assembly: Assembly, settled: Settled) -> CoulombVerdict:
    """Return a verdict with the names of the parts that fall."""
    if settled.outcome is SettlingOutcome.STANDS:
        return CoulombVerdict(settled, ())
    d = assembly.dimension
    shift, turn = settled.motions[:, :d], settled.motions[:, d:]
    way = np.linalg.norm(shift, axis=1) + reach(assembly) * np.linalg.norm(turn, axis=1)
    return CoulombVerdict(settled, tuple(p.name for p, w in zip(assembly.parts, way) if w > MOVED * way.max()))
