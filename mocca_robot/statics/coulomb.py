"""Does it stand with Coulomb friction, does it stand only clamped, or does it fall?

That *some* forces within the friction cones hold the load (`friction`) does not mean that anything brings them about.
Here every contact point has a normal and a tangential spring, parts start without contact forces (or with declared
clamping), and the load comes at once: what sticks pulls on its spring, what slides is held back with μ times what
presses, and is not lifted. The forces that hold the load are then unique, and where there are none the parts move.

Every answer is checked again here from its displacements or motions, whatever solver found them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.runtime.threads import with_one_blas_thread
from mocca_robot.statics.friction_verdict import FrictionVerdict, Standing
from mocca_robot.statics.frictional_contacts import FrictionalContacts
from mocca_robot.statics.solution import EquilibriumResult, Status
from mocca_robot.statics.solver.compliant_cones import CompliantCones
from mocca_robot.statics.solver.coulomb_rest import StepsSettled, rest
from mocca_robot.statics.solver.coulomb_steps import move
from mocca_robot.tolerances import TINY

EQUILIBRIUM_RESIDUAL = 1e-8
"""Unbalanced share of the load up to which parts stand."""
LEAST_UNBALANCED = 1e-7
"""Unbalanced share of the load from which on parts fall: three orders above what is left of the equations of a fall."""
COMPLEMENTARITY = 1e-8
"""How far contacts may be from Coulomb's law, relative to the largest force and the largest displacement."""
SLID_AWAY = 3e3
"""Slip over what springs are pressed together beyond which parts that come to rest are said to have slid away: with
contacts that give by a micrometre, three millimetres."""
STIFFNESS = 1e6
"""N/m of a contact point along its normal: sets the size of displacements, no verdict depends on it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PointSeen:
    """A point looked at from outside the solver, in units of the load.

    Attributes:
        u: (n,) displacements, in the unknowns of the contacts' rows.
        forces: (C, 3) along the axes.
        left: (n,) what no contact force balances.
        slip: (C, 2) along the tangents.
        violation: how far forces and displacements are from Coulomb's law, relative.
        travel: how far parts slide, over how far springs are pressed together.
    """

    u: Array
    forces: Array
    left: Array
    slip: Array
    violation: float
    travel: float

    @property
    def share(self) -> float:
        """Return the unbalanced share of the load."""
        return float(np.linalg.norm(self.left))


def standing(
    contacts: FrictionalContacts,
    wrenches: Array,
    *,
    start: Array | None = None,
    stiffness: float = STIFFNESS,
) -> FrictionVerdict:
    """Return whether parts stand under `wrenches` (N, dof), with the forces, or how they fall.

    `start` is the `state` of a verdict on the same contacts under a similar load; it saves time and decides nothing.
    `stiffness` is k_n of the mean contact point, N/m. Raises InputError for a stiffness that is not positive and for
    wrenches that are not finite numbers of the right shape.
    """
    if not (np.isfinite(stiffness) and stiffness > 0):
        raise InputError(f"The stiffness of contacts is {stiffness}; it must be a number > 0, N/m.")
    wrenches = np.asarray(wrenches, dtype=np.float64)
    if wrenches.shape != (len(contacts.free), contacts.rows.dof) or not np.isfinite(wrenches).all():
        raise InputError(
            f"wrenches have shape {wrenches.shape}; expected finite ({len(contacts.free)}, {contacts.rows.dof})."
        )
    w = contacts.rows.scaled(wrenches)
    scale = max(float(np.linalg.norm(w)), float(contacts.clamping.max(initial=0.0)))
    if scale == 0.0 or not contacts.free[contacts.pairs].any():
        return _untouched(contacts, w)
    return _answer(contacts, wrenches, scale, start, stiffness)


@with_one_blas_thread
def _answer(
    contacts: FrictionalContacts, wrenches: Array, scale: float, start: Array | None, stiffness: float
) -> FrictionVerdict:
    """Return the verdict on `wrenches` (N, dof); forces are solved in units of `scale` newtons."""
    w = contacts.rows.scaled(wrenches) / scale
    problem = _problem(contacts, w, scale)
    found = rest(problem, start)
    seen = _seen(contacts, w, scale, found)
    bound: EquilibriumResult | None = None
    programs = found.programs
    if not _rests(found, seen):
        bound = contacts.bound(wrenches)
        if bound.status is Status.NOT_IN_EQUILIBRIUM:
            return _held_by_nothing(contacts, bound, programs)
        found = move(problem, found)
        programs += found.programs
        seen = _seen(contacts, w, scale, found)
    if seen is None:
        return _unknown(contacts, bound, programs)
    if _rests(found, seen):
        standing = Standing.STANDS
        if seen.travel > SLID_AWAY:
            standing = Standing.STANDS_ONLY_CLAMPED
            bound = contacts.bound(wrenches)
    elif found.falls and seen.violation <= COMPLEMENTARITY and seen.share >= LEAST_UNBALANCED:
        held = bound is not None and bound.status is Status.EQUILIBRIUM
        standing = Standing.STANDS_ONLY_CLAMPED if held else Standing.FALLS
    else:
        standing = Standing.UNDECIDED
    return _verdict(contacts, seen, standing, bound, scale, stiffness, programs, found)


def _problem(contacts: FrictionalContacts, w: Array, scale: float) -> CompliantCones:
    """Return the problem in units of the load and of the mean contact point's compliance, contacts sorted by pair."""
    blocks, steep = contacts.rows.blocks, contacts.steep
    order = blocks.source[::3] // 3
    compliance = contacts.softness.copy()
    compliance[:, 0] *= steep[:, 0] ** 2
    overlap = contacts.softness[:, 0] * contacts.clamping / scale * steep[:, 0]
    return CompliantCones(
        blocks,
        blocks.own_transposed(w),
        np.ascontiguousarray(compliance[order].T),
        np.zeros_like(blocks.own_gram),
        np.ascontiguousarray(overlap[order]),
    )


