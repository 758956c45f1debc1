"""A contact's outline as a ring of a fixed number of corners, around the middle of the rectangle inside the contact."""

from __future__ import annotations

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.rectangle import Rectangle

CORNERS = 16
"""Corners of every outline: its own, and points between them."""
LEAST_EDGE = 1e-3
"""Shorter edges of an outline, as a share of the rectangle's shorter side, are corners."""


def round_ring() -> Array:
    """Return (M, 2) the circle in the unit square."""
    turn = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    return np.stack([0.5 + 0.5 * np.cos(turn), 0.5 + 0.5 * np.sin(turn)], axis=1)


def ring_of(contact: Contact, rectangle: Rectangle, margin: float) -> Array:
    """Return (M, 2) the outline of a contact, its margin inside it, in shares of the rectangle from its origin."""
    r = rectangle
    if contact.holes:
        return round_ring()
    axes = np.stack([r.axis_x, r.axis_y], axis=1)
    flat = (contact.polygon - r.origin) @ axes
    inset = shapely.Polygon(flat).buffer(-margin, join_style="mitre")
    middle = 0.5 * np.array([r.l1, r.l2])
    if inset.is_empty or inset.geom_type != "Polygon" or inset.interiors:
        return round_ring()
    ring = shapely.get_coordinates(shapely.orient_polygons(inset).exterior)[:-1]
    corners = _few(ring, middle, LEAST_EDGE * r.l2)
    if corners is None:
        return round_ring()
    return np.asarray(_subdivided(corners) / np.array([r.l1, r.l2]))


def _few(ring: Array, middle: Array, least: float) -> Array | None:
    """Return a ring of at most M corners inside `ring`, all seen from `middle`; None where there is none."""
    corners = list(ring[np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1) > least])
    while len(corners) > CORNERS:
        points = np.array(corners)
        before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
        area = _cross(points - before, after - points)
        area[area < 0.0] = np.inf  # without an inward corner the ring would grow
        if not np.isfinite(area.min()):
            return None
        corners.pop(int(area.argmin()))
    points = np.array(corners)
    if len(points) < 3:
        return None
    offset = points - middle
    following = np.roll(offset, -1, axis=0)
    distance = _cross(offset, following) / np.linalg.norm(following - offset, axis=1)
    return points if distance.min() > 10.0 * least else None


def _subdivided(corners: Array) -> Array:
    """Return the ring with points added on its longest edges, M in all."""
    pieces = np.ones(len(corners), dtype=np.int64)
    following = np.roll(corners, -1, axis=0)
    length = np.linalg.norm(following - corners, axis=1)
    for _ in range(CORNERS - len(corners)):
        pieces[int((length / pieces).argmax())] += 1
    points = [c + (f - c) * k / n for c, f, n in zip(corners, following, pieces) for k in range(n)]
    return np.array(points)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
