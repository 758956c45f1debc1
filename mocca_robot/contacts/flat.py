"""Contacts between flat parts: where edges of two outlines run along each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.contacts.contact import Contact, ContactReport, NearMiss, Overlap, accepted_pairs
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.tolerances import NEARLY_PARALLEL_RAD, TINY, TOLERANCES, Tolerances


@dataclass(frozen=True, eq=False)
class OutlineEdges:
    """All boundary edges of an assembly as arrays; the solid lies to the left of start → end."""

    part: Array
    start: Array
    end: Array
    direction: Array
    length: Array

    @classmethod
    def of(cls, assembly: Assembly) -> OutlineEdges:
        part, start, end = [], [], []
        for index, p in enumerate(assembly.parts):
            assert isinstance(p.shape, Polygon)
            for ring in p.shape.rings:
                part.append(np.full(len(ring), index))
                start.append(ring)
                end.append(np.roll(ring, -1, axis=0))
        starts, ends = np.concatenate(start), np.concatenate(end)
        delta = ends - starts
        length = np.linalg.norm(delta, axis=1)
        return cls(np.concatenate(part), starts, ends, delta / np.maximum(length, TINY)[:, None], length)


@dataclass(frozen=True, eq=False, kw_only=True)
class EdgePairs:
    """OutlineEdges of two parts that run along each other.

    Attributes:
        edges: those of all parts.
        a, b: (m,) edges of the earlier and of the later part.
        s0, s1: (m,) where on a the shared stretch begins and ends, m from its start.
        outward: (m, 2) unit normal of a.
        rise: (m, 2) how far b lies above a at both ends of the stretch, m; negative where they overlap.
        widest: (m,) the larger amount of the two.
        gap: up to which edges touch, m.
        touching, missing: (m,) whether they do, or nearly.
    """

    edges: OutlineEdges
    a: IntArray
    b: IntArray
    s0: Array
    s1: Array
    outward: Array
    rise: Array
    widest: Array
    gap: float
    touching: BoolArray
    missing: BoolArray


def find_contacts_2d(assembly: Assembly, tolerances: Tolerances = TOLERANCES) -> ContactReport:
    """Return all contacts between the outlines of `assembly`, exact up to `tolerances.contact_gap` × size or its own
    `tolerance_m`.

    Contacts come sorted by pair, then along the earlier part's boundary: edge by edge, from start to end. So the
    numbering of a pair depends on these two parts alone.
    """
    size = assembly.size
    near = edge_pairs(assembly, tolerances)
    edges, a, b, s0, s1, gap = near.edges, near.a, near.b, near.s0, near.s1, near.gap

    found: list[tuple[int, int, int, float, Array, Array]] = []
    rises: dict[tuple[int, int], tuple[float, float]] = {}
    for e in np.flatnonzero(near.touching):
        # An end of a shared stretch is always a corner of one of the two parts: take its exact coordinates.
        p1 = edges.start[a[e]] if s0[e] <= gap else edges.end[b[e]]
        p2 = edges.end[a[e]] if s1[e] >= edges.length[a[e]] - gap else edges.start[b[e]]
        pair = int(edges.part[a[e]]), int(edges.part[b[e]])
        found.append((*pair, int(a[e]), float(s0[e]), np.stack([p1, p2]), near.outward[e]))
        low, high = rises.get(pair, (0.0, 0.0))
        rises[pair] = min(low, float(near.rise[e].min())), max(high, float(near.rise[e].max()))
    found.sort(key=lambda f: f[:4])
    contacts: list[Contact] = []
    for i, j, _, _, segment, normal in found:
        k = contacts[-1].k + 1 if contacts and contacts[-1].parts == (i, j) else 0
        contacts.append(Contact((i, j), read_only(segment), read_only(normal), k))

    rounding = tolerances.overlap_depth * size
    overlaps, accepted = accepted_pairs(
        assembly.sequence,
        rises,
        tolerances.contact_gap * size,
        _overlaps_2d(assembly, rounding),
        max(rounding, assembly.tolerance_m),
    )
    overlapping = {o.parts for o in overlaps}
    pairs_in_contact = {c.parts for c in contacts}
    misses: dict[tuple[str, str], NearMiss] = {}
    for e in np.flatnonzero(near.missing):
        pair = (int(edges.part[a[e]]), int(edges.part[b[e]]))
        names = (assembly.parts[pair[0]].name, assembly.parts[pair[1]].name)
        nearly_parallel = abs(near.rise[e, 1] - near.rise[e, 0]) <= NEARLY_PARALLEL_RAD * (s1[e] - s0[e])
        if pair in pairs_in_contact or names in overlapping or not nearly_parallel:
            continue
        if names not in misses or near.widest[e] < misses[names].gap_m:
            misses[names] = NearMiss(names, float(near.widest[e]), float(s1[e] - s0[e]))
    return ContactReport(tuple(contacts), tuple(misses.values()), overlaps, accepted)


def edge_pairs(assembly: Assembly, tolerances: Tolerances = TOLERANCES) -> EdgePairs:
    """Return the edges of two parts each that run along each other, touching or nearly."""
    size, allowed = assembly.size, assembly.tolerance_m
    gap, near = max(tolerances.contact_gap * size, allowed), max(tolerances.near_miss * size, allowed)
    edges = OutlineEdges.of(assembly)
    tree = shapely.STRtree(shapely.linestrings(np.stack([edges.start, edges.end], axis=1)))
    # Boxes find the pairs that the gaps below sort out; distances would take five times as long.
    low, high = np.minimum(edges.start, edges.end) - near, np.maximum(edges.start, edges.end) + near
    a, b = tree.query(shapely.box(*low.T, *high.T))
    keep = edges.part[a] < edges.part[b]
    a, b = a[keep], b[keep]
    antiparallel = np.einsum("ij,ij->i", edges.direction[a], edges.direction[b])
    a, b = a[antiparallel < -0.9], b[antiparallel < -0.9]

    t = edges.direction[a]
    outward = np.stack([t[:, 1], -t[:, 0]], axis=1)
    relative_start, relative_end = edges.start[b] - edges.start[a], edges.end[b] - edges.start[a]
    s0 = np.einsum("ij,ij->i", relative_end, t).clip(0.0, edges.length[a])
    s1 = np.einsum("ij,ij->i", relative_start, t).clip(0.0, edges.length[a])
    # Gap of b's line over the shared stretch, at both of its ends.
    slope_length = np.einsum("ij,ij->i", relative_start - relative_end, t)
    d_end = np.einsum("ij,ij->i", relative_end, outward)
    d_start = np.einsum("ij,ij->i", relative_start, outward)
    along_end = np.einsum("ij,ij->i", relative_end, t)
    rate = (d_start - d_end) / np.where(np.abs(slope_length) > 0, slope_length, 1.0)
    gap0, gap1 = d_end + rate * (s0 - along_end), d_end + rate * (s1 - along_end)
    widest = np.maximum(np.abs(gap0), np.abs(gap1))
    # Beside an edge that overlaps, its neighbours' edges share stretches as long as the overlap is deep.
    long_enough = s1 - s0 > max(tolerances.min_contact * size, 2.0 * allowed)
    touching = long_enough & (widest <= gap)
    return EdgePairs(
        edges=edges,
        a=a,
        b=b,
        s0=s0,
        s1=s1,
        outward=outward,
        rise=np.stack([gap0, gap1], axis=1),
        widest=widest,
        gap=gap,
        touching=touching,
        missing=long_enough & ~touching & (widest <= near),
    )


def _overlaps_2d(assembly: Assembly, depth: float) -> tuple[Overlap, ...]:
    """Return pairs whose intersection still has area after shrinking it by half the allowed depth."""
    shapes = np.array([to_shapely(p.shape) for p in assembly.parts if isinstance(p.shape, Polygon)])
    tree = shapely.STRtree(shapes)
    a, b = tree.query(shapes, predicate="intersects")
    keep = a < b
    found = []
    for i, j in zip(a[keep], b[keep]):
        common = shapely.intersection(shapes[i], shapes[j])
        if shapely.area(common) <= 0.0 or common.buffer(-0.5 * depth).is_empty:
            continue
        radius = shapely.maximum_inscribed_circle(_largest(common))  # a line from its centre
        names = assembly.parts[i].name, assembly.parts[j].name
        found.append(Overlap(names, 2.0 * float(radius.length), tuple(map(float, radius.coords[0]))))
    return tuple(found)


def _largest(geometry: shapely.Geometry) -> shapely.Geometry:
    pieces = [g for g in shapely.get_parts(geometry) if g.geom_type == "Polygon"]
    return max(pieces, key=shapely.area)
