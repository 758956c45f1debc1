"""Contact points as springs between rigid parts, in coordinates in which all masses are one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.geometry.cones import generalized_normals
from mocca_robot.geometry.frames import tangents
from sim.coulomb.kernel import ContactSprings

HEAVY = 2.0
"""Mass of a part, in every direction, as a multiple of the springs' stiffness at it. All modes of all parts then have
ω² ≤ 2 / HEAVY: an explicit step of 1 is stable where ω² (½ + `VISCOSITY`) < 2."""
VISCOSITY = 1.0
"""Damping of a pressed contact as a multiple of its stiffness, in steps."""
LOOSE = 1e-3
"""Share of a part's stiffness that is added in every direction: what no spring holds needs a mass, too."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Springs:
    """C contact points of F free parts. A part's motion is whitening · q, with q of unit mass.

    Attributes:
        contacts: the springs, in q.
        axes: (C, d, d) [normal; tangents] in the world; the normal points from the first into the second part.
        whitening: (F, dof, dof) upper triangular, for motions [shift; turn · length].
        adrift: (F,) parts that no chain of contacts joins to the ground.
        used: (K,) which of the contact points that were given these are: all between parts of which one is free.
        free: (F,) which of the N parts they are.
        count: N.
        about: (F, d) reference points of the motions, metres.
        length: metres.
        clamping: (C,) newtons with which parts press on each other as long as nothing gives.
    """

    contacts: ContactSprings
    axes: Array
    whitening: Array
    adrift: BoolArray
    used: BoolArray
    free: IntArray
    count: int
    about: Array
    length: float
    clamping: Array

    @classmethod
    def build(
        cls,
        pairs: IntArray,
        points: Array,
        normals: Array,
        *,
        friction: float | Array,
        free: BoolArray,
        about: Array,
        length: float,
        stiffness: Array | None = None,
        shear_ratio: float = 1.0,
        clamping: Array | None = None,
    ) -> Springs:
        """Return the springs at contact `points` (K, d), unit `normals` (K, d) from part i into part j of `pairs`.

        Args:
            friction: Coulomb coefficient of all, or (K,) of each.
            free: (N,) parts that can move.
            about: (N, d) reference point of each part's motion.
            length: a size of the assembly, metres.
            stiffness: (K,) of the springs, equal by default. Only ratios count: points and normals stay where they
                are, so everything grows in proportion to the load.
            shear_ratio: tangential stiffness as a multiple of the normal one.
            clamping: (K,) newtons with which parts press on each other at each point as long as nothing gives.
        """
        count, d = len(free), points.shape[1]
        used = free[pairs].any(axis=1)
        moving = np.flatnonzero(free)
        place = np.full(count, len(moving))
        place[moving] = np.arange(len(moving))
        first, second = place[pairs[used]].T
        axes = np.concatenate([normals[used, None], tangents(normals[used])], axis=1)
        sides = [_rows(axes, points[used], about[pairs[used, s]], length) for s in (0, 1)]
        normal = np.ones(len(first)) if stiffness is None else stiffness[used] / stiffness[used].max(initial=0.0)
        held = _held((first, second), sides, normal, shear_ratio, len(moving))
        whitening = _whitening(held, d)
        wide = np.concatenate([whitening, np.zeros((1, *whitening.shape[1:]))])
        rows = np.stack([np.einsum("ckx,cxy->cky", sides[s], wide[p]) for s, p in ((0, first), (1, second))], axis=1)
        contacts = ContactSprings(
            first=read_only(first, np.int64),
            second=read_only(second, np.int64),
            rows=read_only(rows),
            normal=read_only(normal),
            tangential=read_only(shear_ratio * normal),
            friction=read_only(np.broadcast_to(np.asarray(friction, dtype=np.float64), len(pairs))[used]),
            squeeze=read_only(np.zeros(len(first))),
        )
        return cls(
            contacts=contacts,
            axes=read_only(axes),
            whitening=read_only(whitening),
            adrift=read_only(_adrift(first, second, len(moving)), np.bool_),
            used=read_only(used, np.bool_),
            free=read_only(moving, np.int64),
            count=count,
            about=read_only(about[moving]),
            length=length,
            clamping=read_only(np.zeros(len(first)) if clamping is None else clamping[used]),
        )

    @property
    def dof(self) -> int:
        """Return 3 in 2D and 6 in 3D."""
        return 3 if self.axes.shape[1] == 2 else 6

    def load(self, wrenches: Array) -> tuple[Array, float]:
        """Return world wrenches (N, dof) about the origin as forces (F, dof) on q, and the newtons of their unit.

        The unit is the largest force on any part.
        """
        d = self.about.shape[1]
        force, torque = wrenches[self.free, :d], wrenches[self.free, d:]
        if d == 2:
            torque = torque - (self.about[:, :1] * force[:, 1:] - self.about[:, 1:] * force[:, :1])
        else:
            torque = torque - np.cross(self.about, force)
        both = np.concatenate([force, torque / self.length], axis=1)
        unit = float(np.abs(both).max(initial=0.0)) or 1.0
        return np.asarray(np.einsum("fxy,fx->fy", self.whitening, both / unit)), unit

    def motions(self, q: Array) -> Array:
        """Return q (F, dof) as motions (N, dof) [shift of the reference point; turn], zero of parts that are held."""
        out = np.zeros((self.count, self.dof))
        out[self.free] = np.einsum("fxy,fy->fx", self.whitening, q)
        out[:, self.about.shape[1] :] /= self.length
        return out

    def relative(self, q: Array) -> Array:
        """Return (C, d) how far every contact's second part has gone from its first along the axes; q is (F, dof)."""
        wide, c = np.concatenate([q, np.zeros((1, self.dof))]), self.contacts
        second = np.einsum("cky,cy->ck", c.rows[:, 1], wide[c.second])
        return np.asarray(second - np.einsum("cky,cy->ck", c.rows[:, 0], wide[c.first]))

    def resultant(self, pushes: Array) -> Array:
        """Return (F, dof) the forces on q of `pushes` (C, d) along the axes, on the second part of every contact."""
        c = self.contacts
        out = np.zeros((len(self.free) + 1, self.dof))
        np.add.at(out, c.second, np.einsum("cky,ck->cy", c.rows[:, 1], pushes))
        np.add.at(out, c.first, -np.einsum("cky,ck->cy", c.rows[:, 0], pushes))
        return out[:-1]


