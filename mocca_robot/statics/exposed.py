"""The surface that pressures and wind act on: what nothing covers, and what nothing shelters; and where to stand on it.

Surfaces are looked at in space in either dimension: a flat part is a plate that stands in the x–z plane, so one routine
finds which faces are exposed, which are sheltered from the wind, and what a pressure on them comes to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.actions import Pressure, Wind
from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Assembly, Part
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.surface import triangulated
from mocca_robot.geometry.extrusion import standing, surface
from mocca_robot.geometry.frames import tangents
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.tolerances import COARSE, EXACT, TINY

SAME_PLANE = 1e-5
"""Faces and contacts whose planes are nearer than this share of the assembly's size lie in one plane."""
SLIVER = 1e-10
"""Exposed faces count from this share of the square of the assembly's size: rounding leaves slivers bare."""
FACING = float(np.cos(np.deg2rad(45.0)))


@dataclass(frozen=True, eq=False)
class _Faces:
    """Pieces of surface in space.

    Attributes:
        part: (M,) whose they are.
        normal: (M, 3) outward unit normals.
        corners: M arrays (k, 3), convex or not, each in one plane.
    """

    part: IntArray
    normal: Array
    corners: list[Array]


def surface_forces(
    graph: PartsGraph, action: Pressure | Wind, cell: float | None = None
) -> list[tuple[int, Array, Array]]:
    """Return part, force (3,) and point (3,) of every piece of surface that a pressure acts on.

    With `cell` faces are cut into pieces of at most that width, metres; wind comes whole.
    """
    assembly, present = graph.assembly, graph.present
    found = []
    if isinstance(action, Wind):
        towards = standing(action.towards)
        pieces = _exposed(graph, _faces(assembly, present), looking=(-towards, 0.0))
        for part, normal, centre, seen in _unsheltered(pieces, towards):
            found.append((part, -normal * action.pressure_pa * seen, centre))
        return found
    names = action.parts or tuple(p.name for p in assembly.parts if not p.fixed)
    wanted = np.array([p.name in names for p in assembly.parts])
    looking = None if action.facing is None else (standing(action.facing), FACING)
    faces = _faces(assembly, present & wanted, action.within)
    for part, normal, axes, shape in _exposed(graph, faces, looking):
        if shape.area <= SLIVER * assembly.size**2:
            continue
        for piece in [shape] if cell is None else _cells(shape, cell):
            if piece.area > 0.0:
                found.append((part, -normal * action.pressure_pa * piece.area, _in_space(piece, axes)))
    return found


def _cells(shape: shapely.Geometry, cell: float) -> list[shapely.Geometry]:
    """Return an outline cut along a grid of `cell` metres."""
    low, high = np.reshape(shape.bounds, (2, 2))
    counts = np.maximum(np.ceil((high - low) / cell), 1.0)
    x, y = (np.linspace(low[k], high[k], int(counts[k]) + 1) for k in range(2))
    boxes = [shapely.box(x[i], y[j], x[i + 1], y[j + 1]) for i in range(len(x) - 1) for j in range(len(y) - 1)]
    return list(shapely.intersection(shape, boxes))


def standing_place(part: Part, size: float) -> Array:
    """Return the place (d,) on a part's upper faces where somebody would stand: where they balance, or nearest to it.

    Faces count that look up within 45°, by their area seen from above; of what lies over each other the uppermost is
    stood on. Of a part without any it is the highest corner. `size` is a length of the assembly, metres.
    """
    mesh = surface(part)
    kept = [0, 2] if part.shape.dimension == 2 else [0, 1, 2]
    triangles = mesh.vertices[mesh.faces]
    across = 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    level = across[:, 2] > FACING * np.linalg.norm(across, axis=1)
    if not level.any():
        return np.asarray(mesh.vertices[mesh.vertices[:, 2].argmax()][kept])
    triangles, across = triangles[level], across[level]
    seen = [shapely.Polygon(t[:, :2]) for t in triangles]
    middle = shapely.Point(np.average(triangles[:, :, :2].mean(axis=1), axis=0, weights=across[:, 2]))
    plan = shapely.get_coordinates(shapely.shortest_line(shapely.union_all(seen), middle))[0]
    under = shapely.distance(seen, shapely.Point(plan)) <= SAME_PLANE * size
    slope = across[under, :2] / across[under, 2:]
    heights = triangles[under, 0, 2] - ((plan - triangles[under, 0, :2]) * slope).sum(axis=1)
    return np.asarray(np.r_[plan, heights.max()][kept])


_Piece = tuple[int, Array, Array, shapely.Geometry]
"""Part, outward normal (3,), plane axes with the plane's offset along the normal (4, 3), outline in the plane."""


def _faces(assembly: Assembly, wanted: BoolArray, within: Array | None = None) -> _Faces:
    parts, normals, corners = [], [], []
    # The front and back of a flat part are no faces of the plane it lives in.
    flat = assembly.dimension == 2
    for index in np.flatnonzero(wanted):
        mesh = surface(assembly.parts[index])
        triangles = mesh.vertices[mesh.faces]
        across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        double = np.linalg.norm(across, axis=1)
        for triangle, normal, size in zip(triangles, across / np.maximum(double, TINY)[:, None], double):
            if size <= 0.0 or (flat and abs(normal[1]) > 0.5):
                continue
            piece = triangle if within is None else _clipped(triangle, _box(within))
            if len(piece) >= 3:
                parts.append(int(index))
                normals.append(normal)
                corners.append(piece)
    return _Faces(np.array(parts, dtype=np.int64), np.array(normals).reshape(-1, 3), corners)


