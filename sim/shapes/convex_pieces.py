"""A flat shape as few convex pieces: constrained Delaunay triangles, merged after Hertel and Mehlhorn.

Few pieces matter more than small ones: where two pieces of one part meet on its boundary, the collision of their
edges with a neighbour's makes ghost contacts that hold parts up which should slide.
"""

from __future__ import annotations

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Polygon
from mocca_robot.errors import InputError
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.tolerances import ROUNDING


def convex_pieces(polygon: Polygon) -> tuple[Array, ...]:
    """Return convex rings (k, 2), counter-clockwise, that together cover `polygon` and do not overlap.

    Every corner of a piece is a corner of `polygon`. Raises InputError when the polygon cannot be triangulated.
    """
    points, faces = triangles(polygon)
    return tuple(points[np.array(face)] for face in _merged(points, faces))


def triangles(polygon: Polygon) -> tuple[Array, list[list[int]]]:
    """Return the corners (n, 2) of all rings in order, and counter-clockwise triangles of them that fill the shape.

    Raises InputError when edges cross.
    """
    shape = to_shapely(polygon)
    if not shape.is_valid:
        raise InputError(f"A polygon is not simple ({shapely.is_valid_reason(shape)}); its edges must not cross.")
    points = np.concatenate(polygon.rings)
    index = {(float(x), float(y)): k for k, (x, y) in enumerate(points)}
    faces = []
    for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(shape)):
        corners = shapely.get_coordinates(triangle)[:3]
        face = [index[float(x), float(y)] for x, y in corners]
        if _turn(points, *face) < 0:
            face.reverse()
        faces.append(face)
    return points, faces


def _merged(points: Array, triangles: list[list[int]]) -> list[list[int]]:
    """Return convex faces: every diagonal that can go without a dent goes.

    Diagonals between convex corners go first: there a split would be on a stretch of boundary that slides.
    """
    faces: dict[int, list[int]] = dict(enumerate(triangles))
    owner = {edge: f for f, face in faces.items() for edge in _edges(face)}
    reflex = _reflex(points, owner)
    diagonals = [(a, b) for (a, b) in owner if a < b and (b, a) in owner]
    diagonals.sort(key=lambda e: (reflex[e[0]] + reflex[e[1]], -float(np.linalg.norm(points[e[0]] - points[e[1]])), e))
    for a, b in diagonals:
        first, second = owner[a, b], owner[b, a]
        joined = _joined(faces[first], faces[second], a, b)
        if first == second or joined is None or not _convex_at(points, joined, (a, b)):
            continue
        faces[first] = joined
        for edge in _edges(faces.pop(second)):
            owner[edge] = first
        del owner[a, b], owner[b, a]
    return [faces[f] for f in sorted(faces)]


def _joined(left: list[int], right: list[int], a: int, b: int) -> list[int] | None:
    """Return the ring around both faces without their common edge a → b (left) and b → a (right)."""
    i, j = left.index(a), right.index(b)
    around_left = left[i + 1 :] + left[: i + 1]  # b … a
    around_right = right[j + 1 :] + right[: j + 1]  # a … b
    ring = around_left + around_right[1:-1]
    return ring if len(set(ring)) == len(ring) else None


def _convex_at(points: Array, ring: list[int], corners: tuple[int, int]) -> bool:
    for corner in corners:
        k = ring.index(corner)
        before, here, after = ring[k - 1], ring[k], ring[(k + 1) % len(ring)]
        spread = np.linalg.norm(points[here] - points[before]) * np.linalg.norm(points[after] - points[here])
        if _turn(points, before, here, after) < -ROUNDING * spread:
            return False
    return True


def _reflex(points: Array, owner: dict[tuple[int, int], int]) -> dict[int, bool]:
    """Return for every corner whether the solid's angle there exceeds 180°."""
    outgoing = {a: b for (a, b) in owner if (b, a) not in owner}
    incoming = {b: a for a, b in outgoing.items()}
    return {
        corner: corner in outgoing and _turn(points, incoming[corner], corner, outgoing[corner]) < 0
        for edge in owner
        for corner in edge
    }


def _edges(face: list[int]) -> list[tuple[int, int]]:
    return list(zip(face, face[1:] + face[:1]))


def _turn(points: Array, a: int, b: int, c: int) -> float:
    u, v = points[b] - points[a], points[c] - points[b]
    return float(u[0] * v[1] - u[1] * v[0])