def _rows(axes: Array, points: Array, about: Array, length: float) -> Array:
    """Return (C, d, dof) the axes at points (C, d) as generalized rows about reference points (C, d)."""
    count, d = points.shape
    every = np.repeat(np.arange(count), d)
    rows = generalized_normals(points[every], axes.reshape(-1, d), about[every], length)
    return rows.reshape(count, d, 3 if d == 2 else 6)


def _held(places: tuple[IntArray, IntArray], sides: list[Array], normal: Array, ratio: float, free: int) -> Array:
    """Return (F, dof, dof) the stiffness of all springs at each part while the others stay."""
    dof = sides[0].shape[2]
    out = np.zeros((free + 1, dof, dof))
    along = normal[:, None] * np.r_[1.0, np.full(sides[0].shape[1] - 1, ratio)]
    for place, side in zip(places, sides, strict=True):
        np.add.at(out, place, np.einsum("ckx,ck,cky->cxy", side, along, side))
    return out[:-1]


def _whitening(held: Array, d: int) -> Array:
    """Return (F, dof, dof) W with Wᵀ M W = 1 for the masses M = HEAVY · (stiffness + a little in every direction)."""
    dof = held.shape[1]
    out = np.empty_like(held)
    for p, stiff in enumerate(held):
        level = float(np.trace(stiff[:d, :d])) / d or 1.0
        turning = float(np.trace(stiff[d:, d:])) / (dof - d) or level
        loose = LOOSE * np.diag([level] * d + [turning] * (dof - d))
        out[p] = np.linalg.inv(np.linalg.cholesky(HEAVY * (stiff + loose))).T
    return out


def _adrift(first: IntArray, second: IntArray, free: int) -> BoolArray:
    graph = sp.coo_array((np.ones(len(first)), (first, second)), shape=(free + 1, free + 1))
    label = sp.csgraph.connected_components(graph, directed=False)[1]
    return np.asarray(label[:-1] != label[-1])
