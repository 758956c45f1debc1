"""Triangles that may not fit together → closed, consistently oriented bodies: welding, duplicates, edges of four faces.

A triangle is a row of three vertex indices. An edge is sound when an even number of triangles meet there; two is the
plain case. Where four or more do (voxels that touch along an edge, bodies that share a face), the triangles that bound
one wedge of matter are neighbours, and each body gets corners of its own.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.geometry.frames import tangents
from mocca_robot.tolerances import TINY

SAME_ANGLE = 1e-6
"""Radians; triangles around an edge that differ by less lie on each other."""


def welded(vertices: Array, tolerance: float) -> tuple[Array, IntArray, float]:
    """Return the places (W, 3) of vertices (V, 3), each one's place (V,), and how far one moved at most.

    Vertices closer than `tolerance`, directly or through others, share a place: their mean.
    """
    pairs = KDTree(vertices).query_pairs(tolerance, output_type="ndarray")
    count, place = components(len(vertices), pairs[:, 0], pairs[:, 1])
    size = np.bincount(place, minlength=count)
    where = np.empty((count, 3))
    where[place] = vertices  # a place of one vertex keeps it bit for bit
    shared = size > 1
    means = np.stack([np.bincount(place, vertices[:, k], count) for k in range(3)], axis=1) / size[:, None]
    where[shared] = means[shared]
    moved = float(np.linalg.norm(vertices - where[place], axis=1).max(initial=0.0))
    return where, place, moved


def components(count: int, a: IntArray, b: IntArray) -> tuple[int, IntArray]:
    """Return how many groups `count` things fall into when a[k] and b[k] are linked, and each one's group."""
    graph = sp.coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(count, count))
    groups, found = connected_components(graph, directed=False)
    return int(groups), np.asarray(found, dtype=np.int64)


def bodies(faces: IntArray) -> IntArray:
    """Return (F,) the body of each triangle: those that hang together by edges of two triangles."""
    a, b = Edges(faces).pairs()
    return components(len(faces), a // 3, b // 3)[1]


def with_three_corners(faces: IntArray) -> IntArray:
    """Return those of `faces` (F, 3) that have three different corners."""
    return np.asarray(faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])


class Edges:
    """The undirected edges of triangles (F, 3).

    Attributes:
        edge: (3F,) the edge of each side; side 3f + k runs from corner k of triangle f to the next.
        forward: (3F,) whether the side runs from the lower to the higher vertex.
        ends: (E, 2) the vertices of each edge, lower first.
        count: (E,) how many sides each has.
    """

    def __init__(self, faces: IntArray) -> None:
        start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
        low, high = np.minimum(start, end), np.maximum(start, end)
        span = int(faces.max(initial=0)) + 1
        keys, self.edge, self.count = np.unique(low * span + high, return_inverse=True, return_counts=True)
        self.forward: BoolArray = start < end
        self.ends = np.stack(np.divmod(keys, span), axis=1)

    @property
    def odd(self) -> BoolArray:
        """Return (E,) which edges do not join an even number of triangles."""
        return np.asarray(self.count % 2 == 1)

    @property
    def sound(self) -> bool:
        """Return whether every edge joins two triangles that run through it in opposite directions."""
        forward = np.bincount(self.edge, weights=self.forward, minlength=len(self.count))
        return bool((self.count == 2).all() and (forward == 1).all())

    def sides(self) -> list[IntArray]:
        """Return the sides of each edge that has more than two."""
        order = np.argsort(self.edge, kind="stable")
        start = np.concatenate([[0], np.cumsum(self.count)])
        return [order[start[e] : start[e + 1]] for e in np.flatnonzero(self.count > 2)]

    def pairs(self) -> tuple[IntArray, IntArray]:
        """Return the two sides of each edge that has two."""
        order = np.argsort(self.edge, kind="stable")
        start = np.concatenate([[0], np.cumsum(self.count)])[:-1][self.count == 2]
        return order[start], order[start + 1]


def without_copies(faces: IntArray) -> tuple[IntArray, int]:
    """Return `faces` without those that say a triangle again, and how many went.

    Two triangles on each other that look apart may both be needed, where two bodies touch: they stay unless the
    surface closes without one of each.
    """
    _, first, inverse, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    if (count == 1).all():
        return faces, 0
    single = faces[np.sort(first)]
    if not Edges(single).odd.any():
        return single, len(faces) - len(single)
    turns = _turn(faces)
    key = inverse.reshape(-1) * 2 + turns
    _, kept = np.unique(key, return_index=True)
    return faces[np.sort(kept)], len(faces) - len(kept)


def _turn(faces: IntArray) -> IntArray:
    """Return 0 or 1 per triangle: which of the two ways around it runs through its corners."""
    a, b, c = faces.T
    return np.asarray(((a > b).astype(np.int64) + (b > c) + (c > a)) % 2)


