"""Curved 2D joints: cubic splines over a segment, height fields along u (n-type and z-type, Fig. 6 and 7).

Both families are one: a C¹ piecewise cubic through knots (x_k, y_k) with zero slope at each knot, so that it
never overshoots its control points. x runs along the contact from p1 (0) to p2 (1), y is the height along u.
"""

from __future__ import annotations

import numpy as np

from mocca_robot.assembly import Array, IntArray, read_only
from mocca_robot.contacts import Contact
from mocca_robot.joints.joint import Joint

FLANK_SEGMENTS = 8
"""Straight pieces per flank: 16 to 24 facets a joint, 30 to 50 generalized normals (§3 asks for about 50)."""


def _flank_positions() -> Array:
    """Return positions in (0, 1] along a flank at equal steps of its tangent's angle for a 45° flank."""
    x = np.linspace(0.0, 1.0, 2001)
    angle = np.arctan(4.0 * 1.5 * 4 * x * (1 - x) / 4)
    turned = np.concatenate([[0.0], np.abs(np.diff(angle)).cumsum()]) + 0.35 * x
    return np.interp(np.linspace(0, turned[-1], FLANK_SEGMENTS + 1)[1:], turned, x)


_FLANK = _flank_positions()
_RISE = _FLANK**2 * (3.0 - 2.0 * _FLANK)


def spline_points(segments: Array, directions: Array, knots_x: Array, knots_y: Array) -> Array:
    """Return the discretised curves of E joints at once, (E, V, 2), from p1 to p2.

    Args:
        segments: (E, 2, 2) contact end points p1, p2.
        directions: (E, 2) unit principal directions u.
        knots_x: (E, K) increasing positions in [0, 1], first 0 and last 1.
        knots_y: (E, K) heights in metres along u; first and last 0.
    """
    p1, span = segments[:, 0], segments[:, 1] - segments[:, 0]
    x0, x1 = knots_x[:, :-1, None], knots_x[:, 1:, None]
    y0, y1 = knots_y[:, :-1, None], knots_y[:, 1:, None]
    x = (x0 + (x1 - x0) * _FLANK).reshape(len(segments), -1)
    y = (y0 + (y1 - y0) * _RISE).reshape(len(segments), -1)
    curve = p1[:, None] + x[..., None] * span[:, None] + y[..., None] * directions[:, None]
    return np.concatenate([p1[:, None], curve], axis=1)


def knots_n(a: Array, b: Array, h: Array) -> tuple[Array, Array]:
    """Return knots of n-type joints: flat up to a, one bump of height h that ends at b, flat (E,) each."""
    zero, one = np.zeros_like(a), np.ones_like(a)
    x = np.stack([zero, a, 0.5 * (a + b), b, one], axis=-1)
    return x, np.stack([zero, zero, h, zero, zero], axis=-1)


def knots_z(a: Array, b: Array, h1: Array, h2: Array) -> tuple[Array, Array]:
    """Return knots of z-type joints: a bump of height h1, then one of height h2, between a and b."""
    zero, one = np.zeros_like(a), np.ones_like(a)
    x = np.stack([zero, a, a + (b - a) / 4, a + 3 * (b - a) / 4, b, one], axis=-1)
    return x, np.stack([zero, zero, h1, h2, zero, zero], axis=-1)


def polyline_joint(contact: Contact, kind: str, direction: Array, points: Array, parameters: dict[str, float]) -> Joint:
    """Return the joint along `points` (V, 2) from the contact's first end to its second, without repeats.

    Consecutive points closer than 1e-9 of the contact, and points in the middle of a straight run, are dropped.
    """
    points = simplified(np.concatenate([contact.polygon[:1], points[1:-1], contact.polygon[1:]]))
    index = np.arange(len(points))
    facets: IntArray = np.stack([index[:-1], index[1:]], axis=1)
    return Joint(contact, kind, read_only(direction), read_only(points), facets, parameters)


def simplified(points: Array) -> Array:
    """Return `points` (V, 2) without repeats and without points that lie on the line of their neighbours."""
    length = float(np.abs(points[-1] - points[0]).max())
    kept = [points[0]]
    for k in range(1, len(points) - 1):
        before, here, after = kept[-1], points[k], points[k + 1]
        first, second = here - before, after - before
        if np.linalg.norm(first) <= 1e-9 * length:
            continue
        off_line = abs(first[0] * second[1] - first[1] * second[0])
        if off_line <= 1e-12 * length * max(float(np.linalg.norm(second)), 1e-9 * length):
            continue
        kept.append(here)
    kept.append(points[-1])
    return np.array(kept)
