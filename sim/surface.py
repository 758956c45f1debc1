"""The closed surface of a part in MuJoCo's world, for everything that draws it or writes it to files."""

from __future__ import annotations

import numpy as np

from mocca_robot.assembly import Mesh, Part, Polygon
from sim.contact_model import embed
from sim.convex_pieces import triangles


def surface(part: Part) -> Mesh:
    """Return the part's own mesh, or a flat part as a plate standing in the x–z plane, half on either side of it."""
    if not isinstance(part.shape, Polygon):
        return part.shape
    points, faces = triangles(part.shape)
    n, half = len(points), 0.5 * part.shape.thickness
    front, back = embed(points), embed(points)
    front[:, 1], back[:, 1] = -half, half
    # Counter-clockwise in the drawing is counter-clockwise seen from −y, where the front is.
    front_faces = np.array(faces)
    walls = []
    first = 0
    for ring in part.shape.rings:
        a = first + np.arange(len(ring))
        b = first + (np.arange(len(ring)) + 1) % len(ring)
        walls += [np.stack([a, a + n, b], axis=1), np.stack([b, a + n, b + n], axis=1)]
        first += len(ring)
    return Mesh(np.concatenate([front, back]), np.concatenate([front_faces, front_faces[:, ::-1] + n, *walls]))
