"""Test structures as plain contact arrays, of any size: stacks, arches, walls, domes; planar or curved contacts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.geometry.cones import cross
from mocca_robot.statics.solver.system import ContactSystem

GRAVITY = 9.81
GRIDS = {10: (2, 5), 20: (4, 5), 40: (5, 8), 50: (5, 10), 200: (10, 20)}
"""Sample counts per joint and the grid that gives them."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """A structure of N parts with C contact rays.

    Attributes:
        name: for tables.
        pairs, points, normals: (C, 2), (C, 3), (C, 3) as `mocca_robot.statics.equilibrium` takes them.
        centroids: (N, 3).
        weights: (N,) newtons.
        free: (N,) parts that can move; the one that cannot is the ground.
    """

    name: str
    pairs: IntArray
    points: Array
    normals: Array
    centroids: Array
    weights: Array
    free: BoolArray

    @property
    def length(self) -> float:
        """Return the unit of length of the measure E, metres."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0))) / 2

    def wrenches(self, tilt_rad: float = 0.0, azimuth_rad: float = 0.0) -> Array:
        """Return (N, 6) weights about the origin, gravity tilted towards an azimuth."""
        side = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])
        down = np.array([0.0, 0.0, -1.0])
        force = self.weights[:, None] * (np.cos(tilt_rad) * down + np.sin(tilt_rad) * side)
        return np.concatenate([force, cross(self.centroids, force)], axis=1)

    @property
    def system(self) -> ContactSystem:
        """Return the contact system about the centroids."""
        return ContactSystem.build(self.pairs, self.points, self.normals, self.free, self.centroids, self.length)


@dataclass(frozen=True, eq=False)
class Interface:
    """A quadrilateral contact of parts (i, j): corners (4, 3) in cyclic order, unit normal from i into j."""

    parts: tuple[int, int]
    corners: Array
    normal: Array


def stack(blocks: int, samples: int = 0, shift: float = 0.05) -> Case:
    """Return unit cubes on top of each other, each shifted by `shift` of its width towards +x (limit 1/blocks)."""
    faces = []
    for k in range(blocks):
        # The bottom cube stands on the ground with its whole face, the others on what they share with the last.
        low, high = k * shift - 0.5 + (shift if k else 0.0), k * shift + 0.5
        low, high = (k * shift - 0.5, (k - 1) * shift + 0.5) if k else (-0.5, 0.5)
        faces.append(Interface((k, k + 1), _rectangle(low, high, -0.5, 0.5, float(k)), np.array([0.0, 0.0, 1.0])))
    centroids = np.array([[0.0, 0.0, -0.5]] + [[k * shift, 0.0, k + 0.5] for k in range(blocks)])
    return _case("stack", blocks, faces, centroids, np.ones(blocks), samples)


def arch(blocks: int, samples: int = 0, thickness: float = 0.12) -> Case:
    """Return a semicircular arch of mean radius 1 and the given thickness, springing from fixed ground."""
    angles = np.linspace(np.pi, 0.0, blocks + 1)
    inner, outer, half = 1 - thickness / 2, 1 + thickness / 2, 0.1
    faces, centroids = [], [np.array([0.0, 0.0, -1.0])]
    for k, a in enumerate(angles):
        radial = np.array([np.cos(a), 0.0, np.sin(a)])
        along = np.array([np.sin(a), 0.0, -np.cos(a)])  # towards the next voussoir
        y = np.array([0.0, half, 0.0])
        corners = np.array([inner * radial - y, outer * radial - y, outer * radial + y, inner * radial + y])
        faces.append(Interface((k, (k + 1) % (blocks + 1)), corners, along))
    step = np.pi / blocks
    reach = 2 / 3 * (outer**3 - inner**3) / (outer**2 - inner**2) * np.sin(step / 2) / (step / 2)
    for a in 0.5 * (angles[1:] + angles[:-1]):
        centroids.append(reach * np.array([np.cos(a), 0.0, np.sin(a)]))
    volume = (outer**2 - inner**2) * step / 2 * 2 * half
    return _case("arch", blocks, faces, np.array(centroids), np.full(blocks, volume), samples)


def wall(blocks: int, samples: int = 0) -> Case:
    """Return a running-bond wall of 2 × 1 × 1 bricks, ten to a course (150 blocks have 411 contacts)."""
    width = min(10, blocks)
    rows = blocks // width
    faces, centroids = [], [np.array([0.0, 0.0, -1.0])]
    x0 = [2.0 * c + 0.8 * (r % 2) for r in range(rows) for c in range(width)]
    z0 = [float(r) for r in range(rows) for c in range(width)]
    up, right = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    for b in range(rows * width):
        r, c = divmod(b, width)
        centroids.append(np.array([x0[b] + 1.0, 0.0, z0[b] + 0.5]))
        if c + 1 < width:
            x = x0[b] + 2.0
            corners = np.array([[x, -0.5, r], [x, 0.5, r], [x, 0.5, r + 1], [x, -0.5, r + 1]])
            faces.append(Interface((b + 1, b + 2), corners, right))
        if r == 0:
            faces.append(Interface((0, b + 1), _rectangle(x0[b], x0[b] + 2.0, -0.5, 0.5, 0.0), up))
        for below in range((r - 1) * width, r * width) if r else ():
            low, high = max(x0[b], x0[below]), min(x0[b], x0[below]) + 2.0
            if high - low > 0.5:
                faces.append(Interface((below + 1, b + 1), _rectangle(low, high, -0.5, 0.5, float(r)), up))
    n = rows * width
    return _case("wall", n, faces, np.array(centroids), np.full(n, 2.0), samples)


