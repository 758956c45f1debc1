"""Parts as few convex pieces that together cover them: what the collision checks of planning keep away from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Mesh, Polygon
from mocca_robot.contacts.penetration import solid
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.tolerances import COARSE, EXACT

if TYPE_CHECKING:
    import manifold3d

SWELL = 5e-4
"""Metres: flat outlines grow by this before they are simplified, so that few pieces cover the whole part."""
NEARLY_CONVEX = 0.93
"""A solid that fills this share of its convex hull is covered by its hull."""
HALVINGS = 2
"""How often other solids are cut in half: four pieces, more where a half falls apart."""


def convex_cover(shape: Polygon | Mesh) -> list[Array]:
    """Return corners (V, d) of convex pieces that cover `shape`: the tiles of a swollen outline, or the hulls of the
    halves and quarters of a solid, cut where it helps most.
    """
    if isinstance(shape, Mesh):
        return _hulls(solid(shape), HALVINGS)
    swollen = to_shapely(shape).buffer(SWELL, join_style="mitre").simplify(0.8 * SWELL)
    return [np.asarray(p.exterior.coords)[:-1] for p in convex_pieces(swollen)]


def _hulls(body: manifold3d.Manifold, halvings: int) -> list[Array]:
    hull = body.hull()
    if halvings == 0 or body.volume() > NEARLY_CONVEX * hull.volume():
        return [np.asarray(hull.to_mesh64().vert_properties, dtype=np.float64)[:, :3]]
    low, high = np.reshape(body.bounding_box(), (2, 3))
    best: tuple[float, list[manifold3d.Manifold]] | None = None
    for axis in range(3):
        normal = np.eye(3)[axis]
        cut = body.split_by_plane(normal.tolist(), float(0.5 * (low[axis] + high[axis])))
        halves = [h for half in cut for h in half.decompose() if h.volume() > COARSE * body.volume()]
        covered = sum(h.hull().volume() for h in halves)
        if halves and (best is None or covered < best[0]):
            best = covered, halves
    if best is None or best[0] > 0.995 * hull.volume():
        return [np.asarray(hull.to_mesh64().vert_properties, dtype=np.float64)[:, :3]]
    return [piece for half in best[1] for piece in _hulls(half, halvings - 1)]


def convex_pieces(outline: shapely.Polygon) -> list[shapely.Polygon]:
    """Return convex polygons that tile `outline`: its triangles, merged while two together stay convex."""
    import mapbox_earcut

    rings = [np.asarray(r.coords)[:-1] for r in (outline.exterior, *outline.interiors)]
    ends = np.cumsum([len(r) for r in rings]).astype(np.uint32)
    corners = np.concatenate(rings)
    triangles = mapbox_earcut.triangulate_float64(corners, ends).reshape(-1, 3)
    pieces = [t for t in shapely.polygons(corners[triangles]) if t.area > EXACT]
    merged = True
    while merged:
        merged = False
        for a in range(len(pieces)):
            for b in range(len(pieces) - 1, a, -1):
                hull = shapely.union(pieces[a], pieces[b]).convex_hull
                if hull.area <= (pieces[a].area + pieces[b].area) * (1 + COARSE):
                    pieces[a] = hull
                    del pieces[b]
                    merged = True
    return pieces
