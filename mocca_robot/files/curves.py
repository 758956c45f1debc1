"""Curves of a drawing → straight pieces, the same ones for every part that shares a curve.

A curve that two parts share is usually stored twice, once in each direction and with the last digits rounded
differently. Flattening each by itself would leave slivers between them; so curves are matched first, and all
that agree take the inner points of the first of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from mocca_robot.arrays import Array
from mocca_robot.tolerances import COARSE, TINY

CHORD_TOLERANCE = 2e-4
"""Largest distance between a curve and its chords, as a share of the drawing's size: 0.2 mm on a metre."""

STRAIGHT = 1e-7
"""Curves that bulge less than this share of the drawing are straight lines (editors write lines as curves)."""

SAME = 1e-5
"""Curves whose control points differ by less than this share of the drawing are one shared curve."""

MAX_PIECES = 256
"""Straight pieces of one curve; only reached by control points far outside the drawing."""


def copies_of(curves: Array, size: float) -> Array:
    """Return how many of the curves (N, 4, 2) are the same as each one, itself included, (N,)."""
    forward = curves.reshape(len(curves), 8)
    return np.asarray(KDTree(forward).query_ball_point(forward, SAME * size, return_length=True))


def flattened(curves: Array, size: float) -> list[Array]:
    """Return one (n, 2) polyline per cubic Bézier curve (N, 4, 2), both end points included, exactly its own.

    Invariant under reversal: a curve and its reverse give the same points in opposite order.
    """
    if len(curves) == 0:
        return []
    forward = curves.reshape(len(curves), 8)
    backward = curves[:, ::-1].reshape(len(curves), 8)
    tree = KDTree(forward)
    same: Any = tree.query_ball_point(forward, SAME * size)
    reverse: Any = tree.query_ball_point(backward, SAME * size)
    polylines: list[Array] = []
    for k, curve in enumerate(curves):
        first, first_reverse = min(same[k]), min(reverse[k], default=len(curves))
        if first == k and first_reverse >= k:
            inner = _inner_points(curve, size)
        else:
            turned = first_reverse < first
            inner = polylines[min(first, first_reverse)][1:-1]
            inner = inner[::-1] if turned else inner
        polylines.append(np.concatenate([curve[:1], inner, curve[3:]]))
    return polylines


def conformed(curves: Array, polylines: Sequence[Array], size: float) -> list[Array]:
    """Return the polylines with every corner of another one that lies on their curve as a corner of their own.

    A part may border on two others along one long curve, which they hold in two pieces: flattened apart, their
    chords would leave slivers. With each other's corners, all three run through the same points. Only corners
    within `SAME` of the exact curve are taken, so that shapes which merely come close stay as they are.
    """
    import shapely

    corners = np.unique(np.concatenate(list(polylines)), axis=0) if len(polylines) else np.zeros((0, 2))
    bent = [k for k, line in enumerate(polylines) if len(line) > 2]
    if not bent:
        return list(polylines)
    tree = shapely.STRtree(shapely.points(corners))
    near, found = tree.query(
        [shapely.LineString(polylines[k]) for k in bent],
        predicate="dwithin",
        distance=2 * CHORD_TOLERANCE * size,
    )
    found = found[np.argsort(near, kind="stable")]
    hits = np.split(found, np.bincount(near, minlength=len(bent)).cumsum()[:-1])
    result = list(polylines)
    for k, mine in zip(bent, hits):
        result[k] = _with_corners(curves[k], polylines[k], corners[mine], SAME * size)
    return result


