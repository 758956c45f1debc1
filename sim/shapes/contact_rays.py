"""The few contact points of a pair that carry nearly the same wrenches as all of its facets.

A curved joint arrives as hundreds of flat facets. What one part can do to the other is the conic hull of the
facets' generalized normals [n̂; r × n̂ / reach]; the points kept are chosen from its extreme rays, farthest first,
so that a flat contact keeps its corners and a curved one as many points as its curvature needs.

With friction a point between others of another normal carries what they cannot: then the corners of every plane count.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.cones import extreme_rays, generalized_normals
from mocca_robot.joints.joint import contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_rays
from mocca_robot.statics.loads import LoadCase
from mocca_robot.statics.solution import Status
from mocca_robot.tolerances import COARSE

COVERED = 0.06
"""Stop once every ray lies this close (radians, in the scaled wrench space) to a kept one."""
VIOLATED = 1e-4
"""Speed into a contact, relative to the fastest at any, from which a motion violates it."""
MOST_ROUNDS = 40


@dataclass(frozen=True, eq=False)
class Rays:
    """Contact points of one pair of parts.

    Attributes:
        pair: (i, j), i earlier.
        points: (m, d), metres.
        normals: (m, d) from i into j.
        reach: size of the pair's contact region, metres.
    """

    pair: tuple[int, int]
    points: Array
    normals: Array
    reach: float


@dataclass(frozen=True, eq=False)
class PairRays:
    """All contact points of one pair that its wrench cone needs, and which of them a model keeps.

    Attributes:
        rays: all of them.
        kept: (m,) true for those that span the cone best.
    """

    rays: Rays
    kept: BoolArray

    @property
    def reduced(self) -> Rays:
        """Return the kept ones."""
        return Rays(self.rays.pair, self.rays.points[self.kept], self.rays.normals[self.kept], self.rays.reach)


def pair_rays(contacts: Sequence[Contact], resolution: int, friction: float = 0.0) -> Iterator[PairRays]:
    """Yield the rays of every pair that shares contacts, at most `resolution` of them kept a pair."""
    by_pair: dict[tuple[int, int], list[Contact]] = {}
    for contact in contacts:
        by_pair.setdefault(contact.parts, []).append(contact)
    for pair, mine in sorted(by_pair.items()):
        _, points, normals = contact_rays(mine)
        reach = float(np.linalg.norm(np.ptp(points, axis=0)))
        wrenches = generalized_normals(points, normals, points.mean(axis=0), 0.5 * reach)
        needed = extreme_rays(wrenches, tolerance=COARSE) if friction == 0.0 else _corners(wrenches, normals)
        kept = _spread(wrenches[needed], resolution)
        yield PairRays(Rays(pair, points[needed], normals[needed], reach), kept)


def reduced_rays(contacts: Sequence[Contact], resolution: int, friction: float = 0.0) -> Iterator[Rays]:
    """Yield the kept rays of every pair that shares contacts, at most `resolution` a pair."""
    return (found.reduced for found in pair_rays(contacts, resolution, friction))


def holding(graph: PartsGraph, pairs: Sequence[PairRays], case: LoadCase, friction: float = 0.0) -> list[PairRays]:
    """Return `pairs` with as many more rays kept as it takes to hold what all of them hold under `case`.

    Statics says how the parts would move on the kept rays alone; in every pair the ray that this motion violates most
    is kept, too, until nothing moves, or nothing violates a ray.
    """
    rays = [p.rays for p in pairs]
    number = np.repeat(np.arange(len(rays)), [len(r.points) for r in rays])
    parts = np.array([r.pair for r in rays])[number]
    points, normals = np.concatenate([r.points for r in rays]), np.concatenate([r.normals for r in rays])
    kept = np.concatenate([p.kept for p in pairs])
    there = case.present[parts].all(axis=1)
    about = np.array([p.centroid for p in graph.assembly.parts])
    for _ in range(MOST_ROUNDS):
        used = kept & there
        found = solve_rays(graph, case, (parts[used], points[used], normals[used]), friction)
        if found.status is not Status.NOT_IN_EQUILIBRIUM:
            break
        first, second = (_velocity(found.motions, about, parts[:, side], points) for side in (0, 1))
        opening = ((second - first) * normals).sum(axis=1)
        sliding = np.linalg.norm(second - first - opening[:, None] * normals, axis=1)
        speed = np.where(there & ~kept, opening - friction * sliding, 0.0)
        order = np.argsort(speed)
        order = order[speed[order] < -VIOLATED * np.linalg.norm(second - first, axis=1).max(initial=0.0)]
        if not len(order):
            break
        kept[order[np.unique(number[order], return_index=True)[1]]] = True
    ends = np.cumsum([len(r.points) for r in rays])[:-1]
    return [PairRays(r, k) for r, k in zip(rays, np.split(kept, ends), strict=True)]


def _velocity(motions: Array, about: Array, part: IntArray, points: Array) -> Array:
    """Return (C, d) the velocity of points of their parts under motions (N, dof) about reference points (N, d)."""
    d = points.shape[1]
    arm, turn = points - about[part], motions[part, d:]
    turned = turn * np.stack([-arm[:, 1], arm[:, 0]], axis=1) if d == 2 else np.cross(turn, arm)
    return np.asarray(motions[part, :d] + turned)


def _spread(wrenches: Array, resolution: int) -> BoolArray:
    """Return (m,) which rays to keep to span the cone, farthest first from those already kept."""
    unit = wrenches / np.linalg.norm(wrenches, axis=1)[:, None]
    kept = np.zeros(len(unit), dtype=np.bool_)
    worst = int(np.argmin(unit @ unit.mean(axis=0)))
    kept[worst] = True
    nearest = np.linalg.norm(unit - unit[worst], axis=1)
    while kept.sum() < resolution and nearest.max() > COVERED:
        worst = int(nearest.argmax())
        kept[worst] = True
        nearest = np.minimum(nearest, np.linalg.norm(unit - unit[worst], axis=1))
    return kept


def _corners(wrenches: Array, normals: Array) -> IntArray:
    """Return the indices of the outermost points of every normal."""
    _, group = np.unique(np.round(normals, 6), axis=0, return_inverse=True)
    members = (np.flatnonzero(group.ravel() == g) for g in range(group.max() + 1))
    return np.sort(np.concatenate([mine[extreme_rays(wrenches[mine], tolerance=COARSE)] for mine in members]))
