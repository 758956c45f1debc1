"""Many load cases of one small contact system at once, each from where the last call left off (Eq. 7/8).

Of a thousand contact rays a few dozen carry force. So each case is solved over a *working set* of rays by a dense
dual active-set method; every ray is then checked against the motion found, the worst violated ones of every pair
of parts join the working set, and so on until none is violated: the answer is that of the full problem. A design
loop changes the rays a little and calls again; the previous result then gives working sets and multipliers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.errors import InputError
from mocca_robot.runtime.threads import with_one_blas_thread
from mocca_robot.statics.solver.solvers import SolverFailed
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.tolerances import EXACT

VIOLATION = 1e-9
"""Slack, relative to |w|, below which a ray joins the working set; an order below what verdicts ask for."""
NEWCOMERS = 3
"""Rays of one pair that join in a round: more make fewer but slower rounds."""
NEAR = 1e-4
"""Slack, relative to |w|, up to which a ray without force stays in the working set of the next call."""
MAX_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class BatchResult:
    """K load cases solved.

    Attributes:
        residual: (K, n) v = w + Bᵀf, the motion of Eq. 7 and the residual of Eq. 8, in scaled units.
        forces: (K, C) along every ray; zero on rays that are not active.
        infeasibility: (K,) E / |w|²; ½|v|² / |w|² without a cost, 0 where nothing pulls.
        kkt: (K,) relative KKT residual over all active rays, computed outside the solver; inf where it failed.
        working: (K, C) rays that the last rounds looked at; a later call starts from them.
    """

    residual: Array
    forces: Array
    infeasibility: Array
    kkt: Array
    working: BoolArray


@with_one_blas_thread
def solve_cases(
    system: ContactSystem,
    loads: Array,
    *,
    active: BoolArray | None = None,
    free: BoolArray | None = None,
    cost: Array | None = None,
    warm: BatchResult | None = None,
) -> BatchResult:
    """Return min ½|w + Bᵀf|² + cᵀf over f ≥ 0 for each of K load cases.

    Args:
        system: C rays between the parts; unknowns are the motions of its free parts, n in all.
        loads: (K, n) scaled wrenches, see `ContactSystem.scaled`.
        active: (K, C) rays that exist in each case; default all.
        free: (K, N) parts that can move in each case, among the system's free ones; default all of those.
            Loads on parts held here are ignored, their residual is zero.
        cost: (C,) ≥ 0, price per unit of force; default none.
        warm: an earlier result of the same shape, for a start near the answer. It never changes the answer
            beyond the tolerance.

    Raises InputError for shapes that do not fit.
    """
    matrix = system.matrix.toarray()
    n_rays, n = matrix.shape
    loads = np.atleast_2d(np.asarray(loads, dtype=np.float64))
    n_cases = len(loads)
    active = _mask("active", active, (n_cases, n_rays))
    free = _mask("free", free, (n_cases, len(system.free))) & system.free
    if loads.shape[1] != n:
        raise InputError(f"loads have shape {loads.shape}; this system has {n} unknowns.")
    moving = np.repeat(free[:, system.free], system.dof, axis=1)  # (K, n)
    c = np.zeros(n_rays) if cost is None else np.asarray(cost, dtype=np.float64)
    w = np.where(moving, loads, 0.0)
    scale = np.linalg.norm(w, axis=1)
    pulled = scale > 0.0
    scale[~pulled] = 1.0
    w /= scale[:, None]
    prices = c / scale[:, None]  # (K, C)

    pair = _pair_numbers(system.pairs)
    residual, forces = w.copy(), np.zeros((n_cases, n_rays))
    working = np.zeros((n_cases, n_rays), dtype=np.bool_)
    if warm is not None and warm.forces.shape == forces.shape:
        forces = np.where(active & np.isfinite(warm.forces), warm.forces, 0.0) / scale[:, None]
        working = (warm.working | (forces > 0)) & active
    else:
        working[_worst_of_pairs(np.where(active, w @ matrix.T + prices, np.inf), pair, NEWCOMERS)] = True
    pending = np.flatnonzero(pulled)
    failed = np.zeros(n_cases, dtype=np.bool_)
    for _ in range(MAX_ROUNDS):
        for k in pending:
            rows = np.flatnonzero(working[k])
            try:
                v, f = _active_set(matrix, rows, moving[k], w[k], prices[k, rows], forces[k, rows])
            except SolverFailed:
                failed[k] = True
                continue
            residual[k], forces[k] = v, 0.0
            forces[k, rows] = f
        slack = residual[pending] @ matrix.T + prices[pending]
        slack[working[pending] | ~active[pending]] = np.inf
        slack[failed[pending]] = np.inf
        case, ray = _worst_of_pairs(slack, pair, NEWCOMERS)
        working[pending[case], ray] = True
        pending = pending[np.unique(case)]
        if not len(pending):
            break
    kkt = _kkt(matrix, w, prices, active, moving, residual, forces)
    kkt[failed] = np.inf
    used = _recent(working, forces, residual @ matrix.T + prices)
    energy = 0.5 * (residual**2).sum(axis=1)
    energy[~pulled] = 0.0
    return BatchResult(residual * scale[:, None], forces * scale[:, None], energy, kkt, used)


def _active_set(
    matrix: Array, rows: IntArray, moving: BoolArray, w: Array, price: Array, start: Array
) -> tuple[Array, Array]:
    """Return (v, f) of one case over the rays `rows`; `start` are multipliers to begin from."""
    import daqp

    columns = np.flatnonzero(moving)
    v = np.zeros(len(w))
    if not len(rows) or not len(columns):
        v[columns] = w[columns]
        return v, np.zeros(len(rows))
    b = np.ascontiguousarray(matrix[rows] if len(columns) == len(w) else matrix[np.ix_(rows, columns)])
    _, _, flag, info = daqp.solve(
        np.eye(len(columns)),
        -w[columns],
        b,
        np.full(len(rows), 1e30),
        -price,
        np.zeros(len(rows), dtype=np.int32),
        primal_tol=0.1 * VIOLATION,
        dual_tol=EXACT,
        dual_start=-start if start.any() else None,
    )
    if flag < 1:
        if start.any():
            return _active_set(matrix, rows, moving, w, price, np.zeros_like(start))
        raise SolverFailed(f"DAQP ended with flag {flag}.")
    f = np.maximum(-np.asarray(info["lam"]), 0.0)
    v[columns] = w[columns] + b.T @ f
    return v, f


def _kkt(matrix: Array, w: Array, prices: Array, active: BoolArray, moving: BoolArray, v: Array, f: Array) -> Array:
    """Return (K,) the largest violation of the optimality conditions, for loads of unit norm."""
    stationarity = np.linalg.norm(v - w - np.where(moving, f @ matrix, 0.0), axis=1)
    slack = np.where(active, v @ matrix.T + prices, 0.0)
    primal = -slack.min(axis=1, initial=0.0)
    gap = np.abs((f * slack).sum(axis=1))
    return np.asarray(np.max([stationarity, primal, gap], axis=0))


def _recent(working: BoolArray, forces: Array, slack: Array) -> BoolArray:
    """Return the rays worth starting from next time: those that carry force or nearly touch."""
    near = np.abs(slack) <= NEAR
    return np.asarray(working & ((forces > 0) | near))


def _worst_of_pairs(slack: Array, pair: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Return (case, ray) indices of the up to `count` most negative slacks of every case and pair.

    `slack` is (K, C), `pair` (C,) the number of the pair that each ray belongs to.
    """
    case, ray = np.nonzero(slack < -VIOLATION)
    group = case * (int(pair.max(initial=0)) + 1) + pair[ray]
    order = np.lexsort((slack[case, ray], group))
    group = group[order]
    first = np.searchsorted(group, group)  # where each one's run begins
    chosen = order[np.arange(len(order)) - first < count]
    return case[chosen], ray[chosen]


def _pair_numbers(pairs: IntArray) -> IntArray:
    """Return (C,) a number for every ray that is the same for all rays of one pair of parts."""
    keys = pairs[:, 0] * (int(pairs.max(initial=0)) + 1) + pairs[:, 1]
    return np.asarray(np.unique(keys, return_inverse=True)[1])


def _mask(name: str, mask: BoolArray | None, shape: tuple[int, int]) -> BoolArray:
    if mask is None:
        return np.ones(shape, dtype=np.bool_)
    mask = np.asarray(mask, dtype=np.bool_)
    if mask.shape != shape:
        raise InputError(f"'{name}' has shape {mask.shape}; expected {shape}.")
    return mask