def _with_corners(curve: Array, line: Array, corners: Array, slack: float) -> Array:
    """Return `line` (n, 2) with those `corners` (m, 2) inserted that lie on `curve` and not on its own corners."""
    corners = corners[KDTree(line).query(corners)[0] > 2 * slack] if len(corners) else corners
    if len(corners) == 0:
        return line
    grid = np.linspace(0.0, 1.0, 65)
    t = grid[np.linalg.norm(corners[:, None] - _points(curve, grid)[None], axis=2).argmin(axis=1)]
    for _ in range(8):  # Newton steps towards (B(t) − p)·B'(t) = 0, without the second derivative
        slope = 3 * _quadratic(np.diff(curve, axis=0), t)
        step = np.einsum("ij,ij->i", corners - _points(curve, t), slope)
        t = (t + step / np.maximum(np.einsum("ij,ij->i", slope, slope), TINY)).clip(0.0, 1.0)
    on_it = np.linalg.norm(corners - _points(curve, t), axis=1) <= slack
    own = np.linspace(0.0, 1.0, len(line))
    inserted, at = [*line], [*own]
    for position, corner in sorted(zip(t[on_it], corners[on_it].tolist())):
        if np.linalg.norm(np.array(inserted) - corner, axis=1).min() > 2 * slack:
            inserted.append(np.array(corner))
            at.append(position)
    return np.array(inserted)[np.argsort(at, kind="stable")]


def _points(curve: Array, t: Array) -> Array:
    """Return the points (n, 2) of a cubic (4, 2) at parameters (n,)."""
    s, t = (1.0 - t)[:, None], t[:, None]
    return np.asarray(s**3 * curve[0] + 3 * s**2 * t * curve[1] + 3 * s * t**2 * curve[2] + t**3 * curve[3])


def _quadratic(legs: Array, t: Array) -> Array:
    s, t = (1.0 - t)[:, None], t[:, None]
    return np.asarray(s**2 * legs[0] + 2 * s * t * legs[1] + t**2 * legs[2])


def _inner_points(curve: Array, size: float) -> Array:
    """Return the points between the ends, (n − 1, 2), evenly spaced in the curve's parameter."""
    chord = curve[3] - curve[0]
    length = float(np.linalg.norm(chord))
    legs = curve[1:3] - curve[0]
    if length > 0:
        along, off = legs @ chord / length, np.abs(legs[:, 0] * chord[1] - legs[:, 1] * chord[0]) / length
        slack = STRAIGHT * size
        if off.max() <= slack and along.min() >= -slack and along.max() <= length + slack:
            return np.zeros((0, 2))
    bend = np.linalg.norm(curve[2:] - 2 * curve[1:3] + curve[:2], axis=1).max()
    # Chord error of n even steps of a cubic: at most (3·2/8) · max second difference / n².
    pieces = int(np.clip(np.ceil(np.sqrt(0.75 * bend / (CHORD_TOLERANCE * size))), 1, MAX_PIECES))
    return _points(curve, np.arange(1, pieces) / pieces)


def elevated(points: Sequence[tuple[float, float]]) -> Array:
    """Return the cubic (4, 2) of a line (2 points), quadratic (3) or cubic (4) Bézier curve."""
    p = np.asarray(points, dtype=np.float64)
    if len(p) == 2:
        return np.array([p[0], p[0] + (p[1] - p[0]) / 3, p[1] - (p[1] - p[0]) / 3, p[1]])
    if len(p) == 3:
        return np.array([p[0], p[0] + 2 * (p[1] - p[0]) / 3, p[2] + 2 * (p[1] - p[2]) / 3, p[2]])
    return p


def elliptic_arc(center: Array, u: Array, v: Array, start: float, sweep: float) -> Array:
    """Return cubics (n, 4, 2) of the arc c + cos t·u + sin t·v, t from `start` over `sweep` (radians, signed).

    Each spans at most 30°: 4e-7 of the radius off, and the reversed arc has the same ones.
    """
    pieces = max(1, int(np.ceil(abs(sweep) / (np.pi / 6) - COARSE)))
    t = start + np.arange(pieces + 1) * (sweep / pieces)
    step = sweep / pieces
    leg = np.sin(step) * (np.sqrt(4.0 + 3.0 * np.tan(step / 2.0) ** 2) - 1.0) / 3.0
    cos, sin = np.cos(t)[:, None], np.sin(t)[:, None]
    at, along = center + cos * u + sin * v, leg * (cos * v - sin * u)
    return np.stack([at[:-1], at[:-1] + along[:-1], at[1:] - along[1:], at[1:]], axis=1)
