"""Parts that nearly touch → parts that share their faces exactly.

Faces that touch within the tolerance form groups; every group gets one plane, that of its largest face, and every
corner moves the shortest way onto the planes of its faces. Corners of several parts at one place move together where
that leaves all of them on their planes. What still overlaps afterwards is cut from the later part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Assembly, Mesh, Polygon, Shape
from mocca_robot.contacts.boundaries import Boundaries, boundaries, moved
from mocca_robot.contacts.contact import Accepted, ContactReport
from mocca_robot.contacts.find import find_contacts
from mocca_robot.contacts.penetration import solid
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.geometry.surfaces import welded
from mocca_robot.tolerances import EXACT, NEARLY_PARALLEL_RAD

NEARLY_EXACT = 1e-8
"""Of the assembly's size: how far corners may be off their planes after as many turns as are made; far less than
contacts ask for."""
TURNS = 500
"""How often planes and corners give way to each other: they come closer by a constant factor every time."""
NEARLY_DEPENDENT = 0.02
"""Planes whose normals span a direction by less meet too far away for a corner to go there."""
TOUCHING, ALIGNED = 2.0, 4.0
"""Tolerances that a face may be off the plane of its group: a face that is not level with it is a little further away
where the other does not reach; seams are longer than single faces."""
CRUMB = 1e-6
"""Share of a part below which a piece that cutting leaves is rounding."""
ROUNDS = 3
"""How often overlaps are looked for after cutting; a cut can bare another one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Healed:
    """An assembly after healing.

    Attributes:
        assembly: the parts; its tolerance is 0.
        moved_m: per part how far a corner went at most, metres.
        volume_change: per part the change of volume as a share of it.
        cut: pairs of parts whose overlap was cut from the later one.
        left: pairs that still overlap or miss each other.
    """

    assembly: Assembly
    moved_m: tuple[float, ...]
    volume_change: tuple[float, ...]
    cut: tuple[tuple[str, str], ...]
    left: tuple[Accepted, ...]


def heal(assembly: Assembly) -> Healed:
    """Return `assembly` with parts that share faces exactly wherever they touch within its `tolerance_m`.

    Parts and their order stay. A face moves by at most the tolerance, a corner where faces meet at an angle a little
    more. What cannot be mended this way, as curved faces that are cut into different flats, is named in `left`.
    """
    found = boundaries(assembly)
    alike = _together(found, assembly.tolerance_m)
    corners = _on_planes(found, alike, *_planes(found, alike, assembly.tolerance_m), assembly)
    healed = replace(assembly.with_shapes(moved(assembly, found, corners)), tolerance_m=0.0)
    healed, cut = _without_overlaps(healed, assembly.tolerance_m)
    report = find_contacts(replace(healed, tolerance_m=assembly.tolerance_m))
    away = np.linalg.norm(corners - found.corners, axis=1)
    volumes = [(a.shape.volume, b.shape.volume) for a, b in zip(assembly.parts, healed.parts)]
    return Healed(
        assembly=healed,
        moved_m=tuple(float(away[found.owner == k].max(initial=0.0)) for k in range(len(assembly.parts))),
        volume_change=tuple(after / before - 1.0 for before, after in volumes),
        cut=cut,
        left=_left(report),
    )


def _left(report: ContactReport) -> tuple[Accepted, ...]:
    return (*report.accepted, *(Accepted(o.parts, o.depth_m, 0.0) for o in report.overlaps))


def _planes(found: Boundaries, alike: Sequence[Sequence[int]], tolerance: float) -> tuple[Array, Array, IntArray]:
    """Return per group of faces the normal (G, d) and offset (G,) of its plane, and (F,) the group of each, or −1.

    Faces that touch join groups in the order of their size, then those that lie in one plane where corners meet, as the
    walls of a seam that runs on: as long as no face of a group is further from the plane of its largest one than the
    slack.
    """
    both = np.minimum(found.measure[found.pairs[:, 0]], found.measure[found.pairs[:, 1]])
    order = np.lexsort((found.pairs[:, 1], found.pairs[:, 0], -both))
    joins = [(a, b, TOUCHING * tolerance) for a, b in found.pairs[order].tolist()]
    joins += [(a, b, ALIGNED * tolerance) for a, b in _seams(found, alike)]
    leader = np.arange(len(found.measure))
    members: dict[int, list[int]] = {}
    for a, b, slack in joins:
        first, second = int(leader[a]), int(leader[b])
        if first == second:
            continue
        mine, theirs = members.get(first, [first]), members.get(second, [second])
        larger = (found.measure[first], -first) >= (found.measure[second], -second)
        head, tail, joining = (first, second, theirs) if larger else (second, first, mine)
        points = found.corners[np.concatenate([found.faces[f] for f in joining])]
        anchor = found.corners[found.faces[head]].mean(axis=0)
        if np.abs((points - anchor) @ found.normals[head]).max() > slack:
            continue
        members[head] = mine + theirs
        members.pop(tail, None)
        leader[members[head]] = head
    group = np.full(len(found.measure), -1)
    heads = sorted(members)
    for g, head in enumerate(heads):
        group[members[head]] = g
    normals = found.normals[heads]
    anchors = np.array([found.corners[found.faces[h]].mean(axis=0) for h in heads]).reshape(normals.shape)
    return normals, np.einsum("gd,gd->g", normals, anchors), group


