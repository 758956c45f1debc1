"""One load case solved: whether it is in equilibrium, how far from it, with which forces or which motion (Eq. 7, 8)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.statics.solver.solvers import DENSE_LIMIT, SOLVED, SolverFailed, certificate, solve
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.tolerances import TOLERANCES, Tolerances

GAP_SHARE = 1e-3
"""Of the residual: a KKT residual below it leaves the verdict as it is, however large."""


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


def result_of(
    system: ContactSystem, w: Array, c: Array, v: Array, f: Array, tolerances: Tolerances = TOLERANCES
) -> EquilibriumResult:
    relative, kkt = certificate(system.matrix, w, c, v, f)
    return EquilibriumResult(verdict(relative, kkt, tolerances), 0.5 * relative**2, f, system.unscaled_motion(v), kkt)


def _solved(system: ContactSystem, w: Array, c: Array, solver: str, tolerances: Tolerances) -> EquilibriumResult:
    """Return the result of the named solver; 'auto' takes the fastest for the size and falls back on the others."""
    ours = solver == "interior_point"
    if ours or (solver == "auto" and len(w) * len(c) > DENSE_LIMIT):
        from mocca_robot.statics.solver.interior_point import (
            solve_interior_point,  # compiled code: loaded where it is used
        )

        try:
            result = result_of(system, w, c, *solve_interior_point(system, w, c), tolerances)
            if ours or result.kkt <= SOLVED:
                return result
        except SolverFailed:
            if ours:
                raise
    return result_of(system, w, c, *solve(system.matrix, w, c, solver), tolerances)


def verdict(relative_residual: float, kkt: float, tolerances: Tolerances = TOLERANCES) -> Status:
    """Return the status for |s|/|w| and the relative KKT residual.

    A small residual |A f + w| with f ≥ 0 proves equilibrium by itself. The opposite is proved only when the
    optimality conditions hold, and E is larger than what they leave open: E ≥ ½ (|s|/|w|)² − gap.
    """
    if relative_residual <= tolerances.equilibrium_residual:
        return Status.EQUILIBRIUM
    solved = kkt <= tolerances.kkt or kkt <= GAP_SHARE * relative_residual
    if solved and 0.5 * relative_residual**2 > kkt:
        return Status.NOT_IN_EQUILIBRIUM
    return Status.INACCURATE
