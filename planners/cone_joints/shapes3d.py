"""Solid joints as numbers: all bicubic joints and frusta of an assembly evaluated at once, for the optimiser.

Two numbers per joint. The first is its height as a share of the shorter side of the rectangle it stands on. The second
is the share of that rectangle's sides that a bicubic bump covers (a smaller one of the same height is steeper), or that
the top of a frustum does, which covers the whole rectangle. Two leans per pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.frames import tangents
from mocca_robot.joints.bicubic import (
    FLANK_SEGMENTS,
    BumpPattern,
    Rectangle,
    Rectangles,
    bicubic_joint,
    bump_pattern,
    largest_rectangle,
)
from mocca_robot.joints.clearance import height_limits
from mocca_robot.joints.frustum import LEAST_FLANK, WIDEST_FLANK, frustum_joint, ramp, with_flanks
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.joints.options import JointOptions
from mocca_robot.tolerances import EXACT, PLANE, ROUNDING, TINY
from planners.cone_joints.kinematic import fan

LOWEST = 1e-3
"""Height, as a share of the contact's length, below which a bump is not worth making."""
SMALLEST_SIDE = 1e-3
"""Of a rectangle that stands for a contact without room, as a share of the contact's length."""

SMALLEST = 0.4
"""Smallest bump, as a share of its rectangle's sides."""
SMALLEST_TOP, LARGEST_TOP = 1.0 - 2.0 * WIDEST_FLANK, 1.0 - 2.0 * LEAST_FLANK
"""The top of a frustum, as a share of its rectangle's sides."""
FIRST_TOP = 0.35
"""Of a frustum that a search starts from."""
TOWARDS_EXIT = float(np.deg2rad(35.0))
"""Largest angle between a pair's reference direction and its contact's normal."""
NEAR_EXIT = float(np.deg2rad(40.0))
"""Angle to the way out that a reference direction need not come below: bumps that lean more than they must are
steep on one side only, and a shell tilted to all sides needs both."""
LEAN_IN_REACH = 0.2
"""Further lean of u (as |u' − u|, 11°) for which the reach of bumps is computed."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Shapes3D:
    """The joints of a solid assembly, evaluated together.

    Attributes:
        contacts: one per joint.
        pair: (E,) index of each joint's pair; joints of one pair share u.
        pair_normal: (Q, 3) unit reference direction of each pair; u leans from it.
        rectangles: where the bumps stand; a stand-in on contacts without room for one.
        can_curve: (E,) which contacts have such a rectangle.
        kinds: family of each joint.
        room: how much of it bumps have.
        limits: (E, 2) lowest and highest bump, m, that is wanted besides; infinite where nothing is.
        corners: (E, P, 3) corners of the contacts, padded by repeating the last one.
    """

    assembly: Assembly
    contacts: tuple[Contact, ...]
    pair: IntArray
    pair_normal: Array
    rectangles: Rectangles
    single: tuple[Rectangle | None, ...]
    can_curve: BoolArray
    kinds: tuple[str, ...]
    room: BumpRoom
    limits: Array
    corners: Array
    options: JointOptions

    n_lean: ClassVar[int] = 2
    steepest_lean: ClassVar[float] = 0.45
    rest_kind: ClassVar[str] = "n"
    heights: ClassVar[tuple[int, ...]] = (0,)

    @classmethod
    def of(cls, assembly: Assembly, contacts: Sequence[Contact], options: JointOptions, axis: Array) -> Shapes3D:
        """Return the bicubic joints over `contacts`; `axis` (N, 3) is the direction in which each part leaves.

        A height field along the way out never blocks it, so u leans from the contact's normal towards it until
        it is within `NEAR_EXIT`, as far as `TOWARDS_EXIT` allows.
        """
        pairs = sorted({c.parts for c in contacts})
        index = {p: k for k, p in enumerate(pairs)}
        normals = np.zeros((len(pairs), 3))
        for c in contacts:
            normals[index[c.parts]] += c.normal * c.measure
        first = {c.parts: c.normal for c in reversed(contacts)}
        for q, p in enumerate(pairs):
            norm = float(np.linalg.norm(normals[q]))
            normal = normals[q] / norm if norm > EXACT else first[p]
            normals[q] = _towards(normal, axis[p[1]], TOWARDS_EXIT)
        pair = np.array([index[c.parts] for c in contacts])
        single = tuple(_rectangle(c, options) for c in contacts)
        upright = np.array([float(c.normal @ normals[q]) > 0.4 for c, q in zip(contacts, pair)])
        can_curve = np.array([r is not None for r in single]) & upright
        rectangles = Rectangles.of([r if r is not None else _stand_in(c) for r, c in zip(single, contacts)])
        most = max(len(c.polygon) for c in contacts)
        corners = np.array([c.polygon[np.minimum(np.arange(most), len(c.polygon) - 1)] for c in contacts])
        return cls(
            assembly=assembly,
            contacts=tuple(contacts),
            pair=pair,
            pair_normal=read_only(normals),
            rectangles=rectangles,
            single=single,
            can_curve=read_only(can_curve, np.bool_),
            kinds=(cls.rest_kind,) * len(contacts),
            room=BumpRoom(
                assembly=assembly,
                contacts=tuple(contacts),
                single=single,
                can_curve=can_curve,
                u=normals[pair],
                options=options,
            ),
            limits=read_only(np.tile([-np.inf, np.inf], (len(contacts), 1))),
            corners=read_only(corners),
            options=options,
        )

    @property
    def rest(self) -> Array:
        """Return the row of `shape` of a planar joint."""
        return np.array([0.0, 1.0])

    @cached_property
    def normals(self) -> Array:
        """Return (E, 3) contact normals."""
        return read_only([c.normal for c in self.contacts])

    @cached_property
    def centres(self) -> Array:
        """Return (E, 3) middles of the rectangles."""
        r = self.rectangles
        return read_only(r.origin + 0.5 * (r.edge_x + r.edge_y))

    @cached_property
    def lengths(self) -> Array:
        """Return (E,) shorter sides of the rectangles, m."""
        return read_only(np.linalg.norm(self.rectangles.edge_y, axis=1))

    @cached_property
    def frusta(self) -> BoolArray:
        """Return (E,) which joints are frusta; the others are bicubic bumps."""
        return read_only([kind == "frustum" for kind in self.kinds], np.bool_)

    @cached_property
    def reach(self) -> Array:
        """Return (E, 2) lowest and highest bump, m, that stays clear of boundaries and other joints, and is wanted."""
        room = self.room.curved
        if self.frusta.any():
            room = np.where(self.frusta[:, None], self.room.straight, room)
        return np.stack([np.maximum(room[:, 0], self.limits[:, 0]), np.minimum(room[:, 1], self.limits[:, 1])], axis=1)

    @property
    def _segments(self) -> int:
        """Straight pieces per flank: one makes a truncated pyramid, which saws and wires can cut."""
        return 1 if self.options.piecewise_planar else FLANK_SEGMENTS

    @cached_property
    def _pattern(self) -> BumpPattern:
        return bump_pattern(self._segments, "n")

    @cached_property
    def _telling(self) -> IntArray:
        """Triangles that represent a patch while designing: those on the steepest strips of its flanks.

        A subset of the normals spans a smaller cone, so what holds with them holds with all (Theorem 3.2).
        """
        corners = self._pattern.xy[self._pattern.triangles].mean(axis=1)
        strip = np.minimum(corners, 1.0 - corners) * 3.0 * self._segments
        if self._segments == 1:  # every flank is one plane
            return np.asarray(np.flatnonzero((strip < 1.0).any(axis=1)))
        steep = (strip > 1.0) & (strip < FLANK_SEGMENTS - 1.0)
        inner = strip > 1.0
        return np.asarray(np.flatnonzero((steep[:, 0] & inner[:, 1]) | (steep[:, 1] & inner[:, 0])))

    @cached_property
    def _asked(self) -> tuple[IntArray, IntArray]:
        """Return triangles (E, R), and (E, R, 3) vertices whose mean is a point on each: what stands for the patches.

        Of frusta all corners of all flanks; of bicubic bumps the middles of the telling triangles.
        """
        bump = self._pattern.triangles[self._telling]
        flank, corner = _flank_corners(self._pattern)
        most = max(len(bump), len(flank))
        telling, flank = np.resize(self._telling, most), np.resize(flank, most)
        points = np.stack([np.resize(bump, (most, 3)), np.repeat(np.resize(corner, most)[:, None], 3, axis=1)])
        kind = self.frusta.astype(np.int64)
        return np.stack([telling, flank])[kind], points[kind]

    def bounds(self) -> tuple[Array, Array]:
        """Return lower and upper bounds (E, 2): no bump leaves its room."""
        high = np.where(self.frusta, self.options.tallest_frustum, self.options.max_height)
        least, most = np.where(self.frusta, SMALLEST_TOP, SMALLEST), np.where(self.frusta, LARGEST_TOP, 1.0)
        low = np.stack([np.maximum(self.reach[:, 0] / self.lengths, -high), least], axis=1)
        top = np.stack([np.minimum(self.reach[:, 1] / self.lengths, high), most], axis=1)
        return low, top

    def directions(self, lean: Array) -> Array:
        """Return (E, 3) principal directions for the pairs' leans (Q, 2): tangents of the angle from the normal."""
        n = self.pair_normal
        across = tangents(n)
        u = n + lean[:, :1] * across[:, 0] + lean[:, 1:] * across[:, 1]
        return np.asarray((u / np.linalg.norm(u, axis=1)[:, None])[self.pair])

    def surface(self, shape: Array, u: Array) -> Array:
        """Return (E, K + P, 3): vertices of the patches of shapes (E, 2) and directions (E, 3), then corners."""
        r = self.rectangles
        xy = 0.5 + shape[:, 1, None, None] * (self._pattern.xy - 0.5)
        share = np.broadcast_to(self._pattern.share, xy.shape[:2])
        if self.frusta.any():
            xy = np.where(self.frusta[:, None, None], with_flanks(self._pattern.xy, 0.5 - 0.5 * shape[:, 1]), xy)
            share = np.where(self.frusta[:, None], ramp(self._pattern.xy), share)
        rise = (shape[:, 0] * self.lengths)[:, None] * u
        patch = (
            r.origin[:, None]
            + xy[..., :1] * r.edge_x[:, None]
            + xy[..., 1:] * r.edge_y[:, None]
            + share[..., None] * rise[:, None]
        )
        return np.concatenate([patch, self.corners], axis=1)

    def rays(self, surface: Array) -> tuple[Array, Array]:
        """Return contact points and normals (E, R, 3): those that tell of the patches, and corners of the contact."""
        rim, flat = self._rim(surface)
        if self.frusta.any():
            triangles, vertices = self._asked
            joint = np.arange(len(surface))[:, None, None]
            normals = self._normals(surface[joint, self._pattern.triangles[triangles]])
            points = surface[joint, vertices].mean(axis=2)
            return np.concatenate([points, rim], axis=1), np.concatenate([normals, flat], axis=1)
        corners, normals = self._facets(surface, self._pattern.triangles[self._telling])
        return np.concatenate([corners.mean(axis=2), rim], axis=1), np.concatenate([normals, flat], axis=1)

    def all_rays(self, surface: Array) -> tuple[Array, Array]:
        """Return contact points and normals (E, R, 3): every corner of every triangle, corners of the contact."""
        corners, normals = self._facets(surface, self._pattern.triangles)
        rim, flat = self._rim(surface)
        points = corners.reshape(len(corners), -1, 3)
        return np.concatenate([points, rim], axis=1), np.concatenate([np.repeat(normals, 3, axis=1), flat], axis=1)

    def _facets(self, surface: Array, triangles: IntArray) -> tuple[Array, Array]:
        """Return corners (E, T, 3, 3) and unit normals (E, T, 3) of triangles of the patches."""
        corners = surface[:, triangles]
        return corners, self._normals(corners)

    @staticmethod
    def _normals(corners: Array) -> Array:
        """Return unit normals (E, T, 3) of triangles (E, T, 3, 3)."""
        normals = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
        return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=2), TINY)[..., None])

    def _rim(self, surface: Array) -> tuple[Array, Array]:
        rim = surface[:, len(self._pattern.xy) :]
        return rim, np.broadcast_to(self.normals[:, None], rim.shape)

    def transferred(self, surface: Array) -> tuple[Array, Array]:
        """Return volume (E,) and first moment (E, 3) that each patch moves from P_j to P_i."""
        origin = self.rectangles.origin
        a, b, c = (surface[:, self._pattern.triangles[:, k]] - origin[:, None] for k in range(3))
        six_v = np.einsum("etd,etd->et", a, np.cross(b, c))
        volume = six_v.sum(axis=1) / 6.0
        first = np.einsum("et,etd->ed", six_v, a + b + c) / 24.0
        return volume, first + volume[:, None] * origin

    def violations(self, surface: Array, shape: Array) -> Array:
        """Return (E, 3) by how much height leaves its reach, and the radius its bound, in rectangle sides."""
        height = shape[:, 0]
        low, high = self.reach[:, 0] / self.lengths, self.reach[:, 1] / self.lengths
        # Tightest at the knots: width² / (6 rise), with flanks a third of the shorter side wide.
        flank = shape[:, 1] / 3.0
        missing = self.options.min_radius / self.lengths - flank**2 / (6.0 * np.maximum(np.abs(height), ROUNDING))
        if self.options.piecewise_planar:  # planes have no radius
            missing = np.full_like(missing, -1.0)
        missing = np.where(self.frusta, -1.0, missing)
        return np.stack([low - height, height - high, np.where(np.abs(height) > PLANE, missing, -1.0)], axis=1)

    def candidate_rays(self) -> tuple[Array, Array, Array]:
        """Return points, normals (E, R, 3) and prices (E, R) of forces that joints could transmit.

        The planar contact's own at its corners cost nothing; leaning ones stand where flanks can be and cost the
        tangent of their slope.
        """
        r, count = self.rectangles, len(self.contacts)
        points, normals, prices = [self.corners], [np.broadcast_to(self.normals[:, None], self.corners.shape)], []
        prices.append(np.zeros(self.corners.shape[:2]))
        for slope in (np.deg2rad(20.0), np.deg2rad(40.0)):
            leaning = fan(self.normals, [slope])
            for x, y in ((0.2, 0.5), (0.8, 0.5), (0.5, 0.2), (0.5, 0.8)):
                at = r.origin + x * r.edge_x + y * r.edge_y
                points.append(np.broadcast_to(at[:, None], leaning.shape))
                normals.append(leaning)
                allowed = self.can_curve & (slope <= self.options.max_slope_rad)
                price = np.where(allowed, np.tan(slope), np.inf)
                prices.append(np.broadcast_to(price[:, None], (count, leaning.shape[1])))
        return np.concatenate(points, 1), np.concatenate(normals, 1), np.concatenate(prices, 1)

    def catalogue(self, kinds: Sequence[str]) -> list[tuple[str, Array]]:
        """Return realisable shapes, shallow to sharp: heights of either sign."""
        bumps = ((0.06, 1.0), (0.12, 1.0), (0.2, 1.0), (0.3, 1.0), (0.4, 1.0), (0.15, 0.6), (0.24, 0.6))
        allowed = [(h, size) for h, size in bumps if h <= self.options.max_height]
        return [("n", np.array([sign * h, size])) for h, size in allowed for sign in (1.0, -1.0)]

    def uniform_bumps(self) -> list[tuple[str, Array]]:
        """Return shapes (E, 2) with the same small steep bump everywhere, as high as each joint's room allows."""
        low, high = self.reach[:, 0] / self.lengths, self.reach[:, 1] / self.lengths
        size = np.full(len(low), 0.6)
        bumps = [("n", np.stack([np.clip(h, low, high), size], axis=1)) for h in (-0.2, 0.2)]
        if self.options.frusta:
            bumps += [("frustum", self._frusta_to_the_roomier_side(share)) for share in (0.6, 1.0)]
        return bumps

    def _frusta_to_the_roomier_side(self, share: float) -> Array:
        """Return shapes (E, 2): frusta into the part that has more room, a share as high as room and slope allow."""
        low, top = (bound[:, 0] for bound in self.with_kinds(["frustum"] * len(self.pair)).bounds())
        highest = share * 0.5 * (1.0 - FIRST_TOP) * np.tan(self.options.max_slope_rad)
        height = np.where(top > -low, np.minimum(top, highest), np.maximum(low, -highest))
        return np.stack([height, np.full(len(height), FIRST_TOP)], axis=1)

    def with_kinds(self, kinds: Sequence[Any]) -> Shapes3D:
        """Return the same joints with other families."""
        return self if tuple(kinds) == self.kinds else replace(self, kinds=tuple(kinds))

    def within(self, limits: Array) -> Shapes3D:
        """Return the same joints with bumps between the lowest and highest heights `limits` (E, 2), m."""
        return replace(self, limits=limits)

    def joint(self, index: int, shape: Array, u: Array) -> Joint:
        """Return joint `index` built with shape (2,) and direction u (3,); planar without height."""
        contact, rectangle = self.contacts[index], self.single[index]
        if rectangle is None or abs(shape[0]) < LOWEST:
            return planar(contact)
        height = float(shape[0] * self.lengths[index])
        if self.frusta[index]:
            return frustum_joint(contact, rectangle, height, u, 0.5 - 0.5 * float(shape[1]))
        low, high = 0.5 - 0.5 * float(shape[1]), 0.5 + 0.5 * float(shape[1])
        covered = rectangle.part((low, low), (high, high))
        return bicubic_joint(contact, covered, height, u, self._segments)


