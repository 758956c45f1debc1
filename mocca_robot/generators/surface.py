"""A polygon surface and a direction at every corner → blocks that meet in planes.

Every polygon becomes a block between the surface and its copy `thickness` further along the directions. Two
blocks share the side wall over their common edge; it is planar when the edge and the directions at its two ends
lie in one plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Mesh
from mocca_robot.errors import InputError
from mocca_robot.geometry.frames import tangents
from mocca_robot.tolerances import ROUNDING, TINY

PLANAR = 1e-14
"""Triple product of unit vectors at which a wall counts as planar: what rounding leaves."""
RIDGE = 1e-12
"""Added to the squared equations, so that dependent ones can be solved."""

FLATTEST = 1e-9
"""Area of a polygon, relative to the squares of its edges, from which it has a normal."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface of polygons.

    Attributes:
        points: (V, 3) corners, metres.
        faces: corner indices of each polygon, counter-clockwise seen from outside; a corner on the edge of a
            neighbour (a T-junction) belongs to that neighbour's polygon too.
    """

    points: Array
    faces: tuple[tuple[int, ...], ...]

    def edges(self) -> dict[tuple[int, int], list[int]]:
        """Return the faces at each edge (a < b). Raises InputError when more than two meet."""
        found: dict[tuple[int, int], list[int]] = {}
        for f, face in enumerate(self.faces):
            for a, b in zip(face, (*face[1:], face[0])):
                found.setdefault((min(a, b), max(a, b)), []).append(f)
        for (a, _), owners in found.items():
            if len(owners) > 2:
                where = ", ".join(f"{x:.4g}" for x in self.points[a])
                raise InputError(
                    f"{len(owners)} polygons meet in one edge near ({where}); a surface has two at most. Remove one."
                )
        return found

    def vertex_normals(self) -> Array:
        """Return (V, 3) unit normals: the mean of the adjacent faces' corner normals, weighted by angle."""
        total = np.zeros_like(self.points)
        for face in self.faces:
            corners = self.points[list(face)]
            ahead, behind = np.roll(corners, -1, axis=0) - corners, np.roll(corners, 1, axis=0) - corners
            a = ahead / np.linalg.norm(ahead, axis=1)[:, None]
            b = behind / np.linalg.norm(behind, axis=1)[:, None]
            mean = np.cross(corners - corners.mean(axis=0), ahead).sum(axis=0)
            if not np.linalg.norm(mean) > FLATTEST * (ahead**2).sum():
                where = ", ".join(f"{x:.4g}" for x in corners[0])
                raise InputError(f"A polygon near ({where}) has no area; remove it or move its corners apart.")
            angle = np.arccos(np.clip(np.einsum("ij,ij->i", a, b), -1, 1))
            np.add.at(total, list(face), angle[:, None] * mean / np.linalg.norm(mean))
        length = np.linalg.norm(total, axis=1)
        return np.asarray(total / np.maximum(length, TINY)[:, None])


def planar_directions(
    surface: Surface, thickness: float, *, start: Array | None = None, rounds: int = 30
) -> tuple[Array, Array]:
    """Return (V, 3) directions that make all side walls as planar as possible, and (E,) how far each inner edge's
    wall is from a plane, metres.

    Starts from `start` (V, 3), where that is zero from the vertex normals, and solves det(edge, n_a, n_b) = 0 over
    all inner edges by Gauss–Newton with the smallest change; each direction keeps its component along the first
    one, so that the thickness stays. Where three polygons meet at every corner (as in running bond) there are
    more unknowns than equations.
    """
    edges = np.array([e for e, owners in surface.edges().items() if len(owners) == 2]).reshape(-1, 2)
    normals = surface.vertex_normals()
    if start is not None:
        length = np.linalg.norm(start, axis=1)
        normals = np.where(length[:, None] > 0, start / np.maximum(length, TINY)[:, None], normals)
    start = normals
    directions = start.copy()
    if len(edges) == 0:
        return directions, np.zeros(0)
    first, second = np.moveaxis(tangents(start), 1, 0)
    a, b = edges.T
    span = surface.points[b] - surface.points[a]
    span /= np.linalg.norm(span, axis=1)[:, None]
    rows = np.repeat(np.arange(len(edges)), 2)
    for _ in range(rounds):
        value = np.einsum("ij,ij->i", span, np.cross(directions[a], directions[b]))
        if np.abs(value).max() < PLANAR:
            break
        by_a, by_b = np.cross(directions[b], span), np.cross(span, directions[a])
        columns, entries = [], []
        for end, gradient in ((a, by_a), (b, by_b)):
            columns.append(np.stack([2 * end, 2 * end + 1], axis=1))
            entries.append(
                np.stack(
                    [np.einsum("ij,ij->i", gradient, first[end]), np.einsum("ij,ij->i", gradient, second[end])], axis=1
                )
            )
        jacobian = sp.csr_array(
            (
                np.concatenate([e.ravel() for e in entries]),
                (np.concatenate([rows, rows]), np.concatenate([c.ravel() for c in columns])),
            ),
            shape=(len(edges), 2 * len(start)),
        )
        # Least change that solves the linearised equations; the small ridge copes with dependent ones.
        gram = (jacobian @ jacobian.T + RIDGE * sp.eye_array(len(edges))).tocsc()
        step = -(jacobian.T @ spsolve(gram, value)).reshape(-1, 2)
        step *= min(1.0, 0.2 / max(float(np.abs(step).max()), TINY))
        directions = directions + step[:, :1] * first + step[:, 1:] * second
    return directions, wall_deviation(surface.points, directions, edges, thickness)


