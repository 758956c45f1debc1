"""Moving a solid part along straight lines: which others it meets, and how much solids overlap.

Part A, moved along w, meets B exactly when some line along w passes a point of A and, further on, a point of B.
As the two do not overlap at the start, it is enough to compare the faces of A that look along w with the faces
of B that look back: seen along w they overlap, and B's is not behind A's. Pairs of triangles are compared in the
plane across w, without ever building the swept volume.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import shapely

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.contacts.penetration import shared_volume, solid
from mocca_robot.geometry.frames import tangents
from mocca_robot.tolerances import TINY

SWEEP_TOLERANCE = 1e-6
"""Share of the assembly's size below which a hit's width is sliding contact, rounding or weld; as in 2D."""
CLIP_CORNERS = 10
"""Slots for a triangle cut by four half planes: at most 7 corners, and room to cut."""


def sweep_blockers_3d(assembly: Assembly, part: int, ways_out: Array) -> tuple[int, ...]:
    """Return the earlier parts that `part` hits on its way out along any of `ways_out` (m, 3).

    The way is endless: everything ahead counts. Touching and sliding along a face are no hits: the common
    outline of the faces that meet, seen along the way, is wider than 1e-6 of the assembly's size, or than parts at rest
    may lie inside each other.
    """
    if part == 0:
        return ()
    moving = _mesh(assembly, part)
    # Seen at a slant, what overlaps by the tolerance is a little wider.
    tolerance = max(SWEEP_TOLERANCE * assembly.size, 1.5 * assembly.tolerance_m)
    corners = _box_corners(assembly)[:part]
    hit: set[int] = set()
    for way in ways_out:
        frame = np.concatenate([tangents(way / np.linalg.norm(way)), way[None] / np.linalg.norm(way)])
        ahead = _Profile((moving.vertices @ frame.T)[moving.faces], 1.0, tolerance)
        if len(ahead.corners) == 0:
            continue
        local = corners @ frame.T
        low, high = local.min(axis=1), local.max(axis=1)
        in_line = (low[:, :2] <= ahead.high.max(axis=0)).all(axis=1) & (high[:, :2] >= ahead.low.min(axis=0)).all(
            axis=1
        )
        in_line &= high[:, 2] >= ahead.heights.min() - tolerance
        others = [k for k in np.flatnonzero(in_line).tolist() if k not in hit]
        met = _met(ahead, [_mesh(assembly, k) for k in others], frame, tolerance)
        hit.update(others[k] for k in met)
    return tuple(sorted(hit))


@lru_cache(maxsize=4)
def _box_corners(assembly: Assembly) -> Array:
    """Return the corners (N, 8, 3) of the parts' bounding boxes; kept, since every part is swept against them."""
    boxes = np.array([_mesh(assembly, part).bounds for part in range(len(assembly.parts))])
    return np.asarray(boxes[:, np.arange(8)[:, None] >> np.arange(3) & 1, np.arange(3)])


def _mesh(assembly: Assembly, part: int) -> Mesh:
    shape = assembly.parts[part].shape
    assert isinstance(shape, Mesh)
    return shape


class _Profile:
    """Triangles of a mesh that look along the way (`sense` 1) or back (−1), in the frame across it.

    `corners` (F, 3, 2) are counter-clockwise, `heights` (F, 3) along the way; triangles seen edge-on are left out.
    `low` and `high` (F, 2) bound the triangles, `kept` (F,) says which of all they are.
    """

    def __init__(self, triangles: Array, sense: float, tolerance: float) -> None:
        corners = triangles if sense > 0 else triangles[:, ::-1]
        ab, ac = corners[:, 1, :2] - corners[:, 0, :2], corners[:, 2, :2] - corners[:, 0, :2]
        bc = ac - ab
        area = 0.5 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
        around = np.sqrt((ab**2).sum(axis=1)) + np.sqrt((ac**2).sum(axis=1)) + np.sqrt((bc**2).sum(axis=1))
        wide = area > 0.5 * tolerance * around
        self.kept = np.flatnonzero(wide)
        self.corners, self.heights = corners[wide, :, :2], corners[wide, :, 2]
        self.low, self.high = _extremes(self.corners)


