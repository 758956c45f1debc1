"""Small solid assemblies whose geometry is known by hand."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.contacts.contact import Contact

BOX_FACES = np.array(
    [
        *([0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]),
        *([1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]),
    ]
)


def hexahedron(corners: Array) -> Mesh:
    """Return the solid over eight corners: four counter-clockwise from outside below, four above; any handedness."""
    mesh = Mesh(corners, BOX_FACES)
    return mesh if mesh.volume > 0 else Mesh(corners, BOX_FACES[:, ::-1])


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    """Return an axis-parallel box."""
    (a, b, c), (d, e, f) = low, high
    return hexahedron(
        np.array([[a, b, c], [d, b, c], [d, e, c], [a, e, c], [a, b, f], [d, b, f], [d, e, f], [a, e, f]], dtype=float)
    )


def wall(rows: int = 3, columns: int = 3) -> Assembly:
    """Return blocks in running bond on a slab: T-junctions, partial overlaps, several neighbours per face."""
    parts = [Part("slab", box((-0.3, -0.1, -0.1), (0.2 * columns + 0.2, 0.2, 0.0)), fixed=True)]
    for r in range(rows):
        for k in range(columns):
            x = 0.2 * k - 0.1 * (r % 2)
            parts.append(Part(f"b{r}{k}", box((x, 0.0, 0.1 * r), (x + 0.2, 0.1, 0.1 * r + 0.1))))
    return Assembly("wall", tuple(parts))


def dome(rings: int = 2, around: int = 7) -> Assembly:
    """Return wedges cut along meridians and cones, stacked in rings without a slab; the lowest ring is fixed."""
    polar = np.deg2rad(np.linspace(0.0, 50.0, rings + 1))

    def at(radius: float, theta: float, phi: float) -> list[float]:
        return [
            radius * np.cos(theta) * np.cos(phi),
            radius * np.cos(theta) * np.sin(phi),
            radius * np.sin(theta),
        ]

    parts = []
    for r in range(rings):
        for k in range(around):
            p, q = 2 * np.pi * k / around, 2 * np.pi * (k + 1) / around
            corners = [at(s, t, f) for t in polar[r : r + 2] for s, f in ((1.0, p), (1.0, q), (1.2, q), (1.2, p))]
            parts.append(Part(f"w{r}{k}", hexahedron(np.array(corners)), fixed=r == 0))
    return Assembly("dome", tuple(parts))


def flat_contact(ring: list[tuple[float, float]], holes: list[list[tuple[float, float]]] | None = None) -> Contact:
    """Return a contact in the x–y plane whose normal is +z."""

    def lift(points: list[tuple[float, float]]) -> Array:
        return np.c_[np.array(points, dtype=float), np.zeros(len(points))]

    return Contact((0, 1), lift(ring), np.array([0.0, 0.0, 1.0]), 0, tuple(lift(h) for h in holes or []))


def rotation(seed: int) -> Array:
    """Return a random rotation matrix (3, 3)."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return np.asarray(q if np.linalg.det(q) > 0 else -q)
