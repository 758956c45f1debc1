"""Kinematic design: which wrenches must each joint transmit, and can any joint within the bounds do it (Eq. 13).

With the insertion directions fixed, asking for cone joints that hold every load is a convex programme: any force
at any place where a joint may have that slope. Formally a cone joint is to it what friction is to a flat contact.
`bound` is the relaxation that proves a negative; `required_wrenches` spends as little slope as possible and
so touches few joints and keeps them shallow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.cones import generalized_normals
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.solution import EquilibriumResult, solve_system
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.tolerances import ROUNDING, TINY
from planners.cone_joints.energy import Loads
from planners.cone_joints.rubbing import spread

FORCE_PRICE = 1e-3
"""Per unit of force, beside E: too little to change what a joint needs, enough to choose among equals."""


@dataclass(frozen=True, eq=False)
class Requirement:
    """What kinematic design asks of the joints.

    Attributes:
        wrenches: (K, E, dof) wrench each joint must transmit to its later part per case, about the contact's
            centre, torque over the contact's length, in units of the case's total wrench.
        slope: (E,) share of sloped force: 0 = the planar contact suffices.
        residual: (K,) E/|w|² that the relaxation leaves; above zero even steep joints do not help.
    """

    wrenches: Array
    slope: Array
    residual: Array


@dataclass(frozen=True, eq=False)
class Impossible:
    """Proof that no joint within the bounds holds a load case: forces fail, and this motion wins.

    Attributes:
        case: index of the load case.
        infeasibility: E/|w|² that is left even when every contact point may use every allowed slope.
        motions: (N, dof) the collapse motion that all of these forces together cannot stop.
    """

    case: int
    infeasibility: float
    motions: Array


def fan(normals: Array, slopes: Sequence[float], turns: int = 8) -> Array:
    """Return (E, S, d) unit directions leaning from each normal by each of `slopes` radians, on all sides."""
    sides = spread(normals, turns)
    fans = [np.cos(s) * normals[:, None] + np.sin(s) * sides for s in slopes]
    return np.concatenate(fans, axis=1)


def bound(
    graph: PartsGraph, can_curve: BoolArray, options: JointOptions, loads: Loads, required: int
) -> Impossible | None:
    """Return a proof that no joints within `options` hold the required cases, or None when some might.

    Forces stand at the corners of the slab that contains every allowed joint, and lean by up to the largest slope
    from the contact's normal: a superset of what any joint can transmit, whatever the insertion directions.
    Friction that the design counts on lets them lean further. In 3D the circular cone is replaced by an octagonal one
    around it. Masses are those of the input.
    """
    pairs, points, normals = [], [], []
    flat, contacts = graph.assembly.dimension == 2, graph.contacts
    rubs = float(np.arctan(options.counted_friction))
    slope = _around(options.max_slope_rad + rubs, flat)
    highest = options.tallest_frustum if options.frusta and not flat else options.max_height
    for contact, curves in zip(contacts, can_curve):
        corners = contact.polygon
        directions = contact.normal[None]
        if curves:
            depth = highest * contact.measure ** (1.0 if flat else 0.5)
            corners = np.concatenate([corners + s * depth * contact.normal for s in (-1.0, 1.0)])
            directions = np.concatenate([directions, fan(contact.normal[None], [slope])[0]])
        elif rubs > 0.0:
            directions = np.concatenate([directions, fan(contact.normal[None], [_around(rubs, flat)])[0]])
        points.append(np.repeat(corners, len(directions), axis=0))
        normals.append(np.tile(directions, (len(corners), 1)))
        pairs.append(np.tile(contact.parts, (len(points[-1]), 1)))
    owner = np.repeat(np.arange(len(contacts)), [len(p) for p in points])
    system = ContactSystem.build(
        np.concatenate(pairs),
        np.concatenate(points),
        np.concatenate(normals),
        np.asarray(loads.free.any(axis=0)),
        loads.about,
        loads.length,
    )
    # A failing case is usually the last one placed or the steepest tilt; the whole assembly comes first.
    for case in range(required):
        result = _solve(system, loads, case, owner, None)
        if not result.stands and result.infeasibility > ROUNDING:
            return Impossible(case, result.infeasibility, result.motions)
    return None


def _around(angle_rad: float, flat: bool) -> float:
    """Return how far the edges lean whose convex cone, with the normal, contains all directions within an angle.

    Beyond a right angle that is every direction.
    """
    if angle_rad < ALL_DIRECTIONS:
        return float(np.arctan(np.tan(angle_rad) * (1.0 if flat else 1.0 / np.cos(np.pi / 8))))
    return float(max(angle_rad, np.pi - ALL_DIRECTIONS))


ALL_DIRECTIONS = float(np.deg2rad(89.0))
"""Lean from which a fan is taken to contain every direction."""


def required_wrenches(
    contacts: Sequence[Contact],
    points: Array,
    normals: Array,
    cost: Array,
    allowed: BoolArray,
    loads: Loads,
    cases: Sequence[int],
) -> Requirement:
    """Return the wrenches joints must transmit when slope is as scarce as possible.

    Args:
        points, normals: (E, R, d) where and how each joint could push.
        cost: (E, R) price of a unit of force, 0 for the planar contact's own.
        allowed: (E, R) rays that assemblability leaves.
        cases: indices of the load cases to solve.
    """
    count, rays, d = points.shape
    pairs = np.repeat([c.parts for c in contacts], rays, axis=0)
    use = allowed.ravel()
    owner = np.repeat(np.arange(count), rays)[use]
    free = np.asarray(loads.free.any(axis=0))
    system = ContactSystem.build(
        pairs[use], points.reshape(-1, d)[use], normals.reshape(-1, d)[use], free, loads.about, loads.length
    )
    price = FORCE_PRICE * cost.ravel()[use]
    centres = np.array([c.centre for c in contacts])
    lengths = np.array([c.measure ** (1.0 / (d - 1)) for c in contacts])
    local = generalized_normals(points.reshape(-1, d)[use] - centres[owner], normals.reshape(-1, d)[use])
    local[:, d:] /= lengths[owner, None]
    wrenches = np.zeros((len(cases), count, system.dof))
    slope, total = np.zeros(count), np.zeros(count)
    residual = np.zeros(len(cases))
    for k, case in enumerate(cases):
        result = _solve(system, loads, case, owner, price)
        residual[k] = result.infeasibility
        np.add.at(wrenches[k], owner, result.forces[:, None] * local)
        sloped = np.bincount(owner, result.forces * (price > 0), count)
        slope = np.maximum(slope, sloped)
        total = np.maximum(total, np.bincount(owner, result.forces, count))
    return Requirement(wrenches, slope / max(float(total.max(initial=0.0)), TINY), residual)


def _solve(system: ContactSystem, loads: Loads, case: int, owner: IntArray, price: Array | None) -> EquilibriumResult:
    """Return one case solved in units of its own total wrench; forces come back for all rays of `system`."""
    active = loads.active[case][owner]
    part = system.subset(active).holding(loads.free[case])
    wrench = loads.wrenches[case][loads.free[case]].ravel()
    scale = float(np.linalg.norm(wrench)) or 1.0
    result = solve_system(part, wrench / scale, cost=None if price is None else price[active])
    forces = np.zeros(len(owner))
    forces[active] = result.forces
    return EquilibriumResult(result.status, result.infeasibility, forces, result.motions, result.kkt)
