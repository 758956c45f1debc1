"""Solid joints as numbers: all joints of an assembly evaluated at once, whatever their families, for the optimiser.

One row of numbers per joint (see `mocca_robot.joints.families.family`): a height as a share of the shorter side of the
rectangle it stands on, the share of that rectangle's sides that is covered, and, where families have them, further
heights. Two leans per pair.
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
from mocca_robot.joints.families.family import Family
from mocca_robot.joints.families.frusta import FIRST_TOP
from mocca_robot.joints.families.heights import Heights
from mocca_robot.joints.families.known import family_named, further_families
from mocca_robot.joints.families.sites import JointSites
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.joints.options import JointOptions
from mocca_robot.tolerances import EXACT, PLANE, ROUNDING, TINY
from planners.cone_joints.bump_room import BumpRoom
from planners.cone_joints.kinematic import fan

TOWARDS_EXIT = float(np.deg2rad(35.0))
"""Largest angle between a pair's reference direction and its contact's normal."""
NEAR_EXIT = float(np.deg2rad(40.0))
"""Angle to the way out that a reference direction need not come below: bumps that lean more than they must are
steep on one side only, and a shell tilted to all sides needs both."""
LOWEST = 1e-3
"""Height, as a share of the contact's length, below which a bump is not worth making."""
PLAIN = 2
"""Numbers in a row of a joint with one height."""


@dataclass(frozen=True, eq=False)
class _Group:
    """The joints of one family: their indices; None stands for all joints."""

    family: Family
    index: IntArray | None

    def of(self, values: Array) -> Array:
        """Return the group's rows of `values`."""
        return values if self.index is None else values[self.index]


