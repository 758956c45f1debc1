"""Open edges of triangles that leave no choice how to close them: corners on a neighbour's edge, small flat holes."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.geometry.frames import tangents
from mocca_robot.geometry.surfaces import Edges, without_copies
from mocca_robot.geometry.triangulation import split_facets, triangulate_loops
from mocca_robot.tolerances import EXACT, TINY

MOST_CORNERS = 4
"""Of a hole that is closed: larger ones are more often meant, as in a surface that has no thickness yet."""
FLAT = 1e-5
"""Share of the surface's size up to which the rim of a hole lies in a plane."""
MOST_EDGES = 20_000
"""Open edges of a surface that are looked at."""


def cut_at_corners(vertices: Array, faces: IntArray, slack: float) -> tuple[IntArray, int]:
    """Return triangles with their open edges cut at open corners closer than `slack`, and how many edges were cut."""
    import shapely

    edges = Edges(faces)
    loose = edges.ends[edges.count == 1]
    if not 0 < len(loose) <= MOST_EDGES:
        return faces, 0
    corners = np.unique(loose)
    spread = np.argsort(-np.ptp(vertices, axis=0))[:2]
    lines = np.stack([vertices[loose[:, 0]], vertices[loose[:, 1]]], axis=1)
    tree = shapely.STRtree(shapely.linestrings(lines[:, :, spread]))
    at, edge = tree.query(shapely.points(vertices[corners][:, spread]), predicate="dwithin", distance=slack)
    point, (a, b) = corners[at], loose[edge].T
    along = vertices[b] - vertices[a]
    length = np.maximum(np.linalg.norm(along, axis=1), TINY)
    t = np.einsum("ij,ij->i", vertices[point] - vertices[a], along) / length
    off = np.linalg.norm(vertices[point] - vertices[a] - (t / length)[:, None] * along, axis=1)
    inside = (off <= slack) & (t > slack) & (t < length - slack)
    between: dict[tuple[int, int], list[tuple[float, int]]] = {}
    for e, v, where in zip(edge[inside].tolist(), point[inside].tolist(), t[inside].tolist()):
        between.setdefault((int(loose[e, 0]), int(loose[e, 1])), []).append((where, v))
    split, _ = split_facets(faces, {key: [v for _, v in sorted(found)] for key, found in between.items()})
    split = without_copies(split)[0]
    if int(Edges(split).odd.sum()) >= int(edges.odd.sum()):
        return faces, 0
    return split, len(between)


def filled(vertices: Array, faces: IntArray, size: float) -> tuple[IntArray, int]:
    """Return `faces`, then triangles that fill its holes of three corners, or four in a plane; and how many holes."""
    pieces, count = [faces], 0
    for rim in _rims(faces):
        points = vertices[rim]
        middle = points.mean(axis=0)
        normal = np.cross(points - middle, np.roll(points, -1, axis=0) - middle).sum(axis=0)
        length = float(np.linalg.norm(normal))
        if _corners(points) > MOST_CORNERS or length <= EXACT * size**2:
            continue
        if np.abs((points - middle) @ (normal / length)).max() > FLAT * size:
            continue
        flat = (points - middle) @ tangents(normal / length).T
        pieces.append(rim[triangulate_loops(flat, [np.arange(len(rim))])])
        count += 1
    return np.concatenate(pieces), count


def _rims(faces: IntArray) -> list[IntArray]:
    """Return the rims of the holes that are plain loops of open edges, with the hole to the left."""
    edges = Edges(faces)
    single = np.flatnonzero((edges.count == 1)[edges.edge])
    f, k = np.divmod(single, 3)
    following: dict[int, list[int]] = {}
    for a, b in zip(faces[f, (k + 1) % 3].tolist(), faces[f, k].tolist()):
        following.setdefault(a, []).append(b)
        following.setdefault(b, [])
    found = []
    left = set(following)
    while left:
        start = min(left)
        path = [start]
        left.discard(start)
        while len(following[path[-1]]) == 1 and following[path[-1]][0] in left:
            path.append(following[path[-1]][0])
            left.discard(path[-1])
        if len(path) >= 3 and following[path[-1]] == [start]:
            found.append(np.array(path))
    return found


def _corners(rim: Array) -> int:
    """Return how many corners of a loop (n, 3) are no points on a straight line."""
    before, after = rim - np.roll(rim, 1, axis=0), np.roll(rim, -1, axis=0) - rim
    sine = np.linalg.norm(np.cross(before, after), axis=1)
    return int((sine > FLAT * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)).sum())
