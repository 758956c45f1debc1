"""The normal matrix of Eq. 7 in sparse block columns: compiled assembly, Cholesky factor and substitution.

Everywhere: column j of blocks has its diagonal block and those below it in the rows rows[starts[j]] = j … ascending,
as they are once everything is filled in. Its numbers are a matrix (dof, dof·blocks), one column of the matrix a row,
from values[dof²·starts[j]] on. Free part f has the column place[f].
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
    values: Array,
) -> None:
    """Set `values` to the matrix with the blocks `diagonal` and +H_p on, −H_p off its diagonal blocks.

    below[p] is which block of its column the one of pair p is; 0 where one of the two is not free.
    """
    free = len(diagonal)
    values[:] = 0.0
    for f in range(free):
        _add(values, starts, place[f], 0, diagonal[f], 1.0)
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

    Every column of blocks that is done is taken off all those that it reaches.
    """
    room = np.empty((dof, dof * _longest(starts)))
    for j in range(len(starts) - 1):
        mine = rows[starts[j] : starts[j + 1]]
        begin, end = dof * dof * starts[j], dof * dof * starts[j + 1]
        pivot = _done(values[begin:end], room, dof)
        if pivot != 0:
            return j * dof + pivot
        for p in range(1, len(mine)):
            i = mine[p]
            theirs = rows[starts[i] : starts[i + 1]]
            begin, end = dof * dof * starts[i], dof * dof * starts[i + 1]
            _take_off(room, mine, p, values[begin:end], theirs, dof)
    return 0


@compiled
def _done(block_column: Array, copy: Array, dof: int) -> int:
    """Turn a column of blocks into that of the factor, and copy it; return 0 or the pivot as `factorize` does."""
    high = len(block_column) // dof
    for c in range(dof):
        column, copied = block_column[c * high : (c + 1) * high], copy[c, :high]
        if not column[c] > 0.0:
            return c + 1
        scale = 1.0 / np.sqrt(column[c])
        for k in range(high):
            scaled = column[k] * scale
            column[k] = scaled
            copied[k] = scaled
        for later in range(c + 1, dof):
            factor, rest = copied[later], block_column[later * high : (later + 1) * high]
            for k in range(high):
                rest[k] -= factor * copied[k]
    return 0


@compiled
def _take_off(done: Array, mine: IntArray, p: int, block_column: Array, theirs: IntArray, dof: int) -> None:
    """Take what block p of a column that is `done` does off the column whose diagonal is in its row.

    The blocks below p are all in that column, too; those that follow one another in both go together.
    """
    high = dof * len(theirs)
    q, at = p, 0
    while q < len(mine):
        while theirs[at] != mine[q]:
            at += 1
        run = 1
        while q + run < len(mine) and theirs[at + run] == mine[q + run]:
            run += 1
        low, up = q * dof, (q + run) * dof
        for b in range(dof):
            rest, row = block_column[b * high + at * dof : b * high + (at + run) * dof], p * dof + b
            if dof == 3:
                x, y, t = done[0, low:up], done[1, low:up], done[2, low:up]
                x0, y0, t0 = done[0, row], done[1, row], done[2, row]
                for k in range(len(rest)):
                    rest[k] -= x0 * x[k] + y0 * y[k] + t0 * t[k]
            else:
                x, y, z = done[0, low:up], done[1, low:up], done[2, low:up]
                t, u, v = done[3, low:up], done[4, low:up], done[5, low:up]
                x0, y0, z0 = done[0, row], done[1, row], done[2, row]
                t0, u0, v0 = done[3, row], done[4, row], done[5, row]
                for k in range(len(rest)):
                    rest[k] -= x0 * x[k] + y0 * y[k] + z0 * z[k] + t0 * t[k] + u0 * u[k] + v0 * v[k]
        q, at = q + run, at + run


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
