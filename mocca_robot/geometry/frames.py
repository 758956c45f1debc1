"""The one tangent frame of the project: unit vectors across a direction."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array


def tangents(directions: Array) -> Array:
    """Return (..., d − 1, d) unit vectors across unit `directions` (..., d), right-handed with them.

    In 2D the one vector is the direction turned a quarter counter-clockwise. In 3D first × second = direction; the
    first also lies across the axis that the direction leans on least, so that no frame degenerates.

    Callers whose results are on file with the frame turned by half write −tangents(n), right-handed as well.
    """
    n = np.asarray(directions, dtype=np.float64)
    if n.shape[-1] == 2:
        return np.stack([-n[..., 1], n[..., 0]], axis=-1)[..., None, :]
    first = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=-1)])
    # Rounded as ever: numpy adds up one vector and rows of many in different ways.
    first /= np.linalg.norm(first, axis=None if n.ndim == 1 else -1, keepdims=True)
    return np.stack([first, np.cross(n, first)], axis=-2)
