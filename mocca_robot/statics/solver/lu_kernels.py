"""A matrix of sparse block columns that is not symmetric: compiled assembly, LU factor and substitution.

Blocks lie as in `sparse_kernels`: column j has its diagonal block and those below it in the rows rows[starts[j]] = j …
ascending. Two arrays (blocks, dof, dof) hold them: `low` what is on and below the diagonal, `up` at the same place the
block across the diagonal. Blocks are not exchanged, rows within the diagonal ones are.
"""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.runtime.compiled import compiled


@compiled
def assemble(
    diagonal: Array,
    grams: Array,
    first: IntArray,
    second: IntArray,
    place: IntArray,
    starts: IntArray,
    below: IntArray,
    low: Array,
    up: Array,
) -> None:
    """Set `low` and `up` to the matrix with the blocks `diagonal` and +H_p on, −H_p off its diagonal blocks."""
    free = len(diagonal)
    low[:] = 0.0
    up[:] = 0.0
    for f in range(free):
        low[starts[place[f]]] += diagonal[f]
    for p in range(len(grams)):
        i, j = first[p], second[p]
        if i < free:
            low[starts[place[i]]] += grams[p]
        if j < free:
            low[starts[place[j]]] += grams[p]
        if i < free and j < free:
            slot = starts[min(place[i], place[j])] + below[p]
            low[slot] -= grams[p]
            up[slot] -= grams[p]


@compiled
def factorize(starts: IntArray, rows: IntArray, low: Array, up: Array) -> None:
    """Turn a matrix as in `assemble` into its factor: inverse diagonal blocks, and below them L = A D⁻¹."""
    dof = low.shape[1]
    room = np.empty((dof, dof))
    for j in range(len(starts) - 1):
        begin, count = starts[j], starts[j + 1] - starts[j]
        _invert(low[begin], room)
        for p in range(1, count):
            _times(low[begin + p], low[begin], room)
        for p in range(1, count):
            column, at = rows[begin + p], 0
            for q in range(p, count):
                while rows[starts[column] + at] != rows[begin + q]:
                    at += 1
                slot = starts[column] + at
                _take_off(low[begin + q], up[begin + p], low[slot])
                if q > p:
                    _take_off(low[begin + p], up[begin + q], up[slot])


@compiled
def _invert(a: Array, room: Array) -> None:
    """Turn a block into its inverse, by elimination with exchange of rows."""
    dof = len(a)
    for i in range(dof):
        for k in range(dof):
            room[i, k] = 1.0 if i == k else 0.0
    for c in range(dof):
        pivot = c
        for i in range(c + 1, dof):
            if abs(a[i, c]) > abs(a[pivot, c]):
                pivot = i
        for k in range(dof):
            a[c, k], a[pivot, k] = a[pivot, k], a[c, k]
            room[c, k], room[pivot, k] = room[pivot, k], room[c, k]
        scale = 1.0 / a[c, c] if a[c, c] != 0.0 else 1e300
        for k in range(dof):
            a[c, k] *= scale
            room[c, k] *= scale
        for i in range(dof):
            factor = a[i, c]
            if i != c and factor != 0.0:
                for k in range(dof):
                    a[i, k] -= factor * a[c, k]
                    room[i, k] -= factor * room[c, k]
    a[:] = room


@compiled
def _times(a: Array, b: Array, room: Array) -> None:
    """Turn a into a b."""
    dof = len(a)
    for i in range(dof):
        for k in range(dof):
            total = 0.0
            for m in range(dof):
                total += a[i, m] * b[m, k]
            room[i, k] = total
    a[:] = room


@compiled
def _take_off(a: Array, b: Array, c: Array) -> None:
    """Take a b off c."""
    if len(a) == 3:
        for i in range(3):
            x, y, t = a[i, 0], a[i, 1], a[i, 2]
            for k in range(3):
                c[i, k] -= x * b[0, k] + y * b[1, k] + t * b[2, k]
    else:
        for i in range(6):
            x, y, z, t, u, v = a[i, 0], a[i, 1], a[i, 2], a[i, 3], a[i, 4], a[i, 5]
            for k in range(6):
                c[i, k] -= x * b[0, k] + y * b[1, k] + z * b[2, k] + t * b[3, k] + u * b[4, k] + v * b[5, k]


@compiled
def substitute(
    starts: IntArray, rows: IntArray, low: Array, up: Array, place: IntArray, right: Array, out: Array
) -> None:
    """Set `out` (n,) to the solution for `right` (n,), from what `factorize` left."""
    count, dof = len(starts) - 1, low.shape[1]
    x, rest = np.empty((count, dof)), np.empty(dof)
    for f in range(count):
        for a in range(dof):
            x[place[f], a] = right[f * dof + a]
    for j in range(count):
        for slot in range(starts[j] + 1, starts[j + 1]):
            for a in range(dof):
                total = 0.0
                for b in range(dof):
                    total += low[slot, a, b] * x[j, b]
                x[rows[slot], a] -= total
    for j in range(count - 1, -1, -1):
        for a in range(dof):
            rest[a] = x[j, a]
        for slot in range(starts[j] + 1, starts[j + 1]):
            for a in range(dof):
                total = 0.0
                for b in range(dof):
                    total += up[slot, a, b] * x[rows[slot], b]
                rest[a] -= total
        for a in range(dof):
            total = 0.0
            for b in range(dof):
                total += low[starts[j], a, b] * rest[b]
            x[j, a] = total
    for f in range(count):
        for a in range(dof):
            out[f * dof + a] = x[place[f], a]
