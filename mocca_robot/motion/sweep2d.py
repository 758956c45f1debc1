"""Moving a flat part along straight lines: which others it meets, and how wide its free cone is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.geometry.frames import tangents
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.tolerances import TINY, TOLERANCES


def sweep_blockers_2d(assembly: Assembly, part: int, ways_out: Array) -> tuple[int, ...]:
    """Return the earlier parts that `part` hits on its way out along any of `ways_out` (m, 2).

    The sweep is long enough to clear everything. Touching is not hitting: an overlap counts when it is deeper than
    parts at rest may overlap.
    """
    moving, obstacles = _polygon(assembly, part), _obstacles(assembly)
    outline = np.concatenate(moving.rings)
    hit: set[int] = set()
    for way in ways_out:
        # Only what overlaps the part's width across the way, and does not lie behind it, can be in it.
        frame = np.array([*tangents(way), way]).T
        low, high = obstacles.extent(frame, part)
        mine = outline @ frame
        ahead = (high >= mine.min(axis=0)).all(axis=1) & (low[:, 0] <= mine[:, 0].max())
        others = np.flatnonzero(ahead)
        swept = _entered(moving, way * 2.0 * assembly.size)
        shapely.prepare(swept)
        met = shapely.intersects(swept[:, None], obstacles.cores[others]).any(axis=0)
        hit.update(others[met].tolist())
    return tuple(sorted(hit))


def free_half_angle_2d(assembly: Assembly, part: int, way_out: Array) -> float:
    """Return the half-angle (radians) of the widest cone about `way_out` (2,) along which `part` leaves freely.

    Zero when the axis is blocked. Otherwise the nearest blocked direction carries a corner of the part onto a corner
    of an obstacle: blocked directions are those of the Minkowski difference of the two, whose outline seen from the
    origin ends at differences of corners. So this is exact, up to the depth by which parts at rest may overlap.
    """
    if sweep_blockers_2d(assembly, part, way_out[None]):
        return 0.0
    corners = np.concatenate(_polygon(assembly, part).rings)
    obstacles = _obstacles(assembly)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    reach = float(np.linalg.norm(corners - middle, axis=1).max())
    across = obstacles.middle[:part] - middle
    distance = np.maximum(np.linalg.norm(across, axis=1), TINY)
    # No corner of an obstacle is seen at less than this angle from the way out; most need no closer look.
    width = (obstacles.reach[:part] + reach) / distance
    least = np.arccos(np.clip(across @ way_out / distance, -1.0, 1.0)) - np.arcsin(np.minimum(width, 1.0))
    least[width >= 1.0] = 0.0  # so near that it may be seen anywhere
    widest = float(np.pi)
    for other in np.argsort(least):
        if least[other] >= widest:
            break
        seen = obstacles.corners[obstacles.first[other] : obstacles.first[other + 1], None] - corners
        cosine = float((seen @ way_out / np.linalg.norm(seen, axis=2)).max(initial=-1.0))
        widest = min(widest, float(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return widest


def depth(assembly: Assembly) -> float:
    """Return how deep, m, flat parts at rest may overlap: what lies deeper counts as solid."""
    return max(TOLERANCES.overlap_depth * assembly.size, assembly.tolerance_m)


def _polygon(assembly: Assembly, part: int) -> Polygon:
    shape = assembly.parts[part].shape
    assert isinstance(shape, Polygon)
    return shape


@dataclass(frozen=True, eq=False)
class _Cores:
    """What lies deeper inside each of N parts than parts at rest may overlap.

    Attributes:
        cores: (N,) polygons.
        corners: (M, 2) theirs, part by part; first: (N + 1,) where those of each part begin.
        middle, reach: (N, 2), (N,) circles around them.
    """

    cores: NDArray[np.object_]
    corners: Array
    first: IntArray
    middle: Array
    reach: Array

    def extent(self, frame: Array, count: int) -> tuple[Array, Array]:
        """Return the least and largest coordinates (count, 2) of the first parts along the columns of `frame`."""
        if count == 0 or self.first[count] == 0:
            return np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
        local = self.corners[: self.first[count]] @ frame
        some = np.flatnonzero(np.diff(self.first[: count + 1]))  # thin parts have no core
        low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
        low[some] = np.minimum.reduceat(local, self.first[some])
        high[some] = np.maximum.reduceat(local, self.first[some])
        return low, high


@lru_cache(maxsize=4)
def _obstacles(assembly: Assembly) -> _Cores:
    """Return the obstacles of an assembly; kept, since every part of it is swept against the earlier ones."""
    shapes = np.array([to_shapely(_polygon(assembly, k)) for k in range(len(assembly.parts))])
    cores = shapely.buffer(shapes, -depth(assembly), join_style="mitre")
    corners, owner = shapely.get_coordinates(cores, return_index=True)
    first = np.searchsorted(owner, np.arange(len(cores) + 1))
    bounds = np.array([_polygon(assembly, k).bounds for k in range(len(assembly.parts))])
    middle = bounds.mean(axis=1)
    return _Cores(cores, corners, first, middle, 0.5 * np.linalg.norm(bounds[:, 1] - bounds[:, 0], axis=1))


def _entered(polygon: Polygon, travel: Array) -> NDArray[np.object_]:
    """Return what a polygon enters while moving by `travel`: the parallelograms that its leading edges sweep."""
    start = np.concatenate(polygon.rings)
    end = np.concatenate([np.roll(ring, -1, axis=0) for ring in polygon.rings])
    edge = end - start
    leading = edge[:, 1] * travel[0] - edge[:, 0] * travel[1] > 0.0
    corners = np.stack([start, end, end + travel, start + travel], axis=1)[leading]
    return np.asarray(shapely.polygons(corners))
