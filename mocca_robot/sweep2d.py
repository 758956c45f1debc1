"""Moving a flat part along straight lines: which others it meets, and how wide its free cone is."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from mocca_robot.assembly import Array, Assembly, Polygon
from mocca_robot.contacts import to_shapely
from mocca_robot.tolerances import TOLERANCES


def sweep_blockers_2d(assembly: Assembly, part: int, ways_out: Array) -> tuple[int, ...]:
    """Return the earlier parts that `part` hits on its way out along any of `ways_out` (m, 2).

    The sweep is long enough to clear everything. Touching is not hitting: an overlap counts when it is deeper than
    parts at rest may overlap.
    """
    moving = _polygon(assembly, part)
    tree = shapely.STRtree([_core(_polygon(assembly, k), depth(assembly)) for k in range(part)])
    swept = np.concatenate([_entered(moving, way * 2.0 * assembly.size) for way in ways_out])
    _, hit = tree.query(swept, predicate="intersects")
    return tuple(int(k) for k in np.unique(hit))


def free_half_angle_2d(assembly: Assembly, part: int, way_out: Array) -> float:
    """Return the half-angle (radians) of the widest cone about `way_out` (2,) along which `part` leaves freely.

    Zero when the axis is blocked. Otherwise the nearest blocked direction carries a corner of the part onto a corner
    of an obstacle: blocked directions are those of the Minkowski difference of the two, whose outline seen from the
    origin ends at differences of corners. So this is exact, up to the depth by which parts at rest may overlap.
    """
    if sweep_blockers_2d(assembly, part, way_out[None]):
        return 0.0
    corners = np.concatenate(_polygon(assembly, part).rings)
    nearest = -1.0
    for other in range(part):
        obstacle = shapely.get_coordinates(_core(_polygon(assembly, other), depth(assembly)))
        across = obstacle[:, None] - corners
        nearest = max(nearest, float((across @ way_out / np.linalg.norm(across, axis=2)).max(initial=-1.0)))
    return float(np.arccos(np.clip(nearest, -1.0, 1.0)))


def depth(assembly: Assembly) -> float:
    """Return how deep, m, flat parts at rest may overlap: what lies deeper counts as solid."""
    return TOLERANCES.overlap_depth * assembly.size


def _polygon(assembly: Assembly, part: int) -> Polygon:
    shape = assembly.parts[part].shape
    assert isinstance(shape, Polygon)
    return shape


@lru_cache(maxsize=1024)
def _core(polygon: Polygon, depth: float) -> shapely.Geometry:
    """Return what lies deeper than `depth` inside a polygon; kept, since every later part is swept against it."""
    return shapely.buffer(to_shapely(polygon), -depth, join_style="mitre")


def _entered(polygon: Polygon, travel: Array) -> NDArray[np.object_]:
    """Return what a polygon enters while moving by `travel`: the parallelograms that its leading edges sweep."""
    start = np.concatenate(polygon.rings)
    end = np.concatenate([np.roll(ring, -1, axis=0) for ring in polygon.rings])
    edge = end - start
    leading = edge[:, 1] * travel[0] - edge[:, 0] * travel[1] > 0.0
    corners = np.stack([start, end, end + travel, start + travel], axis=1)[leading]
    return np.asarray(shapely.polygons(corners))
