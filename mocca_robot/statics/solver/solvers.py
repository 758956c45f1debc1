"""Solvers of Eq. 7 with a slack c ≥ 0: min ½|v|² − wᵀv subject to B v + c ≥ 0; one function a solver.

Each returns (v, f): the motion and the multipliers of the constraints, which are the contact forces of Eq. 8.
With c = 0 this is Eq. 7/8; c > 0 charges c per unit of force, which kinematic design uses to spend little.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from mocca_robot.arrays import Array
from mocca_robot.errors import MoccaError, nearest
from mocca_robot.tolerances import EXACT

SOLVED = 1e-8
"""KKT residual with which no second solver is asked: a tenth of `TOLERANCES.kkt`."""
ACCURACY, FEASIBLE, SPLITTING = 1e-11, 1e-10, 1e-9
"""What interior points, active sets and operator splitting are asked for: what each reaches in double precision."""

Solver: TypeAlias = Callable[[sp.csr_array, Array, Array], tuple[Array, Array]]

DENSE_LIMIT = 30_000
"""Unknowns × rays up to which a dense active-set method beats interior points: 60 unknowns with 500 rays."""


class SolverFailed(MoccaError):
    """A solver gave up; the caller tries another one or reports 'inaccurate'."""


def solve(b: sp.csr_array, w: Array, c: Array, name: str = "auto") -> tuple[Array, Array]:
    """Return (v, f) from the solver called `name`; 'auto' takes the fastest for the size and falls back.

    Raises MoccaError for an unknown name and SolverFailed when no solver succeeds.
    """
    if name != "auto":
        if name not in SOLVERS:
            raise MoccaError(f"No statics solver is called '{name}'; {nearest(name, SOLVERS)}")
        return SOLVERS[name](b, w, c)
    order = ("daqp", "piqp", "clarabel") if b.shape[0] * b.shape[1] <= DENSE_LIMIT else ("piqp", "clarabel")
    best: tuple[float, Array, Array] | None = None
    for candidate in order:
        try:
            v, f = SOLVERS[candidate](b, w, c)
        except SolverFailed:
            continue
        residual = kkt_residual(b, w, c, v, f)
        if residual <= SOLVED:
            return v, f
        if best is None or residual < best[0]:
            best = (residual, v, f)
    if best is None:
        raise SolverFailed(f"None of {', '.join(order)} solved the statics problem of size {b.shape}.")
    return best[1], best[2]


def kkt_residual(b: sp.csr_array, w: Array, c: Array, v: Array, f: Array) -> float:
    """Return the largest relative violation of the optimality conditions; independent of any solver.

    Stationarity v = w + Bᵀf, feasibility B v + c ≥ 0 and f ≥ 0, complementarity fᵀ(B v + c) = 0; lengths are
    relative to |w|.
    """
    return certificate(b, w, c, v, f)[1]


def certificate(b: sp.csr_array, w: Array, c: Array, v: Array, f: Array) -> tuple[float, float]:
    """Return the unbalanced share |w + Bᵀf| / |w| of the load, and the `kkt_residual`."""
    scale = float(np.linalg.norm(w)) or 1.0
    slack, unbalanced = b @ v + c, w + b.T @ f
    stationarity = float(np.linalg.norm(v - unbalanced)) / scale
    primal = float(-min(slack.min(initial=0.0), 0.0)) / scale
    dual = float(-min(f.min(initial=0.0), 0.0)) / scale
    gap = abs(float(f @ slack)) / scale**2
    return float(np.linalg.norm(unbalanced)) / scale, max(stationarity, primal, dual, gap)


def solve_daqp(b: sp.csr_array, w: Array, c: Array) -> tuple[Array, Array]:
    """Dual active set, dense: exact to machine precision, fastest for a few dozen unknowns."""
    import daqp

    n = len(w)
    scale = float(np.linalg.norm(w)) or 1.0
    v, _, flag, info = daqp.solve(
        np.eye(n),
        -w / scale,
        np.ascontiguousarray(b.toarray()),
        np.full(len(c), 1e30),
        -c / scale,
        np.zeros(len(c), dtype=np.int32),
        primal_tol=FEASIBLE,
        dual_tol=EXACT,
    )
    if flag < 1:
        raise SolverFailed(f"DAQP ended with flag {flag}.")
    return np.asarray(v) * scale, np.maximum(-np.asarray(info["lam"]), 0.0) * scale


def solve_piqp(b: sp.csr_array, w: Array, c: Array) -> tuple[Array, Array]:
    """Proximal interior point, sparse: fastest public solver for large curved cases."""
    import piqp

    n = len(w)
    scale = float(np.linalg.norm(w)) or 1.0
    solver = piqp.SparseSolver()
    solver.settings.eps_abs = ACCURACY
    solver.settings.eps_rel = ACCURACY
    solver.settings.eps_duality_gap_abs = ACCURACY
    solver.settings.eps_duality_gap_rel = ACCURACY
    solver.settings.max_iter = 200
    solver.setup(sp.eye_array(n, format="csc"), -w / scale, None, None, sp.csc_matrix(b), -c / scale, None, None, None)
    solver.solve()
    result = solver.result
    forces = np.asarray(result.z_l)
    if not (np.isfinite(result.x).all() and np.isfinite(forces).all()):
        raise SolverFailed("PIQP returned numbers that are not finite.")
    return np.asarray(result.x) * scale, np.maximum(forces, 0.0) * scale


def solve_clarabel(b: sp.csr_array, w: Array, c: Array) -> tuple[Array, Array]:
    """Homogeneous interior point, sparse: slower, the most dependable."""
    import clarabel

    n, m = len(w), len(c)
    scale = float(np.linalg.norm(w)) or 1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = ACCURACY
    solver = clarabel.DefaultSolver(
        sp.csc_matrix(sp.eye_array(n)),
        -w / scale,
        sp.csc_matrix(-b),
        c / scale,
        [clarabel.NonnegativeConeT(m)],
        settings,
    )
    solution = solver.solve()
    v, f = np.asarray(solution.x), np.asarray(solution.z)
    if not (np.isfinite(v).all() and np.isfinite(f).all()):
        raise SolverFailed(f"Clarabel ended with {solution.status}.")
    return v * scale, np.maximum(f, 0.0) * scale


def solve_osqp(b: sp.csr_array, w: Array, c: Array) -> tuple[Array, Array]:
    """Operator splitting: quick on planar contacts, not to be trusted for verdicts on curved ones."""
    import osqp

    n, m = len(w), len(c)
    scale = float(np.linalg.norm(w)) or 1.0
    solver = osqp.OSQP()
    solver.setup(
        sp.csc_matrix(sp.eye_array(n)),
        -w / scale,
        sp.csc_matrix(b),
        -c / scale,
        np.full(m, np.inf),
        eps_abs=SPLITTING,
        eps_rel=SPLITTING,
        max_iter=200_000,
        polishing=True,
        verbose=False,
    )
    result = solver.solve(raise_error=False)
    if result.x is None or not np.isfinite(result.x).all():
        raise SolverFailed(f"OSQP ended with {result.info.status}.")
    return np.asarray(result.x) * scale, np.maximum(-np.asarray(result.y), 0.0) * scale


SOLVERS: dict[str, Solver] = {
    "daqp": solve_daqp,
    "piqp": solve_piqp,
    "clarabel": solve_clarabel,
    "osqp": solve_osqp,
}