@dataclass(frozen=True, eq=False, kw_only=True)
class Shapes3D:
    """The joints of a solid assembly, evaluated together.

    Attributes:
        contacts: one per joint.
        pair: (E,) index of each joint's pair; joints of one pair share u.
        pair_normal: (Q, 3) unit reference direction of each pair; u leans from it.
        sites: where the joints stand.
        can_curve: (E,) which contacts have room for one.
        kinds: family of each joint.
        numbers: in every row; those that a joint's family does not have stay zero.
        families: to choose from in a catalogue.
        room: how much of it joints have.
        limits: (E, 2) lowest and highest bump, m, that is wanted besides; infinite where nothing is.
        corners: (E, P, 3) corners of the contacts, padded by repeating the last one.
    """

    assembly: Assembly
    contacts: tuple[Contact, ...]
    pair: IntArray
    pair_normal: Array
    sites: JointSites
    can_curve: BoolArray
    kinds: tuple[str, ...]
    numbers: int = PLAIN
    families: tuple[str, ...]
    room: BumpRoom
    limits: Array
    corners: Array
    options: JointOptions

    n_lean: ClassVar[int] = 2
    steepest_lean: ClassVar[float] = 0.45

    @classmethod
    def of(cls, assembly: Assembly, contacts: Sequence[Contact], options: JointOptions, axis: Array) -> Shapes3D:
        """Return the joints over `contacts`; `axis` (N, 3) is the direction in which each part leaves.

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
        sites = JointSites.of(contacts, options)
        upright = np.array([float(c.normal @ normals[q]) > 0.4 for c, q in zip(contacts, pair)])
        can_curve = np.array([s is not None for s in sites.single]) & upright
        most = max(len(c.polygon) for c in contacts)
        corners = np.array([c.polygon[np.minimum(np.arange(most), len(c.polygon) - 1)] for c in contacts])
        return cls(
            assembly=assembly,
            contacts=tuple(contacts),
            pair=pair,
            pair_normal=read_only(normals),
            sites=sites,
            can_curve=read_only(can_curve, np.bool_),
            kinds=(options.plain,) * len(contacts),
            families=(options.plain,),
            room=BumpRoom(
                assembly=assembly,
                contacts=tuple(contacts),
                sites=sites,
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
        row = np.zeros(self.numbers)
        row[1] = 1.0
        return row

    @property
    def rest_kind(self) -> str:
        """Return the family that planar joints are listed under."""
        return self.options.plain

    @property
    def heights(self) -> tuple[int, ...]:
        """Return the columns of a row that are heights; all zero = planar."""
        return (0, *range(PLAIN, self.numbers))

    @cached_property
    def normals(self) -> Array:
        """Return (E, 3) contact normals."""
        return read_only([c.normal for c in self.contacts])

    @cached_property
    def centres(self) -> Array:
        """Return (E, 3) middles of the rectangles."""
        r = self.sites.rectangles
        return read_only(r.origin + 0.5 * (r.edge_x + r.edge_y))

    @property
    def lengths(self) -> Array:
        """Return (E,) shorter sides of the rectangles, m."""
        return self.sites.lengths

    @cached_property
    def groups(self) -> tuple[_Group, ...]:
        """Return the joints by family."""
        names = list(dict.fromkeys(self.kinds))
        families = [family_named(name, self.options) for name in names]
        if len(names) == 1:
            return (_Group(families[0], None),)
        kinds = np.array(self.kinds)
        return tuple(_Group(f, np.flatnonzero(kinds == name)) for f, name in zip(families, names))

    @cached_property
    def sharp(self) -> BoolArray:
        """Return (E,) which joints are of families with edges."""
        return read_only([family_named(kind, self.options).sharp for kind in self.kinds], np.bool_)

    @cached_property
    def reach(self) -> Array:
        """Return (E, 2) lowest and highest bump, m, that stays clear of boundaries and other joints, and is wanted."""
        room = np.empty((len(self.kinds), 2))
        for group in self.groups:
            room[slice(None) if group.index is None else group.index] = group.of(self.room.of(group.family))
        return np.stack([np.maximum(room[:, 0], self.limits[:, 0]), np.minimum(room[:, 1], self.limits[:, 1])], axis=1)

    @cached_property
    def _tables(self) -> tuple[IntArray, IntArray, IntArray, BoolArray]:
        """Return for joints of several families their triangles (E, T, 3), telling ones (E, A, 3), where these are
        asked (E, A, 3), and which of the triangles count (E, T); shorter lists are padded by repeating them.
        """
        patches = [g.family.patch for g in self.groups]
        most, asked = max(len(p.triangles) for p in patches), max(len(p.telling) for p in patches)
        count = len(self.kinds)
        triangles, telling, at = (np.empty((count, n, 3), dtype=np.int64) for n in (most, asked, asked))
        real = np.zeros((count, most), dtype=np.bool_)
        for group, patch in zip(self.groups, patches):
            triangles[group.index] = np.resize(patch.triangles, (most, 3))
            telling[group.index] = np.resize(patch.triangles[patch.telling], (asked, 3))
            at[group.index] = np.resize(patch.at, (asked, 3))
            real[group.index, : len(patch.triangles)] = True
        return triangles, telling, at, real

    def bounds(self) -> tuple[Array, Array]:
        """Return lower and upper bounds (E, S): no bump leaves its room."""
        low, top = np.zeros((2, len(self.kinds), self.numbers))
        for group in self.groups:
            mine = slice(None) if group.index is None else group.index
            high = group.family.tallest(self.options)
            for column in group.family.heights:
                low[mine, column] = np.maximum(self.reach[mine, 0] / self.lengths[mine], -high)
                top[mine, column] = np.minimum(self.reach[mine, 1] / self.lengths[mine], high)
            low[mine, 1], top[mine, 1] = group.family.sizes
        return low, top

    def directions(self, lean: Array) -> Array:
        """Return (E, 3) principal directions for the pairs' leans (Q, 2): tangents of the angle from the normal."""
        n = self.pair_normal
        across = tangents(n)
        u = n + lean[:, :1] * across[:, 0] + lean[:, 1:] * across[:, 1]
        return np.asarray((u / np.linalg.norm(u, axis=1)[:, None])[self.pair])

    def surface(self, shape: Array, u: Array) -> Array:
        """Return (E, K + P, 3): vertices of the patches of shapes (E, S) and directions (E, 3), then corners."""
        if len(self.groups) == 1:
            return np.concatenate([self._patch(self.groups[0], shape, u), self.corners], axis=1)
        patches = [self._patch(g, shape, u) for g in self.groups]
        most = max(p.shape[1] for p in patches)
        surface = np.empty((len(self.kinds), most, 3))
        for group, patch in zip(self.groups, patches):
            surface[group.index, : patch.shape[1]] = patch
            surface[group.index, patch.shape[1] :] = patch[:, :1]
        return np.concatenate([surface, self.corners], axis=1)

    def _patch(self, group: _Group, shape: Array, u: Array) -> Array:
        """Return the vertices (E', K, 3) of a group's patches."""
        sites = self.sites if group.index is None else self._sites_of(group)
        rows, r = group.of(shape), sites.rectangles
        xy = group.family.positions(sites, rows)
        share, scale = group.family.rise(rows)
        share = np.broadcast_to(share, xy.shape[:2])
        rise = (scale * sites.lengths)[:, None] * group.of(u)
        return np.asarray(
            r.origin[:, None]
            + xy[..., :1] * r.edge_x[:, None]
            + xy[..., 1:] * r.edge_y[:, None]
            + share[..., None] * rise[:, None]
        )

    def _sites_of(self, group: _Group) -> JointSites:
        return self._part_sites[group.family.name]

    @cached_property
    def _part_sites(self) -> dict[str, JointSites]:
        return {g.family.name: self.sites.only(g.index) for g in self.groups if g.index is not None}

    def rays(self, surface: Array) -> tuple[Array, Array]:
        """Return contact points and normals (E, R, 3): those that tell of the patches, and corners of the contact."""
        rim, flat = self._rim(surface)
        if len(self.groups) == 1:
            patch = self.groups[0].family.patch
            corners = surface[:, patch.triangles[patch.telling]]
            asked = corners if patch.asked_at_middles else surface[:, patch.at]
        else:
            _, telling, at, _ = self._tables
            joint = np.arange(len(surface))[:, None, None]
            corners, asked = surface[joint, telling], surface[joint, at]
        normals = _facet_normals(corners)
        return np.concatenate([asked.mean(axis=2), rim], axis=1), np.concatenate([normals, flat], axis=1)

    def all_rays(self, surface: Array) -> tuple[Array, Array]:
        """Return contact points and normals (E, R, 3): every corner of every triangle, corners of the contact."""
        corners = self._triangles(surface)
        normals = _facet_normals(corners)
        rim, flat = self._rim(surface)
        points = corners.reshape(len(corners), -1, 3)
        return np.concatenate([points, rim], axis=1), np.concatenate([np.repeat(normals, 3, axis=1), flat], axis=1)

    def _triangles(self, surface: Array) -> Array:
        """Return the corners (E, T, 3, 3) of all triangles of the patches."""
        if len(self.groups) == 1:
            return np.asarray(surface[:, self.groups[0].family.patch.triangles])
        return np.asarray(surface[np.arange(len(surface))[:, None, None], self._tables[0]])

    def _rim(self, surface: Array) -> tuple[Array, Array]:
        rim = surface[:, surface.shape[1] - self.corners.shape[1] :]
        return rim, np.broadcast_to(self.normals[:, None], rim.shape)

    def transferred(self, surface: Array) -> tuple[Array, Array]:
        """Return volume (E,) and first moment (E, 3) that each patch moves from P_j to P_i."""
        origin = self.sites.rectangles.origin
        corners = self._triangles(surface)
        a, b, c = (corners[:, :, k] - origin[:, None] for k in range(3))
        six_v = np.einsum("etd,etd->et", a, np.cross(b, c))
        if len(self.groups) > 1:
            six_v = np.where(self._tables[3], six_v, 0.0)
        volume = six_v.sum(axis=1) / 6.0
        first = np.einsum("et,etd->ed", six_v, a + b + c) / 24.0
        return volume, first + volume[:, None] * origin

    def violations(self, surface: Array, shape: Array) -> Array:
        """Return (E, 3) by how much height leaves its reach, and the radius its bound, in rectangle sides."""
        heights = shape[:, list(self.heights)]
        low, high = self.reach[:, 0] / self.lengths, self.reach[:, 1] / self.lengths
        radius = np.empty(len(shape))
        for group in self.groups:
            radius[slice(None) if group.index is None else group.index] = group.family.radius(group.of(shape))
        missing = self.options.min_radius / self.lengths - radius
        if self.options.piecewise_planar:  # planes have no radius
            missing = np.full_like(missing, -1.0)
        missing = np.where(self.sharp | (np.abs(heights).max(axis=1) <= PLANE), -1.0, missing)
        return np.stack([low - heights.min(axis=1), heights.max(axis=1) - high, missing], axis=1)

    def candidate_rays(self) -> tuple[Array, Array, Array]:
        """Return points, normals (E, R, 3) and prices (E, R) of forces that joints could transmit.

        The planar contact's own at its corners cost nothing; leaning ones stand where flanks can be and cost the
        tangent of their slope.
        """
        r, count = self.sites.rectangles, len(self.contacts)
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
        """Return realisable shapes, shallow to sharp: plain bumps, and those of all `families` of richer joints."""
        return [
            (name, self._padded(row))
            for name in self.families
            for row in family_named(name, self.options).catalogue(self.options)
        ]

    def _padded(self, rows: Array) -> Array:
        """Return rows (…, m) with zeros for the numbers that they lack."""
        missing = self.numbers - rows.shape[-1]
        return np.concatenate([rows, np.zeros((*rows.shape[:-1], missing))], axis=-1) if missing else rows

    def uniform_bumps(self) -> list[tuple[str, Array]]:
        """Return shapes (E, S) with the same small steep bump everywhere, as high as each joint's room allows."""
        low, high = self.reach[:, 0] / self.lengths, self.reach[:, 1] / self.lengths
        size = np.full(len(low), 0.6)
        bumps = [(self.options.plain, np.stack([np.clip(h, low, high), size], axis=1)) for h in (-0.2, 0.2)]
        if self.options.frusta:
            bumps += [("frustum", self.to_the_roomier_side("frustum", share)) for share in (0.6, 1.0)]
        return [(name, self._padded(rows)) for name, rows in bumps]

    def to_the_roomier_side(self, name: str, share: float) -> Array:
        """Return shapes (E, 2): joints with a flat top into the part that has more room, a share as high as room and
        slope allow.
        """
        low, top = (bound[:, 0] for bound in self.with_kinds([name] * len(self.pair)).bounds())
        highest = share * 0.5 * (1.0 - FIRST_TOP) * np.tan(self.options.max_slope_rad)
        height = np.where(top > -low, np.minimum(top, highest), np.maximum(low, -highest))
        return np.stack([height, np.full(len(height), FIRST_TOP)], axis=1)

    def further(self) -> tuple[str, ...]:
        """Return the families beyond plain bumps and frusta that the options allow, fewest numbers first."""
        return further_families(self.options)

    def refined(self, family: str, shape: Array) -> tuple[Shapes3D, Array] | None:
        """Return plain bumps of rows (E, S) with more heights, and their rows; frusta stay as they are."""
        rich = family_named(family, self.options)
        if not isinstance(rich, Heights) or self.numbers > PLAIN or "n" not in self.kinds:
            return None
        kinds = [family if kind == "n" else kind for kind in self.kinds]
        shapes = replace(self, kinds=tuple(kinds), numbers=len(rich.heights) + 1)
        rows = shapes._padded(shape)
        bumps = np.array([kind == "n" for kind in self.kinds])
        for column in rich.heights:
            rows[bumps, column] = shape[bumps, 0]
        return shapes, rows

    def begun(self, family: str) -> list[tuple[Shapes3D, Array]]:
        """Return joints of a richer family on all contacts, into the roomier part or as small bumps of either sign."""
        rich = family_named(family, self.options)
        shapes = replace(self, kinds=(family,) * len(self.kinds), numbers=max(PLAIN, *(h + 1 for h in rich.heights)))
        if rich.follows_outline:
            return [(shapes, shapes._padded(self.to_the_roomier_side(family, share))) for share in (0.6, 1.0)]
        low, top = shapes.bounds()
        found = []
        for height in (-0.2, 0.2):
            rows = np.tile(shapes.rest, (len(self.kinds), 1))
            rows[:, list(rich.heights)] = height
            rows[:, 1] = 0.6
            found.append((shapes, np.clip(rows, low, top)))
        return found

    def mixed(self) -> Shapes3D:
        """Return the same joints, to be chosen from a catalogue of all families."""
        names = (*self.families, *(("frustum",) if self.options.frusta else ()), *self.further())
        numbers = max(max(family_named(n, self.options).heights) + 1 for n in names)
        return replace(self, families=names, numbers=max(PLAIN, numbers))

    def with_kinds(self, kinds: Sequence[Any]) -> Shapes3D:
        """Return the same joints with other families."""
        return self if tuple(kinds) == self.kinds else replace(self, kinds=tuple(kinds))

    def within(self, limits: Array) -> Shapes3D:
        """Return the same joints with bumps between the lowest and highest heights `limits` (E, 2), m."""
        return replace(self, limits=limits)

    def joint(self, index: int, shape: Array, u: Array) -> Joint:
        """Return joint `index` built with shape (S,) and direction u (3,); planar without height."""
        site, family = self.sites.single[index], family_named(self.kinds[index], self.options)
        if site is None or np.abs(shape[list(family.heights)]).max() < LOWEST:
            return planar(self.contacts[index])
        return family.joint(site, shape, u)


def _facet_normals(corners: Array) -> Array:
    """Return unit normals (E, T, 3) of triangles (E, T, 3, 3)."""
    normals = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=2), TINY)[..., None])


def _towards(normal: Array, way_out: Array, most_rad: float) -> Array:
    """Return `normal` turned towards `way_out` by at most `most_rad`, and not nearer to it than `NEAR_EXIT`."""
    side = way_out - (way_out @ normal) * normal
    length = float(np.linalg.norm(side))
    if length < ROUNDING:
        return normal
    angle = float(np.clip(np.arctan2(length, way_out @ normal) - NEAR_EXIT, 0.0, most_rad))
    return np.asarray(np.cos(angle) * normal + np.sin(angle) * side / length)
