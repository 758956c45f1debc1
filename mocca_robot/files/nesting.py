"""Which closed surfaces of a part are cavities of which."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Mesh


def owners(meshes: Sequence[Mesh]) -> IntArray:
    """Return for each closed surface the one that it belongs to: itself, or the body that it is a cavity of.

    A cavity is turned inwards and lies inside a surface that is turned outwards; the smallest such one has it.
    """
    owner = np.arange(len(meshes))
    if len(meshes) < 2:
        return owner
    volume = np.array([m.volume for m in meshes])
    bounds = np.array([m.bounds for m in meshes])
    for k in np.flatnonzero(volume < 0).tolist():
        around = (bounds[:, 0] <= bounds[k, 0]).all(axis=1) & (bounds[:, 1] >= bounds[k, 1]).all(axis=1)
        around &= volume > -volume[k]
        for j in sorted(np.flatnonzero(around).tolist(), key=lambda j: volume[j]):
            if inside(meshes[j], meshes[k].vertices[0]):
                owner[k] = j
                break
    return owner


def inside(mesh: Mesh, point: Array) -> bool:
    """Return whether a point (3,) lies inside a closed outward mesh: its solid angles add up to a full turn."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
    below = la * lb * lc + ab * lc + bc * la + ca * lb
    return bool(np.arctan2(above, below).sum() / (2 * np.pi) > 0.5)
