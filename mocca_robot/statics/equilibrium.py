"""Is a set of parts in static equilibrium, how far from it, with which forces or which motion (Eq. 7, 8, 10)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.errors import InputError
from mocca_robot.statics.solution import EquilibriumResult, result_of, solve_system
from mocca_robot.statics.solver.solvers import DENSE_LIMIT, SOLVED, SolverFailed
from mocca_robot.statics.solver.system import ContactSystem


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
        solver: 'auto', 'interior_point' (our own), or a name in `mocca_robot.statics.solver.solvers.SOLVERS`.

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


def _stacked(system: ContactSystem, loads: Array, solver: str) -> list[EquilibriumResult]:
    """Return one result per load (K, n): large systems all at once, whatever that leaves unsolved one by one."""
    c = np.zeros(len(system.pairs))
    large = loads.shape[1] * len(c) > DENSE_LIMIT
    if len(loads) > 1 and large and solver in ("auto", "interior_point") and loads.any(axis=1).all():
        from mocca_robot.statics.solver.interior_point import (
            solve_interior_point,  # compiled code: loaded where it is used
        )

        try:
            motions, forces = solve_interior_point(system, loads, c)
        except SolverFailed:
            return [solve_system(system, w, solver=solver) for w in loads]
        together = (result_of(system, w, c, v, f) for w, v, f in zip(loads, motions, forces, strict=True))
        return [r if r.kkt <= SOLVED else solve_system(system, w, solver=solver) for r, w in zip(together, loads)]
    return [solve_system(system, w, solver=solver) for w in loads]
