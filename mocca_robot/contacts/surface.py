"""The surface of a flat 3D contact: its boundary loops and its triangles."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.frames import tangents
from mocca_robot.geometry.triangulation import triangulate_loops


def triangulated(contact: Contact) -> tuple[Array, IntArray]:
    """Return vertices (V, 3) and triangles (F, 3) of a flat 3D contact, holes left out.

    The vertices are the corners of the polygon, then of the holes; every boundary edge is an edge of one
    triangle. Triangles are oriented like the contact: their normals equal `contact.normal`.
    """
    if len(contact.polygon) == 3 and not contact.holes:
        a, b, c = contact.polygon
        along = float(np.linalg.det(np.array([b - a, c - a, contact.normal]))) > 0.0
        return contact.polygon, np.array([[0, 1, 2]] if along else [[0, 2, 1]])
    vertices, loops = contact_loops(contact)
    return vertices, triangulate_loops(vertices @ tangents(contact.normal).T, loops)


def contact_loops(contact: Contact) -> tuple[Array, list[IntArray]]:
    """Return all corners (V, 3) and the boundary loops as indices, the contact to the left seen from P_j."""
    rings = [contact.polygon, *contact.holes]
    vertices = np.concatenate(rings)
    axes = tangents(contact.normal)
    loops, start = [], 0
    for number, ring in enumerate(rings):
        index = np.arange(start, start + len(ring))
        start += len(ring)
        flat = (ring - ring[0]) @ axes.T
        following = np.roll(flat, -1, axis=0)
        turns_left = float((flat[:, 0] * following[:, 1] - flat[:, 1] * following[:, 0]).sum()) > 0
        loops.append(index if turns_left == (number == 0) else index[::-1])
    return vertices, loops
