"""Flat joints as numbers: all joints of an assembly evaluated at once, for the optimiser.

One row of `shape` per joint (w1, w2, h1, h2: see `mocca_robot.joints.spline`), one principal direction per pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.joints.options import JointOptions
from mocca_robot.joints.spline import SplineKind, polyline_joint, smallest_radius, spline_points
from mocca_robot.tolerances import PLANE, ROUNDING, TINY
from planners.cone_joints.clearance2d import Clearance2D, clearance_2d
from planners.cone_joints.shapes import turned_within


@dataclass(frozen=True, eq=False, kw_only=True)
class Shapes2D:
    """The joints of a flat assembly, evaluated together.

    Attributes:
        contacts: one per joint.
        kinds: 'n' or 'z' per joint.
        pair: (E,) index of each joint's pair; joints of one pair share u.
        pair_normal: (Q, 2) unit reference direction of each pair: u is it turned by the pair's lean.
        clearance: how much room either part leaves.
        limits: (E, 2) lowest and highest bump, m, that is wanted besides; infinite where nothing is.
    """

    assembly: Assembly
    contacts: tuple[Contact, ...]
    kinds: tuple[SplineKind, ...]
    pair: IntArray
    pair_normal: Array
    options: JointOptions
    clearance: Clearance2D
    limits: Array

    n_lean: ClassVar[int] = 1
    steepest_lean: ClassVar[float] = 0.85
    rest_kind: ClassVar[SplineKind] = "n"
    heights: ClassVar[tuple[int, ...]] = (2, 3)
    """Columns of `shape` that are heights: a joint with all of them zero is planar."""

    @classmethod
    def of(cls, assembly: Assembly, contacts: Sequence[Contact], options: JointOptions) -> Shapes2D:
        """Return the n-type joints over `contacts`."""
        pairs = sorted({c.parts for c in contacts})
        index = {p: k for k, p in enumerate(pairs)}
        normals = np.zeros((len(pairs), 2))
        for c in contacts:
            normals[index[c.parts]] += c.normal * c.measure
        norms = np.linalg.norm(normals, axis=1)
        first = {c.parts: c.normal for c in reversed(contacts)}
        for q, p in enumerate(pairs):
            normals[q] = normals[q] / norms[q] if norms[q] > ROUNDING else first[p]
        pair = np.array([index[c.parts] for c in contacts])
        clearance = clearance_2d(assembly, contacts, options)
        kinds: tuple[SplineKind, ...] = tuple(cls.rest_kind for _ in contacts)
        return cls(
            assembly=assembly,
            contacts=tuple(contacts),
            kinds=kinds,
            pair=pair,
            pair_normal=read_only(normals),
            options=options,
            clearance=clearance,
            limits=read_only(np.tile([-np.inf, np.inf], (len(contacts), 1))),
        )

    @property
    def rest(self) -> Array:
        """Return the row of `shape` of a planar joint."""
        flat = max(self.options.margin, 0.02) + 0.02
        return np.array([flat, flat, 0.0, 0.0])

    @cached_property
    def segments(self) -> Array:
        """Return (E, 2, 2) contact end points."""
        return read_only([c.polygon for c in self.contacts])

    @cached_property
    def normals(self) -> Array:
        """Return (E, 2) contact normals."""
        return read_only([c.normal for c in self.contacts])

    @cached_property
    def centres(self) -> Array:
        """Return (E, 2) contact mid points."""
        return read_only(self.segments.mean(axis=1))

    @cached_property
    def lengths(self) -> Array:
        """Return (E,) contact lengths, m."""
        return read_only([c.measure for c in self.contacts])

    @cached_property
    def can_curve(self) -> BoolArray:
        """Return (E,) whether a contact may become a joint: long enough, and u can be a height direction of it."""
        upright = np.einsum("ed,ed->e", self.normals, self.pair_normal[self.pair]) > 0.35
        return read_only((self.lengths >= self.options.min_contact) & upright, np.bool_)

    def directions(self, lean: Array) -> Array:
        """Return (E, 2) principal directions for the pairs' leans (Q, 1), radians."""
        c, s = np.cos(lean[:, 0]), np.sin(lean[:, 0])
        n = self.pair_normal
        turned = np.stack([c * n[:, 0] - s * n[:, 1], s * n[:, 0] + c * n[:, 1]], axis=1)
        return np.asarray(turned[self.pair])

    def surface(self, shape: Array, u: Array) -> Array:
        """Return curve points (E, V, 2), V = 21 (piecewise-planar: 6), for shapes (E, 4) and directions (E, 2)."""
        piecewise = self.options.piecewise_planar
        points = np.empty((len(shape), 6 if piecewise else 21, 2))
        for kind in ("n", "z"):
            which = np.array([k == kind for k in self.kinds])
            if which.any():
                points[which] = spline_points(kind, self.segments[which], u[which], shape[which], piecewise)
        return points

    def rays(self, curve: Array) -> tuple[Array, Array]:
        """Return contact points and normals, (E, 2 (V − 1), 2) each: both ends of every straight piece."""
        step = np.diff(curve, axis=1)
        normals = np.stack([step[..., 1], -step[..., 0]], axis=-1)
        normals /= np.maximum(np.linalg.norm(normals, axis=-1), TINY)[..., None]
        points = np.concatenate([curve[:, :-1], curve[:, 1:]], axis=1)
        return points, np.concatenate([normals, normals], axis=1)

    def all_rays(self, curve: Array) -> tuple[Array, Array]:
        """Return `rays`: those of curves are complete."""
        return self.rays(curve)

    def transferred(self, curve: Array) -> tuple[Array, Array]:
        """Return the area (E,) and first moment (E, 2) that each curve moves from P_j to P_i."""
        curve = curve - self.segments[:, :1]
        ring = np.concatenate([curve, curve[:, :1]], axis=1)
        cross = ring[:, :-1, 0] * ring[:, 1:, 1] - ring[:, :-1, 1] * ring[:, 1:, 0]
        area = 0.5 * cross.sum(axis=1)
        first = ((ring[:, :-1] + ring[:, 1:]) * cross[..., None]).sum(axis=1) / 6.0
        return area, first + area[:, None] * self.segments[:, 0]

    def bounds(self) -> tuple[Array, Array]:
        """Return lower and upper bounds (E, 4)."""
        flat, high = max(self.options.margin, 0.02), self.options.max_height
        rows = (len(self.contacts), 1)
        low, top = np.tile([flat, flat, -high, -high], rows), np.tile([0.4, 0.4, high, high], rows)
        limits = self.limits / self.lengths[:, None]
        for column in self.heights:
            low[:, column] = np.maximum(low[:, column], limits[:, 0])
            top[:, column] = np.minimum(top[:, column], limits[:, 1])
        return low, top

    def violations(self, curve: Array, shape: Array) -> Array:
        """Return (E, V) how far curves exceed their room and their smallest radius, in contact lengths; ≤ 0 is well."""
        if self.options.piecewise_planar:  # long flat flanks: look at their middles too
            curve = np.concatenate([curve, 0.5 * (curve[:, 1:] + curve[:, :-1])], axis=1)
        room = self.clearance.violation(curve) / self.lengths[:, None]
        if self.options.min_radius <= 0.0 or self.options.piecewise_planar:
            return np.asarray(room)
        radius = np.empty(len(shape))
        for kind in ("n", "z"):
            which = np.array([k == kind for k in self.kinds])
            radius[which] = smallest_radius(kind, self.lengths[which], shape[which])
        missing = (self.options.min_radius - radius) / self.lengths
        return np.concatenate([room, np.where(self.flat(shape), -1.0, missing)[:, None]], axis=1)

    def flat(self, shape: Array) -> BoolArray:
        """Return (E,) whether a shape is planar."""
        second = np.where(np.array([k == "z" for k in self.kinds]), np.abs(shape[:, 3]), 0.0)
        return np.asarray(np.maximum(np.abs(shape[:, 2]), second) < PLANE)

    def candidate_rays(self) -> tuple[Array, Array, Array]:
        """Return points (E, R, 2), normals (E, R, 2) and prices (E, R) of forces that joints could transmit.

        The planar contact's own at its ends cost nothing; sloped ones stand where a bump's flanks can be and cost
        the tangent of their slope.
        """
        ends, span = self.segments, self.segments[:, 1] - self.segments[:, 0]
        points, normals, prices = [ends[:, 0], ends[:, 1]], [self.normals] * 2, [np.zeros(len(span))] * 2
        # Across the normal, not along the segment: rounded drawings turn one against the other by a little.
        tangents = np.stack([self.normals[:, 1], -self.normals[:, 0]], axis=1)
        tangents *= np.sign(np.einsum("ij,ij->i", tangents, span))[:, None]
        for position in (0.3, 0.7):
            for slope in (np.deg2rad(25.0), np.deg2rad(50.0)):
                for side in (1.0, -1.0):
                    allowed = slope <= self.options.max_slope_rad
                    points.append(self.segments[:, 0] + position * span)
                    normals.append(np.cos(slope) * self.normals + side * np.sin(slope) * tangents)
                    price = np.tan(slope) if allowed else np.inf
                    prices.append(np.where(self.can_curve, price, np.inf))
        return np.stack(points, 1), np.stack(normals, 1), np.stack(prices, 1)

    def catalogue(self, kinds: Sequence[str]) -> list[tuple[SplineKind, Array]]:
        """Return realisable shapes (kind, (4,)) from shallow to sharp, the starting points of the realization."""
        flat = max(self.options.margin, 0.02) + 0.02
        shapes: list[tuple[SplineKind, Array]] = []
        for height in (0.06, 0.12, 0.2, 0.3, 0.42):
            if height > self.options.max_height:
                continue
            for sign in (1.0, -1.0):
                shapes.append(("n", np.array([flat, flat, sign * height, 0.0])))
                if height <= 0.2 and "z" in kinds:
                    shapes.append(("z", np.array([flat, flat, sign * height, -sign * height])))
        return shapes

    def uniform_bumps(self) -> list[tuple[SplineKind, Array]]:
        """Return shapes (E, 4) with the same bump everywhere, of either sign and, where allowed, of either family."""
        bumps: list[tuple[SplineKind, Array]] = []
        kinds: tuple[SplineKind, ...] = ("n", "z")
        for kind in kinds:
            for height in (-0.15, 0.15):
                if kind in self.options.kinds:
                    second = -height if kind == "z" else 0.0
                    row = np.array([self.rest[0], self.rest[1], height, second])
                    rows = np.tile(row, (len(self.contacts), 1))
                    bumps.append((kind, turned_within(rows, self.heights, *self.bounds())))
        return bumps

    def further(self) -> tuple[str, ...]:
        """Return no families beyond n and z."""
        return ()

    def refined(self, family: str, shape: Array) -> None:
        """Return None: there are no richer families."""

    def begun(self, family: str) -> list[tuple[Shapes2D, Array]]:
        """Return nothing to start from."""
        return []

    def mixed(self) -> Shapes2D:
        """Return these joints: their catalogue has all families."""
        return self

    def with_kinds(self, kinds: Sequence[SplineKind]) -> Shapes2D:
        """Return the same joints with other families."""
        return replace(self, kinds=tuple(kinds))

    def within(self, limits: Array) -> Shapes2D:
        """Return the same joints with bumps between the lowest and highest heights `limits` (E, 2), m."""
        return replace(self, limits=limits)

    def joint(self, index: int, shape: Array, u: Array) -> Joint:
        """Return joint `index` built with the parameters shape (4,) and u (2,); planar when it has no height."""
        contact, kind = self.contacts[index], self.kinds[index]
        length = contact.measure
        if abs(shape[2]) < PLANE and (kind == "n" or abs(shape[3]) < PLANE):
            return planar(contact)
        segment, piecewise = self.segments[index][None], self.options.piecewise_planar
        points = spline_points(kind, segment, u[None], shape[None], piecewise)[0]
        names = ("w1", "w2", "h") if kind == "n" else ("w1", "w2", "h1", "h2")
        parameters = {name: float(value * length) for name, value in zip(names, shape)}
        parameters["lean_rad"] = float(np.arctan2(_cross2(contact.normal, u), contact.normal @ u))
        name = f"piecewise_{kind}" if self.options.piecewise_planar else kind
        return polyline_joint(contact, name, u, points, parameters)


def _cross2(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])
