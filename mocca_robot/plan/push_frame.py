"""The frame in which an insertion is pushed: its z axis is the push direction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.geometry.frames import tangents
from mocca_robot.plan.pose import Six, pose_of, six


def frame_along(axis: Array, tcp: Sequence[float]) -> Six:
    """Return the pose of a right-handed frame at the tool's centre point with z along `axis` (3,), unit."""
    z = np.asarray(axis, dtype=np.float64)
    x, y = -tangents(z)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([x, y, z], axis=1)
    matrix[:3, 3] = tcp[:3]
    return six(pose_of(matrix))
