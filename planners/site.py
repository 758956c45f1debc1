"""The design as it will stand in the cell: scaled, upright, in the robot's base frame, as convex pieces to avoid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely

from mocca_robot.assembly import Array, Assembly, Mesh, Polygon, read_only
from mocca_robot.contacts import to_shapely
from mocca_robot.penetration import solid
from planners.cell import RobotCell

SWELL = 5e-4
"""Metres: flat outlines grow by this before they are simplified, so that few pieces cover the whole part."""

NEARLY_CONVEX = 0.97
"""A solid that fills this share of its convex hull is avoided as its hull."""
CELLS = 4
"""Cells per side of the grid that divides other solids."""


@dataclass(frozen=True, eq=False)
class Body:
    """A part where it belongs, in the base frame.

    Attributes:
        pieces: (V, 3) corners of convex pieces that together cover the part.
        centroid: (3,).
        low, high: (3,) corners of its bounding box.
    """

    name: str
    pieces: tuple[Array, ...]
    centroid: Array
    mass_kg: float
    fixed: bool
    low: Array
    high: Array


@dataclass(frozen=True, eq=False)
class Site:
    """The assembly in the cell.

    Attributes:
        assembly: scaled; its own frame.
        turn: (3, d); base-frame direction = turn @ design direction.
        shift: (3,); base-frame point = turn @ point + shift.
        bodies: one per part, in assembly order.
    """

    assembly: Assembly
    turn: Array
    shift: Array
    bodies: tuple[Body, ...]

    def point(self, design: Array) -> Array:
        """Return points (…, d) of the scaled design in the base frame."""
        return np.asarray(design @ self.turn.T + self.shift)


def site(assembly: Assembly, cell: RobotCell) -> Site:
    """Return `assembly` scaled and placed as `cell` says: flat designs stand upright, their y axis up."""
    bounds = np.array([p.shape.bounds for p in assembly.parts])
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    scale = 1.0 if cell.build_size_m is None else cell.build_size_m / float((high - low).max())
    scaled = assembly.with_shapes([_scaled(p.shape, scale, cell.thickness_m) for p in assembly.parts])
    c, s = np.cos(cell.build_yaw_rad), np.sin(cell.build_yaw_rad)
    yaw = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turn = yaw[:, [0, 2]] if assembly.dimension == 2 else yaw
    foot = 0.5 * (low + high)
    foot[-1] = low[-1]
    shift = cell.build_origin_m - turn @ (foot * scale)
    bodies = []
    for part in scaled.parts:
        shape = part.shape
        pieces = [p @ turn.T + shift for p in _outlines(shape)]
        if isinstance(shape, Polygon):
            across = yaw[:, 1] * 0.5 * shape.thickness
            pieces = [np.concatenate([p + across, p - across]) for p in pieces]
        corners = np.concatenate(pieces)
        bodies.append(
            Body(
                part.name,
                tuple(read_only(p) for p in pieces),
                read_only(turn @ part.centroid + shift),
                part.mass,
                part.fixed,
                read_only(corners.min(axis=0)),
                read_only(corners.max(axis=0)),
            )
        )
    return Site(scaled, read_only(turn), read_only(shift), tuple(bodies))


def _scaled(shape: Polygon | Mesh, scale: float, thickness_m: float | None) -> Polygon | Mesh:
    if isinstance(shape, Polygon):
        thickness = shape.thickness * scale if thickness_m is None else thickness_m
        return Polygon(shape.exterior * scale, tuple(h * scale for h in shape.holes), thickness)
    return replace(shape, vertices=shape.vertices * scale)


def _outlines(shape: Polygon | Mesh) -> list[Array]:
    """Return corners (V, d) of convex pieces that cover `shape`."""
    if isinstance(shape, Mesh):
        return _hulls(shape)
    swollen = to_shapely(shape).buffer(SWELL, join_style="mitre").simplify(0.8 * SWELL)
    return [np.asarray(p.exterior.coords)[:-1] for p in convex_pieces(swollen)]


def _hulls(mesh: Mesh) -> list[Array]:
    """Return corners of convex pieces that cover a solid: its hull, or, where that is far too large, the hulls of
    what lies in each cell of a grid.
    """
    import manifold3d
    from scipy.spatial import ConvexHull

    hull = ConvexHull(mesh.vertices)
    whole = [np.asarray(mesh.vertices[hull.vertices])]
    if mesh.volume > NEARLY_CONVEX * hull.volume:
        return whole
    body = solid(mesh)
    low, high = mesh.bounds
    step = (high - low) / CELLS
    pieces = []
    for corner in np.ndindex(CELLS, CELLS, CELLS):
        cell = manifold3d.Manifold.cube(step.tolist()).translate((low + np.array(corner) * step).tolist())
        common = (body ^ cell).hull()
        points = np.asarray(common.to_mesh64().vert_properties)[:, :3]
        if common.volume() > 1e-9 * hull.volume and len(points) >= 4:
            pieces.append(points)
    return pieces or whole


def convex_pieces(outline: shapely.Polygon) -> list[shapely.Polygon]:
    """Return convex polygons that tile `outline`: its triangles, merged while two together stay convex."""
    import mapbox_earcut

    rings = [np.asarray(r.coords)[:-1] for r in (outline.exterior, *outline.interiors)]
    ends = np.cumsum([len(r) for r in rings]).astype(np.uint32)
    corners = np.concatenate(rings)
    triangles = mapbox_earcut.triangulate_float64(corners, ends).reshape(-1, 3)
    pieces = [t for t in shapely.polygons(corners[triangles]) if t.area > 1e-12]
    merged = True
    while merged:
        merged = False
        for a in range(len(pieces)):
            for b in range(len(pieces) - 1, a, -1):
                hull = shapely.union(pieces[a], pieces[b]).convex_hull
                if hull.area <= (pieces[a].area + pieces[b].area) * (1 + 1e-6):
                    pieces[a] = hull
                    del pieces[b]
                    merged = True
    return pieces
