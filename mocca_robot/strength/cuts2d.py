"""Cuts through flat parts: straight chords from boundary to boundary, across necks, bumps and the whole part."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Polygon
from mocca_robot.geometry.frames import tangents
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.strength.sections import Sections
from mocca_robot.strength.settings import EXACT, NEAR, ROUNDING, STEP_ASIDE, TINY

SPACING = 1.0 / 60.0
"""Along the boundary, from where a cut starts square inwards, as a share of the outline's length."""
INNER_TURN = np.deg2rad(3.0)
"""The outline turns inwards by more where two such corners may be the ends of a neck or of a bump's root."""
NECKS = 150
"""Most cuts from inner corner to inner corner: the shortest."""
EVEN = (8, 9)
"""Directions, and places in each, of cuts through the whole part."""


def cuts2d(polygon: Polygon, points: Array) -> Sections:
    """Return cuts through a part whose contact samples are `points` (S, 2)."""
    outline = _Outline(polygon)
    chords = np.concatenate([outline.inwards(), outline.necks(), outline.across()])
    starts, ends = chords[:, 0], chords[:, 1]
    lengths = np.linalg.norm(ends - starts, axis=1)
    kept = lengths > NEAR * outline.size
    starts, ends, lengths = starts[kept], ends[kept], lengths[kept]
    first, last = outline.place(starts), outline.place(ends)
    swap = first > last
    starts, ends = np.where(swap[:, None], ends, starts), np.where(swap[:, None], starts, ends)
    first, last = np.minimum(first, last), np.maximum(first, last)
    along = (ends - starts) / lengths[:, None]
    # Between the two places the outline runs counter-clockwise, so what it encloses lies right of start → end.
    normals = -tangents(along)[:, 0]
    area, centroid = outline.between(first, last, starts, ends)
    at = outline.place(points)
    beyond = (at > first[:, None]) & (at < last[:, None])
    thick = polygon.thickness
    half = 0.5 * lengths[:, None, None] * np.array([[[-1.0], [1.0]]])
    return Sections(
        normals=normals,
        centres=0.5 * (starts + ends),
        areas=lengths * thick,
        inertia=(lengths**3 * thick / 12.0)[:, None, None],
        rims=half,
        beyond=beyond,
        volumes=area * thick,
        centroids=centroid,
    )


def beyond2d(sections: Sections, polygon: Polygon, points: Array) -> BoolArray:
    """Return (P, L) which of further points, in or on the part, lie beyond each cut: by the piece that is cut off."""
    outline = _Outline(polygon)
    found = np.zeros((len(sections.areas), len(points)), dtype=np.bool_)
    along = tangents(sections.normals)[:, 0]
    half = 0.5 * sections.areas[:, None] / polygon.thickness * along
    ends = np.stack([sections.centres - half, sections.centres + half])
    at = np.sort(np.stack([outline.place(e) for e in ends]), axis=0)
    for k in range(len(found)):
        inner = (outline.at > at[0, k]) & (outline.at < at[1, k])
        a, b = ends[:, k] if outline.place(ends[0, k][None])[0] <= at[0, k] + EXACT * outline.total else ends[::-1, k]
        ring = np.vstack([a, outline.ring[inner], b])
        if len(ring) >= 3:
            found[k] = shapely.intersects_xy(
                shapely.Polygon(ring).buffer(ROUNDING * outline.size), points[:, 0], points[:, 1]
            )
    return found