def wall_deviation(points: Array, directions: Array, edges: IntArray, thickness: float) -> Array:
    """Return (E,) the distance of each wall's fourth corner from the plane of the other three, metres."""
    a, b = edges.T
    span = points[b] - points[a]
    normal = np.cross(span, directions[a])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), TINY)[:, None]
    return np.asarray(np.abs(np.einsum("ij,ij->i", normal, directions[b])) * thickness)


def thicken(surface: Surface, directions: Array, thickness: float) -> list[Mesh]:
    """Return one closed, outward mesh per face: the surface is the inner side, `thickness` × directions further
    the outer one. Neighbours share the triangles of their common wall.
    """
    count = len(surface.points)
    space = np.concatenate([surface.points, surface.points + thickness * directions])
    meshes = []
    for face in surface.faces:
        loop = list(face)
        triangles = []
        outer = triangulated_loop(space[[v + count for v in loop]])
        inner = triangulated_loop(space[loop])
        triangles += [[loop[a] + count, loop[b] + count, loop[c] + count] for a, b, c in outer]
        triangles += [[loop[c], loop[b], loop[a]] for a, b, c in inner]
        for a, b in zip(loop, loop[1:] + loop[:1]):
            # Both neighbours cut the wall along the same diagonal: from the lower corner number's inner end.
            if a < b:
                triangles += [[a, b, b + count], [a, b + count, a + count]]
            else:
                triangles += [[a, b, a + count], [b, b + count, a + count]]
        used, local = np.unique(np.array(triangles), return_inverse=True)
        mesh = Mesh(space[used], local.reshape(-1, 3))
        if mesh.volume <= 0:
            where = ", ".join(f"{x:.4g}" for x in space[loop].mean(axis=0))
            raise InputError(
                f"The block at ({where}) turns inside out at a thickness of {thickness:g} m; make the shell thinner, "
                "the polygons larger, or turn the surface's faces outwards."
            )
        meshes.append(mesh)
    return meshes


def triangulated_loop(points: Array) -> list[tuple[int, int, int]]:
    """Return triangles over a loop of points (n, 3), counter-clockwise about its area vector, using every point.

    Of all triangulations the one whose worst triangle is roundest (dynamic programming), so that corners on a
    straight edge get triangles with area.
    """
    n = len(points)
    relative = points - points.mean(axis=0)
    normal = np.cross(relative, np.roll(relative, -1, axis=0)).sum(axis=0)
    normal /= np.linalg.norm(normal)

    def badness(i: int, j: int, k: int) -> float:
        sides = points[[j, k, i]] - points[[i, j, k]]
        area = float(np.cross(sides[0], sides[1]) @ normal)
        square = float((sides**2).sum())
        return square / area if area > ROUNDING * square else 1e9 + (0.0 if area > -ROUNDING * square else 1e9)

    cost = np.zeros((n, n))
    pick = np.zeros((n, n), dtype=np.int64)
    for width in range(2, n):
        for i in range(n - width):
            k = i + width
            options = [max(cost[i, j], cost[j, k], badness(i, j, k)) for j in range(i + 1, k)]
            best = int(np.argmin(options))
            cost[i, k], pick[i, k] = options[best], i + 1 + best
    if cost[0, n - 1] >= 1e9:
        where = ", ".join(f"{x:.4g}" for x in points.mean(axis=0))
        raise InputError(f"The polygon at ({where}) is folded or has no area; it cannot become a block.")
    triangles: list[tuple[int, int, int]] = []
    open_spans: list[tuple[int, int]] = [(0, n - 1)]
    while open_spans:
        i, k = open_spans.pop()
        if k - i >= 2:
            j = int(pick[i, k])
            triangles.append((i, j, k))
            open_spans += [(i, j), (j, k)]
    return triangles
