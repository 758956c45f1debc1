"""Can anything move at all? Infinitesimal rigidity of parts in contact: deadlock, and what is loose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.errors import MoccaError
from mocca_robot.joints.joint import MANY, contact_rays, spanning_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import moving_parts
from mocca_robot.statics.loads import load_cases
from mocca_robot.statics.solver.solvers import SolverFailed
from mocca_robot.statics.solver.system import ContactSystem

SQUARED_ROUNDING = 1e-14
"""Eigenvalue of BᵀB, relative to the largest, that rounding alone may leave."""

OPENING = 1e-6
"""Smallest opening velocity that counts as moving apart, relative to a motion of unit size; normals read back from
files turn by 1e-12."""
SLIDING = 1e-7
"""Smallest singular value, relative to the largest, of contacts that leave no common sliding motion."""

PULLS, CLEARLY = 4, 1e-3
"""Pulls at a large structure, and the share of a pull from which the motion that answers it is one."""


@dataclass(frozen=True, eq=False)
class Mobility:
    """What can move while some parts are held.

    Attributes:
        motions: (N, dof) a motion [velocity at the centroid; angular velocity] that no contact stops; zero when
            nothing can move.
        moving: names of the parts that it moves.
        opens: it separates some contact; otherwise all contacts slide.
    """

    motions: Array
    moving: tuple[str, ...]
    opens: bool

    @property
    def locked(self) -> bool:
        """Return whether no part can move relative to the held ones."""
        return not self.moving


def mobility(graph: PartsGraph, held: BoolArray | None = None) -> Mobility:
    """Return a motion that the contacts allow while `held` (N,) parts (default: the fixed ones) stay, or none.

    Nothing moves exactly when B v ≥ 0 has the solution v = 0 only: no motion opens a contact (a linear program
    that maximises the sum of openings, each at most 1) and none slides along all of them (the null space of B).
    First-order: a motion that is blocked only by curvature counts as free. Raises MoccaError when the program
    cannot be solved.
    """
    assembly = graph.assembly
    fixed = assembly.fixed if held is None else held
    n, dof = len(assembly.parts), assembly.dof
    motions = np.zeros((n, dof))
    if fixed.all():
        return Mobility(motions, (), False)
    spanning = spanning_rays(graph.contacts)
    pairs, points, normals = contact_rays(graph.contacts)
    pairs, points, normals = pairs[spanning], points[spanning], normals[spanning]
    about = np.array([p.centroid for p in assembly.parts])
    length = assembly.size / 2
    system = ContactSystem.build(pairs, points, normals, ~fixed, about, length)
    b = system.matrix
    b = b[np.flatnonzero(np.asarray(abs(b).sum(axis=1)) > 0)]
    v, opens = _pulled(system, b) if len(pairs) >= MANY else (np.zeros(b.shape[1]), False)
    if not opens:
        v, opens = _opening(b)
    if not opens:
        v = _sliding(b)
    if np.abs(v).max(initial=0.0) == 0.0:
        return Mobility(motions, (), False)
    moved = v.reshape(-1, dof).copy()
    moved[:, assembly.dimension :] /= length
    motions[~fixed] = moved
    return Mobility(motions, moving_parts(assembly, motions), opens)


def loose_with_key(graph: PartsGraph) -> Mobility | None:
    """Return what can still move while the key of an interlocking goal is held; None if nothing can or none is asked.

    The load case of that goal pushes contacts apart, so that it says nothing of motions that slide along all of them.
    """
    asked = (case for case in load_cases(graph) if case.name == "interlocking")
    found = (mobility(graph, case.held) for case in asked)
    return next((m for m in found if not m.locked), None)


def leaving_parts(graph: PartsGraph) -> tuple[str, ...]:
    """Return the names of the free parts that can move while all others stay, in assembly order.

    When there are none, the structure is a deadlock for anybody who takes it apart, or puts it together, part by
    part; several parts at once may still move (see `mobility`).
    """
    names = []
    for part in graph.free:
        near = graph.around(part)
        others = np.arange(len(graph.assembly.parts)) != part
        if not near.contacts or not mobility(near, others).locked:
            names.append(graph.assembly.parts[part].name)
    return tuple(names)


def _pulled(system: ContactSystem, b: sp.csr_array) -> tuple[Array, bool]:
    """Return a motion that opens contacts and whether one was found, by pulling at all parts at random.

    Static equilibrium answers a pull with the nearest motion that no contact stops. What is found moves; where
    nothing is found, the linear program decides: for large structures it takes minutes.
    """
    from mocca_robot.statics.solver.interior_point import solve_interior_point  # compiled code: loaded where it is used

    pulls = np.random.default_rng(0).normal(size=(PULLS, b.shape[1]))
    try:
        motions, _ = solve_interior_point(system, pulls, np.zeros(len(system.pairs)))
    except SolverFailed:
        return np.zeros(b.shape[1]), False
    sizes = np.linalg.norm(motions, axis=1, keepdims=True)
    clear = sizes[:, 0] > CLEARLY * np.linalg.norm(pulls, axis=1)
    v = (motions[clear] / sizes[clear]).sum(axis=0)
    opening = b @ v
    return v, bool(opening.max(initial=0.0) > CLEARLY and opening.min(initial=0.0) > -OPENING)


def _opening(b: sp.csr_array) -> tuple[Array, bool]:
    """Return the motion that opens contacts most and whether it opens any."""
    rows, columns = b.shape
    if rows == 0:
        return np.zeros(columns), False
    # Variables v (columns) in a box, and the openings s (rows) in [0, 1]: s ≤ B v.
    matrix = sp.hstack([-b, sp.eye_array(rows)], format="csc")
    found = linprog(
        np.r_[np.zeros(columns), -np.ones(rows)],
        A_ub=matrix,
        b_ub=np.zeros(rows),
        bounds=[(-1.0, 1.0)] * columns + [(0.0, 1.0)] * rows,
        method="highs",
    )
    if not found.success or found.x is None:
        raise MoccaError(f"Whether parts can move cannot be decided: the linear program ends with '{found.message}'.")
    opening = float(found.x[columns:].max(initial=0.0))
    return np.asarray(found.x[:columns]), opening > OPENING


def _sliding(b: sp.csr_array) -> Array:
    """Return a motion along which every contact slides; zero when there is none."""
    rows, columns = b.shape
    if rows == 0:
        return np.ones(columns)
    values, vectors = np.linalg.eigh((b.T @ b).toarray())
    largest = max(float(values[-1]), 0.0)
    # Squared singular values: rounding leaves 1e-16 of the largest.
    if values[0] > max(SLIDING**2, SQUARED_ROUNDING) * largest:
        return np.zeros(columns)
    return np.asarray(vectors[:, 0])