def _rests(found: StepsSettled, seen: PointSeen | None) -> bool:
    """Return whether forces that obey Coulomb's law hold the load."""
    return found.rests and seen is not None and max(seen.violation, seen.share) <= EQUILIBRIUM_RESIDUAL


def _seen(contacts: FrictionalContacts, w: Array, scale: float, found: StepsSettled) -> PointSeen | None:
    """Return the evidence that a point gives, computed from its displacements and forces alone."""
    if found.point is None:
        return None
    rows, blocks, point = contacts.rows, contacts.rows.blocks, found.point
    z = np.stack([blocks.forces(np.repeat(row, 3))[::3] for row in point.z], axis=1)
    u = np.asarray((blocks.to_own @ point.u.reshape(-1, rows.dof, 1)).ravel())
    moves = (rows.matrix @ u).reshape(-1, 3)
    forces = z * contacts.steep
    violation, slip = _law(contacts, forces, moves, scale)
    pressed = float((contacts.softness[:, 0] * forces[:, 0]).max(initial=0.0))
    travel = float(np.hypot(*slip.T).max(initial=0.0)) / max(pressed, TINY)
    left = w + rows.matrix.T @ z.ravel()
    return PointSeen(u=u, forces=forces, left=left, slip=slip, violation=violation, travel=travel)


def _law(contacts: FrictionalContacts, forces: Array, moves: Array, scale: float) -> tuple[float, Array]:
    """Return how far forces (C, 3) and relative motions (C, 3) along the rows are from Coulomb's law, and the slip.

    Relative: to the largest force, and to the largest displacement at any contact.
    """
    mu, steep, soft = contacts.friction, contacts.steep, contacts.softness
    normal, friction = forces[:, 0], forces[:, 1:]
    touching = contacts.free[contacts.pairs].any(axis=1)
    gap = (moves[:, 0] / steep[:, 0] - soft[:, 0] * contacts.clamping / scale + soft[:, 0] * normal) * touching
    slip = (moves[:, 1:] + soft[:, 1:] * friction) * (steep[:, 1:] > 0.0)
    strength, way = np.hypot(*friction.T), np.hypot(*slip.T)
    far = max(float(np.abs(moves).max(initial=0.0)), float(np.abs(gap).max(initial=0.0)), TINY)
    hard = max(float(normal.max(initial=0.0)), TINY)
    violations = (
        (strength - mu * normal) / hard,
        -normal / hard,
        -gap / far,
        normal * gap / (hard * far),
        (mu * normal - strength) * way / (hard * far),
        (strength * way + (friction * slip).sum(axis=1)) / (hard * far),
    )
    return max(float(v.max(initial=0.0)) for v in violations), slip


