"""E of all load cases together as a function of joint parameters, with its gradient by the envelope theorem.

For fixed geometry E = min over f ≥ 0 of ½|G f + w|². With r = G f + w at the optimum, any parameter φ gives
dE/dφ = rᵀ(dG/dφ f + dw/dφ): no solver has to be differentiated. r is the collapse motion, so rᵀ dG f is the power
of the contact forces in it, which is a sum over joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.geometry.cones import cross
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.runtime.threads import on_all_cores
from mocca_robot.statics.batch import BatchResult, solve_cases
from mocca_robot.statics.loads import LoadCase, case_wrenches
from mocca_robot.statics.solution import solve_system
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.tolerances import TINY


@dataclass(frozen=True, eq=False, kw_only=True)
class Loads:
    """The load cases of a design as arrays, and how they change when joints move mass between parts.

    Attributes:
        gravity: (K, d) acceleration per case; zero for interlocking.
        wrenches: (K, N, dof) about each part's reference point, torque over `length`, in units of `unit`.
        free: (K, N) parts that can move.
        active: (K, E) contacts whose two parts are both there.
        about: (N, d) reference points. length: metres. unit: newtons.
    """

    gravity: Array
    wrenches: Array
    free: BoolArray
    active: BoolArray
    about: Array
    length: float
    unit: float
    weight_per_volume: Array

    @classmethod
    def of(cls, graph: PartsGraph, cases: Sequence[LoadCase]) -> Loads:
        """Return the arrays of `cases` for the planar assembly."""
        assembly = graph.assembly
        about = np.array([p.centroid for p in assembly.parts])
        length = assembly.size / 2
        d = assembly.dimension
        raw = np.array([case_wrenches(c, graph) for c in cases])
        raw[..., d:] = (raw[..., d:] - cross(np.broadcast_to(about, raw[..., :d].shape), raw[..., :d])) / length
        raw[~np.array([c.free for c in cases])] = 0.0
        unit = float(np.mean([p.mass for p in assembly.parts]) * np.linalg.norm(assembly.gravity))
        pairs = np.array([c.parts for c in graph.contacts])
        present = np.array([c.present for c in cases])
        thickness = np.array([getattr(p.shape, "thickness", 1.0) * p.density for p in assembly.parts])
        return cls(
            gravity=np.array([np.zeros(d) if c.gravity is None else c.gravity for c in cases]),
            wrenches=raw / unit,
            free=np.array([c.free for c in cases], dtype=np.bool_),
            active=np.asarray(present[:, pairs].all(axis=2)),
            about=about,
            length=length,
            unit=unit,
            weight_per_volume=thickness / unit,
        )

    @cached_property
    def scale(self) -> Array:
        """Return (K,) |w| of each case."""
        return np.asarray(np.maximum(np.linalg.norm(self.wrenches.reshape(len(self.wrenches), -1), axis=1), TINY))

    def only(self, cases: IntArray) -> Loads:
        """Return the loads of the cases with these indices."""
        return replace(
            self,
            gravity=self.gravity[cases],
            wrenches=self.wrenches[cases],
            free=self.free[cases],
            active=self.active[cases],
        )

    def moved(self, pairs: IntArray, volume: Array, moment: Array) -> Array:
        """Return the change of wrenches (K, N, dof) when each joint moves volume (E,) and first moment (E, d) j → i."""
        change = np.zeros_like(self.wrenches)
        for side, sign in ((0, 1.0), (1, -1.0)):
            part = pairs[:, side]
            mass = sign * volume * self.weight_per_volume[part]
            first = sign * moment * self.weight_per_volume[part, None] - mass[:, None] * self.about[part]
            force = mass[None, :, None] * self.gravity[:, None]
            torque = cross(np.broadcast_to(first, force.shape), np.broadcast_to(self.gravity[:, None], force.shape))
            wrench = np.concatenate([force, torque / self.length], axis=2)
            for k in range(len(change)):
                np.add.at(change[k], part, wrench[k])
        change[~self.free] = 0.0
        return change


@dataclass(frozen=True, eq=False)
class EnergyResult:
    """E of every case, and what is needed to differentiate it.

    Attributes:
        infeasibility: (K,) E/|w|², |w| being that of the planar input, so that it does not move with the joints.
        motions: (K, N, dof) residual = collapse motion, scaled, divided by |w| of the case.
        forces: (K, E, R) contact forces divided by |w| of the case.
        batch: where the solver ended, from which a nearby problem starts.
        system: the contact rays of all cases.
    """

    infeasibility: Array
    motions: Array
    forces: Array
    batch: BatchResult | None
    system: ContactSystem

    @property
    def total(self) -> float:
        """Return Σ E/|w|² over the cases."""
        return float(self.infeasibility.sum())


def energy(
    loads: Loads, pairs: IntArray, points: Array, normals: Array, wrenches: Array, warm: EnergyResult | None = None
) -> EnergyResult:
    """Return E of every case for joints with contact points and normals (E, R, d), pairs (E, 2).

    `warm` is the result of a nearby problem of the same shape; it saves time and does not change the answer.
    """
    count, rays, d = points.shape
    free = np.asarray(loads.free.any(axis=0))
    system = ContactSystem.build(
        np.repeat(pairs, rays, axis=0),
        points.reshape(-1, d),
        normals.reshape(-1, d),
        free,
        loads.about,
        loads.length,
    )
    scale = loads.scale
    scaled = wrenches[:, free].reshape(len(wrenches), -1) / scale[:, None]
    active = np.repeat(loads.active, rays, axis=1)
    batch: BatchResult | None = None
    if scaled.shape[1] <= SMALL:
        batch = solve_cases(system, scaled, active=active, free=loads.free, warm=None if warm is None else warm.batch)
        residual, forces = batch.residual, batch.forces
    else:
        residual, forces = each_case(system, scaled, active, loads.free)
    motions = np.zeros((len(wrenches), len(free), system.dof))
    motions[:, free] = residual.reshape(len(wrenches), -1, system.dof)
    infeasibility = 0.5 * (residual**2).sum(axis=1)
    return EnergyResult(infeasibility, motions, forces.reshape(-1, count, rays), batch, system)


SMALL = 150
"""Unknowns up to which warm working sets beat an interior point that starts afresh."""


def each_case(
    system: ContactSystem, scaled: Array, active: BoolArray, free: BoolArray, cost: Array | None = None
) -> tuple[Array, Array]:
    """Return residuals (K, n) and forces (K, C) of large systems, cases side by side on the machine's cores.

    `active` (K, C) and `free` (K, N) as in `Loads`; `cost` (C,) is a price per unit of force.
    """
    residual, forces = np.zeros_like(scaled), np.zeros(active.shape)
    whole = system.blocks  # made once, before the threads that share it
    # Prices are there to choose by: six digits do, and where even these fail, forces without prices are a choice.
    first = "auto" if cost is None else "interior_point"

    def one(k: int) -> None:
        held = ~free[k][system.free]
        if active[k].all() and not held.any():
            part, rays, moving = system, active[k], np.ones(whole.size, dtype=np.bool_)
        else:
            part, rays = system.subset(active[k]).holding(free[k]), active[k]
            moving = np.repeat(~held, system.dof)
        result = solve_system(part, scaled[k][moving], cost=None if cost is None else cost[rays], solver=first)
        if cost is not None and not np.isfinite(result.infeasibility):
            result = solve_system(part, scaled[k][moving])
        forces[k, rays] = np.nan_to_num(result.forces)
        residual[k, moving] = scaled[k][moving] + part.matrix.T @ forces[k, rays]

    on_all_cores(one, range(len(scaled)))
    return residual, forces


def joint_wrenches(
    loads: Loads, pairs: IntArray, points: Array, normals: Array, forces: Array, volume: Array, moment: Array
) -> Array:
    """Return (K, E, 2, dof): wrenches on P_i and P_j of each joint's contact forces and of the mass it moved.

    About the parts' reference points, torque over `loads.length`, forces (K, E, R) and result over |w| of the case.
    Masses move from P_j to P_i: volume (E,), first moment (E, d).
    """
    d = points.shape[2]
    result = np.empty((len(forces), len(pairs), 2, loads.wrenches.shape[2]))
    for side, sign in ((0, -1.0), (1, 1.0)):
        part = pairs[:, side]
        lever = cross(points - loads.about[part][:, None], normals) / loads.length
        result[:, :, side, :d] = sign * np.einsum("ker,erd->ked", forces, normals)
        result[:, :, side, d:] = sign * np.einsum("ker,erd->ked", forces, lever)
        mass = -sign * volume * loads.weight_per_volume[part]
        first = -sign * moment * loads.weight_per_volume[part, None] - mass[:, None] * loads.about[part]
        gravity = np.broadcast_to(loads.gravity[:, None], (len(forces), len(pairs), d))
        result[:, :, side, :d] += mass[:, None] * gravity / loads.scale[:, None, None]
        torque = cross(np.broadcast_to(first, gravity.shape), gravity) / loads.length
        result[:, :, side, d:] += torque / loads.scale[:, None, None]
    return result
