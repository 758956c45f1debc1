"""Compiled passes over contacts that are second-order cones with compliance; conventions as in `kernels`."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.runtime.compiled import compiled


@compiled
def stiffness(b: Array, eta: Array, c: Array, out: Array) -> None:
    """Set `out` (6, contacts) to the symmetric (W² + C)⁻¹: rows 00, 01, 02, 11, 12, 22.

    W² = η² (2 b bᵀ − J), C = diag(c) with equal tangential entries. In the plane of the normal and b's tangential
    direction the determinant is a sum of positive terms, so that nothing cancels however near a cone's boundary.
    """
    for k in range(b.shape[1]):
        across = np.sqrt(b[1, k] ** 2 + b[2, k] ** 2)
        x, y = (b[1, k] / across, b[2, k] / across) if across > 0.0 else (1.0, 0.0)
        size, c0, c1 = eta[k] ** 2, c[0, k], c[1, k]
        long = size * (1.0 + 2.0 * across**2)
        off = 2.0 * size * across * np.sqrt(1.0 + across**2)
        det = size**2 + long * (c0 + c1) + c0 * c1
        normal, along, mixed, beside = (long + c1) / det, (long + c0) / det, -off / det, 1.0 / (size + c1)
        out[0, k] = normal
        out[1, k] = mixed * x
        out[2, k] = mixed * y
        out[3, k] = along * x * x + beside * y * y
        out[4, k] = (along - beside) * x * y
        out[5, k] = along * y * y + beside * x * x


@compiled
def apply(h: Array, x: Array) -> Array:
    """Return (3, contacts) the symmetric matrices h (6, contacts) times x (3, contacts)."""
    out = np.empty_like(x)
    for k in range(x.shape[1]):
        out[0, k] = h[0, k] * x[0, k] + h[1, k] * x[1, k] + h[2, k] * x[2, k]
        out[1, k] = h[1, k] * x[0, k] + h[3, k] * x[1, k] + h[4, k] * x[2, k]
        out[2, k] = h[2, k] * x[0, k] + h[4, k] * x[1, k] + h[5, k] * x[2, k]
    return out


@compiled
def gram_of_stiffness(rays: Array, starts: IntArray, h: Array, out: Array) -> None:
    """Set `out` (P, dof, dof) to the sums over a pair's contacts of Gᵀ h G, h (6, contacts) symmetric."""
    longest = 0
    for p in range(len(starts) - 1):
        longest = max(longest, starts[p + 1] - starts[p])
    room = np.empty(longest)
    for p in range(len(starts) - 1):
        mine = slice(starts[p], starts[p + 1])
        count, begin = (starts[p + 1] - starts[p]) // 3, starts[p] // 3
        weighted = room[: 3 * count]
        for i in range(len(rays)):
            ray = rays[i, mine]
            for c in range(count):
                k = begin + c
                normal, one, two = ray[3 * c], ray[3 * c + 1], ray[3 * c + 2]
                weighted[3 * c] = h[0, k] * normal + h[1, k] * one + h[2, k] * two
                weighted[3 * c + 1] = h[1, k] * normal + h[3, k] * one + h[4, k] * two
                weighted[3 * c + 2] = h[2, k] * normal + h[4, k] * one + h[5, k] * two
            for j in range(i + 1):
                other = rays[j, mine]
                total = 0.0
                for k in range(3 * count):
                    total += other[k] * weighted[k]
                out[p, i, j] = out[p, j, i] = total


@compiled
def coulomb(
    rays: Array, starts: IntArray, relative: Array, c: Array, overlap: Array, x: Array, z: Array, grams: Array
) -> None:
    """Set what Coulomb's law makes of relative motions (P, dof): x, z (3, contacts), and Gᵀ (−dz/dx) G of every pair.

    x = G u less the overlap (contacts,) along the normal that was there before; the normal spring presses with
    z₀ = −x₀/c₀, the tangential one sticks or slides: |z_t| ≤ z₀, against x_t.
    """
    longest = 0
    for p in range(len(starts) - 1):
        longest = max(longest, starts[p + 1] - starts[p])
    room = np.empty((longest, len(rays)))
    h = np.empty((3, 3))
    for p in range(len(starts) - 1):
        count, begin = (starts[p + 1] - starts[p]) // 3, starts[p] // 3
        for c_ in range(count):
            k, at = begin + c_, starts[p] + 3 * c_
            for row in range(3):
                total = 0.0
                for a in range(len(rays)):
                    total += rays[a, at + row] * relative[p, a]
                x[row, k] = total
            x[0, k] -= overlap[k]
            _law(x[:, k], c[:, k], z[:, k], h)
            for row in range(3):
                for a in range(len(rays)):
                    total = 0.0
                    for other in range(3):
                        total += h[row, other] * rays[a, at + other]
                    room[3 * c_ + row, a] = total
        for i in range(len(rays)):
            ray = rays[i, starts[p] : starts[p + 1]]
            for j in range(len(rays)):
                total = 0.0
                for k in range(3 * count):
                    total += ray[k] * room[k, j]
                grams[p, i, j] = total


@compiled
def _law(x: Array, c: Array, z: Array, h: Array) -> None:
    """Set the force z (3,) of one contact and h = −dz/dx (3, 3)."""
    h[:] = 0.0
    if x[0] >= 0.0:
        z[:] = 0.0
        return
    z[0], h[0, 0] = -x[0] / c[0], 1.0 / c[0]
    z[1], z[2] = -x[1] / c[1], -x[2] / c[1]
    trial = np.sqrt(z[1] ** 2 + z[2] ** 2)
    if trial <= z[0]:
        h[1, 1] = h[2, 2] = 1.0 / c[1]
        return
    d1, d2 = z[1] / trial, z[2] / trial
    share = z[0] / (trial * c[1])
    z[1], z[2] = z[0] * d1, z[0] * d2
    h[1, 0], h[2, 0] = d1 / c[0], d2 / c[0]
    h[1, 1], h[1, 2], h[2, 2] = share * d2 * d2, -share * d1 * d2, share * d1 * d1
    h[2, 1] = h[1, 2]
