"""Equilibrium with Coulomb friction: one circular cone about each contact normal (a pair of rays in 2D)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from mocca_robot.assembly import Array, BoolArray, IntArray
from mocca_robot.motion_cone import generalized_normals
from mocca_robot.statics.equilibrium import EquilibriumResult, Status, solve_system, verdict
from mocca_robot.statics.system import ContactSystem


def equilibrium_with_friction(
    pairs: IntArray,
    points: Array,
    normals: Array,
    wrenches: Array,
    free: BoolArray,
    friction: float,
    about: Array | None = None,
    length: float | None = None,
) -> EquilibriumResult:
    """Return the equilibrium of parts whose contact forces stay in the friction cone |f_t| ≤ μ f_n.

    Arguments as in `equilibrium`; `wrenches` is one load case (N, dof). `forces` of the result are vectors
    (C, d) acting on part j. In 2D the cone is exactly two rays; in 3D it is a second-order cone.
    """
    if normals.shape[1] == 2:
        return _planar(pairs, points, normals, wrenches, free, friction, about, length)
    return _spatial(pairs, points, normals, wrenches, free, friction, about, length)


def _planar(
    pairs: IntArray,
    points: Array,
    normals: Array,
    wrenches: Array,
    free: BoolArray,
    friction: float,
    about: Array | None,
    length: float | None,
) -> EquilibriumResult:
    tangents = np.stack([-normals[:, 1], normals[:, 0]], axis=1)
    rays = np.concatenate([normals + friction * tangents, normals - friction * tangents])
    rays /= np.sqrt(1.0 + friction**2)
    system = ContactSystem.build(np.tile(pairs, (2, 1)), np.tile(points, (2, 1)), rays, free, about, length)
    result = solve_system(system, system.scaled(wrenches))
    per_ray = result.forces[:, None] * rays
    forces = per_ray[: len(pairs)] + per_ray[len(pairs) :]
    return EquilibriumResult(result.status, result.infeasibility, forces, result.motions, result.kkt)


def _spatial(
    pairs: IntArray,
    points: Array,
    normals: Array,
    wrenches: Array,
    free: BoolArray,
    friction: float,
    about: Array | None,
    length: float | None,
) -> EquilibriumResult:
    """Clarabel on Eq. 8: min ½|s|² over contact forces in second-order cones."""
    import clarabel

    frame = ContactSystem.build(pairs, points, normals, free, about, length)
    w = frame.scaled(wrenches)
    scale = float(np.linalg.norm(w))
    if scale == 0.0:
        return EquilibriumResult(Status.EQUILIBRIUM, 0.0, np.zeros_like(normals), frame.unscaled_motion(w), 0.0)
    first, second = _tangents(normals)
    axes = np.stack([normals, first, second], axis=1)  # (C, 3, 3)
    columns = [_ray_matrix(frame, points, axes[:, k]) for k in range(3)]
    transmit = sp.csc_matrix(sp.hstack([c.T for c in columns]))  # (n, 3C), grouped by axis
    m, n = len(pairs), len(w)
    order = np.arange(3 * m).reshape(3, m).T.ravel()
    transmit = transmit[:, order]
    # Variables [s; f]: s − Aᵀf = w/|w|, cone (μ f_n, f_t1, f_t2) ∈ SOC per contact; min ½|s|².
    cone_rows = sp.diags_array(np.tile([friction, 1.0, 1.0], m))
    constraints = sp.vstack(
        [
            sp.hstack([sp.eye_array(n), -transmit]),
            sp.hstack([sp.csr_array((3 * m, n)), -cone_rows]),
        ]
    )
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    objective = sp.block_diag([sp.eye_array(n), sp.csr_array((3 * m, 3 * m))], format="csc")
    solution = clarabel.DefaultSolver(
        sp.csc_matrix(objective),
        np.zeros(n + 3 * m),
        sp.csc_matrix(constraints),
        np.r_[w / scale, np.zeros(3 * m)],
        [clarabel.ZeroConeT(n), *[clarabel.SecondOrderConeT(3)] * m],
        settings,
    ).solve()
    s, f = np.asarray(solution.x[:n]), np.asarray(solution.x[n:]).reshape(m, 3)
    # Checked here, not in the solver: forces pulled back into their cones, residual and dual feasibility anew.
    f = _into_cone(f, friction)
    residual = w / scale + transmit @ f.ravel()
    relative = float(np.linalg.norm(residual))
    power = (transmit.T @ residual).reshape(m, 3)  # relative velocity at each contact; dual cone: f·power ≥ 0
    blocked = np.hypot(power[:, 1], power[:, 2]) * friction - power[:, 0]
    gap = abs(float((f * power).sum()))
    kkt = max(float(np.linalg.norm(residual - s)), float(blocked.max(initial=0.0)), gap)
    forces = np.einsum("ck,ckd->cd", f, axes) * scale
    return EquilibriumResult(
        verdict(relative, kkt), 0.5 * relative**2, forces, frame.unscaled_motion(residual * scale), kkt
    )


def _tangents(normals: Array) -> tuple[Array, Array]:
    """Return two unit tangents per normal, (C, 3) each."""
    helper = np.zeros_like(normals)
    helper[np.arange(len(normals)), np.abs(normals).argmin(axis=1)] = 1.0
    first = np.cross(normals, helper)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return first, np.cross(normals, first)


def _ray_matrix(frame: ContactSystem, points: Array, directions: Array) -> sp.csr_array:
    i, j = frame.pairs[:, 0], frame.pairs[:, 1]
    return ContactSystem(
        frame.pairs,
        generalized_normals(points, directions, frame.about[i], frame.length),
        generalized_normals(points, directions, frame.about[j], frame.length),
        frame.free,
        frame.about,
        frame.length,
    ).matrix


def _into_cone(f: Array, friction: float) -> Array:
    f = f.copy()
    f[:, 0] = np.maximum(f[:, 0], 0.0)
    tangential = np.hypot(f[:, 1], f[:, 2])
    shrink = np.minimum(1.0, friction * f[:, 0] / np.maximum(tangential, 1e-300))
    f[:, 1:] *= shrink[:, None]
    return f
