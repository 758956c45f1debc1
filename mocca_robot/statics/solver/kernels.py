"""Compiled passes over the contact rays of Eq. 7: what numpy would do in ten passes over memory, in one.

Everywhere: `rays` (dof, M) holds one ray a column, sorted by pair, pair p in the columns starts[p] … starts[p + 1];
s, z, d = z/s, ds, dz and the like hold one number a column, a motion or wrench of all pairs is (P, dof).
"""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.runtime.compiled import compiled


@compiled
def columns(pairs_rays: Array, order: IntArray, starts: IntArray, offsets: Array, out: Array) -> None:
    """Set `out` (dof, M) to the rays [n; (r − a) × n / L] of `order` about points that lie −offset·L from their a.

    `pairs_rays` is (C, dof), `offsets` (P, d) belongs to the second part of every pair.
    """
    planar = pairs_rays.shape[1] == 3
    for p in range(len(starts) - 1):
        offset = offsets[p]
        for k in range(starts[p], starts[p + 1]):
            ray = pairs_rays[order[k]]
            for a in range(len(ray)):
                out[a, k] = ray[a]
            if planar:
                out[2, k] += offset[0] * ray[1] - offset[1] * ray[0]
            else:
                out[3, k] += offset[1] * ray[2] - offset[2] * ray[1]
                out[4, k] += offset[2] * ray[0] - offset[0] * ray[2]
                out[5, k] += offset[0] * ray[1] - offset[1] * ray[0]


@compiled
def relative(motions: Array, first: IntArray, second: IntArray, out: Array) -> None:
    """Set `out` (P, dof) to the motion of j less that of i, from `motions` (F·dof,); other parts than F stand still."""
    dof = out.shape[1]
    free = len(motions) // dof
    for p in range(len(first)):
        i, j = first[p], second[p]
        for a in range(dof):
            out[p, a] = (motions[j * dof + a] if j < free else 0.0) - (motions[i * dof + a] if i < free else 0.0)


@compiled
def gather(wrenches: Array, first: IntArray, second: IntArray, out: Array) -> None:
    """Set `out` (F·dof,) to the sum on every free part of its pairs' wrenches (P, dof): + on j, − on i."""
    dof = wrenches.shape[1]
    out[:] = 0.0
    for p in range(len(first)):
        i, j = first[p], second[p]
        for a in range(dof):
            if j * dof < len(out):
                out[j * dof + a] += wrenches[p, a]
            if i * dof < len(out):
                out[i * dof + a] -= wrenches[p, a]


# Vectors are used where the compiler sees slices of known stride that are indexed from zero: rays[a, mine], then [k].


@compiled
def _times(rays: Array, mine: slice, motion: Array, out: Array) -> None:
    for a in range(len(rays)):
        ray, factor = rays[a, mine], motion[a]
        for k in range(len(out)):
            out[k] += factor * ray[k]


@compiled
def _sum(ray: Array, y: Array) -> float:
    total = 0.0
    for k in range(len(y)):
        total += ray[k] * y[k]
    return total


@compiled
def _gram(rays: Array, mine: slice, d: Array, room: Array, out: Array) -> None:
    for a in range(len(rays)):
        ray, weighted = rays[a, mine], room[: len(d)]
        for k in range(len(d)):
            weighted[k] = ray[k] * d[k]
        for b in range(a + 1):
            out[a, b] = out[b, a] = _sum(rays[b, mine], weighted)


@compiled
def _room(starts: IntArray) -> Array:
    longest = 0
    for p in range(len(starts) - 1):
        longest = max(longest, starts[p + 1] - starts[p])
    return np.empty(longest)


@compiled
def times(rays: Array, starts: IntArray, relative: Array, out: Array) -> None:
    """Set `out` (M,) to every ray times the relative motion of its pair."""
    out[:] = 0.0
    for p in range(len(starts) - 1):
        mine = slice(starts[p], starts[p + 1])
        _times(rays, mine, relative[p], out[mine])


@compiled
def wrenches(rays: Array, starts: IntArray, y: Array, out: Array) -> None:
    """Set `out` (P, dof) to the sum of every pair's rays times y (M,)."""
    for p in range(len(starts) - 1):
        mine = slice(starts[p], starts[p + 1])
        for a in range(len(rays)):
            out[p, a] = _sum(rays[a, mine], y[mine])


@compiled
def gram(rays: Array, starts: IntArray, d: Array, out: Array) -> None:
    """Set `out` (P, dof, dof) to H_p = R_pᵀ diag(d) R_p for weights d (M,)."""
    room = _room(starts)
    for p in range(len(starts) - 1):
        mine = slice(starts[p], starts[p + 1])
        _gram(rays, mine, d[mine], room, out[p])


@compiled
def advance(
    rays: Array,
    starts: IntArray,
    all_s: Array,
    all_z: Array,
    all_ds: Array,
    all_dz: Array,
    length: float,
    all_d: Array,
    z_wrenches: Array,
    grams: Array,
) -> tuple[float, float]:
    """Go `length` along ds and dz, set d = z/s, every pair's wrench of z, and its H_p; return sᵀz and the largest d."""
    gap, largest = 0.0, 0.0
    room = _room(starts)
    for p in range(len(starts) - 1):
        mine = slice(starts[p], starts[p + 1])
        s, z, ds, dz, d = all_s[mine], all_z[mine], all_ds[mine], all_dz[mine], all_d[mine]
        for k in range(len(s)):
            s[k] += length * ds[k]
            z[k] += length * dz[k]
            d[k] = z[k] / s[k]
            gap += s[k] * z[k]
            largest = max(largest, d[k])
        for a in range(len(rays)):
            z_wrenches[p, a] = _sum(rays[a, mine], z)
        _gram(rays, mine, d, room, grams[p])
    return gap, largest