def _seams(found: Boundaries, alike: Sequence[Sequence[int]]) -> list[tuple[int, int]]:
    """Return pairs of touching faces of different parts that meet in a corner and are nearly parallel."""
    at: dict[int, list[int]] = {}
    for face in np.unique(found.pairs).tolist():
        for corner in found.faces[face].tolist():
            at.setdefault(corner, []).append(face)
    seen: dict[tuple[int, int], None] = {}
    for mine in alike:
        faces = sorted({f for c in mine for f in at.get(c, [])})
        cosine = np.abs(found.normals[faces] @ found.normals[faces].T)
        for k, m in np.argwhere(np.triu(cosine > np.cos(NEARLY_PARALLEL_RAD), 1)).tolist():
            if found.face_part[faces[k]] != found.face_part[faces[m]]:
                seen[faces[k], faces[m]] = None
    return list(seen)


def _on_planes(
    found: Boundaries,
    alike: Sequence[Sequence[int]],
    normals: Array,
    offsets: Array,
    group: IntArray,
    assembly: Assembly,
) -> Array:
    """Return (n, d) where every corner goes."""
    planes: list[set[int]] = [set() for _ in found.corners]
    for face in np.flatnonzero(group >= 0):
        for corner in found.faces[face].tolist():
            planes[corner].add(int(group[face]))
    asked = [sorted(set().union(*(planes[c] for c in mine))) for mine in alike]
    start = np.array([found.corners[mine].mean(axis=0) for mine in alike]).reshape(-1, normals.shape[1])
    places, normals, offsets = settled(start, asked, normals, offsets, EXACT * assembly.size)
    corners = found.corners.copy()
    furthest = 10.0 * assembly.tolerance_m
    for mine, from_, place, wanted in zip(alike, start, places, asked):
        off = np.abs(normals[wanted] @ place - offsets[wanted]).max(initial=0.0)
        if off <= NEARLY_EXACT * assembly.size and np.linalg.norm(place - from_) <= furthest:
            corners[mine] = place
            continue
        for c in mine:
            own = sorted(planes[c])
            target = _nearest(corners[c][None], normals[own][None], offsets[own][None])[0]
            if np.linalg.norm(target - corners[c]) <= furthest:
                corners[c] = target
    return corners


def settled(
    places: Array, asked: Sequence[Sequence[int]], normals: Array, offsets: Array, exact: float
) -> tuple[Array, Array, Array]:
    """Return `places` (K, d), each moved onto the planes that it is `asked` to lie on, and these planes.

    Where more planes ask than can meet in a point, as around a corner of a dome, planes and places give way in turns:
    each place goes to the nearest point on its planes, each of these planes to the best fit of its places.
    """
    places, normals, offsets = places.copy(), normals.copy(), offsets.copy()
    by_count: dict[int, list[int]] = {}
    for k, mine in enumerate(asked):
        by_count.setdefault(len(mine), []).append(k)
    batches = [(np.array(ks), np.array([list(asked[k]) for k in ks])) for n, ks in sorted(by_count.items()) if n]
    place = np.repeat(np.arange(len(asked)), [len(mine) for mine in asked])
    plane = np.array([p for mine in asked for p in mine], dtype=np.int64)
    loose = np.zeros(len(normals), dtype=np.bool_)
    for _ in range(TURNS):
        for ks, theirs in batches:
            places[ks] = _nearest(places[ks], normals[theirs], offsets[theirs])
        off = np.abs(np.einsum("nd,nd->n", normals[plane], places[place]) - offsets[plane])
        if off.max(initial=0.0) <= exact:
            break
        loose[plane[np.isin(place, place[off > exact])]] = True
        normals, offsets = _fitted(places, place, plane, loose, normals, offsets)
    return places, normals, offsets


