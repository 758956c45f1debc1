"""Poses as UR controllers take them: [x, y, z, rx, ry, rz], metres and a rotation vector in radians."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.tolerances import EXACT

HALF_TURN = 1e-7
"""Sine of an angle below which its axis cannot be read from the skew part of a rotation."""

Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]


def six(values: Sequence[float] | Array) -> Six:
    """Return six floats as a tuple; ValueError for any other count."""
    a, b, c, d, e, f = (float(v) for v in values)
    return a, b, c, d, e, f


def three(values: Sequence[float] | Array) -> Three:
    """Return three floats as a tuple; ValueError for any other count."""
    a, b, c = (float(v) for v in values)
    return a, b, c


def rotation_matrix(rotvec: Sequence[float] | Array) -> Array:
    """Return the (3, 3) rotation by |rotvec| radians about rotvec (Rodrigues)."""
    r = np.asarray(rotvec, dtype=np.float64)
    angle = float(np.linalg.norm(r))
    if angle < EXACT:
        near: Array = np.eye(3) + _cross(r)
        return near
    k = _cross(r / angle)
    rotation: Array = np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)
    return rotation


def rotation_vector(rotation: Array) -> Array:
    """Return the rotation vector (3,) of a rotation matrix, angle in [0, π]."""
    skew = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    sine, cosine = float(np.linalg.norm(skew)) / 2.0, (float(np.trace(rotation)) - 1.0) / 2.0
    angle = float(np.arctan2(sine, cosine))
    if sine > HALF_TURN:
        return skew * (angle / (2.0 * sine))
    if cosine > 0.0:
        return skew / 2.0
    # Near π the antisymmetric part vanishes; the axis is the dominant column of (R + 1)/2.
    column = (rotation + np.eye(3)) / 2.0
    k = int(np.argmax(np.diag(column)))
    axis: Array = column[:, k] / np.linalg.norm(column[:, k])
    return axis * angle


def transform(pose: Sequence[float] | Array) -> Array:
    """Return the (4, 4) matrix of a pose."""
    out = np.eye(4)
    out[:3, :3] = rotation_matrix(pose[3:6])
    out[:3, 3] = pose[:3]
    return out


def pose_of(matrix: Array) -> Six:
    """Return the pose of a (4, 4) matrix."""
    return six(np.concatenate([matrix[:3, 3], rotation_vector(matrix[:3, :3])]))


def distance_m(a: Sequence[float] | Array, b: Sequence[float] | Array) -> float:
    """Return how far apart the origins of two poses lie, metres."""
    return float(np.linalg.norm(np.asarray(a[:3], dtype=float) - np.asarray(b[:3], dtype=float)))


def angle_rad(a: Sequence[float] | Array, b: Sequence[float] | Array) -> float:
    """Return the angle of the rotation between two poses, radians."""
    relative = rotation_matrix(a[3:6]).T @ rotation_matrix(b[3:6])
    return float(np.linalg.norm(rotation_vector(relative)))


def _cross(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
