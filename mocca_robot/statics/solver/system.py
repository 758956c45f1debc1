"""Contact points as the constraint matrix of Eq. 5/8, in units in which forces and torques are comparable."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.errors import InputError
from mocca_robot.geometry.cones import generalized_normals
from mocca_robot.tolerances import COARSE

if TYPE_CHECKING:
    from mocca_robot.statics.solver.blocks import PairBlocks


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactSystem:
    """C unilateral contact rays between N parts.

    Row c of B is +g_j on part j and −g_i on part i of `pairs[c]`, where g = [n̂; (r − about) × n̂ / length]:
    B v ≥ 0 keeps the parts from penetrating (Eq. 5), and Bᵀ f are the wrenches of contact forces f (Eq. 2).

    Attributes:
        pairs: (C, 2) part indices (i, j); the normal points from i into j.
        rays_i, rays_j: (C, dof) generalized normals about the reference point of either part.
        free: (N,) parts that can move; the others are ground.
        about: (N, d) reference point of each part's motion.
        length: metres; torques are divided and angular velocities multiplied by it.
    """

    pairs: IntArray
    rays_i: Array
    rays_j: Array
    free: BoolArray
    about: Array
    length: float

    @classmethod
    def build(
        cls,
        pairs: IntArray,
        points: Array,
        normals: Array,
        free: BoolArray,
        about: Array | None = None,
        length: float | None = None,
    ) -> ContactSystem:
        """Return the system of contact `points` (C, d) with unit `normals` (C, d) pointing from i into j.

        `about` (N, d) defaults to the origin, `length` to the RMS distance of the points from their mean.
        Raises InputError for shapes that do not match, non-finite numbers, unknown parts or normals that are
        not of unit length.
        """
        pairs = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
        points, normals = np.asarray(points, dtype=np.float64), np.asarray(normals, dtype=np.float64)
        n_parts, d = len(free), points.shape[-1]
        if points.shape != normals.shape or len(points) != len(pairs) or d not in (2, 3):
            raise InputError(
                f"pairs {pairs.shape}, points {points.shape} and normals {normals.shape} must be "
                "(C, 2), (C, d) and (C, d) with d = 2 or 3."
            )
        if len(pairs) and (pairs.min() < 0 or pairs.max() >= n_parts):
            wrong = pairs[(pairs < 0) | (pairs >= n_parts)][0]
            raise InputError(f"pairs name part {wrong}, but there are parts 0 … {n_parts - 1} only.")
        if (pairs[:, 0] == pairs[:, 1]).any():
            own = int(np.flatnonzero(pairs[:, 0] == pairs[:, 1])[0])
            raise InputError(f"Contact {own} is between part {pairs[own, 0]} and itself; a contact has two parts.")
        if not (np.isfinite(points).all() and np.isfinite(normals).all()):
            raise InputError("Contact points and normals must be finite numbers.")
        lengths = np.linalg.norm(normals, axis=1)
        if len(lengths) and np.abs(lengths - 1.0).max() > COARSE:
            worst = int(np.abs(lengths - 1.0).argmax())
            raise InputError(f"Normal {worst} has length {lengths[worst]:.6g}; normals must have length 1.")
        about = np.zeros((n_parts, d)) if about is None else np.asarray(about, dtype=np.float64)
        if about.shape != (n_parts, d) or not np.isfinite(about).all():
            raise InputError(f"Reference points 'about' have shape {about.shape}; expected finite ({n_parts}, {d}).")
        if length is not None and not (np.isfinite(length) and length > 0):
            raise InputError(f"The unit of length is {length}; it must be a number > 0, metres.")
        if length is None:
            spread = points - points.mean(axis=0) if len(points) else np.ones((1, d))
            length = float(np.sqrt((spread**2).sum(axis=1).mean())) or 1.0
        i, j = pairs[:, 0], pairs[:, 1]
        return cls(
            pairs=pairs,
            rays_i=generalized_normals(points, normals, about[i], length),
            rays_j=generalized_normals(points, normals, about[j], length),
            free=np.asarray(free, dtype=np.bool_),
            about=about,
            length=length,
        )

    @property
    def dof(self) -> int:
        """Return 3 in 2D and 6 in 3D."""
        return 3 if self.about.shape[1] == 2 else 6

    @cached_property
    def columns(self) -> IntArray:
        """Return (N,) the first unknown of each part's motion, −1 for ground."""
        columns = np.full(len(self.free), -1)
        columns[self.free] = np.arange(int(self.free.sum())) * self.dof
        return columns

    @cached_property
    def matrix(self) -> sp.csr_array:
        """Return B, (C, dof · number of free parts), sparse."""
        n, dof = len(self.pairs), self.dof
        rows, cols, values = [], [], []
        for side, rays, sign in ((0, self.rays_i, -1.0), (1, self.rays_j, 1.0)):
            column = self.columns[self.pairs[:, side]]
            moving = np.flatnonzero(column >= 0)
            rows.append(np.repeat(moving, dof))
            cols.append((column[moving, None] + np.arange(dof)).ravel())
            values.append(sign * rays[moving].ravel())
        shape = (n, dof * int(self.free.sum()))
        index = (np.concatenate(rows), np.concatenate(cols))
        return sp.csr_array((np.concatenate(values), index), shape=shape)

    @cached_property
    def blocks(self) -> PairBlocks:
        """Return the rays sorted by pair of parts, for the interior point; made once, for every load."""
        from mocca_robot.statics.solver.blocks import PairBlocks  # compiled code: loaded where it is used

        return PairBlocks.of(self.pairs, self.rays_j, self.free, self.about, self.length)

    def scaled(self, wrenches: Array) -> Array:
        """Return world wrenches (…, N, dof) about the origin as scaled unknown-space vectors (…, dof · free)."""
        d = self.about.shape[1]
        force, torque = wrenches[..., :d], wrenches[..., d:]
        if d == 2:
            shift = self.about[:, 0] * force[..., 1] - self.about[:, 1] * force[..., 0]
            torque = (torque - shift[..., None]) / self.length
        else:
            torque = (torque - np.cross(np.broadcast_to(self.about, force.shape), force)) / self.length
        both = np.concatenate([force, torque], axis=-1)[..., self.free, :]
        return np.asarray(both.reshape(*both.shape[:-2], -1))

    def unscaled_motion(self, v: Array) -> Array:
        """Return scaled motions (…, dof · free) as (…, N, dof) [velocity at `about`; angular velocity]."""
        d = self.about.shape[1]
        motion = np.zeros((*v.shape[:-1], len(self.free), self.dof))
        motion[..., self.free, :] = v.reshape(*v.shape[:-1], -1, self.dof)
        motion[..., d:] /= self.length
        return motion

    def subset(self, rays: BoolArray) -> ContactSystem:
        """Return the system with only the contact rays where `rays` (C,) is true."""
        return ContactSystem(
            pairs=self.pairs[rays],
            rays_i=self.rays_i[rays],
            rays_j=self.rays_j[rays],
            free=self.free,
            about=self.about,
            length=self.length,
        )

    def holding(self, free: BoolArray) -> ContactSystem:
        """Return the system with other parts free to move."""
        return ContactSystem(
            pairs=self.pairs, rays_i=self.rays_i, rays_j=self.rays_j, free=free, about=self.about, length=self.length
        )
