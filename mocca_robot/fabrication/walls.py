"""Places of a part that are thinner than a tool can make: walls and necks, slots, edges that taper off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh, Polygon
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.tolerances import ROUNDING, TINY

OFF_FACE = 1e-7
"""How far from its own face, relative to the size, a ray begins to look for the wall's other side."""

SAMPLES = 600
"""Places of a solid part's surface at which its thickness is measured, spread by area."""
FACING_RAD = np.deg2rad(45.0)
"""A wall is material between two surfaces that face away from each other within this angle."""
MITRE_LIMIT = 4.0
"""Convex corners blunter than 29° are no thin place, whatever the width at their very tip."""


@dataclass(frozen=True, eq=False)
class ThinPlace:
    """Where a part is thinnest.

    Attributes:
        part: its name.
        kind: 'wall' (material) or 'slot' (a gap that the part leaves open).
        place: (d,), metres, in the assembly.
        thickness: metres.
    """

    part: str
    kind: str
    place: Array
    thickness: float

    def text(self, limit: float, scale: float = 1.0) -> str:
        """Return a line for people, in millimetres of the part as made."""
        at = ", ".join(f"{v * 1e3:.4g}" for v in self.place)
        return (
            f"part '{self.part}' has a {self.kind} of {self.thickness * scale * 1e3:.2g} mm at ({at}) mm of the "
            f"assembly; the limit is {limit * 1e3:.3g} mm"
        )


def thin_places(assembly: Assembly, limit: float) -> list[ThinPlace]:
    """Return each part's thinnest wall below `limit` (m), of flat parts also its narrowest slot, thinnest first.

    Flat parts are compared with their opening and closing by a disc of that diameter, which misses nothing. Solids
    are measured along the inward normal at `SAMPLES` places, so that a spot smaller than their spacing can pass.
    """
    found: list[ThinPlace] = []
    for part in assembly.parts:
        if isinstance(part.shape, Polygon):
            found += _flat(part.name, part.shape, limit)
        else:
            thickness, place = _solid(part.shape)
            if thickness < limit:
                found.append(ThinPlace(part.name, "wall", place, thickness))
    return sorted(found, key=lambda t: t.thickness)


def _flat(name: str, polygon: Polygon, limit: float) -> list[ThinPlace]:
    shape = to_shapely(polygon)
    opened = _moved(_moved(shape, -0.5 * limit), 0.5 * limit)
    closed = _moved(_moved(shape, 0.5 * limit), -0.5 * limit)
    found = []
    for kind, difference in (("wall", shapely.difference(shape, opened)), ("slot", shapely.difference(closed, shape))):
        places = [
            shapely.maximum_inscribed_circle(piece, tolerance=0.01 * limit)
            for piece in shapely.get_parts(difference)
            if piece.geom_type == "Polygon" and shapely.area(piece) > 0.05 * limit**2
        ]
        if places:
            least = min(places, key=shapely.length)
            found.append(ThinPlace(name, kind, np.array(least.coords[0]), 2.0 * float(shapely.length(least))))
    return [t for t in found if t.thickness < 0.98 * limit]


def _moved(shape: shapely.Geometry, by: float) -> shapely.Geometry:
    return shapely.buffer(shape, by, join_style="mitre", mitre_limit=MITRE_LIMIT)


def _solid(mesh: Mesh) -> tuple[float, Array]:
    """Return the smallest thickness met and the place (3,) on the surface where it was; infinite without any wall."""
    corners = mesh.vertices[mesh.faces]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(doubled, axis=1)
    normals = doubled / np.maximum(area, TINY)[:, None]
    triangles, points = _samples(corners, area)
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    best, place = np.inf, np.zeros(3)
    for start in range(0, len(points), 64):
        mine = triangles[start : start + 64]
        reach = _first_exit(points[start : start + 64], -normals[mine], corners, normals, OFF_FACE * size)
        least = int(reach.argmin())
        if reach[least] < best:
            best, place = float(reach[least]), points[start + least]
    return best, place


def _samples(corners: Array, area: Array) -> tuple[Array, Array]:
    """Return triangle indices and points (n, 3) spread evenly by area, always the same ones."""
    positions = (np.arange(SAMPLES) + 0.5) / SAMPLES * area.sum()
    chosen = np.minimum(np.searchsorted(np.cumsum(area), positions), len(area) - 1)
    steps = np.arange(SAMPLES)[:, None] * np.array([0.7548776662, 0.5698402910]) % 1.0  # the R2 sequence
    u, v = np.where((steps.sum(axis=1) > 1.0)[:, None], 1.0 - steps, steps).T
    a, b, c = (corners[chosen, k] for k in range(3))
    return chosen, a + u[:, None] * (b - a) + v[:, None] * (c - a)


def _first_exit(origins: Array, ways: Array, corners: Array, normals: Array, least: float) -> Array:
    """Return (n,) how far each ray runs inside before it leaves through a facing surface; inf where it does not."""
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(ways[:, None], edge2[None])  # (n, F, 3)
    det = np.einsum("nfi,fi->nf", p, edge1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = origins[:, None] - corners[None, :, 0]
        u = np.einsum("nfi,nfi->nf", s, p) / det
        q = np.cross(s, edge1[None])
        v = np.einsum("ni,nfi->nf", ways, q) / det
        t = np.einsum("nfi,fi->nf", q, edge2) / det
        inside = (u >= -ROUNDING) & (v >= -ROUNDING) & (u + v <= 1.0 + ROUNDING) & (t > least)
    reach = np.where(inside, t, np.inf)
    first = reach.argmin(axis=1)
    rows = np.arange(len(origins))
    facing = np.einsum("ni,ni->n", ways, normals[first]) >= np.cos(FACING_RAD)
    return np.where(facing, reach[rows, first], np.inf)


def warnings(assembly: Assembly, limit: float, scale: float = 1.0, most: int = 8) -> Sequence[str]:
    """Return at most `most` lines on places thinner than `limit` (m) once the assembly is made at `scale`."""
    found = thin_places(assembly, limit / scale)
    lines = [t.text(limit, scale) for t in found[:most]]
    return [*lines, f"and {len(found) - most} more parts with thin places"] if len(found) > most else lines