def _box(within: Array) -> Array:
    """Return (2, 3) corners of a box in space; in 2D it has no limits across the plane."""
    if within.shape[1] == 3:
        return within
    return np.array([[within[0, 0], -np.inf, within[0, 1]], [within[1, 0], np.inf, within[1, 1]]])


def _clipped(corners: Array, box: Array) -> Array:
    """Return the part of a convex polygon (k, 3) inside a box (2, 3) (Sutherland and Hodgman)."""
    for axis in range(3):
        for sign, limit in ((1.0, box[0, axis]), (-1.0, -box[1, axis])):
            if not np.isfinite(limit) or not len(corners):
                continue
            inside = sign * corners[:, axis] - limit
            kept: list[Array] = []
            for k in range(len(corners)):
                following = (k + 1) % len(corners)
                if inside[k] >= 0.0:
                    kept.append(corners[k])
                if (inside[k] > 0.0) != (inside[following] > 0.0) and inside[k] != inside[following]:
                    t = inside[k] / (inside[k] - inside[following])
                    if 0.0 < t < 1.0:
                        kept.append(corners[k] + t * (corners[following] - corners[k]))
            corners = np.array(kept).reshape(-1, 3)
    return corners


def _exposed(graph: PartsGraph, faces: _Faces, looking: tuple[Array, float] | None) -> list[_Piece]:
    """Return what of `faces` is not covered by a present neighbour, and looks at least so far along a direction."""
    covers: dict[int, list[tuple[Array, list[Array]]]] = {}
    assembly = graph.assembly
    for contact in graph.contacts:
        normal, pieces = _contact_in_space(assembly, contact)
        i, j = contact.parts
        covers.setdefault(i, []).append((normal, pieces))
        covers.setdefault(j, []).append((-normal, pieces))
    near = SAME_PLANE * assembly.size
    found = []
    for part, normal, corners in zip(faces.part, faces.normal, faces.corners):
        if looking is not None and not float(normal @ looking[0]) > looking[1]:
            continue
        axes = tangents(normal)
        offset = float(corners[0] @ normal)
        outline: shapely.Geometry = shapely.Polygon(corners @ axes.T)
        for direction, pieces in covers.get(int(part), ()):
            if float(direction @ normal) < 1.0 - COARSE or abs(float(pieces[0][0] @ normal) - offset) > near:
                continue
            outline = outline.difference(shapely.union_all([shapely.Polygon(p @ axes.T) for p in pieces]))
        found.append((int(part), normal, np.vstack([axes, normal * offset, normal]), outline))
    return found


def _contact_in_space(assembly: Assembly, contact: Contact) -> tuple[Array, list[Array]]:
    """Return a contact's normal (3,) and its surface as triangles or a rectangle (k, 3), flat parts standing."""
    if assembly.dimension == 3:
        vertices, triangles = triangulated(contact)
        return contact.normal, list(vertices[triangles])
    thickness = min(assembly.parts[p].shape.thickness for p in contact.parts)  # type: ignore[union-attr]
    a, b = standing(contact.polygon)
    half = np.array([0.0, 0.5 * thickness, 0.0])
    return standing(contact.normal), [np.array([a - half, b - half, b + half, a + half])]


def _in_space(outline: shapely.Geometry, axes: Array) -> Array:
    """Return the centroid (3,) of an outline in a plane given by its axes and offset."""
    centre = outline.centroid
    return np.asarray(centre.x * axes[0] + centre.y * axes[1] + axes[2])


def _unsheltered(pieces: Sequence[_Piece], towards: Array) -> list[tuple[int, Array, Array, float]]:
    """Return part, normal, centre and area across the wind of what the wind meets first.

    Seen along the wind, of two faces that overlap the one further upwind shelters the other there.
    """
    across = tangents(towards)
    seen, kept = [], []
    for piece in pieces:
        part, normal, axes, outline = piece
        for polygon in (g for g in shapely.get_parts(outline) if g.geom_type == "Polygon" and g.area > 0.0):
            flat = shapely.get_coordinates(polygon.exterior)
            space = flat @ axes[:2] + axes[2]
            holes = [shapely.get_coordinates(r) @ axes[:2] + axes[2] for r in polygon.interiors]
            shadow = shapely.Polygon(space @ across.T, [h @ across.T for h in holes])
            if shadow.area > 0.0:
                seen.append(shadow)
                kept.append((part, normal, axes))
    tree = shapely.STRtree(seen)
    found = []
    for k, shadow in enumerate(seen):
        part, normal, axes = kept[k]
        lit: shapely.Geometry = shadow
        for other in tree.query(shadow, predicate="intersects"):
            common = shadow.intersection(seen[other]) if other != k else shapely.Point()
            if common.area <= EXACT * shadow.area:
                continue
            place = shapely.get_coordinates(common.representative_point())[0]
            if _along(place, kept[other][1], kept[other][2], across, towards) < _along(
                place, normal, axes, across, towards
            ):
                lit = lit.difference(seen[other])
        if lit.area > 0.0:
            centre = shapely.get_coordinates(lit.centroid)[0]
            depth = _along(centre, normal, axes, across, towards)
            point = centre @ across + depth * towards
            found.append((part, normal, point, float(lit.area)))
    return found


def _along(place: Array, normal: Array, axes: Array, across: Array, towards: Array) -> float:
    """Return how far down the wind (metres) the plane of a face is met at a place (2,) seen along the wind."""
    start = place @ across
    return float((axes[2] - start) @ normal / (towards @ normal))