def dome(blocks: int, samples: int = 0, thickness: float = 0.15, rise_deg: float = 75.0) -> Case:
    """Return a spherical dome of mean radius 1 in rings of up to twenty blocks, open at the top."""
    around = min(20, max(4, blocks // 3))
    rings = blocks // around
    theta = np.linspace(0.0, np.deg2rad(rise_deg), rings + 1)  # elevation of the bed joints
    phi = np.linspace(0.0, 2 * np.pi, around + 1)
    radii = np.array([1 - thickness / 2, 1 + thickness / 2])

    def point(radius: float, t: float, p: float) -> Array:
        return np.array([radius * np.cos(t) * np.cos(p), radius * np.cos(t) * np.sin(p), radius * np.sin(t)])

    faces, centroids, weights = [], [np.array([0.0, 0.0, -1.0])], []
    for r in range(rings):
        low, high = theta[r], theta[r + 1]
        for k in range(around):
            me, p, q = 1 + r * around + k, phi[k], phi[k + 1]
            mid = 0.5 * (p + q)
            below = 0 if r == 0 else me - around
            bed = np.array([point(x, low, a) for x, a in zip(radii[[0, 1, 1, 0]], (p, p, q, q))])
            upward = np.array([-np.sin(low) * np.cos(mid), -np.sin(low) * np.sin(mid), np.cos(low)])
            faces.append(Interface((below, me), bed, _facing(bed, upward)))
            neighbour = 1 + r * around + (k + 1) % around
            head = np.array([point(x, t, q) for x, t in zip(radii[[0, 1, 1, 0]], (low, low, high, high))])
            faces.append(Interface((me, neighbour), head, np.array([-np.sin(q), np.cos(q), 0.0])))
            centroids.append(point(1.0, 0.5 * (low + high), mid) * np.sinc((q - p) / 2 / np.pi))
            weights.append((np.sin(high) - np.sin(low)) * (q - p) * np.ptp(radii**3) / 3)
    return _case("dome", rings * around, faces, np.array(centroids), np.array(weights), samples)


KINDS: dict[str, Callable[..., Case]] = {"stack": stack, "arch": arch, "wall": wall, "dome": dome}


def _case(kind: str, blocks: int, faces: Sequence[Interface], centroids: Array, volumes: Array, samples: int) -> Case:
    rays = [_rays(face, samples) for face in faces]
    pairs = np.concatenate([np.tile(f.parts, (len(p), 1)) for f, (p, _) in zip(faces, rays)])
    free = np.ones(len(centroids), dtype=np.bool_)
    free[0] = False
    weights = np.r_[0.0, volumes] * 1000.0 * GRAVITY
    name = f"{kind}-{blocks}-{f'{samples}' if samples else 'planar'}"
    points, normals = (np.concatenate(x) for x in zip(*rays))
    return Case(name=name, pairs=pairs, points=points, normals=normals, centroids=centroids, weights=weights, free=free)


def _rays(face: Interface, samples: int, bulge: float = 0.15) -> tuple[Array, Array]:
    """Return the corners of a flat interface, or `samples` points and normals of a smooth bump over it."""
    if samples == 0:
        return face.corners, np.tile(face.normal, (4, 1))
    rows, columns = GRIDS[samples]
    s, t = (x.ravel() for x in np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij"))
    a, b, c, d = face.corners
    e1, e2 = (b + c - a - d) / 4, (c + d - a - b) / 4  # half-axes of the quadrilateral
    flat = sum(
        w[:, None] * corner
        for w, corner in zip(
            ((1 - s) * (1 - t) / 4, (1 + s) * (1 - t) / 4, (1 + s) * (1 + t) / 4, (1 - s) * (1 + t) / 4), (a, b, c, d)
        )
    )
    height = bulge * np.sqrt(np.linalg.norm(e1) * np.linalg.norm(e2))
    ds, dt = -2 * s * (1 - t**2) * height, -2 * t * (1 - s**2) * height
    # Reciprocal axes turn the derivatives along s and t into a gradient in the plane of the contact.
    r1, r2 = np.linalg.pinv(np.stack([e1, e2])).T
    normals = face.normal - ds[:, None] * r1 - dt[:, None] * r2
    points = np.asarray(flat) + (height * (1 - s**2) * (1 - t**2))[:, None] * face.normal
    return points, normals / np.linalg.norm(normals, axis=1)[:, None]


def _rectangle(x0: float, x1: float, y0: float, y1: float, z: float) -> Array:
    return np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]])


def _facing(corners: Array, direction: Array) -> Array:
    """Return the unit normal of the best plane through `corners` that looks along `direction`."""
    normal = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    normal /= np.linalg.norm(normal)
    return np.asarray(normal if normal @ direction > 0 else -normal)
