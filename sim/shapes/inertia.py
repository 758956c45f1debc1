"""Inertia of parts about their centres of mass, from exact geometry."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Mesh, Part, Polygon


def inertia(part: Part) -> Array:
    """Return the inertia tensor (3, 3) about the centre of mass in world axes, kg·m².

    A flat part moves in its plane only, so that just its polar moment matters; it is returned on the diagonal.
    """
    if isinstance(part.shape, Polygon):
        return float(part.density * part.shape.thickness * _polar_moment(part.shape)) * np.eye(3)
    return np.asarray(part.density * _mesh_inertia(part.shape))


def _polar_moment(polygon: Polygon) -> float:
    """Return ∫ r² dA about the centroid, m⁴ (Green's theorem; holes run clockwise and subtract)."""
    total = 0.0
    for ring in polygon.rings:
        p = ring - polygon.centroid
        q = np.roll(p, -1, axis=0)
        cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
        total += float((cross * (p * p + p * q + q * q).sum(axis=1)).sum()) / 12.0
    return total


def _mesh_inertia(mesh: Mesh) -> Array:
    """Return ∫ (r² 1 − r rᵀ) dV about the centroid, m⁵, summed over signed tetrahedra."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - mesh.centroid for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    total = a + b + c
    second = sum(np.einsum("f,fi,fj->ij", volume, x, x) for x in (a, b, c, total)) / 20.0
    return np.asarray(np.trace(second) * np.eye(3) - second)
