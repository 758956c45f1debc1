"""How far a support may move before a flat structure falls: what rests on it follows, step by step, as far as it goes.

Parts are rigid. At every step the support goes on a little and the parts take the positions of least potential energy
that do not overlap: to first order a linear programme, min −w·v subject to g + B v ≥ 0 with the gaps g at hand (the
piecewise rigid displacement method: Iannuzzo, Van Mele and Block, 2018). Then contacts are looked up anew. It falls
where parts go on though the support rests. The multipliers of every programme are contact forces that hold the weight.

With friction a contact that slides lifts by μ times the way, as in all of limit analysis. What opens at hinges, as
arches do, does not slide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import shapely
from scipy.optimize import linprog

from mocca_robot.actions import SupportMove
from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.contacts.friction import between
from mocca_robot.errors import InputError
from mocca_robot.geometry.cones import cross
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import moving_parts
from mocca_robot.statics.load_factor import LoadFactor
from mocca_robot.statics.touching import touches
from mocca_robot.tolerances import COARSE

STEP, FINEST = 5e-3, 1e-5
"""The support goes on by the first share of the assembly's size, and near the fall by ever less down to the second."""
FALLS = 0.02
"""No part goes farther at once than this share of the size: what wants to while the support rests falls."""
AT_REST = 1e-8
"""Share of the size by which nothing moves any more."""
OVERLAP = 0.01
"""Parts that share more than the square of this share of the size have been driven into each other."""
ROUNDS = 15
"""Looks at the contacts of a step until everything rests; three at the limit of `FALLS` in a row are a fall."""
FARTHEST = 0.5
"""Share of the size up to which a support is followed."""


def support_factors(graph: PartsGraph, friction: float = 0.0) -> tuple[LoadFactor, ...]:
    """Return how far every support that moves goes, as a multiple of the move asked for, before the structure falls."""
    return tuple(support_factor(graph, a, friction) for a in graph.assembly.actions if isinstance(a, SupportMove))


def support_factor(graph: PartsGraph, action: SupportMove, friction: float = 0.0) -> LoadFactor:
    """Return how many times a support can make its move before the finished structure falls.

    Infinite where it stands though the support has gone half as far as the assembly is large, None where the support is
    driven into what cannot give way; motions are of the first step of the fall. Holes of parts touch nothing. Raises
    InputError for solids.
    """
    assembly = graph.assembly
    if assembly.dimension == 3:
        raise InputError(
            f"Load '{action.name}' moves a support; only flat structures are followed so far. Leave it out, or draw "
            "the structure with the support moved and check that."
        )
    walk = _Walk(assembly, action, friction)
    factor, motions = walk.until_it_falls()
    moving = moving_parts(assembly, motions)
    return LoadFactor(
        name=action.name,
        factor=factor,
        bound=factor,
        motions=motions,
        moving=moving,
        steps=walk.solved,
        move=(float(np.linalg.norm(action.shift)), action.turn_rad),
    )


class _Wedged(Exception):
    """A step drives parts into each other."""


