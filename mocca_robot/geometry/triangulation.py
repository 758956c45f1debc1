"""Flat regions → triangles that keep every boundary vertex, so that neighbouring surfaces meet edge on edge.

Regions are given by their boundary as a set of directed edges with the region to the left (a 1-chain). Chains
add and cancel exactly, whatever rounding the coordinates carry: a mesh put together from pieces whose boundary
chains cancel is closed by construction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import cast

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.tolerances import EXACT, TINY

SLIVER = 1e-9
"""Triangles whose height is below this share of their longest edge count as degenerate: their normals are noise."""


def triangulate_loops(points: Array, loops: Sequence[IntArray]) -> IntArray:
    """Return triangles (F, 3) over `points` (V, 2) of the region to the left of `loops` (index arrays).

    Each loop edge belongs to exactly one triangle and every other edge to two, also when points lie on a
    straight line. Triangles come out counter-clockwise.
    """
    from manifold3d import triangulate

    order = np.concatenate(loops)
    origin, scale = points[order].mean(axis=0), float(np.ptp(points[order], axis=0).max()) or 1.0
    rings = [(points[loop] - origin) / scale for loop in loops]
    found = np.asarray(triangulate(rings, EXACT, False), dtype=np.int64).reshape(-1, 3)
    return without_slivers(points, order[found])


def without_slivers(points: Array, facets: IntArray) -> IntArray:
    """Return `facets` (F, 3) with degenerate triangles flipped away where the neighbour across allows it."""
    for _ in range(len(facets)):
        height = _relative_heights(points, facets)
        slivers = np.flatnonzero(height <= SLIVER)
        flipped = next((f for s in slivers if (f := _flip(points, facets, int(s))) is not None), None)
        if flipped is None:
            break
        facets = flipped
    return facets


def _relative_heights(points: Array, facets: IntArray) -> Array:
    a, b, c = (points[facets[:, k]] for k in range(3))
    ab, ac, bc = b - a, c - a, c - b
    doubled = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    longest = np.maximum(np.maximum((ab**2).sum(axis=1), (ac**2).sum(axis=1)), (bc**2).sum(axis=1))
    return np.asarray(doubled / np.maximum(longest, TINY))


def _flip(points: Array, facets: IntArray, sliver: int) -> IntArray | None:
    """Return `facets` with the longest edge of one triangle flipped if that improves the worse of the two."""
    corners = facets[sliver]
    lengths = np.linalg.norm(points[np.roll(corners, -1)] - points[corners], axis=1)
    k = int(lengths.argmax())
    a, b, c = corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]
    for other in range(len(facets)):
        row = facets[other].tolist()
        if (b, a) in zip(row, row[1:] + row[:1]):
            d = next((v for v in row if v not in (a, b)), None)
            if d is None:
                continue
            new = np.array([[a, d, c], [d, b, c]])
            if _relative_heights(points, new).min() <= _relative_heights(points, facets[[sliver, other]]).min():
                return None
            result = facets.copy()
            result[[sliver, other]] = new
            return result
    return None


def boundary_chain(facets: IntArray, vertices: int) -> IntArray:
    """Return the directed edges (B, 2) of `facets` (F, 3) that no facet runs through the other way.

    `vertices` is any number above the largest index. An edge that is left over twice comes back twice.
    """
    edges = np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]])
    return cancelled(edges, vertices)


def cancelled(edges: IntArray, vertices: int) -> IntArray:
    """Return what remains of directed `edges` (N, 2) after opposite ones cancel, sorted."""
    if len(edges) == 0:
        return edges.reshape(0, 2)
    low, high = edges.min(axis=1), edges.max(axis=1)
    keys, group = np.unique(low * vertices + high, return_inverse=True)
    net = np.bincount(group, weights=np.where(edges[:, 0] < edges[:, 1], 1.0, -1.0)).astype(np.int64)
    net[keys // vertices == keys % vertices] = 0
    pairs = np.stack([keys // vertices, keys % vertices], axis=1)
    forward = np.repeat(pairs, np.maximum(net, 0), axis=0)
    backward = np.repeat(pairs[:, ::-1], np.maximum(-net, 0), axis=0)
    return np.concatenate([forward, backward])


def chain_loops(edges: IntArray, points: Mapping[int, Array]) -> list[IntArray]:
    """Return the closed loops of a balanced chain `edges` (N, 2); `points` gives each vertex's position (2,).

    Where loops touch in a vertex, each goes on along the boundary of its own piece of the region.
    """
    out: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        out.setdefault(a, []).append(b)
    loops = []
    while out:
        start = next(iter(out))
        loop, before, here = [start], start, start
        while True:
            choices = out[here]
            following = choices[0] if len(choices) == 1 else _next_around(points, before, here, choices)
            choices.remove(following)
            if not choices:
                del out[here]
            before, here = here, following
            if here == start:
                break
            loop.append(here)
        loops.append(np.array(loop))
    return loops


def _next_around(points: Mapping[int, Array], before: int, here: int, choices: Sequence[int]) -> int:
    """Return the choice that is met first when turning clockwise at `here` from the way we came."""
    if before == here:
        return choices[0]
    back = points[before] - points[here]
    angles = []
    for choice in choices:
        way = points[choice] - points[here]
        turn = np.arctan2(back[1] * way[0] - back[0] * way[1], back @ way) % (2 * np.pi)
        angles.append(turn if turn > EXACT else 2 * np.pi)
    return choices[int(np.argmin(angles))]


def split_facets(facets: IntArray, on_edges: Mapping[tuple[int, int], Sequence[int]]) -> tuple[IntArray, IntArray]:
    """Return `facets` (F, 3) with extra vertices on their edges, and the original facet of each (F',).

    `on_edges` maps (low, high) vertex pairs to the vertices between them, ordered from low to high. Triangles
    that collapse (a vertex twice) are dropped: the chain of what remains is that of the split boundary.
    """
    result: list[tuple[int, int, int]] = []
    origin: list[int] = []
    for number, facet in enumerate(cast("list[tuple[int, int, int]]", facets.tolist())):
        pieces = [facet]
        for k in range(3):
            a, b = facet[k], facet[(k + 1) % 3]
            between = on_edges.get((a, b) if a < b else (b, a))
            if not between:
                continue
            at, turn = next((n, t) for n, p in enumerate(pieces) for t in range(3) if p[t] == a and p[t - 2] == b)
            apex = pieces[at][turn - 1]
            run = [a, *(between if a < b else reversed(between)), b]
            pieces[at : at + 1] = [(p, q, apex) for p, q in pairwise(run)]
        for a, b, c in pieces:
            if a != b and b != c and c != a:
                result.append((a, b, c))
                origin.append(number)
    return np.array(result, dtype=np.int64).reshape(-1, 3), np.array(origin, dtype=np.int64)