def _fitted(
    places: Array, place: IntArray, plane: IntArray, loose: BoolArray, normals: Array, offsets: Array
) -> tuple[Array, Array]:
    """Return the planes, those that are `loose` fitted to the places that are asked to lie on them."""
    count = np.bincount(plane, minlength=len(normals))
    middle = np.zeros_like(normals)
    np.add.at(middle, plane, places[place])
    middle /= np.maximum(count, 1)[:, None]
    away = places[place] - middle[plane]
    spread = np.zeros((*normals.shape, normals.shape[1]))
    np.add.at(spread, plane, away[:, :, None] * away[:, None, :])
    fit = np.linalg.eigh(spread)[1][:, :, 0]
    fit *= np.where(np.einsum("gd,gd->g", fit, normals) < 0.0, -1.0, 1.0)[:, None]
    # Places that hardly span a plane say little about how it lies.
    usable = loose & (count >= normals.shape[1]) & (np.einsum("gd,gd->g", fit, normals) > np.cos(NEARLY_PARALLEL_RAD))
    normals = np.where(usable[:, None], fit, normals)
    return normals, np.where(usable, np.einsum("gd,gd->g", normals, middle), offsets)


def _nearest(points: Array, normals: Array, offsets: Array) -> Array:
    """Return the points (n, d) nearest to `points` on all their planes, normals (n, k, d), offsets (n, k)."""
    off = offsets - np.einsum("nkd,nd->nk", normals, points)
    return np.asarray(points + np.einsum("ndk,nk->nd", np.linalg.pinv(normals, rcond=NEARLY_DEPENDENT), off))


def _together(found: Boundaries, tolerance: float) -> list[list[int]]:
    """Return the corners of faces that touch, those of several parts or bodies at one place together.

    No face has two of them.
    """
    with_planes = np.unique([c for face in np.unique(found.pairs).tolist() for c in found.faces[face].tolist()])
    with_planes = with_planes.astype(np.int64)
    if not len(with_planes):
        return []
    on: list[set[int]] = [set() for _ in found.corners]
    for face, corners in enumerate(found.faces):
        for c in corners.tolist():
            on[c].add(face)
    points = found.corners[with_planes]
    near = cKDTree(points).query_pairs(2.0 * tolerance, output_type="ndarray")
    distance = np.linalg.norm(points[near[:, 0]] - points[near[:, 1]], axis=1)
    leader = {int(c): int(c) for c in with_planes}
    groups = {int(c): [int(c)] for c in with_planes}
    for a, b in with_planes[near[np.lexsort((near[:, 1], near[:, 0], distance))]].tolist():
        first, second = sorted((leader[a], leader[b]))
        if first == second:
            continue
        both = groups[first] + groups[second]
        if any(on[c] & on[d] for c in groups[first] for d in groups[second]):
            continue
        if np.ptp(found.corners[both], axis=0).max() > 2.0 * tolerance:
            continue
        groups[first] = both
        for c in groups.pop(second):
            leader[c] = first
    return [groups[k] for k in sorted(groups)]


def _without_overlaps(assembly: Assembly, tolerance: float) -> tuple[Assembly, tuple[tuple[str, str], ...]]:
    """Return `assembly` with what pairs still share cut from the later part, and these pairs."""
    cut: list[tuple[str, str]] = []
    for _ in range(ROUNDS):
        overlaps = [o for o in find_contacts(assembly).overlaps if o.depth_m <= 4.0 * tolerance]
        if not overlaps:
            break
        shapes: list[Shape] = [p.shape for p in assembly.parts]
        for overlap in overlaps:
            a, b = sorted(assembly.index(name) for name in overlap.parts)
            less = _less(shapes[b], shapes[a])
            if less is not None:
                shapes[b] = less
                cut.append(overlap.parts)
        assembly = assembly.with_shapes(shapes)
    return assembly, tuple(dict.fromkeys(cut))


def _less(shape: Shape, other: Shape) -> Shape | None:
    """Return `shape` without what lies in `other`; None where that leaves no single body."""
    if isinstance(shape, Polygon):
        assert isinstance(other, Polygon)
        left = to_shapely(shape).difference(to_shapely(other))
        if left.geom_type != "Polygon" or left.is_empty:
            return None
        rings = [np.asarray(r.coords)[:-1] for r in (left.exterior, *left.interiors)]
        return Polygon(rings[0], tuple(rings[1:]), shape.thickness)
    assert isinstance(other, Mesh)
    pieces = [p for p in (solid(shape) - solid(other)).decompose() if p.volume() > CRUMB * shape.volume]
    if len(pieces) != 1:
        return None
    mesh = pieces[0].to_mesh64()
    points = np.asarray(mesh.vert_properties)[:, :3]
    faces = np.asarray(mesh.tri_verts, dtype=np.int64)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    points, place, _ = welded(points, EXACT * size)
    return Mesh(points, place[faces])
