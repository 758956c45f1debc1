"""Cuts through solid parts: planes across the whole part, and across whatever a contact lets stand out of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Mesh
from mocca_robot.geometry.frames import tangents
from mocca_robot.strength.sections import Sections
from mocca_robot.strength.settings import EXACT, NEEDLE, NO_AREA, TINY

EVEN = (7, 3)
"""Planes along each main axis of the part, and along each direction between two."""
BUMP = (0.1, 0.35, 0.65)
"""Where a contact's own surface is cut, between its lowest and its highest place."""
FLAT = 5e-3
"""A contact that rises by less, as a share of the part's size, has no bump."""
RIMS = 12
"""Directions in which the rim of a cut is furthest out."""
FINE = 400
"""Faces into which the surface is cut at least to tell which weight lies beyond a plane."""
SHELLS = 4
"""Pieces into which the weight under each face is cut for that, from the centroid outwards."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Touched:
    """Where one neighbour touches a part: (m,) its samples, and the mean normal (3,) out of the part."""

    samples: IntArray
    normal: Array


def cuts3d(mesh: Mesh, points: Array, touched: Sequence[Touched]) -> Sections:
    """Return cuts through a part whose contact samples are `points` (S, 3)."""
    planes = np.concatenate([_across(mesh), _bumps(mesh, points, touched)])
    cuts = _Cut.by(mesh, planes[:, :3], planes[:, 3])
    normals, levels = planes[cuts.kept, :3], planes[cuts.kept, 3]
    volumes, centroids = _beyond(mesh, normals, levels)
    return Sections(
        normals=normals,
        centres=cuts.centres,
        areas=cuts.areas,
        inertia=cuts.inertia,
        rims=cuts.rims,
        beyond=beyond3d(normals, levels, points),
        volumes=volumes,
        centroids=centroids,
    )


def beyond3d(normals: Array, levels: Array, points: Array) -> BoolArray:
    """Return (P, n) which points lie beyond each plane."""
    return np.asarray(normals @ points.T > levels[:, None])


def _across(mesh: Mesh) -> Array:
    """Return (n, 4) planes, normal and level, along the part's main axes and between them."""
    axes = np.linalg.svd(mesh.vertices - mesh.vertices.mean(axis=0), full_matrices=False)[2]
    between = [axes[a] + sign * axes[b] for a, b in ((0, 1), (0, 2), (1, 2)) for sign in (1.0, -1.0)]
    found = []
    for number, way in enumerate((*axes, *between)):
        count = EVEN[0] if number < 3 else EVEN[1]
        normal = way / np.linalg.norm(way)
        heights = mesh.vertices @ normal
        low, high = heights.min(), heights.max()
        found += [[*normal, low + s * (high - low)] for s in (np.arange(count) + 0.5034) / count]
    return np.array(found)


def _bumps(mesh: Mesh, points: Array, touched: Sequence[Touched]) -> Array:
    found = []
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    for side in touched:
        heights = points[side.samples] @ side.normal
        low, high = heights.min(), heights.max()
        if high - low > FLAT * size:
            found += [[*side.normal, low + share * (high - low)] for share in BUMP]
    return np.array(found).reshape(-1, 4)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Cut:
    """What planes cut out of a mesh: `kept` of the planes do, and have centres, areas, second moments and rims."""

    kept: IntArray
    centres: Array
    areas: Array
    inertia: Array
    rims: Array

    @classmethod
    def by(cls, mesh: Mesh, normals: Array, levels: Array) -> _Cut:
        """Return all cuts at once: a segment per plane and face that it crosses, summed up plane by plane."""
        heights = normals @ mesh.vertices.T - levels[:, None]
        up = heights > 0.0
        above = up[:, mesh.faces]
        count = above.sum(axis=2)
        plane, face = np.nonzero((count == 1) | (count == 2))
        first, starts = np.unique(plane, return_index=True)
        axes = tangents(normals)
        # The first corner is alone on its side; the cut runs between the two edges there, the part to its left.
        mine = above[plane, face]
        alone = np.where(count[plane, face] == 1, mine.argmax(axis=1), (~mine).argmax(axis=1))
        a, b, c = (mesh.faces[face, (alone + k) % 3] for k in range(3))
        ends = []
        for other in (b, c):
            t = heights[plane, a] / (heights[plane, a] - heights[plane, other])
            place = mesh.vertices[a] + t[:, None] * (mesh.vertices[other] - mesh.vertices[a])
            ends.append(np.einsum("md,mkd->mk", place, axes[plane]))
        flip = up[plane, a][:, None]
        p, q = np.where(flip, ends[0], ends[1]), np.where(flip, ends[1], ends[0])

        def summed(values: Array) -> Array:
            return np.add.reduceat(values, starts, axis=0)

        groups = np.searchsorted(first, plane)
        middle = summed(p) / np.bincount(groups)[:, None]
        p, q = p - middle[groups], q - middle[groups]
        double = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
        area = 0.5 * summed(double)
        sign = np.where(area < 0.0, -1.0, 1.0)
        area, double = np.abs(area), double * sign[groups]
        safe = np.maximum(area, TINY)
        centre = summed(double[:, None] * (p + q)) / (6.0 * safe)[:, None]
        u, v = p - centre[groups], q - centre[groups]
        double = sign[groups] * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        pairs = u[:, :, None] * u[:, None] + v[:, :, None] * v[:, None]
        mixed = u[:, :, None] * v[:, None]
        inertia = summed(double[:, None, None] * (pairs + 0.5 * (mixed + mixed.transpose(0, 2, 1)))) / 12.0
        angles = 2.0 * np.pi * np.arange(RIMS) / RIMS
        ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        along = u @ ways.T
        furthest = along == np.maximum.reduceat(along, starts, axis=0)[groups]
        corners = [np.flatnonzero(row)[np.unique(groups[row], return_index=True)[1]] for row in furthest.T]
        size = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
        whole = (area > NO_AREA * size**2) & (
            np.linalg.det(inertia) > NEEDLE * np.trace(inertia, axis1=1, axis2=2) ** 2
        )
        flat = np.einsum("gk,gkd->gd", centre + middle, axes[first])
        return cls(
            kept=first[whole],
            centres=(flat + levels[first, None] * normals[first])[whole],
            areas=area[whole],
            inertia=inertia[whole],
            rims=np.stack([u[c] for c in corners], axis=1)[whole],
        )


def _beyond(mesh: Mesh, normals: Array, levels: Array) -> tuple[Array, Array]:
    """Return (P,) volumes and (P, 3) centroids beyond planes, the part as `SHELLS` pieces of a cone under each face."""
    origin = mesh.centroid
    corners = mesh.vertices[mesh.faces] - origin
    while len(corners) < FINE:
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
        inner = [np.stack([corners[:, k], middles[:, k], middles[:, k - 1]], axis=1) for k in range(3)]
        corners = np.concatenate([*inner, middles])
    volume = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    edges = (np.arange(SHELLS + 1) / SHELLS) ** (1.0 / 3.0)
    out = 0.75 * np.diff(edges**4) / np.diff(edges**3)
    points = (out[:, None, None] * corners.mean(axis=1)).reshape(-1, 3)
    weight = np.tile(volume / SHELLS, SHELLS)
    here = (normals @ points.T > (levels - normals @ origin)[:, None]).astype(np.float64)
    sums = here @ np.column_stack([weight, weight[:, None] * points])
    total = sums[:, 0]
    safe = np.where(np.abs(total) > EXACT * abs(float(volume.sum())), total, np.inf)
    return np.maximum(total, 0.0), origin + sums[:, 1:] / safe[:, None]
