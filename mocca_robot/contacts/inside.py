"""Parts inside parts: wholly within the outer surface of another that they touch nowhere."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from mocca_robot.assembly import Assembly, Mesh, Polygon
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.penetration import solid
from mocca_robot.geometry import surfaces
from mocca_robot.tolerances import ROUNDING


def parts_inside(assembly: Assembly, contacts: Sequence[Contact]) -> tuple[tuple[int, int], ...]:
    """Return the pairs (inner, outer) of parts, by index, where `inner` lies within the outer surface of `outer`, in
    its material or in a hollow of it, without a contact between them.
    """
    touching = {pair for c in contacts for pair in (c.parts, c.parts[::-1])}
    bounds = np.array([p.shape.bounds for p in assembly.parts])
    lower, upper = bounds[:, 0], bounds[:, 1]
    found = []
    for outer in range(len(assembly.parts)):
        boxed = ((lower > lower[outer]) & (upper < upper[outer])).all(axis=1)
        found += [
            (inner, outer)
            for inner in np.flatnonzero(boxed).tolist()
            if (inner, outer) not in touching and _within(assembly, inner, outer)
        ]
    return tuple(sorted(found))


def _within(assembly: Assembly, inner: int, outer: int) -> bool:
    mine, around = assembly.parts[inner].shape, assembly.parts[outer].shape
    if isinstance(mine, Polygon) and isinstance(around, Polygon):
        return bool(shapely.Polygon(around.exterior).contains(shapely.Polygon(mine.exterior)))
    assert isinstance(mine, Mesh) and isinstance(around, Mesh)
    outside = solid(_without_hollows(mine)) - solid(_without_hollows(around))
    return bool(outside.volume() <= ROUNDING * abs(mine.volume))


def _without_hollows(mesh: Mesh) -> Mesh:
    """Return the mesh without the surfaces that are turned inwards."""
    body = surfaces.bodies(mesh.faces)
    pieces = [mesh.faces[body == k] for k in np.unique(body)]
    outward = [faces for faces in pieces if Mesh(mesh.vertices, faces).volume > 0.0]
    if len(outward) == len(pieces):
        return mesh
    used, faces = np.unique(np.concatenate(outward), return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3))
