"""Equilibrium with Coulomb friction: one circular cone about each contact normal (a pair of rays in 2D)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.errors import InputError, nearest
from mocca_robot.geometry.frames import tangents
from mocca_robot.statics.solution import EquilibriumResult, Status, solve_system, verdict
from mocca_robot.statics.solver.solvers import SolverFailed
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.tolerances import TINY, TOLERANCES

CONE_ACCURACY = 1e-10
"""What a cone solver is asked for, a thousandth of `TOLERANCES.kkt`."""


def equilibrium_with_friction(
    pairs: IntArray,
    points: Array,
    normals: Array,
    wrenches: Array,
    free: BoolArray,
    friction: float | Array,
    about: Array | None = None,
    length: float | None = None,
    solver: str = "auto",
) -> EquilibriumResult:
    """Return the equilibrium of parts whose contact forces stay in the friction cone |f_t| ≤ μ f_n.

    Arguments as in `equilibrium`; `wrenches` is one load case (N, dof). `forces` of the result are vectors
    (C, d) acting on part j. In 2D the cone is exactly two rays, for any solver of Eq. 7; in 3D it is a
    second-order cone, for those in `CONE_SOLVERS`. `friction` is one coefficient, or (C,) one a contact. Raises
    InputError for a solver that has no such cones.
    """
    if normals.shape[1] == 2:
        return _planar(pairs, points, normals, wrenches, free, friction, about, length, solver)
    if solver != "auto" and solver not in CONE_SOLVERS:
        raise InputError(f"'{solver}' does not solve friction in 3D; {nearest(solver, CONE_SOLVERS)}")
    return _spatial(pairs, points, normals, wrenches, free, friction, about, length, solver)


def _planar(
    pairs: IntArray,
    points: Array,
    normals: Array,
    wrenches: Array,
    free: BoolArray,
    friction: float | Array,
    about: Array | None,
    length: float | None,
    solver: str,
) -> EquilibriumResult:
    mu = np.full(len(normals), friction, dtype=np.float64)[:, None]
    beside = mu * tangents(normals)[:, 0]
    rays = np.concatenate([normals + beside, normals - beside])
    rays /= np.sqrt(1.0 + np.concatenate([mu, mu]) ** 2)
    system = ContactSystem.build(np.tile(pairs, (2, 1)), np.tile(points, (2, 1)), rays, free, about, length)
    result = solve_system(system, system.scaled(wrenches), solver=solver)
    per_ray = result.forces[:, None] * rays
    forces = per_ray[: len(pairs)] + per_ray[len(pairs) :]
    return EquilibriumResult(result.status, result.infeasibility, forces, result.motions, result.kkt)


def _spatial(
    pairs: IntArray,
    points: Array,
    normals: Array,
    wrenches: Array,
    free: BoolArray,
    friction: float | Array,
    about: Array | None,
    length: float | None,
    solver: str,
) -> EquilibriumResult:
    """Eq. 8 over second-order cones: our own interior point, Clarabel where it fails."""
    axes = np.concatenate([normals[:, None], tangents(normals)], axis=1)  # (C, 3, 3)
    frame = three_rows(pairs, points, axes, free, friction, about, length)
    w = frame.scaled(wrenches)
    scale = float(np.linalg.norm(w))
    if scale == 0.0:
        return EquilibriumResult(Status.EQUILIBRIUM, 0.0, np.zeros_like(normals), frame.unscaled_motion(w), 0.0)
    if not free[frame.pairs].any():
        return EquilibriumResult(Status.NOT_IN_EQUILIBRIUM, 0.5, np.zeros_like(normals), frame.unscaled_motion(w), 0.0)
    best: tuple[float, Array, Array] | None = None
    for attempt in CONE_SOLVERS.values() if solver == "auto" else (CONE_SOLVERS[solver],):
        try:
            f = _into_cone(attempt(frame, w / scale).reshape(-1, 3))
        except SolverFailed:
            continue
        residual = w / scale + frame.matrix.T @ f.ravel()
        kkt = cone_kkt(frame, residual, f)
        if best is None or kkt < best[0]:
            best = (kkt, f, residual)
        if kkt <= TOLERANCES.kkt or float(np.linalg.norm(residual)) <= TOLERANCES.kkt:
            break
    if best is None:
        nan = np.full_like(normals, np.nan)
        return EquilibriumResult(Status.INACCURATE, np.nan, nan, frame.unscaled_motion(0 * w), np.inf)
    kkt, f, residual = best
    relative = float(np.linalg.norm(residual))
    forces = np.einsum("ck,ckd->cd", f * steepness(friction, len(pairs)), axes) * scale
    motions = frame.unscaled_motion(residual * scale)
    return EquilibriumResult(verdict(relative, kkt), 0.5 * relative**2, forces, motions, kkt)


def cone_kkt(frame: ContactSystem, residual: Array, f: Array) -> float:
    """Return the largest violation of the optimality conditions for a unit load, computed outside any solver.

    `f` (C, 3) lie in their cones and `residual` is w + Gᵀf, so stationarity holds; what is left are the relative
    motions G·residual, which must lie in the (self-dual) cones, and complementarity.
    """
    motion = (frame.matrix @ residual).reshape(-1, 3)
    blocked = np.hypot(motion[:, 1], motion[:, 2]) - motion[:, 0]
    return max(float(blocked.max(initial=0.0)), abs(float((f * motion).sum())))


def _own_solver(frame: ContactSystem, w: Array) -> Array:
    from mocca_robot.statics.solver.friction_cones import solve_friction_cones  # compiled code: loaded where it is used

    return solve_friction_cones(frame.blocks, w)


def _clarabel(frame: ContactSystem, w: Array) -> Array:
    """min ½|s|² over s = w + Gᵀf, f_c ∈ Q."""
    import clarabel

    m, n = len(frame.pairs) // 3, len(w)
    constraints = sp.vstack(
        [
            sp.hstack([sp.eye_array(n), -frame.matrix.T]),
            sp.hstack([sp.csr_array((3 * m, n)), -sp.eye_array(3 * m)]),
        ]
    )
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = CONE_ACCURACY
    objective = sp.block_diag([sp.eye_array(n), sp.csr_array((3 * m, 3 * m))], format="csc")
    solution = clarabel.DefaultSolver(
        sp.csc_matrix(objective),
        np.zeros(n + 3 * m),
        sp.csc_matrix(constraints),
        np.r_[w, np.zeros(3 * m)],
        [clarabel.ZeroConeT(n), *[clarabel.SecondOrderConeT(3)] * m],
        settings,
    ).solve()
    f = np.asarray(solution.x[n:])
    if not np.isfinite(f).all():
        raise SolverFailed(f"Clarabel ended with {solution.status}.")
    return f


CONE_SOLVERS: dict[str, Callable[[ContactSystem, Array], Array]] = {
    "interior_point": _own_solver,
    "clarabel": _clarabel,
}
"""Solvers of Eq. 8 over second-order cones, in the order in which 'auto' tries them."""


def three_rows(
    pairs: IntArray,
    points: Array,
    axes: Array,
    free: BoolArray,
    friction: float | Array,
    about: Array | None,
    length: float | None,
) -> ContactSystem:
    """Return the system with rows [n/μ; t₁; t₂] for every contact, [n; 0; 0] where μ = 0.

    `axes` are (C, 3, d); in 2D the third one, which does not exist, is given as zeros.
    """
    thrice = np.repeat(np.arange(len(pairs)), 3)
    d = axes.shape[2]
    third = np.asarray(axes[:, 2].any(axis=1))
    units = np.where(third[:, None, None], axes, np.stack([axes[:, 0], axes[:, 1], axes[:, 1]], axis=1))
    system = ContactSystem.build(pairs[thrice], points[thrice], units.reshape(-1, d), free, about, length)
    steep = steepness(friction, len(pairs))
    steep[:, 2] *= third
    steep = steep.reshape(-1, 1)
    return replace(system, rays_i=system.rays_i * steep, rays_j=system.rays_j * steep)


def _into_cone(f: Array) -> Array:
    """Return f (C, 3) with every row pulled back into Q, should rounding have left it outside."""
    f = f.copy()
    f[:, 0] = np.maximum(f[:, 0], 0.0)
    shrink = np.minimum(1.0, f[:, 0] / np.maximum(np.hypot(f[:, 1], f[:, 2]), TINY))
    f[:, 1:] *= shrink[:, None]
    return f


def steepness(friction: float | Array, count: int) -> Array:
    """Return (count, 3) what turns the axes n, t₁, t₂ of a contact into the rows of its cone: 1/μ, 1, 1.

    Where μ = 0 the rows are n, 0, 0: tangential forces then do nothing.
    """
    mu = np.full(count, friction, dtype=np.float64)
    rough = mu > 0.0
    return np.stack([1.0 / np.where(rough, mu, 1.0), 1.0 * rough, 1.0 * rough], axis=1)