@dataclass(frozen=True, eq=False, kw_only=True)
class BumpRoom:
    """How high bumps may get on every contact, worked out when it is first asked for.

    Attributes:
        single: the rectangle on each contact, None without one.
        can_curve: (E,) which contacts may become joints.
        u: (E, 3) their principal directions; bumps may lean from them by `LEAN_IN_REACH`.
    """

    assembly: Assembly
    contacts: tuple[Contact, ...]
    single: tuple[Rectangle | None, ...]
    can_curve: BoolArray
    u: Array
    options: JointOptions

    @cached_property
    def curved(self) -> Array:
        """Return (E, 2) lowest and highest bicubic bump, m."""
        return self._limits(1 / 3)

    @cached_property
    def straight(self) -> Array:
        """Return (E, 2) lowest and highest frustum, m."""
        return self._limits(LEAST_FLANK)

    def _limits(self, flank: float) -> Array:
        reach = np.zeros((len(self.contacts), 2))
        some = np.flatnonzero(self.can_curve)
        if len(some):
            chosen = [self.contacts[int(e)] for e in some]
            stacked = Rectangles.of([r for e in some if (r := self.single[e]) is not None])
            shorter = np.linalg.norm(stacked.edge_y, axis=1)
            margin = np.maximum(self.options.margin * shorter, self.options.min_distance)
            low, high = height_limits(self.assembly, chosen, stacked, self.u[some], margin, LEAN_IN_REACH, flank)
            reach[some] = np.stack([low, high], axis=1)
        return read_only(reach)


