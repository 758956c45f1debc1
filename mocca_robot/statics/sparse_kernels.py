"""The normal matrix of Eq. 7 in sparse block columns: compiled assembly, Cholesky factor and substitution.

Everywhere: column j of blocks has its diagonal block and those below it in the rows rows[starts[j]] = j … ascending,
as they are once everything is filled in. Its numbers are a matrix (dof, dof·blocks), one column of the matrix a row,
from values[dof²·starts[j]] on. Free part f has the column place[f].
"""

from __future__ import annotations

import numpy as np

from mocca_robot.assembly import Array, IntArray
from mocca_robot.statics.compiled import compiled


@compiled
def assemble(
    mass: Array,
    grams: Array,
    first: IntArray,
    second: IntArray,
    place: IntArray,
    starts: IntArray,
    below: IntArray,
    values: Array,
) -> None:
    """Set `values` to the matrix with `mass` and +H_p on, −H_p off its diagonal blocks.

    below[p] is which block of its column the one of pair p is; 0 where one of the two is not free.
    """
    free = len(mass)
    values[:] = 0.0
    for f in range(free):
        _add(values, starts, place[f], 0, mass[f], 1.0)
    for p in range(len(grams)):
        i, j = first[p], second[p]
        if i < free:
            _add(values, starts, place[i], 0, grams[p], 1.0)
        if j < free:
            _add(values, starts, place[j], 0, grams[p], 1.0)
        if i < free and j < free:
            _add(values, starts, min(place[i], place[j]), below[p], grams[p], -1.0)


@compiled
def _add(values: Array, starts: IntArray, column: int, row: int, block: Array, sign: float) -> None:
    """Add a symmetric block to one of a column."""
    dof = len(block)
    begin, high = dof * dof * starts[column], dof * (starts[column + 1] - starts[column])
    for b in range(dof):
        for a in range(dof):
            values[begin + b * high + row * dof + a] += sign * block[a, b]


@compiled
def _longest(starts: IntArray) -> int:
    blocks = 0
    for j in range(len(starts) - 1):
        blocks = max(blocks, starts[j + 1] - starts[j])
    return blocks


@compiled
def factorize(starts: IntArray, rows: IntArray, dof: int, values: Array) -> int:
    """Turn a matrix as in `assemble` into its Cholesky factor; return 0, or which pivot, from 1, is not positive.

    Every column that is done is taken off all that it reaches; blocks that follow one another in both go together.
    """
    count = len(starts) - 1
    room = np.empty((dof, dof * _longest(starts)))
    for j in range(count):
        blocks = starts[j + 1] - starts[j]
        high, begin, mine = dof * blocks, dof * dof * starts[j], rows[starts[j] : starts[j + 1]]
        for c in range(dof):
            column, copy = values[begin + c * high : begin + (c + 1) * high], room[c, :high]
            if not column[c] > 0.0:
                return j * dof + c + 1
            scale = 1.0 / np.sqrt(column[c])
            for k in range(high):
                scaled = column[k] * scale
                column[k] = scaled
                copy[k] = scaled
            for later in range(c + 1, dof):
                factor, rest = copy[later], values[begin + later * high : begin + (later + 1) * high]
                for k in range(high):
                    rest[k] -= factor * copy[k]
        for p in range(1, blocks):
            i = mine[p]
            theirs = rows[starts[i] : starts[i + 1]]
            high, begin = dof * len(theirs), dof * dof * starts[i]
            q, at = p, 0
            while q < blocks:
                while theirs[at] != mine[q]:
                    at += 1
                run = 1
                while q + run < blocks and theirs[at + run] == mine[q + run]:
                    run += 1
                low, up = q * dof, (q + run) * dof
                for b in range(dof):
                    rest = values[begin + b * high + at * dof : begin + b * high + (at + run) * dof]
                    row = p * dof + b
                    if dof == 3:
                        x, y, t = room[0, low:up], room[1, low:up], room[2, low:up]
                        x0, y0, t0 = room[0, row], room[1, row], room[2, row]
                        for k in range(len(rest)):
                            rest[k] -= x0 * x[k] + y0 * y[k] + t0 * t[k]
                    else:
                        x, y, z = room[0, low:up], room[1, low:up], room[2, low:up]
                        t, u, v = room[3, low:up], room[4, low:up], room[5, low:up]
                        x0, y0, z0 = room[0, row], room[1, row], room[2, row]
                        t0, u0, v0 = room[3, row], room[4, row], room[5, row]
                        for k in range(len(rest)):
                            rest[k] -= x0 * x[k] + y0 * y[k] + z0 * z[k] + t0 * t[k] + u0 * u[k] + v0 * v[k]
                q, at = q + run, at + run
    return 0


@compiled
def substitute(
    starts: IntArray, rows: IntArray, dof: int, values: Array, place: IntArray, right: Array, out: Array
) -> None:
    """Set `out` (n,) to the solution of LLᵀ x = right, L from `factorize`, its rows where `place` says."""
    count = len(starts) - 1
    x, room = np.empty(count * dof), np.empty(dof * _longest(starts))
    for f in range(count):
        for a in range(dof):
            x[place[f] * dof + a] = right[f * dof + a]
    for j in range(count):
        mine = rows[starts[j] : starts[j + 1]]
        high, begin = dof * len(mine), dof * dof * starts[j]
        taken_off = room[:high]
        taken_off[:] = 0.0
        for c in range(dof):
            column = values[begin + c * high : begin + (c + 1) * high]
            known = (x[j * dof + c] - taken_off[c]) / column[c]
            x[j * dof + c] = known
            for k in range(high):
                taken_off[k] += known * column[k]
        for p in range(1, len(mine)):
            for a in range(dof):
                x[mine[p] * dof + a] -= taken_off[p * dof + a]
    for j in range(count - 1, -1, -1):
        mine = rows[starts[j] : starts[j + 1]]
        high, begin = dof * len(mine), dof * dof * starts[j]
        reached = room[:high]
        for p in range(len(mine)):
            for a in range(dof):
                reached[p * dof + a] = x[mine[p] * dof + a]
        for c in range(dof - 1, -1, -1):
            column, total = values[begin + c * high + c : begin + (c + 1) * high], 0.0
            known = reached[c:]
            for k in range(1, len(known)):
                total += column[k] * known[k]
            known[0] = (known[0] - total) / column[0]
            x[j * dof + c] = known[0]
    for f in range(count):
        for a in range(dof):
            out[f * dof + a] = x[place[f] * dof + a]
