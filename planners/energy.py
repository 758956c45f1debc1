"""E of all load cases together as a function of joint parameters, with its gradient by the envelope theorem.

For fixed geometry E = min over f ≥ 0 of ½|G f + w|². With r = G f + w at the optimum, any parameter φ gives
dE/dφ = rᵀ(dG/dφ f + dw/dφ): no solver has to be differentiated. r is the collapse motion, so rᵀ dG f is the power
of the contact forces in it, which is evaluated locally, joint by joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mocca_robot.assembly import Array, Assembly, BoolArray, IntArray
from mocca_robot.contacts import Contact
from mocca_robot.loads import LoadCase, case_wrenches
from mocca_robot.motion_cone import cross
from mocca_robot.statics.batch import BatchResult, solve_cases
from mocca_robot.statics.system import ContactSystem


@dataclass(frozen=True, eq=False)
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
    def of(cls, assembly: Assembly, contacts: Sequence[Contact], cases: Sequence[LoadCase]) -> Loads:
        """Return the arrays of `cases` for the planar assembly."""
        about = np.array([p.centroid for p in assembly.parts])
        length = assembly.size / 2
        d = assembly.dimension
        raw = np.array([case_wrenches(c, assembly, contacts) for c in cases])
        raw[..., d:] = (raw[..., d:] - cross(np.broadcast_to(about, raw[..., :d].shape), raw[..., :d])) / length
        raw[~np.array([c.free for c in cases])] = 0.0
        unit = float(np.mean([p.mass for p in assembly.parts]) * np.linalg.norm(assembly.gravity))
        pairs = np.array([c.parts for c in contacts])
        present = np.array([c.present for c in cases])
        thickness = np.array([getattr(p.shape, "thickness", 1.0) * p.density for p in assembly.parts])
        return cls(
            np.array([np.zeros(d) if c.gravity is None else c.gravity for c in cases]),
            raw / unit,
            np.array([c.free for c in cases], dtype=np.bool_),
            np.asarray(present[:, pairs].all(axis=2)),
            about,
            length,
            unit,
            thickness / unit,
        )

    @cached_property
    def scale(self) -> Array:
        """Return (K,) |w| of each case."""
        return np.asarray(np.maximum(np.linalg.norm(self.wrenches.reshape(len(self.wrenches), -1), axis=1), 1e-300))

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
    """

    infeasibility: Array
    motions: Array
    forces: Array
    batch: BatchResult

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
    result = solve_cases(system, scaled, active=active, free=loads.free, warm=None if warm is None else warm.batch)
    motions = np.zeros((len(wrenches), len(free), system.dof))
    motions[:, free] = result.residual.reshape(len(wrenches), -1, system.dof)
    infeasibility = 0.5 * (result.residual**2).sum(axis=1)
    return EnergyResult(infeasibility, motions, result.forces.reshape(-1, count, rays), result)


def local_power(result: EnergyResult, loads: Loads, pairs: IntArray, points: Array, normals: Array) -> Array:
    """Return (E,) Σ_k f_k n̂_k · (velocity of P_j − velocity of P_i at r_k), summed over the cases.

    With forces and motions of the optimum this is rᵀ G f of each joint; its derivative is that of E.
    """
    d = points.shape[2]
    power = np.zeros(len(pairs))
    for motion, forces in zip(result.motions, result.forces):
        relative = _velocity(motion[pairs[:, 1]], points - loads.about[pairs[:, 1]][:, None], loads.length, d)
        relative -= _velocity(motion[pairs[:, 0]], points - loads.about[pairs[:, 0]][:, None], loads.length, d)
        power += np.einsum("er,erd,erd->e", forces, normals, relative)
    return power


def _velocity(motion: Array, arm: Array, length: float, d: int) -> Array:
    linear, angular = motion[:, None, :d], motion[:, None, d:] / length
    if d == 2:
        return np.asarray(linear + angular * np.stack([-arm[..., 1], arm[..., 0]], axis=-1))
    return np.asarray(linear + np.cross(np.broadcast_to(angular, arm.shape), arm))
