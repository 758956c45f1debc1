"""Curved 2D joints: cubic splines over a segment, height fields along u (n-type and z-type, Fig. 6 and 7).

Both families are one: a C¹ piecewise cubic through knots (x_k, y_k) with zero slope at each knot, so that it
never overshoots its control points. x runs along the contact from p1 (0) to p2 (1), y is the height along u.
An n-type joint is flat, rises to height h, falls back and is flat again; a z-type has a second bump of the
opposite sign before it is flat again. Between two knots the steepest slope is 3/2 of the mean slope.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np

from mocca_robot.arrays import Array, IntArray, read_only
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.joint import Joint
from mocca_robot.tolerances import EXACT, ROUNDING

SplineKind: TypeAlias = Literal["n", "z"]

_SMOOTH: dict[str, tuple[int, ...]] = {"n": (1, 9, 9, 1), "z": (1, 6, 6, 6, 1)}
"""Straight pieces between knots. Both kinds have 20, hence 40 generalized normals (§3 asks for about 50)."""

_PIECEWISE: dict[str, tuple[int, ...]] = {"n": (1, 1, 1, 2), "z": (1, 1, 1, 1, 1)}
"""The same with flat flanks, from control point to control point."""


def spline_points(kind: SplineKind, segments: Array, directions: Array, shape: Array, piecewise: bool = False) -> Array:
    """Return the discretised curves of E joints at once, (E, 21, 2), from p1 to p2; (E, 6, 2) when `piecewise`.

    Args:
        kind: family of all of them.
        segments: (E, 2, 2) contact end points p1, p2.
        directions: (E, 2) unit principal directions u.
        shape: (E, 4) rows (w1, w2, h1, h2) in multiples of the contact's length: width of the flat at p1 and at
            p2, heights along u. n-type joints have no h2.
        piecewise: piecewise-planar: straight lines between the control points.
    """
    p1, span = segments[:, 0], segments[:, 1] - segments[:, 0]
    length = np.linalg.norm(span, axis=1)
    knots_x, knots_y = _knots(kind, shape)
    x, y = _curve((_PIECEWISE if piecewise else _SMOOTH)[kind], knots_x, knots_y * length[:, None])
    return np.asarray(p1[:, None] + x[..., None] * span[:, None] + y[..., None] * directions[:, None])


def _knots(kind: SplineKind, shape: Array) -> tuple[Array, Array]:
    a, b, h1, h2 = shape[:, 0], 1.0 - shape[:, 1], shape[:, 2], shape[:, 3]
    zero, one = np.zeros_like(a), np.ones_like(a)
    if kind == "n":
        return np.stack([zero, a, 0.5 * (a + b), b, one], 1), np.stack([zero, zero, h1, zero, zero], 1)
    quarter = 0.25 * (b - a)
    x = np.stack([zero, a, a + quarter, b - quarter, b, one], 1)
    return x, np.stack([zero, zero, h1, h2, zero, zero], 1)


def _curve(spans: tuple[int, ...], knots_x: Array, knots_y: Array) -> tuple[Array, Array]:
    xs, ys = [knots_x[:, :1]], [knots_y[:, :1]]
    for k, pieces in enumerate(spans):
        t = np.arange(1, pieces + 1) / pieces
        rise = t * t * (3.0 - 2.0 * t)
        xs.append(knots_x[:, k, None] + (knots_x[:, k + 1] - knots_x[:, k])[:, None] * t)
        ys.append(knots_y[:, k, None] + (knots_y[:, k + 1] - knots_y[:, k])[:, None] * rise)
    return np.concatenate(xs, axis=1), np.concatenate(ys, axis=1)


def smallest_radius(kind: SplineKind, length: Array, shape: Array) -> Array:
    """Return (E,) the smallest radius of curvature, m, at the knots, where it is tightest: w² / (6 |Δy|)."""
    knots_x, knots_y = _knots(kind, shape)
    width = np.diff(knots_x, axis=1) * length[:, None]
    rise = np.abs(np.diff(knots_y, axis=1)) * length[:, None]
    return np.asarray((width**2 / (6.0 * np.maximum(rise, EXACT * length[:, None]))).min(axis=1))


def polyline_joint(contact: Contact, kind: str, direction: Array, points: Array, parameters: dict[str, float]) -> Joint:
    """Return the joint along `points` (V, 2) from the contact's first end to its second, without repeats."""
    points = _simplified(np.concatenate([contact.polygon[:1], points[1:-1], contact.polygon[1:]]))
    index = np.arange(len(points))
    facets: IntArray = np.stack([index[:-1], index[1:]], axis=1)
    return Joint(
        contact=contact,
        kind=kind,
        direction=read_only(direction),
        vertices=read_only(points),
        facets=facets,
        parameters=parameters,
    )


def _simplified(points: Array) -> Array:
    """Return `points` (V, 2) without repeats and without points on the line through their neighbours."""
    length = float(np.linalg.norm(points[-1] - points[0]))
    kept = [points[0]]
    for here, after in pairwise(points[1:]):
        first, second = here - kept[-1], after - kept[-1]
        if np.linalg.norm(first) <= ROUNDING * length:
            continue
        reach = max(float(np.linalg.norm(second)), ROUNDING * length)
        if abs(first[0] * second[1] - first[1] * second[0]) <= EXACT * length * reach:
            continue
        kept.append(here)
    kept.append(points[-1])
    return np.array(kept)
