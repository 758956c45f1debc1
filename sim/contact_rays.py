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

from mocca_robot.assembly import Array, Assembly, IntArray
from mocca_robot.contacts import Contact
from mocca_robot.motion_cone import extreme_rays, generalized_normals

COVERED = 0.06
"""Stop once every ray lies this close (radians, in the scaled wrench space) to a kept one."""


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


def reduced_rays(
    assembly: Assembly, contacts: Sequence[Contact], resolution: int, friction: float = 0.0
) -> Iterator[Rays]:
    """Yield the kept rays of every pair that shares contacts, at most `resolution` a pair."""
    by_pair: dict[tuple[int, int], list[Contact]] = {}
    for contact in contacts:
        by_pair.setdefault(contact.parts, []).append(contact)
    for pair, mine in sorted(by_pair.items()):
        points = np.concatenate([c.polygon for c in mine])
        normals = np.concatenate([np.tile(c.normal, (len(c.polygon), 1)) for c in mine])
        reach = float(np.linalg.norm(np.ptp(points, axis=0)))
        kept = _spread(points, normals, reach, resolution, friction)
        yield Rays(pair, points[kept], normals[kept], reach)


def _spread(points: Array, normals: Array, reach: float, resolution: int, friction: float) -> Array:
    """Return indices of rays that span the cone, farthest first from those already kept."""
    wrenches = generalized_normals(points, normals, points.mean(axis=0), 0.5 * reach)
    candidates = extreme_rays(wrenches, tolerance=1e-6) if friction == 0.0 else _corners(wrenches, normals)
    unit = wrenches[candidates] / np.linalg.norm(wrenches[candidates], axis=1)[:, None]
    first = int(np.argmin(unit @ unit.mean(axis=0)))
    kept = [first]
    nearest = np.linalg.norm(unit - unit[first], axis=1)
    while len(kept) < resolution and nearest.max() > COVERED:
        worst = int(nearest.argmax())
        kept.append(worst)
        nearest = np.minimum(nearest, np.linalg.norm(unit - unit[worst], axis=1))
    return np.asarray(candidates[sorted(kept)])


def _corners(wrenches: Array, normals: Array) -> IntArray:
    """Return the indices of the outermost points of every normal."""
    _, group = np.unique(np.round(normals, 6), axis=0, return_inverse=True)
    members = (np.flatnonzero(group.ravel() == g) for g in range(group.max() + 1))
    return np.sort(np.concatenate([mine[extreme_rays(wrenches[mine], tolerance=1e-6)] for mine in members]))