def _flank_corners(pattern: BumpPattern) -> tuple[IntArray, IntArray]:
    """Return 16 pairs of a triangle on a frustum's flank and a vertex at one of the flank's four corners."""
    middles = pattern.xy[pattern.triangles].mean(axis=1)
    found = []
    for axis in (0, 1):
        for end in (0.0, 1.0):
            away = np.abs(middles[:, axis] - end)
            across = np.abs(middles[:, 1 - axis] - 0.5)
            triangle = int(np.flatnonzero((away < 1 / 3) & (across < 1 / 6))[0])
            for up in (0.0, 1 / 3):
                for side in (up, 1.0 - up):
                    corner = np.empty(2)
                    corner[axis], corner[1 - axis] = abs(end - up), side
                    found.append((triangle, int(np.abs(pattern.xy - corner).sum(axis=1).argmin())))
    return np.array([f[0] for f in found]), np.array([f[1] for f in found])


def _towards(normal: Array, way_out: Array, most_rad: float) -> Array:
    """Return `normal` turned towards `way_out` by at most `most_rad`, and not nearer to it than `NEAR_EXIT`."""
    side = way_out - (way_out @ normal) * normal
    length = float(np.linalg.norm(side))
    if length < ROUNDING:
        return normal
    angle = float(np.clip(np.arctan2(length, way_out @ normal) - NEAR_EXIT, 0.0, most_rad))
    return np.asarray(np.cos(angle) * normal + np.sin(angle) * side / length)


def _rectangle(contact: Contact, options: JointOptions) -> Rectangle | None:
    scale = float(np.sqrt(contact.measure))
    if scale < options.min_contact:
        return None
    found = largest_rectangle(contact, max(options.margin * scale, options.min_distance))
    # Slivers hold nothing: below a tenth of the contact's size a bump is a scratch.
    return found if found is not None and found.l2 > 0.1 * scale else None


def _stand_in(contact: Contact) -> Rectangle:
    """Return a tiny rectangle in a contact that has no room for one, so that arrays stay rectangular."""
    x, y = tangents(contact.normal)
    side = SMALLEST_SIDE * float(np.sqrt(contact.measure))
    return Rectangle(read_only(contact.centre), read_only(x), read_only(y), side, side)