def _extremes(corners: Array) -> tuple[Array, Array]:
    """Return the least and the greatest coordinates (F, d) of triangles (F, 3, d): thrice as fast as min and max."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _met(ahead: _Profile, others: Sequence[Mesh], frame: Array, tolerance: float) -> list[int]:
    """Return which of `others` the profile meets on its way, by index; all their triangles are compared at once."""
    lowest = float(ahead.heights.min()) - tolerance
    low, high = ahead.low.min(axis=0), ahead.high.max(axis=0)
    triangles, owners = [], []
    for k, other in enumerate(others):
        local = other.vertices @ frame.T
        least, most = local.min(axis=0), local.max(axis=0)
        if most[2] >= lowest and (most[:2] >= low).all() and (least[:2] <= high).all():
            triangles.append(local[other.faces])
            owners.append(np.full(len(other.faces), k))
    if not triangles:
        return []
    corners, owner = np.concatenate(triangles), np.concatenate(owners)
    least, most = _extremes(corners)
    near = (most[:, 2] >= lowest) & (most[:, 0] > low[0]) & (most[:, 1] > low[1])
    near &= (least[:, 0] < high[0]) & (least[:, 1] < high[1])
    back = _Profile(corners[near], -1.0, tolerance)
    owner = owner[near][back.kept]
    apart = back.heights.max(axis=1)[:, None] < ahead.heights.min(axis=1) - tolerance  # behind
    for axis in range(2):
        apart |= back.low[:, axis, None] >= ahead.high[:, axis]
        apart |= back.high[:, axis, None] <= ahead.low[:, axis]
    b, a = np.nonzero(~apart)
    if not len(a):
        return []
    return [int(k) for k in np.unique(owner[b[_meeting_widths(ahead, a, back, b, tolerance) > tolerance]])]


def _meeting_widths(ahead: _Profile, a: IntArray, back: _Profile, b: IntArray, tolerance: float) -> Array:
    """Return (n,) how wide, m, pairs of triangles overlap where the second is not behind the first."""
    first, second = ahead.corners[a], back.corners[b]
    polygon = np.concatenate([first, np.repeat(first[:, -1:], CLIP_CORNERS - 3, axis=1)], axis=1)
    for k in range(3):
        start, end = second[:, k], second[:, (k + 1) % 3]
        inward = np.stack([start[:, 1] - end[:, 1], end[:, 0] - start[:, 0]], axis=1)
        polygon = _clipped(polygon, np.einsum("nkd,nd->nk", polygon - start[:, None], inward))
    gain, level = _plane(second, back.heights[b])
    slope, base = _plane(first, ahead.heights[a])
    above = np.einsum("nkd,nd->nk", polygon, gain - slope) + (level - base)[:, None] + tolerance
    polygon = _clipped(polygon, above)
    step = np.roll(polygon, -1, axis=1) - polygon
    offset = polygon - polygon[:, :1]
    area = 0.5 * (offset[..., 0] * step[..., 1] - offset[..., 1] * step[..., 0]).sum(axis=1)
    around = np.linalg.norm(step, axis=2).sum(axis=1)
    return np.asarray(2.0 * area / np.maximum(around, TINY))


def _clipped(polygon: Array, inside: Array) -> Array:
    """Return convex polygons (n, K, 2) cut where `inside` (n, K) ≥ 0, padded by repeating a corner."""
    following, after = np.roll(polygon, -1, axis=1), np.roll(inside, -1, axis=1)
    crosses = (inside > 0) != (after > 0)
    share = np.where(crosses, inside / np.where(crosses, inside - after, 1.0), 0.0)
    cut = polygon + share[..., None] * (following - polygon)
    n, k = inside.shape
    both = np.stack([polygon, cut], axis=2).reshape(n, 2 * k, 2)
    repeated = (polygon == following).all(axis=2)
    kept = np.stack([(inside > 0) & ~repeated, crosses], axis=2).reshape(n, 2 * k)
    order = np.argsort(~kept, axis=1, kind="stable")[:, :k]
    result = np.take_along_axis(both, order[..., None], axis=1)
    valid = np.take_along_axis(kept, order, axis=1)
    return np.where(valid[..., None], result, result[:, :1])


def _plane(corners: Array, heights: Array) -> tuple[Array, Array]:
    """Return gradients (n, 2) and levels (n,) of the planes through triangles (n, 3, 2) with `heights` (n, 3)."""
    ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    rise_b, rise_c = heights[:, 1] - heights[:, 0], heights[:, 2] - heights[:, 0]
    doubled = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    gradient = np.stack([rise_b * ac[:, 1] - rise_c * ab[:, 1], rise_c * ab[:, 0] - rise_b * ac[:, 0]], axis=1)
    gradient /= doubled[:, None]
    return gradient, heights[:, 0] - np.einsum("nd,nd->n", gradient, corners[:, 0])


def mesh_overlap(meshes: Sequence[Mesh]) -> float:
    """Return the largest volume that two of `meshes` share, as a share of the smaller one's volume.

    Every pair whose bounding boxes share a volume is intersected (manifold3d).
    """
    if len(meshes) < 2:
        return 0.0
    bounds = np.array([m.bounds for m in meshes])
    lower, upper = bounds[:, 0], bounds[:, 1]
    boxes = shapely.box(lower[:, 0], lower[:, 1], upper[:, 0], upper[:, 1])
    i, j = shapely.STRtree(boxes).query(boxes)
    shared = np.minimum(upper[i], upper[j]) - np.maximum(lower[i], lower[j])
    close = (i < j) & (shared > 0).all(axis=1)
    solids = [solid(m) for m in meshes] if close.any() else []
    worst = 0.0
    for a, b in zip(i[close], j[close]):
        smaller = min(meshes[a].volume, meshes[b].volume)
        worst = max(worst, shared_volume(solids[a], solids[b]) / smaller)
    return worst
