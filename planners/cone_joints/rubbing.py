"""Friction that a design counts on: every contact ray becomes the edges of a cone about it.

A ray n of a contact with normal n₀ carries the directions t_k, spread in the contact's plane, along by the smallest
turn from n₀ to n: d_k = t_k − (t_k·n)/(1 + n₀·n) (n₀ + n). Its edges are n + μ d_k, of unit length. In 2D they are n
turned by ±atan μ: the whole cone. In 3D they are a pyramid inside it, so what they hold the cone holds. They are smooth
in n, so the envelope theorem's gradient goes through them as it does through n.
Assemblability, slope and room are about n and never about these edges.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mocca_robot.arrays import Array
from mocca_robot.geometry.frames import tangents
from planners.cone_joints.shapes import Shapes

Scalar = TypeVar("Scalar", bound=np.generic)
EDGES = 8
"""Of the pyramid inside a friction cone, in 3D."""


def pushes(shapes: Shapes, points: Array, normals: Array) -> tuple[Array, Array]:
    """Return where and how contacts with these points and normals (E, R, d) push: (E, R · edges, d) both.

    Every ray's edges follow one another. Without friction to count on they are the arguments.
    """
    mu = shapes.options.counted_friction
    if mu == 0.0:
        return points, normals
    return repeated(shapes, points), cone_edges(shapes.normals, normals, mu)


def repeated(shapes: Shapes, values: NDArray[Scalar]) -> NDArray[Scalar]:
    """Return `values` (E, R, …) of rays once for every edge of each, in the order of `pushes`."""
    if shapes.options.counted_friction == 0.0:
        return values
    return np.repeat(values, 2 if shapes.normals.shape[1] == 2 else EDGES, axis=1)


def cone_edges(contact_normals: Array, normals: Array, friction: float) -> Array:
    """Return (E, R · edges, d) unit edges of the friction cones about `normals` (E, R, d) on contacts' normals (E, d).

    Normals must not oppose their contact's.
    """
    sides = spread(contact_normals, EDGES)
    upright = contact_normals[:, None]
    along = np.einsum("ekd,erd->erk", sides, normals) / (1.0 + (normals * upright).sum(axis=2))[..., None]
    carried = sides[:, None] - along[..., None] * (upright + normals)[:, :, None]
    edges = (normals[:, :, None] + friction * carried) / np.hypot(1.0, friction)
    return np.asarray(edges.reshape(len(normals), -1, normals.shape[2]))


def spread(normals: Array, count: int) -> Array:
    """Return (E, k, d) unit directions evenly around every normal (E, d): `count`, in 2D the two there are."""
    across = tangents(normals)
    if normals.shape[1] == 2:
        return np.concatenate([across, -across], axis=1)
    angle = 2 * np.pi * np.arange(count) / count
    return np.asarray(np.cos(angle)[:, None] * across[:, :1] + np.sin(angle)[:, None] * across[:, 1:])
