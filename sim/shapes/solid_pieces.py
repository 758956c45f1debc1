"""What collides while a solid part travels into its seat: points of its joints against faces of its neighbours'.

Small spheres sit just inside the driven part at the corners and in the middle of its contact facets; each facet of
the earlier parts is a thin prism that reaches into the material. Prisms share corners offset along mean normals, so
that none sticks out at a ridge. Coplanar facets that make one convex polygon become one prism: flat contacts cost
next to nothing, curved ones as much as their curvature.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from mocca_robot.arrays import Array
from mocca_robot.assembly import Polygon
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.frames import tangents
from mocca_robot.tolerances import COARSE, ROUNDING, TINY
from sim.shapes.contact_model import ContactModel, Geom, geom
from sim.shapes.convex_pieces import convex_pieces

SAME_NORMAL, SAME_OFFSET, MEETS = 1e-5, 1e-4, 1e-5
"""Cells in which normals and offsets (relative to the size) count as one plane, and edges as meeting a point."""

RADIUS = 0.02
"""Of the spheres, relative to the size of a small facet: they must fit into the tip of a bump."""
DEPTH = 0.3
"""Of the prisms, relative to the same: beneath a sharp ridge deeper ones would come out on the other side."""


NO_SHAPES = ContactModel((), ())


def solid_pieces(
    contacts: Sequence[Contact], part: int, clearance: float = 0.0, others: ContactModel = NO_SHAPES
) -> ContactModel:
    """Return the model for driving `part`, made smaller by `clearance` (m): its points against earlier faces.

    `others` is what the earlier parts carry each other by, for when they are left free.
    """
    mine = merged([piece for c in contacts if c.parts[1] == part for piece in convex_contacts(c)])
    if not mine:
        return others
    corners = np.concatenate([c.polygon for c in mine])
    reach = float(np.linalg.norm(np.ptp(corners, axis=0)))
    small = min(0.1 * reach, float(np.percentile([np.sqrt(c.measure) for c in mine], 10)))
    radius, depth = RADIUS * small, DEPTH * small
    geoms: list[Geom] = list(others.geoms)
    corner_points, corner_normals = _mean_normals(mine, reach)
    # Corners alone would miss a facet that is entered over the middle of its edge.
    middles, middle_normals = np.array([c.centre for c in mine]), np.array([c.normal for c in mine])
    points = np.concatenate([corner_points, middles])
    for point, inward in zip(points, np.concatenate([corner_normals, middle_normals])):
        centre = point + (radius + clearance) * inward
        geoms.append(geom(part, "sphere", centre, np.array([radius, 0.0, 0.0]), role="point"))
    for earlier in sorted({c.parts[0] for c in mine}):
        theirs = [c for c in mine if c.parts[0] == earlier]
        points, inward = _mean_normals(theirs, reach)
        below = {_key(p, reach): p - depth * n for p, n in zip(points, inward)}
        for contact in theirs:
            lower = np.array([below[_key(p, reach)] for p in contact.polygon])
            geoms.append(geom(earlier, "convex", np.concatenate([contact.polygon, lower]), np.zeros(3), role="face"))
    return ContactModel(tuple(geoms), others.pairs or ())


def merged(contacts: Sequence[Contact], tolerance: float = 1e-6) -> tuple[Contact, ...]:
    """Return the contacts with coplanar ones of a pair in one, where together they fill a convex polygon."""
    groups: dict[tuple[object, ...], list[Contact]] = {}
    for contact in contacts:
        size = float(np.ptp(contact.polygon, axis=0).max())
        plane = (
            tuple(np.round(contact.normal / SAME_NORMAL).astype(int)),
            round(float(contact.centre @ contact.normal) / (SAME_OFFSET * size)),
        )
        groups.setdefault((contact.parts, plane), []).append(contact)
    out: list[Contact] = []
    for group in groups.values():
        hull = _hull(group)
        area = sum(c.measure for c in group)
        whole = None if hull is None else Contact(group[0].parts, hull, group[0].normal)
        if len(group) > 1 and whole is not None and whole.measure <= area * (1.0 + tolerance):
            out.append(whole)
        else:
            out.extend(group)
    return tuple(out)


def convex_contacts(contact: Contact) -> tuple[Contact, ...]:
    """Return convex contacts that together are `contact`, which may have dents and holes."""
    axes = -tangents(contact.normal)
    rings = [ring @ axes.T for ring in (contact.polygon, *contact.holes)]
    hull = _hull([contact])
    if not contact.holes and hull is not None and len(hull) == len(contact.polygon):
        return (contact,)
    pieces = convex_pieces(Polygon(rings[0], tuple(rings[1:])))
    corners = np.concatenate([contact.polygon, *contact.holes])
    flat = np.concatenate(rings)
    out = []
    for piece in pieces:
        # The corners themselves, so that neighbouring facets keep sharing them to the last digit.
        nearest = np.linalg.norm(flat[None] - piece[:, None], axis=2).argmin(axis=1)
        out.append(Contact(contact.parts, corners[nearest], contact.normal))
    return tuple(out)


def _hull(group: Sequence[Contact]) -> Array | None:
    points = np.concatenate([c.polygon for c in group])
    try:
        return np.asarray(points[ConvexHull(points @ -tangents(group[0].normal).T).vertices])
    except QhullError:
        return None


def _mean_normals(contacts: Sequence[Contact], reach: float) -> tuple[Array, Array]:
    """Return the distinct corners (m, 3) and, for each, a vector into the later part that is at least 1 deep.

    Deep means measured along the normal of every facet that meets there, also of one whose edge merely passes
    through: a flat frame's edge runs along many corners of the patch inside it.
    """
    points = np.array(list({_key(p, reach): p for c in contacts for p in c.polygon}.values()))
    start = np.concatenate([c.polygon for c in contacts])
    edge = np.concatenate([np.roll(c.polygon, -1, axis=0) for c in contacts]) - start
    normals = np.concatenate([np.tile(c.normal, (len(c.polygon), 1)) for c in contacts])
    inward = []
    for point in points:
        offset = point - start
        along = np.clip((offset * edge).sum(axis=1) / np.maximum((edge**2).sum(axis=1), TINY), 0.0, 1.0)
        meets = np.linalg.norm(offset - along[:, None] * edge, axis=1) < MEETS * reach
        mine = np.unique(np.round(normals[meets], 6), axis=0)
        mean = mine.sum(axis=0)
        mean /= max(float(np.linalg.norm(mean)), ROUNDING)
        inward.append(mean / max(float((mine @ mean).min()), 0.2))
    return points, np.array(inward)


def _key(point: Array, reach: float) -> tuple[int, ...]:
    return tuple(int(k) for k in np.round(point / (COARSE * reach)))
