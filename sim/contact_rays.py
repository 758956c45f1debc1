"""The few contact points of a pair that carry nearly the same wrenches as all of its facets.

A curved joint arrives as hundreds of flat facets. What one part can do to the other is the conic hull of the
facets' generalized normals [n̂; r × n̂ / reach]; the points kept are chosen from its extreme rays, farthest first,
so that a flat contact keeps its corners and a curved one as many points as its curvature needs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.assembly import Array, Assembly
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


def reduced_rays(assembly: Assembly, contacts: Sequence[Contact], resolution: int) -> Iterator[Rays]:
    """Yield the kept rays of every pair that shares contacts, at most `resolution` a pair."""
    by_pair: dict[tuple[int, int], list[Contact]] = {}
    for contact in contacts:
        by_pair.setdefault(contact.parts, []).append(contact)
    for pair, mine in sorted(by_pair.items()):
        points = np.concatenate([c.polygon for c in mine])
        normals = np.concatenate([np.tile(c.normal, (len(c.polygon), 1)) for c in mine])
        reach = float(np.linalg.norm(np.ptp(points, axis=0)))
        kept = _spread(points, normals, reach, resolution)
        yield Rays(pair, points[kept], normals[kept], reach)


def _spread(points: Array, normals: Array, reach: float, resolution: int) -> Array:
    """Return indices of extreme rays, farthest first from those already kept."""
    wrenches = generalized_normals(points, normals, points.mean(axis=0), 0.5 * reach)
    candidates = extreme_rays(wrenches, tolerance=1e-6)
    unit = wrenches[candidates] / np.linalg.norm(wrenches[candidates], axis=1)[:, None]
    first = int(np.argmin(unit @ unit.mean(axis=0)))
    kept = [first]
    nearest = np.linalg.norm(unit - unit[first], axis=1)
    while len(kept) < resolution and nearest.max() > COVERED:
        worst = int(nearest.argmax())
        kept.append(worst)
        nearest = np.minimum(nearest, np.linalg.norm(unit - unit[worst], axis=1))
    return np.asarray(candidates[sorted(kept)])
