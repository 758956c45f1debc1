"""Is a set of parts in static equilibrium, how far from it, with which forces or which motion (Eq. 7, 8, 10)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from mocca_robot.assembly import Array, BoolArray, IntArray
from mocca_robot.errors import InputError
from mocca_robot.statics.solvers import DENSE_LIMIT, SolverFailed, certificate, solve
from mocca_robot.statics.system import ContactSystem
from mocca_robot.tolerances import TOLERANCES, Tolerances


class Status(StrEnum):
    """Verdict of a statics problem."""

    EQUILIBRIUM = "equilibrium"
    NOT_IN_EQUILIBRIUM = "not_in_equilibrium"
    INACCURATE = "inaccurate"
    """The solver's optimality conditions do not hold well enough for a verdict."""


@dataclass(frozen=True, eq=False)
class EquilibriumResult:
    """One load case solved.

    Attributes:
        status: the verdict.
        infeasibility: E / |w|², dimensionless: 0 = equilibrium, ½ = nothing is held (Eq. 8, torque measured in
            units of `length` about each part's reference point).
        forces: (C,) force along each contact normal, N; (C, d) contact force vectors with friction.
        motions: (N, dof) the collapse motion [velocity at the reference point; angular velocity], per unit of
            residual force; zero in equilibrium (Eq. 7).
        kkt: relative residual of the optimality conditions, computed outside the solver.
    """

    status: Status
    infeasibility: float
    forces: Array
    motions: Array
    kkt: float

    @property
    def stands(self) -> bool:
        """Return whether the verdict is equilibrium."""
        return self.status is Status.EQUILIBRIUM


def equilibrium(
    pairs: IntArray,
    points: Array,
    normals: Array,
    wrenches: Array,
    *,
    fixed: Sequence[int] | BoolArray = (),
    friction: float = 0.0,
    about: Array | None = None,
    length: float | None = None,
    solver: str = "auto",
) -> EquilibriumResult | list[EquilibriumResult]:
    """Return the equilibrium of N parts under external `wrenches`, or one result per stacked load case.

    Args:
        pairs: (C, 2) part indices (i, j) of each contact point.
        points: (C, 2 | 3) contact points, metres, world frame.
        normals: (C, 2 | 3) unit normals from i into j.
        wrenches: (N, 3 | 6) [force; torque about the origin], or (K, N, 3 | 6) for K load cases.
        fixed: indices, or an (N,) boolean mask, of the parts that cannot move.
        friction: Coulomb coefficient; 0 = frictionless.
        about, length: reference points (N, d) and length unit of the measure E; see `ContactSystem`.
        solver: 'auto', 'interior_point' (our own), or a name in `mocca_robot.statics.solvers.SOLVERS`.

    Raises InputError for shapes that do not fit, numbers that are not finite, unknown parts, and normals that are
    not of unit length.
    """
    wrenches = np.asarray(wrenches, dtype=np.float64)
    points = np.asarray(points, dtype=np.float64)
    dof = 3 if points.shape[-1] == 2 else 6
    if wrenches.ndim not in (2, 3) or wrenches.shape[-1] != dof:
        raise InputError(f"wrenches have shape {wrenches.shape}; expected (N, {dof}) or (K, N, {dof}).")
    if not np.isfinite(wrenches).all():
        raise InputError("External wrenches must be finite numbers.")
    if friction < 0 or not np.isfinite(friction):
        raise InputError(f"Friction coefficient {friction} is not a number ≥ 0.")
    free = ~_mask_of(fixed, wrenches.shape[-2])
    stacked = wrenches if wrenches.ndim == 3 else wrenches[None]
    if friction > 0:
        from mocca_robot.statics.friction import equilibrium_with_friction

        results = [
            equilibrium_with_friction(pairs, points, normals, w, free, friction, about, length, solver) for w in stacked
        ]
    else:
        system = ContactSystem.build(pairs, points, normals, free, about, length)
        results = _stacked(system, system.scaled(stacked), solver)
    return results if wrenches.ndim == 3 else results[0]


def _mask_of(fixed: Sequence[int] | BoolArray, n_parts: int) -> BoolArray:
    """Return (N,) which parts are fixed. Raises InputError for a mask of another length and for unknown parts."""
    given = np.asarray(fixed)
    if given.dtype == np.bool_:
        if given.shape != (n_parts,):
            raise InputError(f"The mask 'fixed' has shape {given.shape}; wrenches are given for {n_parts} parts.")
        return given
    numbers = given.astype(np.int64).ravel()
    if ((numbers < 0) | (numbers >= n_parts)).any():
        wrong = int(numbers[(numbers < 0) | (numbers >= n_parts)][0])
        raise InputError(f"'fixed' names part {wrong}, but there are parts 0 … {n_parts - 1} only.")
    mask = np.zeros(n_parts, dtype=np.bool_)
    mask[numbers] = True
    return mask


