"""Contacts that a file states, in place of those that a search would find."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, read_only
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.contacts.contact import Contact
from mocca_robot.errors import InputError
from mocca_robot.tolerances import TINY, TOLERANCES


def stored_contacts(assembly: Assembly) -> tuple[Contact, ...]:
    """Return the contacts of `assembly.interfaces`, by pair; a polygon that is not flat is cut into triangles.

    Raises InputError for parts that are not there and places that are not near both parts.
    """
    found: dict[tuple[int, int], list[Contact]] = {}
    slack = TOLERANCES.near_miss * assembly.size
    for interface in assembly.interfaces:
        i, j = sorted(assembly.index(name) for name in interface.parts)
        mine = found.setdefault((i, j), [])
        for polygon in interface.polygons:
            for part in (i, j):
                low, high = assembly.parts[part].shape.bounds
                off = float(np.maximum(low - polygon, polygon - high).max())
                if off > slack:
                    raise InputError(
                        f"The stored interface of '{assembly.parts[i].name}' and '{assembly.parts[j].name}' lies "
                        f"{off:.3g} m outside of '{assembly.parts[part].name}'; compute the interfaces again."
                    )
            for flat in _flat(polygon, TOLERANCES.contact_gap * assembly.size):
                normal = _outward(assembly, i, flat)
                mine.append(Contact((i, j), read_only(flat), read_only(normal), len(mine)))
    return tuple(c for pair in sorted(found) for c in found[pair])


def _vector(polygon: Array) -> Array:
    away = polygon - polygon.mean(axis=0)
    return np.asarray(0.5 * np.cross(away, np.roll(away, -1, axis=0)).sum(axis=0))


def _flat(polygon: Array, gap: float) -> list[Array]:
    area = _vector(polygon)
    normal = area / max(float(np.linalg.norm(area)), TINY)
    if np.abs((polygon - polygon.mean(axis=0)) @ normal).max() <= gap:
        return [polygon]
    return [polygon[[0, k, k + 1]] for k in range(1, len(polygon) - 1)]


def _outward(assembly: Assembly, part: int, polygon: Array) -> Array:
    """Return the unit normal of a polygon out of a part: that of the part's nearest face that is parallel."""
    area = _vector(polygon)
    normal = area / max(float(np.linalg.norm(area)), TINY)
    mesh = assembly.parts[part].shape
    assert isinstance(mesh, Mesh)
    corners = mesh.vertices[mesh.faces]
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.maximum(np.linalg.norm(vectors, axis=1), TINY)
    cosine = vectors @ normal / length
    centre = polygon.mean(axis=0)
    off = np.abs(np.einsum("ij,ij->i", corners[:, 0] - centre, vectors) / length)
    away = np.linalg.norm(
        np.maximum(corners.min(axis=1) - centre, 0) + np.maximum(centre - corners.max(axis=1), 0), axis=1
    )
    score = off + away + assembly.size * (1.0 - np.abs(cosine))
    return np.asarray(normal if cosine[int(score.argmin())] >= 0.0 else -normal)
