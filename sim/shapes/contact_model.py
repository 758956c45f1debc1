"""What collides with what: convex pieces of flat parts, and matching facets of any parts.

Two models, both world-frame lists of simple shapes:

`pieces` covers each flat part with few convex prisms. At rest those meet that share a contact, with whatever faces
and corners they have; while a part travels, every prism meets every other part.

`facets` puts, at points of each contact, a small sphere in the later part against a thin box in the earlier one,
and lets only these pairs collide. It is what solids use (slabs that all collide make ghost contacts), and holds
while parts move little.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.frames import tangents
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.loads import LoadCase
from sim.shapes.contact_rays import PairRays, Rays, holding, pair_rays, reduced_rays
from sim.shapes.convex_pieces import convex_pieces

BUDGET = 4800
"""Contact points of a whole model: a dome of 400 joints then gets 12 a joint and takes about 60 steps a second."""
RESOLUTION = (12, 128)
"""Fewest and most contact points of a pair of parts."""
ENOUGH, BEGIN_WITH = 48, 8
"""Contact points of a pair that serve every load; those to begin with where they are chosen for one load."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Geom:
    """A shape fixed to a part.

    Attributes:
        part: index.
        kind: 'convex' (hull of `points`), 'sphere' or 'box' (centred at points[0]).
        points: (k, 3) world coordinates, metres.
        size: radius of a sphere; half edges (3,) of a box.
        rotation: (3, 3) columns are a box's axes.
        role: 'any' obeys the model's pairs; a 'point' meets the 'face' of every other part, and nothing else.
    """

    part: int
    kind: Literal["convex", "sphere", "box"]
    points: Array
    size: Array
    rotation: Array
    role: Literal["any", "point", "face"] = "any"


@dataclass(frozen=True, eq=False)
class ContactModel:
    """Shapes, and which of them may touch: index pairs, or None when every shape meets those of other parts."""

    geoms: tuple[Geom, ...]
    pairs: tuple[tuple[int, int], ...] | None

    def only(self, present: BoolArray) -> ContactModel:
        """Return the model of the parts where `present` (N,) is true."""
        keep = [k for k, g in enumerate(self.geoms) if present[g.part]]
        new = {old: k for k, old in enumerate(keep)}
        pairs = None
        if self.pairs is not None:
            pairs = tuple((new[a], new[b]) for a, b in self.pairs if a in new and b in new)
        return ContactModel(tuple(self.geoms[k] for k in keep), pairs)


def embed(points: Array) -> Array:
    """Return points or vectors (…, 2 | 3) in MuJoCo's world (…, 3): flat parts stand in its x–z plane."""
    if points.shape[-1] == 3:
        return points
    out = np.zeros((*points.shape[:-1], 3))
    out[..., 0], out[..., 2] = points[..., 0], points[..., 1]
    return out


def pieces(assembly: Assembly, contacts: Sequence[Contact] | None = None) -> ContactModel:
    """Return the flat parts as convex prisms; with `contacts`, only prisms that share one may touch.

    Without, all prisms collide: right for parts that travel. For parts at rest it lets prisms meet that share just
    a corner, and their ghost contacts hold a part up by a few degrees. Raises InputError for shapes that are not
    simple.
    """
    geoms = [
        _prism(index, ring, part.shape.thickness)
        for index, part in enumerate(assembly.parts)
        if isinstance(part.shape, Polygon)
        for ring in convex_pieces(part.shape)
    ]
    if contacts is None:
        return ContactModel(tuple(geoms), None)
    outlines = {part: _Outlines.of(geoms, part) for part in {p for c in contacts for p in c.parts}}
    pairs = {(outlines[c.parts[0]].nearest(c.centre), outlines[c.parts[1]].nearest(c.centre)) for c in contacts}
    return ContactModel(tuple(geoms), tuple(sorted(pairs)))