def solve_system(
    system: ContactSystem,
    w: Array,
    *,
    cost: Array | None = None,
    solver: str = "auto",
    tolerances: Tolerances = TOLERANCES,
) -> EquilibriumResult:
    """Return the equilibrium of `system` under the scaled wrench `w` (see `ContactSystem.scaled`).

    `cost` (C,) ≥ 0 is a price per unit of contact force; with it the result is a trade-off, and the status only
    tells whether the solver succeeded and whether a residual is left.
    """
    c = np.zeros(len(system.pairs)) if cost is None else cost
    scale = float(np.linalg.norm(w))
    if scale == 0.0 or len(w) == 0:
        return EquilibriumResult(Status.EQUILIBRIUM, 0.0, np.zeros(len(c)), system.unscaled_motion(w), 0.0)
    if len(c) == 0:
        return EquilibriumResult(Status.NOT_IN_EQUILIBRIUM, 0.5, c, system.unscaled_motion(w), 0.0)
    try:
        return _solved(system, w, c, solver, tolerances)
    except SolverFailed:
        nan = np.full(len(c), np.nan)
        return EquilibriumResult(Status.INACCURATE, np.nan, nan, system.unscaled_motion(0 * w), np.inf)


def _result(
    system: ContactSystem, w: Array, c: Array, v: Array, f: Array, tolerances: Tolerances = TOLERANCES
) -> EquilibriumResult:
    relative, kkt = certificate(system.matrix, w, c, v, f)
    return EquilibriumResult(verdict(relative, kkt, tolerances), 0.5 * relative**2, f, system.unscaled_motion(v), kkt)


def _stacked(system: ContactSystem, loads: Array, solver: str) -> list[EquilibriumResult]:
    """Return one result per load (K, n): large systems all at once, whatever that leaves unsolved one by one."""
    c = np.zeros(len(system.pairs))
    large = loads.shape[1] * len(c) > DENSE_LIMIT
    if len(loads) > 1 and large and solver in ("auto", "interior_point") and loads.any(axis=1).all():
        from mocca_robot.statics.interior_point import solve_interior_point  # compiled code: loaded where it is used

        try:
            motions, forces = solve_interior_point(system, loads, c)
        except SolverFailed:
            return [solve_system(system, w, solver=solver) for w in loads]
        together = (_result(system, w, c, v, f) for w, v, f in zip(loads, motions, forces, strict=True))
        return [r if r.kkt <= 1e-8 else solve_system(system, w, solver=solver) for r, w in zip(together, loads)]
    return [solve_system(system, w, solver=solver) for w in loads]


def _solved(system: ContactSystem, w: Array, c: Array, solver: str, tolerances: Tolerances) -> EquilibriumResult:
    """Return the result of the named solver; 'auto' takes the fastest for the size and falls back on the others."""
    ours = solver == "interior_point"
    if ours or (solver == "auto" and len(w) * len(c) > DENSE_LIMIT):
        from mocca_robot.statics.interior_point import solve_interior_point  # compiled code: loaded where it is used

        try:
            result = _result(system, w, c, *solve_interior_point(system, w, c), tolerances)
            if ours or result.kkt <= 1e-8:
                return result
        except SolverFailed:
            if ours:
                raise
    return _result(system, w, c, *solve(system.matrix, w, c, solver), tolerances)


def verdict(relative_residual: float, kkt: float, tolerances: Tolerances = TOLERANCES) -> Status:
    """Return the status for |s|/|w| and the relative KKT residual.

    A small residual |A f + w| with f ≥ 0 proves equilibrium by itself. The opposite is proved only when the
    optimality conditions hold, and E is larger than what they leave open: E ≥ ½ (|s|/|w|)² − gap.
    """
    if relative_residual <= tolerances.equilibrium_residual:
        return Status.EQUILIBRIUM
    solved = kkt <= tolerances.kkt or kkt <= 1e-3 * relative_residual
    if solved and 0.5 * relative_residual**2 > kkt:
        return Status.NOT_IN_EQUILIBRIUM
    return Status.INACCURATE