@compiled
def predict(
    rays: Array,
    starts: IntArray,
    relative: Array,
    all_s: Array,
    all_z: Array,
    missing: Array,
    targets: Array,
    target_wrenches: Array,
    inverse_wrenches: Array,
) -> tuple[float, float]:
    """Look along the direction that heads straight for s∘z = 0: with r = ds/s it has dz = −z (1 + r).

    Set target = z + ds∘dz/s, and every pair's wrenches of it and of 1/s; the corrector wants target − μ/s. Return the
    steepest descent, as `direction` does, and dsᵀdz.
    """
    lowest, highest, product = 0.0, 0.0, 0.0
    room = _room(starts)
    targets[:] = missing
    for p in range(len(starts) - 1):
        mine = slice(starts[p], starts[p + 1])
        s, z, target, inverse = all_s[mine], all_z[mine], targets[mine], room[: starts[p + 1] - starts[p]]
        _times(rays, mine, relative[p], target)
        for k in range(len(s)):
            inverse[k] = 1.0 / s[k]
            r = target[k] * inverse[k]
            lowest = min(lowest, r)
            highest = max(highest, r)
            second = z[k] * (r + r * r)
            product -= s[k] * second
            target[k] = z[k] - second
        for a in range(len(rays)):
            target_wrenches[p, a] = _sum(rays[a, mine], target)
            inverse_wrenches[p, a] = _sum(rays[a, mine], inverse)
    return min(lowest, -1.0 - highest), product


@compiled
def direction(
    rays: Array,
    starts: IntArray,
    relative: Array,
    all_s: Array,
    all_z: Array,
    all_d: Array,
    missing: Array,
    targets: Array,
    mu: float,
    all_ds: Array,
    all_dz: Array,
) -> float:
    """Take μ/s off the target, set ds = R relative + missing and dz = −target − d∘ds; return their steepest descent.

    That is the smallest of ds/s and dz/z: a step of −1 over it reaches the boundary.
    """
    steepest = 0.0
    all_ds[:] = missing
    for p in range(len(starts) - 1):
        mine = slice(starts[p], starts[p + 1])
        s, z, d, target, ds, dz = all_s[mine], all_z[mine], all_d[mine], targets[mine], all_ds[mine], all_dz[mine]
        _times(rays, mine, relative[p], ds)
        for k in range(len(s)):
            target[k] -= mu / s[k]
            dz[k] = -target[k] - d[k] * ds[k]
            steepest = min(steepest, min(ds[k] / s[k], dz[k] / z[k]))
    return steepest


@compiled
def refine(
    rays: Array,
    starts: IntArray,
    relative: Array,
    all_s: Array,
    all_z: Array,
    all_d: Array,
    all_ds: Array,
    all_dz: Array,
) -> float:
    """Add R relative to ds and −d∘(R relative) to dz; return their steepest descent, as `direction` does."""
    steepest = 0.0
    room = _room(starts)
    for p in range(len(starts) - 1):
        mine = slice(starts[p], starts[p + 1])
        s, z, d, ds, dz = all_s[mine], all_z[mine], all_d[mine], all_ds[mine], all_dz[mine]
        change = room[: len(s)]
        change[:] = 0.0
        _times(rays, mine, relative[p], change)
        for k in range(len(s)):
            ds[k] += change[k]
            dz[k] -= d[k] * change[k]
            steepest = min(steepest, min(ds[k] / s[k], dz[k] / z[k]))
    return steepest


@compiled
def gram_of_cones(rays: Array, starts: IntArray, all_b: Array, sizes: Array, out: Array) -> None:
    """Set `out` (P, dof, dof) to the sums over a pair's contacts of Gᵀ size (2 b bᵀ − J) G, J = diag(1, −1, −1).

    A contact has three columns, b (3, M/3) and size (M/3,) belong to contacts.
    """
    room = _room(starts)
    for p in range(len(starts) - 1):
        mine, contacts = slice(starts[p], starts[p + 1]), slice(starts[p] // 3, starts[p + 1] // 3)
        b, size, weighted = all_b[:, contacts], sizes[contacts], room[: starts[p + 1] - starts[p]]
        for i in range(len(rays)):
            ray = rays[i, mine]
            for c in range(len(size)):
                normal, one, two = ray[3 * c], ray[3 * c + 1], ray[3 * c + 2]
                along = 2.0 * (normal * b[0, c] + one * b[1, c] + two * b[2, c])
                weighted[3 * c] = size[c] * (along * b[0, c] - normal)
                weighted[3 * c + 1] = size[c] * (along * b[1, c] + one)
                weighted[3 * c + 2] = size[c] * (along * b[2, c] + two)
            for j in range(i + 1):
                out[p, i, j] = out[p, j, i] = _sum(rays[j, mine], weighted)