@dataclass(frozen=True, eq=False)
class _Outlines:
    """The edges (E, 2) of a part's prisms, `start` to `start` + `edge`, and the prism (E,) that each belongs to."""

    start: Array
    edge: Array
    prism: IntArray

    @classmethod
    def of(cls, geoms: Sequence[Geom], part: int) -> _Outlines:
        mine = [k for k, geom in enumerate(geoms) if geom.part == part]
        rings = [geoms[k].points[: len(geoms[k].points) // 2][:, [0, 2]] for k in mine]
        edges = [np.roll(ring, -1, axis=0) - ring for ring in rings]
        return cls(np.concatenate(rings), np.concatenate(edges), np.repeat(mine, [len(ring) for ring in rings]))

    def nearest(self, point: Array) -> int:
        """Return the prism whose outline passes closest to `point`; a contact lies on one edge, so on one prism."""
        along = np.clip(((point - self.start) * self.edge).sum(axis=1) / (self.edge**2).sum(axis=1), 0.0, 1.0)
        away = np.linalg.norm(self.start + along[:, None] * self.edge - point, axis=1)
        return int(self.prism[away.argmin()])


def facets(contacts: Sequence[Contact], resolution: int | None = None, friction: float = 0.0) -> ContactModel:
    """Return sphere–box pairs at the contact points that carry each pair's wrench cone.

    `resolution` is the largest number of points per pair of parts; flat contacts use their corners only. By default
    as many as `BUDGET` leaves each pair: with 12 the outer parts of a curved joint's wrench cone are missing and a
    horse's head falls that statics holds by 2°; with 24 it stands.
    """
    if resolution is None:
        resolution = affordable(contacts)
    return facet_pairs(reduced_rays(contacts, resolution, friction))


def affordable(contacts: Sequence[Contact]) -> int:
    """Return how many contact points `BUDGET` leaves each pair of parts."""
    return int(np.clip(BUDGET // max(1, len({c.parts for c in contacts})), *RESOLUTION))


def facet_pairs(kept: Iterable[Rays]) -> ContactModel:
    """Return a sphere–box pair at each of the contact points."""
    geoms: list[Geom] = []
    pairs: list[tuple[int, int]] = []
    for rays in kept:
        radius = 0.02 * rays.reach
        for point, normal in zip(embed(rays.points), embed(rays.normals)):
            frame = _frame(normal)
            half = np.array([0.1 * rays.reach, 0.1 * rays.reach, radius])
            pairs.append((len(geoms), len(geoms) + 1))
            geoms.append(geom(rays.pair[0], "box", point - radius * normal, half, frame))
            geoms.append(geom(rays.pair[1], "sphere", point + radius * normal, np.array([radius, 0.0, 0.0])))
    return ContactModel(tuple(geoms), tuple(pairs))


def telling_rays(assembly: Assembly, contacts: Sequence[Contact], friction: float = 0.0) -> tuple[PairRays, ...] | None:
    """Return the contact points to choose from load by load; None where `contact_model` serves every load.

    A dome of 350 curved joints that keeps 13 points each falls 3° before one that has all of them.
    """
    if assembly.dimension == 2 and friction == 0.0:
        return None
    most = affordable(contacts)
    if most < ENOUGH:
        return tuple(pair_rays(contacts, BEGIN_WITH, friction))
    if friction == 0.0:
        return None
    # With friction every facet carries what others cannot: of a horse's 212 points a pair 128 lose half a degree.
    rays = tuple(pair_rays(contacts, most, friction))
    return None if all(r.kept.all() for r in rays) else rays


def holding_model(graph: PartsGraph, rays: Sequence[PairRays], case: LoadCase, friction: float = 0.0) -> ContactModel:
    """Return facet pairs at those of `telling_rays` that hold what all of them hold under `case`."""
    return facet_pairs(r.reduced for r in holding(graph, rays, case, friction))


def contact_model(assembly: Assembly, contacts: Sequence[Contact], friction: float = 0.0) -> ContactModel:
    """Return the model to judge stability with: convex pieces for flat parts, facet pairs for solids.

    With friction flat parts take facet pairs too: the many points of prisms share forces in ways that depend on
    their softness, and Newton's method needs ten times as long.
    """
    flat = assembly.dimension == 2
    return pieces(assembly, contacts) if flat and friction == 0.0 else facets(contacts, friction=friction)


def _prism(part: int, ring: Array, thickness: float) -> Geom:
    corners = np.concatenate([embed(ring), embed(ring)])
    corners[: len(ring), 1], corners[len(ring) :, 1] = -0.5 * thickness, 0.5 * thickness
    return geom(part, "convex", corners, np.zeros(3))


def geom(
    part: int,
    kind: Literal["convex", "sphere", "box"],
    points: Array,
    size: Array,
    rotation: Array | None = None,
    role: Literal["any", "point", "face"] = "any",
) -> Geom:
    """Return a shape with read-only arrays; `rotation` defaults to the world's axes."""
    frame = np.eye(3) if rotation is None else rotation
    return Geom(
        part=part,
        kind=kind,
        points=read_only(np.atleast_2d(points)),
        size=read_only(size),
        rotation=read_only(frame),
        role=role,
    )


def _frame(normal: Array) -> Array:
    """Return a rotation (3, 3) whose last column is `normal`."""
    return np.column_stack([*-tangents(normal), normal])


__all__ = [
    "ContactModel",
    "Geom",
    "PairRays",
    "Rays",
    "contact_model",
    "embed",
    "facet_pairs",
    "facets",
    "geom",
    "holding_model",
    "pieces",
    "telling_rays",
]