def without_membranes(vertices: Array, faces: IntArray) -> tuple[IntArray, int]:
    """Return `faces` without walls inside a body, and how many triangles went.

    A wall is a sheet all of whose edges are met by other triangles as well; of several whose removal closes the
    surface, the one that leaves most volume is a wall.
    """
    removed = 0
    for _ in range(len(faces)):
        edges = Edges(faces)
        if not edges.odd.any():
            break
        a, b = edges.pairs()
        sheets, sheet = components(len(faces), a // 3, b // 3)
        rim = edges.count != 2
        loose = np.zeros(sheets, dtype=np.bool_)
        loose[sheet[np.flatnonzero((edges.count == 1)[edges.edge]) // 3]] = True
        met = np.zeros(sheets, dtype=np.bool_)
        met[sheet[np.flatnonzero((rim & edges.odd)[edges.edge]) // 3]] = True
        best: tuple[int, float] | None = None
        chosen = -1
        for k in np.flatnonzero(met & ~loose)[:50]:
            rest = faces[sheet != k]
            open_edges = int(Edges(rest).odd.sum()) if len(rest) else len(edges.count)
            key = (-open_edges, abs(_volume(vertices, _oriented(vertices, rest))))
            if open_edges < int(edges.odd.sum()) and (best is None or key > best):
                best, chosen = key, int(k)
        if chosen < 0:
            break
        removed += int((sheet == chosen).sum())
        faces = faces[sheet != chosen]
    return faces, removed


def _volume(vertices: Array, faces: IntArray) -> float:
    if len(faces) == 0:
        return 0.0
    a, b, c = (vertices[faces[:, k]] - vertices[faces[0, 0]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def _oriented(vertices: Array, faces: IntArray) -> IntArray:
    found = oriented(vertices, faces)
    return faces if found is None else found[0]


def oriented(vertices: Array, faces: IntArray) -> tuple[IntArray, int] | None:
    """Return `faces` with neighbours that agree, turning as few as possible, and how many were turned.

    None for a one-sided surface. Triangles around an edge of four or more alternate.
    """
    edges = Edges(faces)
    a, b = edges.pairs()
    for sides in edges.sides() if (edges.count > 2).any() else ():
        ordered = _around(vertices, faces, sides)[0]
        a, b = np.concatenate([a, ordered]), np.concatenate([b, np.roll(ordered, -1)])
    n = len(faces)
    turned = edges.forward[a] == edges.forward[b]
    f, g = a // 3, b // 3
    # Two copies of each triangle, as it is and turned; linked are the copies that agree.
    links = (np.concatenate([f, f + n]), np.concatenate([g + n * turned, g + n * ~turned]))
    count, group = components(2 * n, *links)
    if (group[:n] == group[n:]).any():
        return None
    as_is = np.bincount(group[:n], minlength=count)
    twin = np.empty(count, dtype=np.int64)
    twin[group[:n]], twin[group[n:]] = group[n:], group[:n]
    better = (as_is > as_is[twin]) | ((as_is == as_is[twin]) & (np.arange(count) < twin))
    keep = better[group[:n]]
    return np.where(keep[:, None], faces, faces[:, ::-1]), int((~keep).sum())


def _around(vertices: Array, faces: IntArray, sides: IntArray) -> tuple[IntArray, Array]:
    """Return the sides of one edge in the order of their triangles' angles about it, and these angles (rounded).

    Of two triangles on each other, the one that ends a wedge of matter comes before the one that begins one.
    """
    f, k = np.divmod(sides, 3)
    start, end, apex = faces[f, k], faces[f, (k + 1) % 3], faces[f, (k + 2) % 3]
    low, high = min(start[0], end[0]), max(start[0], end[0])
    axis = vertices[high] - vertices[low]
    axis = axis / max(float(np.linalg.norm(axis)), TINY)
    first, second = tangents(axis)
    arms = vertices[apex] - vertices[low]
    angle = np.arctan2(arms @ second, arms @ first)
    steps = np.round((angle - angle[0]) / SAME_ANGLE).astype(np.int64) % round(2 * np.pi / SAME_ANGLE)
    ends = start < end
    order = np.lexsort((~ends, steps))
    return sides[order], steps[order]


def separated(vertices: Array, faces: IntArray) -> tuple[Array, IntArray, IntArray]:
    """Return vertices, faces and each face's body; bodies that touch along edges or faces share no vertex.

    `faces` are oriented. At an edge of four or more, a triangle's neighbour is the one that closes its wedge of matter.
    """
    edges = Edges(faces)
    a, b = edges.pairs()
    for sides in edges.sides() if (edges.count > 2).any() else ():
        ordered = _around(vertices, faces, sides)[0]
        begins = ~edges.forward[ordered]
        if begins.sum() * 2 != len(ordered):
            continue
        at = int(np.flatnonzero(begins)[0])
        ordered = np.roll(ordered, -at)
        begins = np.roll(begins, -at)
        if begins[::2].all() and not begins[1::2].any():
            a, b = np.concatenate([a, ordered[::2]]), np.concatenate([b, ordered[1::2]])
    f, k = np.divmod(a, 3)
    g, m = np.divmod(b, 3)
    _, body = components(len(faces), f, g)
    nodes = (np.concatenate([3 * f + k, 3 * f + (k + 1) % 3]), np.concatenate([3 * g + (m + 1) % 3, 3 * g + m]))
    count, corner = components(3 * len(faces), *nodes)
    places = np.empty((count, 3))
    places[corner] = vertices[faces.reshape(-1)]
    return places, corner.reshape(-1, 3), body
