"""Frusta: solid joints with straight flanks all round and a flat top, height fields along u.

All of a flank can have the steepest slope that is allowed, from the rim to the top. A curved bump is that steep only
half way up: under the same bound on slope a frustum is higher, its forces stand further apart, and it transmits larger
moments.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from mocca_robot.arrays import Array, IntArray, read_only
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.bumps import Rectangles, bump_pattern, lean_of
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.patch import joint_with_patch
from mocca_robot.joints.rectangle import Rectangle, rectangle_parameters

LEAST_FLANK = 0.25
"""Narrowest flank, as a share of the rectangle's sides."""
WIDEST_FLANK = 0.475
"""Widest flank: it leaves a top of a twentieth of each side."""


def ramp(xy: Array) -> Array:
    """Return how far up, 0 to 1, points `xy` (…, 2) of the unit square are when flanks are a third wide."""
    return np.asarray(np.minimum(3.0 * np.minimum(xy, 1.0 - xy).min(axis=-1), 1.0))


def with_flanks(xy: Array, flank: Array) -> Array:
    """Return `xy` (K, 2), made for flanks a third wide, moved to suit flanks of width `flank` (E,): (E, K, 2)."""
    wide = flank[:, None, None]
    up = np.minimum(3.0 * np.minimum(xy, 1.0 - xy), 1.0) * wide
    inner = wide + (3.0 * xy - 1.0) * (1.0 - 2.0 * wide)
    return np.asarray(np.where(xy < 1 / 3, up, np.where(xy > 2 / 3, 1.0 - up, inner)))


@cache
def _pattern() -> tuple[Array, IntArray, IntArray]:
    pattern = bump_pattern(1, "n")
    return read_only(pattern.xy), pattern.triangles, pattern.rim


def frustum_joint(contact: Contact, rectangle: Rectangle, h: float, u: Array, flank: float) -> Joint:
    """Return the joint with a frustum of height `h` (m, signed, along `u`) over `rectangle`.

    `flank` is the width of its flanks as a share of the rectangle's sides, below a half. The rectangle must lie
    strictly inside the contact. Raises ValueError for other flanks and where u leans more than a height field may.
    """
    if not 0.0 < flank < 0.5:
        raise ValueError(f"flanks of {flank:g} of the rectangle's sides; a frustum has between 0 and 0.5")
    u = np.asarray(u, dtype=np.float64)
    lean_of(Rectangles.of([rectangle]), u[None])
    xy, triangles, rim = _pattern()
    at = with_flanks(xy, np.array([flank]))[0]
    flat = rectangle.origin + at[:, :1] * rectangle.l1 * rectangle.axis_x + at[:, 1:] * rectangle.l2 * rectangle.axis_y
    vertices = flat + h * ramp(xy)[:, None] * (u / np.linalg.norm(u))
    numbers = rectangle_parameters(rectangle) | {"height_m": float(h), "flank": float(flank)}
    return joint_with_patch(contact, "frustum", u, (vertices, triangles), rim, numbers)