def _verdict(
    contacts: FrictionalContacts,
    seen: PointSeen,
    standing: Standing,
    bound: EquilibriumResult | None,
    scale: float,
    stiffness: float,
    programs: int,
    found: StepsSettled,
) -> FrictionVerdict:
    """Return the verdict in newtons and metres."""
    rows, rests = contacts.rows, found.rests
    slip, motion = seen.slip * scale / stiffness, seen.left * scale
    if rests and standing is not Standing.STANDS:
        motion = seen.u * scale / max(float(np.linalg.norm(seen.u)), TINY)
    if not rests:
        slip = (rows.matrix @ motion).reshape(-1, 3)[:, 1:]
    moves = rows.unscaled_motion(motion)
    gives = rows.unscaled_motion(seen.u * scale / stiffness)
    return FrictionVerdict(
        standing=standing,
        forces=np.einsum("ck,ckd->cd", seen.forces, contacts.axes) * scale,
        displacements=gives if rests else np.zeros_like(gives),
        slip=np.einsum("ck,ckd->cd", slip, contacts.axes[:, 1:]),
        motions=np.zeros_like(moves) if standing is Standing.STANDS else moves,
        unbalanced=seen.share,
        complementarity=seen.violation,
        travel=seen.travel,
        clamped_forces=bound.forces if bound is not None and standing is Standing.STANDS_ONLY_CLAMPED else None,
        bound=bound,
        programs=programs,
        shares=found.shares,
        state=None if found.point is None else found.point.u,
    )


def _held_by_nothing(contacts: FrictionalContacts, bound: EquilibriumResult, programs: int) -> FrictionVerdict:
    """Return the verdict where no forces within the cones hold the load: Eq. 8 and its motion prove it."""
    return FrictionVerdict(
        standing=Standing.FALLS,
        forces=bound.forces,
        displacements=np.zeros_like(bound.motions),
        slip=np.zeros_like(contacts.normals),
        motions=bound.motions,
        unbalanced=float(np.sqrt(2.0 * bound.infeasibility)),
        complementarity=float("nan"),
        travel=float("nan"),
        bound=bound,
        programs=programs,
    )


def _unknown(contacts: FrictionalContacts, bound: EquilibriumResult | None, programs: int) -> FrictionVerdict:
    """Return that nothing is known, not even a step of time."""
    still = np.zeros((len(contacts.free), contacts.rows.dof))
    return FrictionVerdict(
        standing=Standing.UNDECIDED,
        forces=np.full_like(contacts.normals, np.nan),
        displacements=still,
        slip=np.zeros_like(contacts.normals),
        motions=still,
        unbalanced=float("nan"),
        complementarity=float("nan"),
        travel=float("nan"),
        bound=bound,
        programs=programs,
    )


def _untouched(contacts: FrictionalContacts, w: Array) -> FrictionVerdict:
    """Return the verdict on parts without a load, or without a contact that could hold any of them."""
    loaded = bool(w.any())
    none = np.zeros_like(contacts.normals)
    return FrictionVerdict(
        standing=Standing.FALLS if loaded else Standing.STANDS,
        forces=none,
        displacements=np.zeros((len(contacts.free), contacts.rows.dof)),
        slip=none,
        motions=contacts.rows.unscaled_motion(w),
        unbalanced=1.0 if loaded else 0.0,
        complementarity=0.0,
    )
