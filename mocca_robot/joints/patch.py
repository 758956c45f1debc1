"""A surface patch let into a contact: the patch, and the flat remainder of the contact around it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mocca_robot.arrays import Array, IntArray, read_only
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.surface import contact_loops
from mocca_robot.errors import InputError
from mocca_robot.geometry.frames import tangents
from mocca_robot.geometry.triangulation import triangulate_loops
from mocca_robot.joints.joint import Joint


def joint_with_patch(
    contact: Contact,
    kind: str,
    direction: Array,
    patch: tuple[Array, IntArray],
    rim: IntArray,
    parameters: Mapping[str, float],
) -> Joint:
    """Return the joint made of a patch and the flat remainder of `contact`, meeting edge on edge.

    `patch` is (vertices (P, 3), triangles (T, 3)), triangles oriented from P_i into P_j; `rim` (R,) lists the
    patch's boundary vertices counter-clockwise seen from P_j; they lie in the contact's plane. The joint's
    first vertices are the corners of the contact polygon and of its holes. Raises InputError when the rim does
    not lie strictly inside the contact.
    """
    surface, facets = patch
    corners, loops = contact_loops(contact)
    vertices = np.concatenate([corners, surface])
    axes = tangents(contact.normal)
    flat = (vertices - corners[0]) @ axes.T
    around = rim + len(corners)
    _require_inside(contact, [flat[loop] for loop in loops], flat[around])
    remainder = triangulate_loops(flat, [*loops, around[::-1]])
    return Joint(
        contact=contact,
        kind=kind,
        direction=read_only(direction / np.linalg.norm(direction)),
        vertices=read_only(vertices),
        facets=read_only(np.concatenate([remainder, facets + len(corners)]), np.int64),
        parameters=dict(parameters),
    )


def _require_inside(contact: Contact, rings: list[Array], rim: Array) -> None:
    import shapely

    polygon = shapely.Polygon(rings[0], rings[1:])
    if not shapely.contains_properly(polygon, shapely.Polygon(rim)):
        i, j = contact.parts
        gap = float(shapely.Polygon(rim).difference(polygon).area)
        raise InputError(
            f"The patch of the joint between parts {i} and {j} (contact {contact.k}) touches or leaves its contact "
            f"({gap:.3g} m² outside); keep a margin, e.g. largest_rectangle(contact, margin) with margin > 0."
        )
