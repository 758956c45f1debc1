"""Which polyhedra penetrate each other, and how deep."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.contacts.contact import Contact, Overlap
from mocca_robot.geometry.facets import FacetSet
from mocca_robot.tolerances import ROUNDING

if TYPE_CHECKING:
    import manifold3d

LARGE_FACE = 1e-3
"""Share of the largest face from which on a face's direction is worth trying."""


def penetrations(
    assembly: Assembly, faces: FacetSet, partner: IntArray, contacts: Sequence[Contact], depth: float
) -> tuple[Overlap, ...]:
    """Return the pairs of parts that penetrate deeper than `depth` (metres).

    Most pairs are told apart by a plane: that of a contact, or of a face of either part, or, for built joints, the
    plane that has all triangles on its two sides but those that the parts share. `partner` (T,) is the part that
    each triangle is shared with, or −1. Only the other pairs are intersected as solids.
    """
    meshes = [p.shape for p in assembly.parts if isinstance(p.shape, Mesh)]
    planes: dict[tuple[int, int], list[Contact]] = {}
    for contact in contacts:
        planes.setdefault(contact.parts, []).append(contact)
    solids: dict[int, manifold3d.Manifold] = {}
    overlaps = []
    for i, j in _boxes_overlap(meshes, depth).tolist():
        mine = planes.get((i, j), [])
        if _apart_but_for_joint(i, j, faces, partner, depth):
            continue
        if _separated(meshes[i], meshes[j], i, j, faces, mine, depth):
            continue
        for part in (i, j):
            if part not in solids:
                solids[part] = solid(meshes[part])
        common = solids[i] ^ solids[j]
        found, place = _depth(common)
        if found > depth and shared_volume(solids[i], solids[j]) > 0.5 * common.volume():
            overlaps.append(Overlap((assembly.parts[i].name, assembly.parts[j].name), found, place))
    return tuple(overlaps)


def solid(mesh: Mesh) -> manifold3d.Manifold:
    """Return `mesh` as a manifold3d solid."""
    import manifold3d

    return manifold3d.Manifold(
        manifold3d.Mesh64(np.array(mesh.vertices, order="C"), np.array(mesh.faces, dtype=np.uint64, order="C"))
    )


def shared_volume(first: manifold3d.Manifold, second: manifold3d.Manifold) -> float:
    """Return the volume that two solids share, m³.

    Between faces that coincide exactly an intersection is sometimes left with sheets that it closes the wrong
    way. The union of the same two does not have them, and what they share is what their union lacks.
    """
    common = float((first ^ second).volume())
    if common <= 0.0:
        return 0.0
    lacking = float(first.volume() + second.volume() - (first + second).volume())
    return min(common, max(lacking, 0.0))


def _boxes_overlap(meshes: Sequence[Mesh], depth: float) -> IntArray:
    """Return (m, 2) pairs i < j whose bounding boxes share more than `depth` along every axis."""
    bounds = np.array([m.bounds for m in meshes])
    lower, upper = bounds[:, 0], bounds[:, 1]
    spread = np.ptp(np.concatenate([lower, upper]), axis=0) / (upper - lower).mean(axis=0)
    x, y = np.argsort(-spread)[:2]
    boxes = shapely.box(lower[:, x], lower[:, y], upper[:, x], upper[:, y])
    i, j = shapely.STRtree(boxes).query(boxes)
    i, j = i[i < j], j[i < j]
    common = np.minimum(upper[i], upper[j]) - np.maximum(lower[i], lower[j])
    pairs = np.stack([i, j], axis=1)[(common > depth).all(axis=1)]
    return np.asarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))])


def _separated(
    first: Mesh, second: Mesh, i: int, j: int, faces: FacetSet, contacts: Sequence[Contact], depth: float
) -> bool:
    """Return whether a plane of a contact or of a face has all of `first` on one side and `second` on the other."""
    normals = np.array([c.normal for c in contacts[:20]]).reshape(-1, 3)
    if len(normals) and _gap(first, second, normals).max() >= -depth:
        return True
    mine, theirs = faces.normals[faces.facet_part == i], -faces.normals[faces.facet_part == j]
    return bool(_gap(first, second, np.concatenate([mine, theirs])).max() >= -depth)


def _apart_but_for_joint(i: int, j: int, faces: FacetSet, partner: IntArray, depth: float) -> bool:
    """Return whether a plane has all of i's triangles below it and all of j's above, leaving out those they share.

    Then the shared triangles, a height field over the plane, are all that i and j have of each other's side. A
    surface has the vector area of the flat contact it stands for, so the mean normal is that contact's.
    """
    # Triangles come part by part.
    first, second = (slice(*np.searchsorted(faces.part, [p, p + 1])) for p in (i, j))
    shared = partner[first] == j
    if not shared.any():
        return False
    corners = faces.vertices[faces.triangles[first][shared]]
    normals = faces.triangle_normals[first][shared]
    area = np.einsum("ij,ij->i", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), normals)
    normal = area @ normals
    length = float(np.linalg.norm(normal))
    # Walls on opposite sides, as of a slot, have no side in common.
    if (normals @ normal).min() <= ROUNDING * length:
        return False
    normal /= length
    below = faces.vertices[faces.triangles[first][~shared]] @ normal
    above = faces.vertices[faces.triangles[second][partner[second] != i]] @ normal
    return bool(above.min(initial=np.inf) - below.max(initial=-np.inf) >= -depth)


def _gap(first: Mesh, second: Mesh, normals: Array) -> Array:
    """Return (m,) how far `second` starts above where `first` ends, along each unit normal."""
    return np.asarray((normals @ second.vertices.T).min(axis=1) - (normals @ first.vertices.T).max(axis=1))


def _depth(common: manifold3d.Manifold) -> tuple[float, tuple[float, ...]]:
    """Return how thick the intersection is, metres, and the middle of its thickest piece: the least width over its face
    normals, zero when empty.
    """
    deepest: tuple[float, tuple[float, ...]] = (0.0, ())
    if common.is_empty() or common.volume() <= 0.0:
        return deepest
    for piece in common.decompose():
        area = piece.surface_area()
        if area <= 0.0:
            continue
        # Rounding leaves sheets between parts that only touch; their mean thickness 2 V / A gives them away.
        mean = 2.0 * piece.volume() / area
        mesh = piece.to_mesh64()
        points = np.asarray(mesh.vert_properties)[:, :3]
        corners = points[np.asarray(mesh.tri_verts, dtype=np.int64)]
        vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(vectors, axis=1)
        large = length > LARGE_FACE * length.max(initial=0.0)
        if large.any():
            normals = vectors[large] / length[large, None]
            width = np.ptp(normals @ points.T, axis=1).min()
            middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
            deepest = max(deepest, (min(float(width), 3.0 * mean), tuple(middle.tolist())))
    return deepest