@dataclass
class _Walk:
    """A structure on its way; counts the programmes solved."""

    assembly: Assembly
    action: SupportMove
    friction: float
    solved: int = 0

    def __post_init__(self) -> None:
        assembly = self.assembly
        self.rings = [p.shape.exterior for p in assembly.parts if isinstance(p.shape, Polygon)]
        self.centres = np.array([p.centroid for p in assembly.parts])
        self.free = ~assembly.fixed
        self.row = np.cumsum(self.free) - 1
        self.support = assembly.index(self.action.part)
        self.weights = np.array([p.mass for p in assembly.parts])[self.free, None] * assembly.gravity
        self.size = assembly.size

    def until_it_falls(self) -> tuple[float | None, Array]:
        """Return the largest multiple of the move that stood, and how it falls (N, 3) then; zero where it does not.

        None where the support drives into something that cannot give way.
        """
        poses, share = np.zeros((len(self.rings), 3)), 0.0
        unit = self._reach()
        poses, fall = self._settled(poses)
        if fall is not None:
            return 0.0, fall
        step = STEP * self.size / unit
        while share * unit < FARTHEST * self.size:
            try:
                after, fall = self._settled(self._followed(poses, share + step))
            except _Wedged:
                after, fall, wedged = poses, None, True
            else:
                wedged = False
            if fall is None and not wedged:
                poses, share = after, share + step
            elif step * unit > FINEST * self.size:
                step *= 0.25
            else:
                return (None, np.zeros_like(poses)) if fall is None else (share, fall)
        return np.inf, np.zeros_like(poses)

    def _reach(self) -> float:
        """Return how far the farthest point of the support goes with the whole move, metres."""
        moved = self._pose(1.0)
        arm = float(np.linalg.norm(self.rings[self.support] - self.centres[self.support], axis=1).max())
        return float(np.linalg.norm(moved[:2]) + arm * abs(moved[2]))

    def _pose(self, share: float) -> Array:
        """Return (3,) where the support is after a share of its move: shift of its centroid and turn."""
        turn, centre = share * self.action.turn_rad, self.centres[self.support]
        about = centre if self.action.about is None else self.action.about
        arm = centre - about
        c, s = np.cos(turn) - 1.0, np.sin(turn)
        return np.array([*(share * self.action.shift + [c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]]), turn])

    def _followed(self, poses: Array, share: float) -> Array:
        """Return the poses (N, 3) after the support went on and the parts followed to first order."""
        after = poses.copy()
        after[self.support] = self._pose(share)
        after[self.free] += self._least_energy(poses, after[self.support] - poses[self.support])
        return after

    def _settled(self, poses: Array) -> tuple[Array, Array | None]:
        """Return the poses in which everything rests while the support does, and how it falls where nothing rests."""
        poses, wild = poses.copy(), 0
        for _ in range(ROUNDS):
            step = self._least_energy(poses, np.zeros(3))
            far = max(float(np.abs(step[:, :2]).max()), float(np.abs(step[:, 2]).max()) * self.size / 2)
            poses[self.free] += step
            wild = wild + 1 if far > (1.0 - COARSE) * FALLS * self.size else 0
            if wild > 2:
                motions = np.zeros_like(poses)
                motions[self.free] = step
                return poses, motions
            if far < AT_REST * self.size:
                break
        if self._overlap(poses) > (OVERLAP * self.size) ** 2:
            raise _Wedged
        return poses, None

    def _overlap(self, poses: Array) -> float:
        """Return the largest area (m²) that two parts share."""
        shapes = [shapely.Polygon(self._placed(k, pose)) for k, pose in enumerate(poses)]
        first, second = shapely.STRtree(shapes).query(shapes, predicate="intersects")
        pairs = [(i, j) for i, j in zip(first, second, strict=True) if i < j and (self.free[i] or self.free[j])]
        return max((float(shapes[i].intersection(shapes[j]).area) for i, j in pairs), default=0.0)

    def _least_energy(self, poses: Array, support: Array) -> Array:
        """Return the motions (F, 3) of least potential energy that overlap nothing while the support moves on (3,)."""
        self.solved += 1
        length, count = self.size / 2, int(self.free.sum())
        met = touches([self._placed(k, poses[k]) for k in range(len(self.rings))], self.free, self.size)
        sideways = np.stack([-met.normals[:, 1], met.normals[:, 0]], axis=1)
        signs = (0.0,) if self.friction == 0.0 else (-1.0, 1.0)
        rubs = between(self.friction, self.assembly.parts, np.column_stack([met.corner, met.edge]))
        normals = np.concatenate([met.normals + sign * np.reshape(rubs, (-1, 1)) * sideways for sign in signs])
        gaps, rows = np.tile(met.gaps, len(signs)), np.arange(len(normals))
        blocks = []
        for part, side in ((met.corner, 1.0), (met.edge, -1.0)):
            part = np.tile(part, len(signs))
            arms = np.tile(met.points, (len(signs), 1)) - self.centres[part] - poses[part, :2]
            entries = side * np.column_stack([normals, cross(arms, normals)])
            led = part == self.support
            gaps = gaps + np.where(led, entries @ support, 0.0)
            moves = self.free[part]
            columns = 3 * self.row[part[moves], None] + np.arange(3)
            scaled = entries[moves] / np.array([1.0, 1.0, length])
            shape = (len(normals), 3 * count)
            blocks.append(
                sp.coo_array((scaled.ravel(), (np.repeat(rows[moves], 3), columns.ravel())), shape=shape).tocsr()
            )
        matrix = blocks[0] + blocks[1]
        work = np.zeros((count, 3))
        work[:, :2] = self.weights
        price = COARSE * float(np.linalg.norm(self.weights, axis=1).sum()) / count
        # Two halves, forth and back, so that what gains nothing costs something and stays.
        found = linprog(
            np.concatenate([price - work.ravel(), price + work.ravel()]),
            A_ub=sp.hstack([-matrix, matrix]).tocsr(),
            b_ub=gaps,
            bounds=(0.0, FALLS * self.size),
            method="highs",
        )
        if found.x is None:  # no position without overlap is within reach
            raise _Wedged
        forth, back = np.split(found.x, 2)
        return np.asarray((forth - back).reshape(count, 3) / np.array([1.0, 1.0, length]))

    def _placed(self, part: int, pose: Array) -> Array:
        """Return a part's ring (n, 2) in a pose."""
        c, s = np.cos(pose[2]), np.sin(pose[2])
        arms = self.rings[part] - self.centres[part]
        return np.asarray(arms @ np.array([[c, s], [-s, c]]) + self.centres[part] + pose[:2])
