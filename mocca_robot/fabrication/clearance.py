"""Play between parts for fabrication: every joint's surface moves back along its own normal."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Assembly, Mesh, Part, Polygon
from mocca_robot.errors import InputError
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.tolerances import TINY

ONE_PLANE = 1e-3
"""Relative singular value of normals that say the same: faces of one bump, not another wall."""


def with_clearance(assembly: Assembly, clearance: float) -> Assembly:
    """Return parts with `clearance` (m) between neighbours: solids lose half of it at their shared facets.

    Every corner of a shared facet moves so that each facet around it is displaced by that much along its normal
    (shared ones) or stays in its plane (free ones), in the least-squares sense where more than three meet: parts
    keep their outer shape and leave the same gap on flat, steep and curved stretches of a joint. Flat parts lose half
    of it all around, as in a cutting drawing.

    Works on built designs, whose neighbours share the same triangles. Raises InputError for a clearance that is
    negative or not small against the parts, where no two solids share a triangle and where a flat part falls apart.
    """
    if not (np.isfinite(clearance) and 0.0 <= clearance <= 0.02 * assembly.size):
        limit = 20.0 * assembly.size
        raise InputError(f"A clearance of {clearance * 1e3:g} mm cannot be made; give 0 to {limit:.3g} mm.")
    if clearance == 0.0:
        return assembly
    if assembly.dimension == 2:
        return assembly.with_shapes([_narrowed(p, 0.5 * clearance) for p in assembly.parts])
    meshes = [p.shape for p in assembly.parts if isinstance(p.shape, Mesh)]
    shared = _shared_triangles(meshes)
    if not any(s.any() for s in shared):
        raise InputError(f"No two parts of '{assembly.name}' share a facet exactly; apply clearance to a design.")
    return assembly.with_shapes([_set_back(m, s, 0.5 * clearance) for m, s in zip(meshes, shared, strict=True)])


def _narrowed(part: Part, depth: float) -> Polygon:
    """Return a flat part's outline moved inwards by `depth`, as a cutting drawing moves it."""
    assert isinstance(part.shape, Polygon)
    exact = to_shapely(part.shape)
    moved = exact.buffer(-depth, join_style="mitre", mitre_limit=4.0)
    if moved.geom_type != "Polygon" or moved.is_empty or len(moved.interiors) != len(exact.interiors):
        raise InputError(
            f"Part '{part.name}' falls apart, or loses a hole, when its outline moves inwards by {depth * 1e3:.3g} mm; "
            "use a smaller clearance."
        )
    rings = [np.asarray(r.coords)[:-1] for r in (moved.exterior, *moved.interiors)]
    return Polygon(rings[0], tuple(rings[1:]), part.shape.thickness)


def _shared_triangles(meshes: list[Mesh]) -> list[BoolArray]:
    """Return per mesh (F,) which triangles another mesh has, too, with the same three corners."""
    corners = np.concatenate([m.vertices[m.faces] for m in meshes])  # (F, 3, 3)
    order = np.lexsort((corners[:, :, 2], corners[:, :, 1], corners[:, :, 0]), axis=1)
    rows = np.take_along_axis(corners, order[..., None], axis=1).reshape(-1, 9)
    _, group, count = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    twice = np.asarray(count[group.ravel()] > 1)
    return np.split(twice, np.cumsum([len(m.faces) for m in meshes])[:-1])


def _set_back(mesh: Mesh, shared: BoolArray, depth: float) -> Mesh:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), TINY)[:, None]
    around: list[list[int]] = [[] for _ in mesh.vertices]
    for face, vertices in enumerate(mesh.faces):
        for vertex in vertices:
            around[vertex].append(face)
    moved = mesh.vertices.copy()
    for vertex, faces in enumerate(around):
        index: IntArray = np.array(faces, dtype=np.int64)
        if len(index) and shared[index].any():
            moved[vertex] += _displacement(normals[index], np.where(shared[index], -depth, 0.0))
    return Mesh(moved, mesh.faces)


def _displacement(normals: Array, wanted: Array) -> Array:
    """Return the shortest d with normals·d ≈ wanted; facets in one plane count once."""
    _, first = np.unique(np.round(normals, 6), axis=0, return_index=True)
    return np.asarray(np.linalg.lstsq(normals[first], wanted[first], rcond=ONE_PLANE)[0])
