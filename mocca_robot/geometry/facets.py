"""Meshes → facets: flat regions of adjacent coplanar triangles, the faces that a person would count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Mesh
from mocca_robot.tolerances import EXACT, TINY

MERGE_ANGLE_RAD = 2e-5
"""Adjacent triangles that differ by less are one face. Six-digit files turn a face by about 5e-6; a finely
tessellated bump of slope 0.1° still turns by 1e-4 from triangle to triangle and has to stay a bump."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FacetSet:
    """All triangles of several meshes, and the facets that they form.

    Attributes:
        vertices: (V, 3) distinct coordinates over all parts, bitwise.
        triangles: (T, 3) indices into `vertices`, counter-clockwise seen from outside.
        part: (T,) part index of each triangle.
        facet: (T,) facet index of each triangle, 0 … F − 1.
        triangle_normals: (T, 3) outward unit normals.
        normals: (F, 3) outward unit normals, weighted by area.
        facet_part: (F,) part index of each facet.
        count: (F,) number of triangles of each facet.
        lower, upper: (F, 3) bounding boxes.
    """

    vertices: Array
    triangles: IntArray
    part: IntArray
    facet: IntArray
    triangle_normals: Array
    normals: Array
    facet_part: IntArray
    count: IntArray
    lower: Array
    upper: Array

    @cached_property
    def _by_facet(self) -> tuple[IntArray, IntArray]:
        order = np.argsort(self.facet, kind="stable")
        return order, np.searchsorted(self.facet[order], np.arange(len(self.count) + 1))

    def triangles_of(self, facet: int) -> IntArray:
        """Return the (m, 3) triangles of one facet."""
        order, start = self._by_facet
        return np.asarray(self.triangles[order[start[facet] : start[facet + 1]]])

    def loops(self, facet: int) -> list[IntArray]:
        """Return the boundary loops of a facet as vertex indices: outer ones counter-clockwise about its normal,
        holes clockwise. A loop that touches itself is cut at the vertex where it does.
        """
        following: dict[int, list[int]] = {}
        triangles = self.triangles_of(facet)
        directed = {(int(t[k]), int(t[(k + 1) % 3])) for t in triangles for k in range(3)}
        for a, b in directed:
            if (b, a) not in directed:
                following.setdefault(a, []).append(b)
        loops: list[IntArray] = []
        while following:
            start = min(following)
            path, seen = [start], {start: 0}
            while True:
                here = path[-1]
                if here not in following:
                    break
                step = following[here].pop()
                if not following[here]:
                    del following[here]
                if step in seen:
                    cut = seen[step]
                    loops.append(np.array(path[cut:]))
                    for v in path[cut + 1 :]:
                        del seen[v]
                    path = path[: cut + 1]
                    if len(path) == 1 and path[0] not in following:
                        break
                    continue
                seen[step] = len(path)
                path.append(step)
        return [loop for loop in loops if len(loop) >= 3]


def facets(meshes: Sequence[Mesh], flatness: float, bend: float = 0.0) -> FacetSet:
    """Return the facets of `meshes`; a merged region that deviates from its plane by more than `flatness`
    (metres) is left as single triangles. Triangles without area are dropped.

    Neighbours are one face, too, where neither has a corner further than `bend` (metres) off the other's plane.
    """
    part = np.concatenate([np.full(len(m.faces), i) for i, m in enumerate(meshes)])
    offset = np.cumsum([0] + [len(m.vertices) for m in meshes])
    triangles = np.concatenate([m.faces + o for m, o in zip(meshes, offset)])
    vertices, same = distinct_rows(np.concatenate([m.vertices for m in meshes]))
    triangles = same[triangles]
    corners = vertices[triangles]
    area_vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(area_vectors, axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    keep = twice_area > EXACT * longest**2
    part, triangles, corners = part[keep], triangles[keep], corners[keep]
    area_vectors, twice_area = area_vectors[keep], twice_area[keep]
    normals = area_vectors / twice_area[:, None]

    facet = _merge(triangles, part, normals, vertices, bend)
    planes = _mean_normals(facet, area_vectors)
    anchor = np.zeros((len(planes), 3))
    anchor[facet] = corners[:, 0]
    deviation = np.zeros(len(planes))
    off = np.abs(np.einsum("tki,ti->tk", corners - anchor[facet][:, None], planes[facet])).max(axis=1)
    np.maximum.at(deviation, facet, off)
    bent = deviation[facet] > flatness
    facet = facet.copy()
    facet[bent] = len(planes) + np.arange(int(bent.sum()))
    _, facet = np.unique(facet, return_inverse=True)
    n = int(facet.max(initial=-1)) + 1
    owner = np.zeros(n, dtype=np.int64)
    owner[facet] = part
    lower, upper = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    np.minimum.at(lower, facet, corners.min(axis=1))
    np.maximum.at(upper, facet, corners.max(axis=1))
    return FacetSet(
        vertices=vertices,
        triangles=triangles,
        part=part,
        facet=facet,
        triangle_normals=normals,
        normals=_mean_normals(facet, area_vectors),
        facet_part=owner,
        count=np.bincount(facet, minlength=n),
        lower=lower,
        upper=upper,
    )


def distinct_rows(rows: Array) -> tuple[Array, IntArray]:
    """Return the distinct rows of (n, 3) numbers, compared bit by bit, and each row's index among them."""
    rows = np.ascontiguousarray(rows + 0.0)
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    new = np.r_[True, (ordered[1:] != ordered[:-1]).any(axis=1)]
    index = np.empty(len(rows), dtype=np.int64)
    index[order] = np.cumsum(new) - 1
    return ordered[new], index


def _mean_normals(facet: IntArray, area_vectors: Array) -> Array:
    total = np.stack([np.bincount(facet, weights=area_vectors[:, k]) for k in range(3)], axis=1)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1), TINY)[:, None])


def _merge(triangles: IntArray, part: IntArray, normals: Array, vertices: Array, allowed: float) -> IntArray:
    """Return (T,) component numbers: triangles of one part connected across edges without a bend."""
    t, vertex_count = len(triangles), len(vertices)
    start = triangles.reshape(-1)
    end = np.roll(triangles, -1, axis=1).reshape(-1)
    key = (np.repeat(part, 3) * vertex_count + np.minimum(start, end)) * vertex_count + np.maximum(start, end)
    owner = np.repeat(np.arange(t), 3)
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    a, b = owner[order][:-1][same], owner[order][1:][same]
    bend = np.linalg.norm(np.cross(normals[a], normals[b]), axis=1)
    flat = bend <= MERGE_ANGLE_RAD
    if allowed > 0.0:
        flat |= (
            np.maximum(_off(vertices, triangles, normals, a, b), _off(vertices, triangles, normals, b, a)) <= allowed
        )
    flat &= np.einsum("ij,ij->i", normals[a], normals[b]) > 0
    graph = sp.coo_array((np.ones(int(flat.sum())), (a[flat], b[flat])), shape=(t, t))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _off(vertices: Array, triangles: IntArray, normals: Array, a: IntArray, b: IntArray) -> Array:
    """Return (n,) how far the corners of triangles b lie off the planes of triangles a, metres."""
    corners = vertices[triangles[b]] - vertices[triangles[a][:, :1]]
    return np.asarray(np.abs(np.einsum("nkd,nd->nk", corners, normals[a])).max(axis=1))
