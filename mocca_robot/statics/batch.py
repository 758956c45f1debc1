"""Many load cases of one small contact system at once, each from where the last call left off (Eq. 7/8).

Of a thousand contact rays a few dozen carry force. So each case is solved over a *working set* of rays by a dense
dual active-set method; every ray is then checked against the motion found, the worst violated ones of every pair
of parts join the working set, and so on until none is violated: the answer is that of the full problem. A design
loop changes the rays a little and calls again; the previous result then gives working sets and multipliers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.assembly import Array, BoolArray, IntArray
from mocca_robot.errors import InputError
from mocca_robot.statics.solvers import SolverFailed
from mocca_robot.statics.system import ContactSystem

VIOLATION = 1e-9
"""Slack, relative to |w|, below which a ray joins the working set; an order below what verdicts ask for."""
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

    groups = _PairGroups.of(system.pairs)
    residual, forces = w.copy(), np.zeros((n_cases, n_rays))
    working = np.zeros((n_cases, n_rays), dtype=np.bool_)
    if warm is not None and warm.forces.shape == forces.shape:
        forces = np.where(active & np.isfinite(warm.forces), warm.forces, 0.0) / scale[:, None]
        working = (warm.working | (forces > 0)) & active
    else:
        working = groups.worst(np.where(active, w @ matrix.T + prices, np.inf), 2)
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
        slack = np.where(active[pending], residual[pending] @ matrix.T + prices[pending], np.inf)
        violated = (slack < -VIOLATION) & ~working[pending]
        left = violated.any(axis=1) & ~failed[pending]
        working[pending] |= groups.worst(np.where(violated, slack, np.inf), 3)
        pending = pending[left]
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
    solution, _, flag, info = daqp.solve(
        np.eye(len(columns)),
        -w[columns],
        b,
        np.full(len(rows), 1e30),
        -price,
        np.zeros(len(rows), dtype=np.int32),
        primal_tol=0.1 * VIOLATION,
        dual_tol=1e-12,
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
    near = np.abs(slack) <= 1e-6
    return np.asarray(working & ((forces > 0) | near))


@dataclass(frozen=True, eq=False)
class _PairGroups:
    """Rays grouped by the pair of parts they belong to, to pick the worst few of every pair at once."""

    order: IntArray
    starts: IntArray
    group: IntArray

    @classmethod
    def of(cls, pairs: IntArray) -> _PairGroups:
        order = np.lexsort((pairs[:, 1], pairs[:, 0]))
        ordered = pairs[order]
        new = np.r_[True, (ordered[1:] != ordered[:-1]).any(axis=1)] if len(pairs) else np.zeros(0, dtype=np.bool_)
        return cls(order, np.flatnonzero(new), np.cumsum(new) - 1)

    def worst(self, slack: Array, count: int) -> BoolArray:
        """Return (K, C) the `count` rays of smallest finite slack of every pair in which one is negative."""
        chosen = np.zeros(slack.shape, dtype=np.bool_)
        if not len(self.order) or not len(slack):
            return chosen
        ordered = slack[:, self.order]
        for _ in range(count):
            least = np.minimum.reduceat(ordered, self.starts, axis=1)[:, self.group]
            # One ray of every pair: ties (a planar contact moving along its normal) come one by one.
            hit = (ordered == least) & (least < 0.0)
            first = hit & (np.cumsum(hit, axis=1) - _before(hit, self.starts, self.group) == 1)
            rows, columns = np.nonzero(first)
            chosen[rows, self.order[columns]] = True
            ordered[rows, columns] = np.inf
        return chosen


def _before(hit: BoolArray, starts: IntArray, group: IntArray) -> IntArray:
    """Return (K, C) how many hits lie in the groups before each ray's own."""
    totals = np.add.reduceat(hit.astype(np.int64), starts, axis=1)
    return np.asarray((np.cumsum(totals, axis=1) - totals)[:, group])


def _mask(name: str, mask: BoolArray | None, shape: tuple[int, int]) -> BoolArray:
    if mask is None:
        return np.ones(shape, dtype=np.bool_)
    mask = np.asarray(mask, dtype=np.bool_)
    if mask.shape != shape:
        raise InputError(f"'{name}' has shape {mask.shape}; expected {shape}.")
    return mask
