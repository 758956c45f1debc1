"""Mortise-and-tenon joints: a straight block along u over a rectangle, upright or tilted (Fig. 15, 16).

The walls are parallel to u, so the joint lets P_j leave along u alone (with draft: along a narrow cone). Built
along the u of a bicubic joint it holds at least what that joint holds across u.
"""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.contacts.contact import Contact
from mocca_robot.errors import InputError
from mocca_robot.joints.bicubic import Rectangles, lean_of, rectangle_of, rectangle_parameters
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.joints.patch import joint_with_patch
from mocca_robot.joints.rectangle import Rectangle
from mocca_robot.joints.spline import polyline_joint

_RIM = np.array([0, 1, 2, 3])
_FACETS = np.array(
    [
        [4, 5, 6],
        [4, 6, 7],
        *([k, (k + 1) % 4, 4 + k] for k in range(4)),
        *([(k + 1) % 4, 4 + (k + 1) % 4, 4 + k] for k in range(4)),
    ]
)


def tenon_joint(
    contact: Contact, rectangle: Rectangle, h: float, u: Array | None = None, draft_rad: float = 0.0
) -> Joint:
    """Return a mortise-and-tenon joint: a block of height `h` (m, signed) along `u` over `rectangle`.

    `u` defaults to the contact normal, the upright joint. With `draft_rad` every wall leans inwards by that
    angle from u, as moulding needs it. The rectangle must lie strictly inside the contact. Raises InputError
    when the draft leaves no top.
    """
    u = contact.normal if u is None else np.asarray(u, dtype=np.float64)
    lean_of(Rectangles.of([rectangle]), u[None])
    u = u / np.linalg.norm(u)
    inset = abs(h) * float(np.tan(draft_rad))
    if 2.0 * inset >= min(rectangle.l1, rectangle.l2):
        raise InputError(
            f"A draft of {np.rad2deg(draft_rad):.3g}° over a height of {abs(h):.3g} m narrows the tenon by "
            f"{2 * inset:.3g} m, but it is only {min(rectangle.l1, rectangle.l2):.3g} m wide; lower either."
        )
    low, high = (inset / rectangle.l1, inset / rectangle.l2), (1 - inset / rectangle.l1, 1 - inset / rectangle.l2)
    top = rectangle.part(low, high).corners + h * u
    parameters = rectangle_parameters(rectangle) | {"height_m": float(h), "draft_rad": float(draft_rad)}
    patch = (np.concatenate([rectangle.corners, top]), _FACETS)
    return joint_with_patch(contact, "tenon", u, patch, _RIM, parameters)


def tenon_of(joint: Joint, inset: float = 0.0) -> Joint:
    """Return the tilted mortise-and-tenon joint derived from a bicubic one: same u, rectangle and height.

    `inset` narrows the rectangle by that share on every side. Planar joints come back planar.
    """
    if joint.is_planar:
        return planar(joint.contact)
    rectangle = rectangle_of(joint).part((inset, inset), (1.0 - inset, 1.0 - inset))
    return tenon_joint(joint.contact, rectangle, joint.parameters["height_m"], joint.direction)


def tenon_joint_2d(contact: Contact, direction: Array, a: float, b: float, h: float) -> Joint:
    """Return a flat single-direction joint: a tenon of height `h` (m, signed) along `direction`.

    It stands on the contact between the shares `a` < `b` of its length. Its walls are parallel to `direction`,
    so P_j can leave along it and in no other way.
    """
    if not 0.0 < a < b < 1.0:
        raise InputError(f"A tenon needs 0 < a < b < 1 along its contact; got a = {a:.3g}, b = {b:.3g}.")
    u = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    p1, p2 = contact.polygon
    foot, end = p1 + a * (p2 - p1), p1 + b * (p2 - p1)
    points = np.array([p1, foot, foot + h * u, end + h * u, end, p2])
    return polyline_joint(contact, "tenon", u, points, {"a": float(a), "b": float(b), "height_m": float(h)})
