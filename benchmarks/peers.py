"""Public solvers that are not part of the product, behind the same signature (B, w, c) → (v, f)."""

from __future__ import annotations

import importlib.util

import numpy as np
import scipy.sparse as sp

from mocca_robot.arrays import Array
from mocca_robot.statics.solver.solvers import SOLVERS, Solver, SolverFailed


def solve_qpalm(b: sp.csr_array, w: Array, c: Array) -> tuple[Array, Array]:
    """Proximal augmented Lagrangian."""
    import qpalm

    m, n = b.shape
    scale = float(np.linalg.norm(w)) or 1.0
    data = qpalm.Data(n, m)
    data.Q, data.A = sp.csc_matrix(sp.eye_array(n)), sp.csc_matrix(b)
    data.q, data.bmin, data.bmax = -w / scale, -c / scale, np.full(m, 1e20)
    settings = qpalm.Settings()
    settings.eps_abs = settings.eps_rel = 1e-9
    settings.max_iter = 50_000
    settings.verbose = 0
    solver = qpalm.Solver(data, settings)
    solver.solve()
    v, y = np.array(solver.solution.x), np.array(solver.solution.y)
    if not (np.isfinite(v).all() and np.isfinite(y).all()):
        raise SolverFailed(f"QPALM ended with {solver.info.status}.")
    return v * scale, np.maximum(-y, 0.0) * scale


def solve_highs(b: sp.csr_array, w: Array, c: Array) -> tuple[Array, Array]:
    """Interior-point LP over |w + Bᵀf|₁: it tells equilibrium, but its v is not Eq. 7's unless that is zero."""
    from scipy.optimize import linprog

    m, n = b.shape
    scale = float(np.linalg.norm(w)) or 1.0
    identity = sp.eye_array(n)
    result = linprog(
        np.r_[c / scale, np.ones(2 * n)],
        A_eq=sp.hstack([b.T, identity, -identity], format="csc"),
        b_eq=-w / scale,
        bounds=(0, None),
        method="highs-ipm",
    )
    if not result.success or result.x is None:
        raise SolverFailed(f"HiGHS ended with: {result.message[:60]}")
    f = np.maximum(result.x[:m], 0.0)
    return w + b.T @ (f * scale), f * scale


def available() -> dict[str, Solver]:
    """Return every public solver that is installed here."""
    found = {**SOLVERS, "highs": solve_highs}
    if importlib.util.find_spec("qpalm") is not None:
        found["qpalm"] = solve_qpalm
    return found