class _Outline:
    """The exterior of a polygon by length along it; holes are cut around as if they were not there."""

    def __init__(self, polygon: Polygon) -> None:
        self.ring = polygon.exterior
        self.shape = to_shapely(polygon)
        shapely.prepare(self.shape)
        self.next = np.roll(self.ring, -1, axis=0)
        steps = np.linalg.norm(self.next - self.ring, axis=1)
        self.at = np.r_[0.0, np.cumsum(steps)[:-1]]
        self.total = float(steps.sum())
        self.size = float(np.linalg.norm(np.ptp(self.ring, axis=0)))
        self.along = (self.next - self.ring) / np.maximum(steps, TINY)[:, None]
        origin = self.ring[0]
        moments = [_moments(a - origin, b - origin) for a, b in zip(self.ring, self.next)]
        self.sums = np.vstack([np.zeros(3), np.cumsum(moments, axis=0)])

    def place(self, points: Array) -> Array:
        """Return (n,) where along the outline the nearest place to each point is."""
        line = shapely.LineString(np.vstack([self.ring, self.ring[:1]]))
        found = shapely.line_locate_point(line, shapely.points(points))
        return np.asarray(np.where(found >= self.total, 0.0, found))

    def inwards(self) -> Array:
        """Return (n, 2, 2) chords square to the outline, from places spread along it and both sides of each corner."""
        count = max(8, int(1.0 / SPACING))
        places = np.sort(np.r_[np.linspace(0.0, self.total, count, endpoint=False), self.at + STEP_ASIDE * self.total])
        edge = np.searchsorted(self.at, places, side="right") - 1
        starts = self.ring[edge] + (places - self.at[edge])[:, None] * self.along[edge]
        return self._rays(starts, tangents(self.along[edge])[:, 0])

    def _rays(self, starts: Array, ways: Array) -> Array:
        """Return (m, 2, 2) chords from places on the outline along `ways` to where they first leave the part."""
        span = self.next - self.ring
        det = ways[:, None, 0] * span[None, :, 1] - ways[:, None, 1] * span[None, :, 0]
        gap = self.ring[None] - starts[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            far = (gap[..., 0] * span[None, :, 1] - gap[..., 1] * span[None, :, 0]) / det
            share = (gap[..., 0] * ways[:, None, 1] - gap[..., 1] * ways[:, None, 0]) / det
        met = (far > NEAR * self.size) & (share >= -EXACT) & (share <= 1.0 + EXACT)
        reach = np.where(met, far, np.inf).min(axis=1)
        hit = np.isfinite(reach)
        return np.stack([starts[hit], starts[hit] + reach[hit, None] * ways[hit]], axis=1)

    def necks(self) -> Array:
        """Return (n, 2, 2) chords inside the part from inner corner to inner corner."""
        before = np.roll(self.along, 1, axis=0)
        turn = np.arctan2(
            before[:, 0] * self.along[:, 1] - before[:, 1] * self.along[:, 0], (before * self.along).sum(1)
        )
        inner = self.ring[turn < -INNER_TURN]
        a, b = np.triu_indices(len(inner), 1)
        order = np.argsort(np.linalg.norm(inner[a] - inner[b], axis=1), kind="stable")[: 4 * NECKS]
        chords = np.stack([inner[a[order]], inner[b[order]]], axis=1)
        middles = 0.5 * chords[:, 0] + 0.5 * chords[:, 1]
        lines = shapely.linestrings(chords + NEAR * (middles[:, None] - chords))
        return chords[shapely.covers(self.shape, lines)][:NECKS] if len(chords) else chords

    def across(self) -> Array:
        """Return (n, 2, 2) chords of even families of parallel lines."""
        found = []
        for angle in np.pi * np.arange(EVEN[0]) / EVEN[0]:
            normal = np.array([np.cos(angle), np.sin(angle)])
            heights = self.ring @ normal
            span = heights.max() - heights.min()
            for share in (np.arange(EVEN[1]) + 0.5034) / EVEN[1]:
                level = heights.min() + share * span
                up = heights > level
                edges: IntArray = np.flatnonzero(up != np.roll(up, -1))
                t = (level - heights[edges]) / (np.roll(heights, -1)[edges] - heights[edges])
                met = self.ring[edges] + t[:, None] * (self.next - self.ring)[edges]
                met = met[np.argsort(met @ tangents(normal)[0])]
                found += [np.stack(pair) for pair in list(pairwise(met))[::2]]
        return np.array(found).reshape(-1, 2, 2)

    def between(self, first: Array, last: Array, starts: Array, ends: Array) -> tuple[Array, Array]:
        """Return areas (n,) and centroids (n, 2) of what chords cut off between two places of the outline."""
        origin = self.ring[0]
        e1, e2 = (np.searchsorted(self.at, p, side="right") - 1 for p in (first, last))
        s, e = starts - origin, ends - origin
        same = e1 == e2
        whole = self.sums[e2] - self.sums[e1 + 1]
        parts = _moments(s, self.next[e1] - origin) + whole + _moments(self.ring[e2] - origin, e)
        sums = np.where(same[:, None], _moments(s, e), parts) + _moments(e, s)
        area = sums[:, 0]
        safe = np.where(np.abs(area) > TINY, area, np.inf)
        return np.maximum(area, 0.0), origin + sums[:, 1:] / safe[:, None]


def _moments(a: Array, b: Array) -> Array:
    """Return (…, 3) area and first moments of the triangles origin, a, b."""
    half = 0.5 * (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    return np.concatenate([half[..., None], half[..., None] * (a + b) / 3.0], axis=-1)
