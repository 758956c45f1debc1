"""Curved 3D joints: bicubic patches over a rectangle inside the contact, height fields along u (Fig. 9).

The rectangle is cut into 3 × 3 cells; the four middle ones of the 16 control points have height h along u, the
others zero. The height is h·f(x)·f(y) with f the C¹ piecewise cubic through (0, 0), (1/3, 1), (2/3, 1), (1, 0)
with zero slope at each knot, so that the patch joins the flat rim smoothly and never overshoots h. The z-type
changes f(x) for one that rises to 1 at x = 1/4 and falls to −1 at 3/4: one half rises, the other sinks.

`bumps.bump_rays` evaluates the tessellated patches of all joints of an assembly at once.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mocca_robot.arrays import Array, read_only
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.surface import triangulated
from mocca_robot.joints.bumps import (
    FLANK_SEGMENTS,
    MAX_LEAN,
    BumpParameters,
    BumpPattern,
    Bumps,
    Rectangles,
    bump_pattern,
    bump_rays,
    lean_of,
)
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.patch import joint_with_patch
from mocca_robot.joints.rectangle import Rectangle, largest_rectangle, rectangle_parameters


def bicubic_joint(
    contact: Contact,
    rectangle: Rectangle,
    h: float,
    u: Array,
    resolution: int = FLANK_SEGMENTS,
    kind: str = "n",
) -> Joint:
    """Return the joint with a bicubic patch of height `h` (m, signed, along `u`) over `rectangle`.

    `resolution` is the number of straight pieces per flank; 1 gives the piecewise-planar variant. The rectangle
    must lie strictly inside the contact. For a bump over part of a rectangle pass `rectangle.part(low, high)`.
    """
    stacked = Rectangles.of([rectangle])
    flat = BumpParameters.flat(1)
    lean = lean_of(stacked, np.asarray(u, dtype=np.float64)[None])
    bumps = bump_rays(stacked, BumpParameters(np.array([h]), lean, flat.low, flat.high), resolution, kind)
    name = "bicubic" if resolution > 1 else "piecewise"
    return joint_with_patch(
        contact,
        name if kind == "n" else f"{name}_z",
        np.asarray(u, dtype=np.float64),
        (bumps.vertices[0], bumps.pattern.triangles),
        bumps.pattern.rim,
        rectangle_parameters(rectangle) | {"height_m": float(h), "flank_segments": float(resolution)},
    )


def rectangle_of(joint: Joint) -> Rectangle:
    """Return the rectangle that a 3D joint's patch was built on. Raises KeyError for joints without one."""
    return rectangle_from(joint.parameters)


def rectangle_from(parameters: Mapping[str, float]) -> Rectangle:
    """Return the rectangle of a joint's parameters. Raises KeyError where one of its numbers is missing."""
    p = parameters
    vectors = [read_only([p[f"{name}_{k}"] for k in "xyz"]) for name in ("origin", "axis_x", "axis_y")]
    return Rectangle(vectors[0], vectors[1], vectors[2], p["l1_m"], p["l2_m"])


__all__ = [
    "FLANK_SEGMENTS",
    "MAX_LEAN",
    "BumpParameters",
    "BumpPattern",
    "Bumps",
    "Rectangle",
    "Rectangles",
    "bicubic_joint",
    "bump_pattern",
    "bump_rays",
    "largest_rectangle",
    "lean_of",
    "rectangle_from",
    "rectangle_of",
    "rectangle_parameters",
    "triangulated",
]
