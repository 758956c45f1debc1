"""The normal matrix of Eq. 7 in a band: compiled assembly from the pairs' blocks, Cholesky factor and substitution."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.runtime.compiled import compiled


@compiled
def assemble(diagonal: Array, grams: Array, first: IntArray, second: IntArray, place: IntArray, band: Array) -> None:
    """Set the lower band (n, width + 1) of the matrix with `diagonal` and +H_p on, −H_p off its diagonal blocks.

    band[c, r − c] is the entry in row r and column c. Free part f has the unknowns dof·place[f] ….
    """
    free = len(diagonal)
    band[:] = 0.0
    for f in range(free):
        _add(band, place[f], place[f], diagonal[f], 1.0)
    for p in range(len(grams)):
        i, j = first[p], second[p]
        if i < free:
            _add(band, place[i], place[i], grams[p], 1.0)
        if j < free:
            _add(band, place[j], place[j], grams[p], 1.0)
        if i < free and j < free:
            _add(band, max(place[i], place[j]), min(place[i], place[j]), grams[p], -1.0)


@compiled
def _add(band: Array, row: int, column: int, block: Array, sign: float) -> None:
    """Add a symmetric block to a place on or below the diagonal."""
    dof = len(block)
    for b in range(dof):
        for a in range(b if row == column else 0, dof):
            band[column * dof + b, (row - column) * dof + a - b] += sign * block[a, b]


@compiled
def factorize(band: Array, ends: IntArray) -> int:
    """Turn a band as in `assemble` into its Cholesky factor; return 0, or which pivot, from 1, is not positive.

    Column c of part k = c // dof has nothing, and the factor neither, below row ends[k] − 1. Using that, and taking off
    all columns of a part at once, takes two thirds of the time of LAPACK's factorization where the band is narrow, and
    as long where it is wide.
    """
    n, dof = len(band), len(band) // max(len(ends), 1)
    part = np.zeros((dof, band.shape[1]))  # its columns, row by row: [c, r − first] is the entry in row r
    for first in range(0, n, dof):
        rows = ends[first // dof] - first
        for c in range(dof):
            column, copy = band[first + c, : rows - c], part[c, c:rows]
            if not column[0] > 0.0:
                return first + c + 1
            scale = 1.0 / np.sqrt(column[0])
            for k in range(rows - c):
                scaled = column[k] * scale
                column[k] = scaled
                copy[k] = scaled
            for later in range(c + 1, dof):
                factor, rest, column = part[c, later], band[first + later, : rows - later], part[c, later:rows]
                for k in range(rows - later):
                    rest[k] -= factor * column[k]
        for r in range(dof, rows):
            rest = band[first + r, : rows - r]
            if dof == 3:
                x, y, t = part[0, r:rows], part[1, r:rows], part[2, r:rows]
                x0, y0, t0 = x[0], y[0], t[0]
                for k in range(rows - r):
                    rest[k] -= x0 * x[k] + y0 * y[k] + t0 * t[k]
            else:
                x, y, z = part[0, r:rows], part[1, r:rows], part[2, r:rows]
                t, u, v = part[3, r:rows], part[4, r:rows], part[5, r:rows]
                x0, y0, z0, t0, u0, v0 = x[0], y[0], z[0], t[0], u[0], v[0]
                for k in range(rows - r):
                    rest[k] -= x0 * x[k] + y0 * y[k] + z0 * z[k] + t0 * t[k] + u0 * u[k] + v0 * v[k]
    return 0


@compiled
def substitute(band: Array, ends: IntArray, position: IntArray, right: Array, out: Array) -> None:
    """Set `out` (n,) to the solution of LLᵀ x = right, L from `factorize`, its rows where `position` (n,) says."""
    n, dof = len(right), len(right) // max(len(ends), 1)
    x = np.empty(n)
    for r in range(n):
        x[position[r]] = right[r]
    for c in range(n):
        end = ends[c // dof]
        x[c] /= band[c, 0]
        rest, column, solved = x[c + 1 : end], band[c, 1 : end - c], x[c]
        for k in range(len(rest)):
            rest[k] -= solved * column[k]
    for c in range(n - 1, -1, -1):
        end = ends[c // dof]
        known, column, total = x[c + 1 : end], band[c, 1 : end - c], 0.0
        for k in range(len(known)):
            total += column[k] * known[k]
        x[c] = (x[c] - total) / band[c, 0]
    for r in range(n):
        out[r] = x[position[r]]
