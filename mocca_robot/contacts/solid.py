"""Contacts between polyhedra: where flat faces of two parts share an area.

Two roads lead to a contact. Facets whose triangles both meshes have in common (equal corners, opposite sense) are
contacts as they stand: that is how built joints arrive, hundreds of triangles each. All other facets are compared
in pairs: antiparallel, in one plane, and overlapping there by an area that is computed in the plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.contacts.contact import Contact, ContactReport, NearMiss, accepted_pairs
from mocca_robot.contacts.penetration import penetrations
from mocca_robot.contacts.stored import stored_contacts
from mocca_robot.geometry.facets import FacetSet, facets
from mocca_robot.geometry.frames import tangents
from mocca_robot.tolerances import NEARLY_PARALLEL_RAD, TOLERANCES, Tolerances

Found = tuple[int, int, int, int, Array, tuple[Array, ...], Array]
"""Parts i and j, the facets of i and of j, outer loop, holes, normal."""


def find_contacts_3d(assembly: Assembly, tolerances: Tolerances = TOLERANCES) -> ContactReport:
    """Return all contacts between the polyhedra of `assembly`, exact up to `tolerances.contact_gap` × size or its own
    `tolerance_m`.

    A contact polygon may be non-convex and have holes; its corners are corners of either mesh, bit for bit,
    wherever they are not crossings of two edges. Contacts come sorted by pair, then by the earlier part's facet and the
    later part's: the numbering of a pair depends on these two parts alone.
    """
    size = assembly.size
    touching = touching_facets(assembly, tolerances)
    faces, misses = touching.faces, touching.misses
    contacts: list[Contact] = []
    for i, j, _, _, outer, holes, normal in touching.found:
        again = bool(contacts) and contacts[-1].parts == (i, j)
        k = contacts[-1].k + 1 if again else 0
        contacts.append(Contact((i, j), read_only(outer), read_only(normal), k, tuple(read_only(h) for h in holes)))
    if assembly.interfaces:
        contacts = list(stored_contacts(assembly))
    pairs = {c.parts for c in contacts}
    rounding = tolerances.overlap_depth * size
    overlaps = penetrations(assembly, faces, touching.partner, contacts, rounding)
    deeper, accepted = accepted_pairs(
        assembly.sequence, touching.rises, tolerances.contact_gap * size, overlaps, max(rounding, assembly.tolerance_m)
    )
    named = {o.parts for o in overlaps}
    near = []
    for (i, j), (gap, area) in sorted(misses.items()):
        names = (assembly.parts[i].name, assembly.parts[j].name)
        if (i, j) not in pairs and names not in named:
            near.append(NearMiss(names, gap, area))
    return ContactReport(tuple(contacts), tuple(near), deeper, accepted)


@dataclass(frozen=True, eq=False, kw_only=True)
class TouchingFacets:
    """Which facets of an assembly of solids touch which.

    Attributes:
        faces: all of them.
        found: pairs that touch, with the contact between them.
        partner: (T,) the part that each triangle is shared with, or −1.
        rises: per pair of parts the least and largest distance of faces that touch (m; negative: they overlap).
        misses: per pair of parts whose faces nearly touch the gap (m) and area (m²).
    """

    faces: FacetSet
    found: list[Found]
    partner: IntArray
    rises: dict[tuple[int, int], tuple[float, float]]
    misses: dict[tuple[int, int], tuple[float, float]]


def touching_facets(assembly: Assembly, tolerances: Tolerances = TOLERANCES) -> TouchingFacets:
    """Return the facets that touch, sorted by the parts, then by the facets."""
    meshes = [p.shape for p in assembly.parts if isinstance(p.shape, Mesh)]
    rounding = tolerances.contact_gap * assembly.size
    faces = facets(meshes, max(rounding, assembly.tolerance_m), assembly.tolerance_m)
    found, spent, partner = _shared_facets(faces, rounding)
    flat, rises, misses = _facet_overlaps(faces, spent, tolerances, assembly.size, assembly.tolerance_m)
    found += flat
    found.sort(key=lambda f: f[:4])
    return TouchingFacets(faces=faces, found=found, partner=partner, rises=rises, misses=misses)


def _shared_facets(faces: FacetSet, gap: float) -> tuple[list[Found], BoolArray, IntArray]:
    """Return the contacts where two parts have the same triangles, (F,) which facets that used up, and (T,) the part
    that each triangle is shared with, or −1.

    Whole facets that consist of the same triangles become one contact each. Of the others, those of a single
    triangle do; larger ones are left to be compared as polygons.
    """
    ids = np.sort(faces.triangles, axis=1)
    order = np.lexsort((faces.part, ids[:, 2], ids[:, 1], ids[:, 0]))
    same = (ids[order][1:] == ids[order][:-1]).all(axis=1)
    a, b = order[:-1][same], order[1:][same]
    opposite = np.einsum("ij,ij->i", faces.triangle_normals[a], faces.triangle_normals[b]) < 0
    keep = opposite & (faces.part[a] != faces.part[b])
    a, b = a[keep], b[keep]
    partner = np.full(len(faces.part), -1)
    partner[a], partner[b] = faces.part[b], faces.part[a]
    mine, theirs = faces.facet[a], faces.facet[b]
    pairs, shared = np.unique(mine * len(faces.count) + theirs, return_counts=True)
    whole = (shared == faces.count[pairs // len(faces.count)]) & (shared == faces.count[pairs % len(faces.count)])
    single = (faces.count[mine] == 1) | (faces.count[theirs] == 1)
    spent = np.zeros(len(faces.count), dtype=np.bool_)
    spent[pairs[whole] // len(faces.count)] = True
    spent[pairs[whole] % len(faces.count)] = True
    for facet in (mine[single], theirs[single]):
        spent[facet[faces.count[facet] == 1]] = True
    found: list[Found] = []
    for t, u in zip(a[single], b[single]):
        corners, normal = faces.vertices[faces.triangles[t]], faces.triangle_normals[t]
        pair, both = (int(faces.part[t]), int(faces.part[u])), (int(faces.facet[t]), int(faces.facet[u]))
        found.append((*pair, *both, corners, (), normal))
    for facet, other in zip(*np.divmod(pairs[whole & (shared > 1)], len(faces.count))):
        loops = [faces.vertices[loop] for loop in faces.loops(int(facet))]
        if len(loops) > 1:
            loops.sort(key=lambda loop: -float(np.linalg.norm(np.cross(loop, np.roll(loop, -1, axis=0)).sum(axis=0))))
        outer, *holes = (_without_straight_corners(loop, gap) for loop in loops)
        i, j = int(faces.facet_part[facet]), int(faces.facet_part[other])
        found.append((i, j, int(facet), int(other), outer, tuple(holes), faces.normals[facet]))
    return found, spent, partner


@dataclass(frozen=True, eq=False, kw_only=True)
class _Plane:
    """A facet as a 2D polygon in its own plane: x = origin + p₀ axes₀ + p₁ axes₁."""

    origin: Array
    axes: Array
    normal: Array
    polygon: shapely.Geometry
    corners: Array
    flat_corners: Array

    @classmethod
    def of(cls, faces: FacetSet, facet: int) -> _Plane:
        normal = faces.normals[facet]
        axes = tangents(normal)
        loops = faces.loops(facet)
        corners = faces.vertices[np.concatenate(loops)]
        origin = corners[0]
        flat = (corners - origin) @ axes.T
        cuts = np.cumsum([len(loop) for loop in loops])[:-1]
        return cls(
            origin=origin,
            axes=axes,
            normal=normal,
            polygon=_polygon(np.split(flat, cuts)),
            corners=corners,
            flat_corners=flat,
        )

    def lifted(self, points: Array) -> Array:
        """Return (m, 2) points of the plane in space."""
        return np.asarray(self.origin + points @ self.axes)


def _polygon(loops: list[Array]) -> shapely.Geometry:
    """Return the region that loops bound: the union of counter-clockwise ones less the others."""
    if len(loops) == 1:
        shape = shapely.Polygon(loops[0])
    else:
        rings = [shapely.Polygon(loop) for loop in loops]
        outer = max(range(len(rings)), key=lambda r: rings[r].area)
        shape = shapely.Polygon(loops[outer], [loop for r, loop in enumerate(loops) if r != outer])
    return shape if shape.is_valid else shapely.make_valid(shape)


def _facet_overlaps(
    faces: FacetSet, spent: BoolArray, tolerances: Tolerances, size: float, allowed: float
) -> tuple[list[Found], dict[tuple[int, int], tuple[float, float]], dict[tuple[int, int], tuple[float, float]]]:
    """Return contacts from overlapping facets that are at most `allowed` apart (m), and by pair the least and largest
    rise of the one above the other, and the near misses: gap (m) and area (m²).
    """
    gap, near = max(tolerances.contact_gap * size, allowed), max(tolerances.near_miss * size, allowed)
    # Along the rim of a face that overlaps, its neighbours' faces share strips as wide as the overlap is deep.
    narrowest = max(tolerances.min_contact * size, 2.0 * allowed)
    a, b = _candidates(faces, spent, near)
    planes: dict[int, _Plane] = {}
    found: list[Found] = []
    rises: dict[tuple[int, int], tuple[float, float]] = {}
    misses: dict[tuple[int, int], tuple[float, float]] = {}
    parallel = np.linalg.norm(np.cross(faces.normals[a], faces.normals[b]), axis=1) <= tolerances.contact_angle_rad
    if allowed > 0.0:
        parallel[:] = True  # how far apart they are at the most is asked below
    for fa, fb, may_touch in zip(a.tolist(), b.tolist(), parallel.tolist()):
        for f in (fa, fb):
            if f not in planes:
                planes[f] = _Plane.of(faces, f)
        mine, other = planes[fa], planes[fb]
        theirs, moved = _projected(mine, other, gap)
        common = shapely.intersection(mine.polygon, theirs)
        pair = (int(faces.facet_part[fa]), int(faces.facet_part[fb]))
        for piece in shapely.get_parts(common):
            if piece.geom_type != "Polygon" or 2 * piece.area <= narrowest * piece.length:
                continue
            rise = _rise(mine, other, shapely.get_coordinates(piece))
            widest = float(np.abs(rise).max())
            if may_touch and widest <= gap:
                turned = shapely.geometry.polygon.orient(piece)
                outer, *holes = (
                    _exact_loop(mine, other, moved, np.asarray(ring.coords)[:-1], gap)
                    for ring in (turned.exterior, *turned.interiors)
                )
                if len(outer) >= 3:
                    kept = tuple(h for h in holes if len(h) >= 3)
                    found.append((*pair, fa, fb, outer, kept, mine.normal))
                    low, high = rises.get(pair, (0.0, 0.0))
                    rises[pair] = min(low, float(rise.min())), max(high, float(rise.max()))
                continue
            parallel_enough = np.ptp(rise) <= NEARLY_PARALLEL_RAD * np.sqrt(piece.area)
            if widest <= near and parallel_enough and widest < misses.get(pair, (np.inf, 0.0))[0]:
                misses[pair] = (widest, float(piece.area))
    return found, rises, misses


def _candidates(faces: FacetSet, spent: BoolArray, near: float) -> tuple[IntArray, IntArray]:
    """Return facet pairs (of the earlier, of the later part) that are antiparallel, close and side by side."""
    alive = np.flatnonzero(~spent)
    lower, upper = faces.lower[alive] - near / 2, faces.upper[alive] + near / 2
    spread = (upper.max(axis=0) - lower.min(axis=0)) / (upper - lower).mean(axis=0)
    x, y, z = np.argsort(-spread)
    boxes = shapely.box(lower[:, x], lower[:, y], upper[:, x], upper[:, y])
    left, right = shapely.STRtree(boxes).query(boxes)
    keep = faces.facet_part[alive[left]] < faces.facet_part[alive[right]]
    left, right = left[keep], right[keep]
    keep = (lower[left, z] <= upper[right, z]) & (lower[right, z] <= upper[left, z])
    a, b = alive[left[keep]], alive[right[keep]]
    cosine = np.einsum("ij,ij->i", faces.normals[a], faces.normals[b])
    keep = cosine < -np.cos(NEARLY_PARALLEL_RAD)
    a, b = a[keep], b[keep]
    # The slab that b's box occupies along a's normal has to meet a's plane.
    anchor = np.zeros((len(faces.count), 3))
    anchor[faces.facet] = faces.vertices[faces.triangles[:, 0]]
    n = faces.normals[a]
    middle = 0.5 * (faces.lower[b] + faces.upper[b]) - anchor[a]
    reach = 0.5 * np.einsum("ij,ij->i", np.abs(n), faces.upper[b] - faces.lower[b])
    keep = np.abs(np.einsum("ij,ij->i", n, middle)) <= reach + near
    return a[keep], b[keep]


def _projected(mine: _Plane, other: _Plane, gap: float) -> tuple[shapely.Geometry, Array]:
    """Return `other`'s polygon in the plane of `mine`, corners closer than `gap` to one of mine put onto it, and
    (m, 2) where its corners went.
    """
    flat = (other.corners - mine.origin) @ mine.axes.T
    distance = np.linalg.norm(flat[:, None] - mine.flat_corners[None], axis=2)
    nearest = distance.argmin(axis=1)
    close = distance[np.arange(len(flat)), nearest] <= gap
    flat[close] = mine.flat_corners[nearest[close]]
    # The same corners in the same order, so each coordinate of the polygon finds its new place.
    where = {tuple(p): k for k, p in enumerate(other.flat_corners)}
    own = shapely.get_coordinates(other.polygon)
    index = np.array([where.get(tuple(p), -1) for p in own])
    fallback = (other.lifted(own) - mine.origin) @ mine.axes.T
    moved = np.where((index >= 0)[:, None], flat[index], fallback)
    shape = shapely.set_coordinates(shapely.from_wkb(shapely.to_wkb(other.polygon)), moved)
    return (shape if shape.is_valid else shapely.make_valid(shape)), flat


def _rise(mine: _Plane, other: _Plane, points: Array) -> Array:
    """Return (m,) how far above `mine` the plane of `other` lies at points (m, 2) of `mine`, metres."""
    below = other.origin - mine.lifted(points)
    return np.asarray((below @ other.normal) / float(mine.normal @ other.normal))


def _exact_loop(mine: _Plane, other: _Plane, moved: Array, loop: Array, gap: float) -> Array:
    """Return a loop (m, 2) of the overlap in space, its corners replaced by the mesh corners they stand for, and
    without repeats and corners on a straight line.
    """
    flat = np.concatenate([mine.flat_corners, moved])
    space = np.concatenate([mine.corners, other.corners])
    distance = np.linalg.norm(loop[:, None] - flat[None], axis=2)
    nearest = distance.argmin(axis=1)
    snapped = distance[np.arange(len(loop)), nearest] <= 2 * gap
    points = np.where(snapped[:, None], space[nearest], mine.lifted(loop))
    points = points[np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1) > gap]
    return _without_straight_corners(points, gap) if len(points) >= 3 else points


def _without_straight_corners(points: Array, gap: float) -> Array:
    """Return a loop (m, 3) without the corners that lie on the straight line between their neighbours."""
    after = np.concatenate([points[1:], points[:1]]) - points
    before = np.concatenate([after[-1:], after[:-1]])
    # |a × b|² = |a|²|b|² − (a·b)² would cancel; written out because np.cross is slow on short loops.
    x, y, z = before.T
    u, v, w = after.T
    sine = np.sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2)
    chord = np.linalg.norm(before + after, axis=1)
    straight = (sine <= 1e-2 * gap * chord) & (np.einsum("ij,ij->i", before, after) > 0)
    return np.asarray(points[~straight])
