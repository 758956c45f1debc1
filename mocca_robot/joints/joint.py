"""A joint's built geometry, the same in 2D and 3D: flat facets, each with its corners and its normal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.cones import MotionCone, extreme_rays, generalized_normals
from mocca_robot.tolerances import COARSE

MANY, CROWDED = 5_000, 60
"""Rays in all, and on average per pair of parts, from which on finding the extreme ones pays for itself."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Joint:
    """J_ij^k: what stands in place of `contact`.

    Attributes:
        contact: the planar contact it replaces; the joint has the same boundary.
        kind: 'planar', 'n', 'z', 'bicubic', 'tenon', …
        direction: the principal direction u, unit, (d,), from P_i towards P_j.
        vertices: (V, d) points of the surface.
        facets: (F, 2) segments in 2D, (F, 3) triangles in 3D, oriented so that their normals point from P_i
            into P_j.
        parameters: the numbers that generated the surface, for files and reports; metres and radians.
    """

    contact: Contact
    kind: str
    direction: Array
    vertices: Array
    facets: IntArray
    parameters: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def facet_normals(self) -> Array:
        """Return (F, d) unit normals from P_i into P_j."""
        if self.is_planar:
            # The contact's own: a sliver among its triangles has none.
            return read_only(np.tile(self.contact.normal, (len(self.facets), 1)))
        corners = self.vertices[self.facets]
        if self.vertices.shape[1] == 2:
            t = corners[:, 1] - corners[:, 0]
            normals = np.stack([t[:, 1], -t[:, 0]], axis=1)
        else:
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return read_only(normals / np.linalg.norm(normals, axis=1)[:, None])

    @cached_property
    def rays(self) -> tuple[Array, Array]:
        """Return contact points (C, d) and unit normals (C, d): every corner of every facet."""
        corners = self.vertices[self.facets]
        k = corners.shape[1]
        return read_only(corners.reshape(-1, corners.shape[2])), read_only(np.repeat(self.facet_normals, k, axis=0))

    @property
    def is_planar(self) -> bool:
        """Return whether the joint is still the flat contact."""
        return self.kind == "planar"

    def motion_cone(self, about: Array | None = None, length: float = 1.0) -> MotionCone:
        """Return V, the motions of P_j against a fixed P_i (Eq. 1), about `about` (default: origin)."""
        points, normals = self.rays
        return MotionCone(read_only(generalized_normals(points, normals, about, length)))


def planar(contact: Contact) -> Joint:
    """Return the joint that leaves `contact` as it is."""
    if contact.polygon.shape[1] == 2:
        facets: IntArray = np.array([[0, 1]])
        vertices = contact.polygon
    else:
        from mocca_robot.contacts.surface import triangulated

        vertices, facets = triangulated(contact)
    return Joint(contact=contact, kind="planar", direction=contact.normal, vertices=vertices, facets=facets)


def contact_rays(contacts: Sequence[Contact]) -> tuple[IntArray, Array, Array]:
    """Return pairs (C, 2), points (C, d) and normals (C, d): every corner of every contact."""
    if not contacts:
        raise ValueError("no contacts")
    corners = [len(c.polygon) for c in contacts]
    pairs = np.repeat(np.array([c.parts for c in contacts], dtype=np.int64), corners, axis=0)
    normals = np.repeat(np.array([c.normal for c in contacts]), corners, axis=0)
    return pairs, np.concatenate([c.polygon for c in contacts]), normals


@lru_cache(maxsize=4)
def spanning_rays(contacts: tuple[Contact, ...]) -> BoolArray:
    """Return (C,) which of `contact_rays` suffice for the forces without friction between every pair of parts.

    All of them where they are few: finding the extreme ones has to pay for itself.
    """
    pairs, points, normals = contact_rays(contacts)
    spanning = np.ones(len(pairs), dtype=np.bool_)
    _, pair_of, corners = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    if len(pairs) >= MANY and len(pairs) >= CROWDED * len(corners):
        order = np.argsort(pair_of.ravel(), kind="stable")
        for mine in np.split(order, np.cumsum(corners)[:-1]):
            here = points[mine]
            reach = 0.5 * float(np.linalg.norm(np.ptp(here, axis=0)))
            spanning[mine] = False
            wrenches = generalized_normals(here, normals[mine], here.mean(axis=0), reach)
            spanning[mine[extreme_rays(wrenches, tolerance=COARSE)]] = True
    spanning.setflags(write=False)
    return spanning
