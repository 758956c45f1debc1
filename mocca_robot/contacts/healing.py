"""Parts that nearly touch → parts that share their faces exactly.

Faces that touch within the tolerance form groups; every group gets one plane, that of its largest face, and every
corner moves the shortest way onto the planes of its faces. Corners of several parts at one place move together where
that leaves all of them on their planes. What still overlaps afterwards is cut from the later part.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly, Mesh, Polygon, Shape
from mocca_robot.contacts.boundaries import Boundaries, boundaries, moved
from mocca_robot.contacts.contact import Accepted, ContactReport
from mocca_robot.contacts.find import find_contacts
from mocca_robot.contacts.penetration import solid
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.geometry.surfaces import welded

EXACT = 1e-11
"""Of the assembly's size: corners within it lie on their planes, so far as double precision goes."""
NEARLY_DEPENDENT = 0.02
"""Planes whose normals span a direction by less meet too far away for a corner to go there."""
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
    normals, offsets, group = _planes(found, assembly.tolerance_m)
    corners = _on_planes(found, normals, offsets, group, assembly)
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


def _planes(found: Boundaries, tolerance: float) -> tuple[Array, Array, IntArray]:
    """Return per group of faces the normal (G, d) and offset (G,) of its plane, and (F,) the group of each, or −1.

    Pairs join groups in the order of their size, as long as every face of the group stays within the tolerance of the
    plane of its largest one.
    """
    measure = found.measure
    both = np.minimum(measure[found.pairs[:, 0]], measure[found.pairs[:, 1]])
    leader = np.arange(len(measure))
    members: dict[int, list[int]] = {}
    for a, b in found.pairs[np.lexsort((found.pairs[:, 1], found.pairs[:, 0], -both))].tolist():
        first, second = leader[a], leader[b]
        if first == second:
            continue
        mine, theirs = members.get(first, [first]), members.get(second, [second])
        head, tail = (first, second) if (measure[first], -first) >= (measure[second], -second) else (second, first)
        joining = theirs if head == first else mine
        points = found.corners[np.concatenate([found.faces[f] for f in joining])]
        anchor = found.corners[found.faces[head]].mean(axis=0)
        # A face that is not level with the plane may be a little further away where the other does not reach.
        if np.abs((points - anchor) @ found.normals[head]).max() > 2.0 * tolerance:
            continue
        members[head] = mine + theirs
        members.pop(tail, None)
        leader[members[head]] = head
    group = np.full(len(measure), -1)
    heads = sorted(members)
    for g, head in enumerate(heads):
        group[members[head]] = g
    normals = found.normals[heads]
    anchors = np.array([found.corners[found.faces[h]].mean(axis=0) for h in heads]).reshape(-1, normals.shape[1])
    return normals, np.einsum("gd,gd->g", normals, anchors), group


def _on_planes(found: Boundaries, normals: Array, offsets: Array, group: IntArray, assembly: Assembly) -> Array:
    """Return (n, d) where every corner goes."""
    tolerance, size = assembly.tolerance_m, assembly.size
    planes: list[set[int]] = [set() for _ in found.corners]
    for face in np.flatnonzero(group >= 0):
        for corner in found.faces[face].tolist():
            planes[corner].add(int(group[face]))
    corners = found.corners.copy()
    alike = _together(found, planes, tolerance)
    for mine in alike:
        place = corners[mine].mean(axis=0)
        asked = sorted(set().union(*(planes[c] for c in mine)))
        target = _nearest(place, normals[asked], offsets[asked])
        if _reached(target, place, normals[asked], offsets[asked], tolerance, size):
            corners[mine] = target
            continue
        if all(_smooth(normals[sorted(planes[c])]) for c in mine):
            corners[mine] = place
            continue
        for c in mine:
            own = sorted(planes[c])
            target = _nearest(corners[c], normals[own], offsets[own])
            if _reached(target, corners[c], normals[own], offsets[own], tolerance, size):
                corners[c] = target
    return corners


def _together(found: Boundaries, planes: list[set[int]], tolerance: float) -> list[list[int]]:
    """Return the corners that have planes, those of several parts at one place together; no part has two in one."""
    with_planes = np.array([k for k, p in enumerate(planes) if p], dtype=np.int64)
    if not len(with_planes):
        return []
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
        if len({int(found.owner[c]) for c in both}) < len(both):
            continue
        if np.ptp(found.corners[both], axis=0).max() > 2.0 * tolerance:
            continue
        groups[first] = both
        for c in groups.pop(second):
            leader[c] = first
    return [groups[k] for k in sorted(groups)]


def _nearest(point: Array, normals: Array, offsets: Array) -> Array:
    """Return the point nearest to `point` on all planes, those that are nearly dependent taken together."""
    return np.asarray(point + np.linalg.pinv(normals, rcond=NEARLY_DEPENDENT) @ (offsets - normals @ point))


def _reached(target: Array, point: Array, normals: Array, offsets: Array, tolerance: float, size: float) -> bool:
    """Return whether `target` is on all planes, and no further from `point` than planes at an angle ask for."""
    on = bool(np.abs(normals @ target - offsets).max(initial=0.0) <= EXACT * size)
    return on and float(np.linalg.norm(target - point)) <= 10.0 * tolerance


def _smooth(normals: Array) -> bool:
    """Return whether a corner lies inside a curved face: more planes than can meet in a point."""
    return bool(len(normals) > normals.shape[1])


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
    pieces = [p for p in (solid(shape) - solid(other)).decompose() if p.volume() > 1e-6 * shape.volume]
    if len(pieces) != 1:
        return None
    mesh = pieces[0].to_mesh64()
    points = np.asarray(mesh.vert_properties)[:, :3]
    faces = np.asarray(mesh.tri_verts, dtype=np.int64)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    points, place, _ = welded(points, 1e-12 * size)
    return Mesh(points, place[faces])
