"""The faces of all parts as planes through corners, and which touch which: edges in 2D, facets in 3D alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, IntArray, read_only
from mocca_robot.assembly import Assembly, Mesh, Polygon, Shape
from mocca_robot.contacts.flat import edge_pairs
from mocca_robot.contacts.solid import touching_facets
from mocca_robot.geometry.facets import distinct_rows


@dataclass(frozen=True, eq=False, kw_only=True)
class Boundaries:
    """The faces of an assembly's parts.

    Attributes:
        corners: (n, d) the corners of every part, part by part; those at one place in one part count once.
        owner: (n,) the part of each.
        faces: per face its corners, as numbers.
        normals: (F, d) outward.
        measure: (F,) length or area.
        face_part: (F,) the part of each.
        pairs: (P, 2) faces of two parts that touch.
        shapes: per part, for every corner of its shape the number among `corners`.
    """

    corners: Array
    owner: IntArray
    faces: tuple[IntArray, ...]
    normals: Array
    measure: Array
    face_part: IntArray
    pairs: IntArray
    shapes: tuple[IntArray, ...]


def boundaries(assembly: Assembly) -> Boundaries:
    """Return the faces of `assembly`, with what touches within its tolerance."""
    return _edges(assembly) if assembly.dimension == 2 else _facets(assembly)


def moved(assembly: Assembly, found: Boundaries, corners: Array) -> list[Shape]:
    """Return the shapes with their corners at `corners` (n, d)."""
    shapes: list[Shape] = []
    for part, index in zip(assembly.parts, found.shapes, strict=True):
        points = corners[index]
        if isinstance(part.shape, Mesh):
            shapes.append(Mesh(points, part.shape.faces))
            continue
        cuts = np.cumsum([len(ring) for ring in part.shape.rings])[:-1]
        outer, *holes = np.split(points, cuts)
        shapes.append(Polygon(outer, tuple(holes), part.shape.thickness))
    return shapes


def _edges(assembly: Assembly) -> Boundaries:
    near = edge_pairs(assembly)
    edges = near.edges
    shapes, corners, owner, count = [], [], [], 0
    ends: list[IntArray] = []
    for k, part in enumerate(assembly.parts):
        assert isinstance(part.shape, Polygon)
        mine = []
        for ring in part.shape.rings:
            index = count + np.arange(len(ring))
            ends.append(np.stack([index, np.roll(index, -1)], axis=1))
            mine.append(index)
            corners.append(ring)
            count += len(ring)
        shapes.append(np.concatenate(mine))
        owner.append(np.full(len(shapes[-1]), k))
    outward = np.stack([edges.direction[:, 1], -edges.direction[:, 0]], axis=1)
    return Boundaries(
        corners=read_only(np.concatenate(corners)),
        owner=np.concatenate(owner),
        faces=tuple(np.concatenate(ends)),
        normals=outward,
        measure=edges.length,
        face_part=np.asarray(edges.part, dtype=np.int64),
        pairs=np.stack([near.a, near.b], axis=1)[near.touching],
        shapes=tuple(shapes),
    )


def _facets(assembly: Assembly) -> Boundaries:
    touching = touching_facets(assembly)
    faces = touching.faces
    meshes = [p.shape for p in assembly.parts if isinstance(p.shape, Mesh)]
    # A corner of a part, by its place among the distinct ones of all: one number for every place that a part has.
    vertices, place = distinct_rows(np.concatenate([m.vertices for m in meshes]))
    part = np.repeat(np.arange(len(meshes)), [len(m.vertices) for m in meshes])
    keys, number = np.unique(part * len(vertices) + place, return_inverse=True)
    cuts = np.cumsum([len(m.vertices) for m in meshes])[:-1]
    corners = [np.unique(faces.triangles_of(f)) for f in range(len(faces.count))]
    mine = [np.searchsorted(keys, int(p) * len(vertices) + c) for p, c in zip(faces.facet_part, corners)]
    triangle = faces.vertices[faces.triangles]
    area = 0.5 * np.linalg.norm(np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0]), axis=1)
    return Boundaries(
        corners=read_only(vertices[keys % len(vertices)]),
        owner=np.asarray(keys // len(vertices)),
        faces=tuple(mine),
        normals=faces.normals,
        measure=np.bincount(faces.facet, weights=area, minlength=len(faces.count)).astype(np.float64),
        face_part=faces.facet_part,
        pairs=np.array([(f[2], f[3]) for f in touching.found], dtype=np.int64).reshape(-1, 2),
        shapes=tuple(np.split(number, cuts)),
    )
