"""How parts press on each other: contacts as beds of springs that only push, so that pressures are unique.

Parts are rigid, every contact gives by the same amount per pascal. Without friction the parts' small motions minimise
½ Σ k a max(0, −b·u)² − w·u over the contact's samples (rows b, areas a), a convex problem that a few steps of Newton's
method solve; how stiff the bed is changes no pressure. With friction the forces are those of `statics.coulomb`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.friction import between, clamped, tangential_ratio
from mocca_robot.contacts.surface import triangulated
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.runtime.threads import with_one_blas_thread
from mocca_robot.statics.frictional_contacts import FrictionalContacts
from mocca_robot.statics.loads import LoadCase, case_wrenches
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.strength.settings import TINY

FINE = {2: 1.0 / 60.0, 3: 1.0 / 16.0}
"""Largest stretch between samples of a contact by dimension, as a share of the smaller part's size."""
SMALL = 0.5
"""Facets below this share of that stretch have one sample, others three."""
LEFT_OVER = 1e-8
"""Share of the load that may be left unbalanced."""
STEPS = 500
FLOWN = 1e12
"""Parts that move by more, in units of what the load presses one spring together, have left their contacts."""
STALLED = 25
"""Steps without progress after which nothing balances the load."""
SOFT = 1e-10
"""What holds parts in directions that no contact resists, relative to the stiffest; it carries no load at the end."""
GAUSS = 0.5 / np.sqrt(3.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Bed:
    """Samples of all contacts, sorted by pair of parts.

    Attributes:
        system: their rows.
        points, normals: (C, d), normals from part i into part j.
        areas: (C,) m² that each stands for.
    """

    system: ContactSystem
    points: Array
    normals: Array
    areas: Array

    @classmethod
    def of(cls, graph: PartsGraph, fine: float | None = None) -> Bed:
        """Return the samples of a graph's contacts; `fine` replaces `FINE`."""
        assembly = graph.assembly
        sizes = np.array([np.linalg.norm(np.ptp(p.shape.bounds, axis=0)) for p in assembly.parts])
        share = FINE[assembly.dimension] if fine is None else fine
        contacts = sorted(graph.contacts, key=lambda c: c.parts)
        limits = share * np.array([sizes[list(c.parts)].min() for c in contacts])
        owner, points, areas = (_along_edges if assembly.dimension == 2 else _over_faces)(assembly, contacts, limits)
        normals = np.array([c.normal for c in contacts])[owner]
        pairs = np.array([c.parts for c in contacts], dtype=np.int64)[owner]
        about = np.array([p.centroid for p in assembly.parts])
        system = ContactSystem.build(pairs, points, normals, ~assembly.fixed, about, assembly.size / 2)
        return cls(system=system, points=points, normals=normals, areas=areas)

    @cached_property
    def of_part(self) -> tuple[IntArray, ...]:
        """Return the samples of every part."""
        parts = len(self.system.free)
        owner, sample = self.pairs.T.ravel(), np.tile(np.arange(len(self.pairs)), 2)
        order = np.lexsort((sample, owner))
        return tuple(np.split(sample[order], np.searchsorted(owner[order], np.arange(1, parts))))

    @property
    def pairs(self) -> IntArray:
        """Return (C, 2) the two parts of each."""
        return self.system.pairs


def _along_edges(assembly: Assembly, contacts: Sequence[Contact], limits: Array) -> tuple[IntArray, Array, Array]:
    """Return (C,) the contact of every sample, points (C, 2) and areas (C,): two a stretch, as of Gauss."""
    thick = np.array([p.shape.thickness for p in assembly.parts if isinstance(p.shape, Polygon)])
    ends = np.array([c.polygon for c in contacts])
    across = np.array([thick[list(c.parts)].min() for c in contacts])
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    counts = np.maximum(1, np.ceil(lengths / limits)).astype(np.int64)
    owner = np.repeat(np.arange(len(contacts)), 2 * counts)
    number = np.concatenate([np.arange(2 * c) for c in counts])
    shares = (number // 2 + 0.5 + np.where(number % 2, GAUSS, -GAUSS)) / counts[owner]
    points = ends[owner, 0] + shares[:, None] * (ends[owner, 1] - ends[owner, 0])
    return owner, points, (lengths * across / (2 * counts))[owner]


def _over_faces(assembly: Assembly, contacts: Sequence[Contact], limits: Array) -> tuple[IntArray, Array, Array]:
    """Return (C,) the contact of every sample, points (C, 3) and areas (C,): three a triangle, as of Gauss, or one."""
    owner, corners = _triangles(contacts)
    done: list[tuple[IntArray, Array]] = []
    while len(corners):
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long = edges.max(axis=1) > limits[owner]
        done.append((owner[~long], corners[~long]))
        corners = _halved(corners[long], edges[long].argmax(axis=1))
        owner = np.tile(owner[long], 2)
    owner, corners = np.concatenate([o for o, _ in done]), np.concatenate([c for _, c in done])
    pairs = np.array([c.parts for c in contacts])[owner]
    order = np.lexsort((owner, pairs[:, 1], pairs[:, 0]))
    owner, corners = owner[order], corners[order]
    double = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    # A facet much smaller than a stretch presses evenly: its middle stands for it.
    tiny = np.linalg.norm(np.ptp(corners, axis=1), axis=1) < SMALL * limits[owner]
    weights = np.full((3, 3), 1.0 / 6.0) + 0.5 * np.eye(3)
    points = np.einsum("qk,tkd->tqd", weights, corners)
    points[tiny, 0] = corners[tiny].mean(axis=1)
    areas = np.repeat(double[:, None] / 6.0, 3, axis=1)
    areas[tiny, 0] *= 3.0
    kept = np.ones(areas.shape, dtype=np.bool_)
    kept[tiny, 1:] = False
    return np.repeat(owner, 3)[kept.ravel()], points[kept], areas[kept]


def _triangles(contacts: Sequence[Contact]) -> tuple[IntArray, Array]:
    """Return (m,) the contact of every triangle, and triangles (m, 3, 3): fans of what is convex, all at once."""
    owners, corners = [], []
    sizes = np.array([0 if c.holes else len(c.polygon) for c in contacts])
    for size in np.unique(sizes):
        mine = np.flatnonzero(sizes == size)
        if size > 0:
            rings = np.array([contacts[int(k)].polygon for k in mine])
            edges = np.roll(rings, -1, axis=1) - rings
            turns = np.cross(edges, np.roll(edges, -1, axis=1))
            along = np.einsum("mkd,md->mk", turns, np.array([contacts[int(k)].normal for k in mine]))
            convex = (along >= 0.0).all(axis=1) | (along <= 0.0).all(axis=1)
            fans = np.stack([np.stack([rings[:, 0], rings[:, k], rings[:, k + 1]], axis=1) for k in range(1, size - 1)])
            owners.append(np.tile(mine[convex], size - 2))
            corners.append(fans[:, convex].reshape(-1, 3, 3))
            mine = mine[~convex]
        for k in mine:
            vertices, triangles = triangulated(contacts[int(k)])
            owners.append(np.full(len(triangles), k))
            corners.append(vertices[triangles])
    return np.concatenate(owners), np.concatenate(corners)


def _halved(corners: Array, longest: IntArray) -> Array:
    """Return triangles (2m, 3, d): each halved at the middle of its longest edge, which starts at corner `longest`."""
    rows = np.arange(len(corners))
    a, b, c = (corners[rows, (longest + k) % 3] for k in range(3))
    middle = 0.5 * (a + b)
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


@dataclass(frozen=True, eq=False, kw_only=True)
class Pressed:
    """What a load case does to all contacts.

    Attributes:
        forces: (C, d) newtons on part j at every sample of the bed; zero where a part is absent.
        left: share of the load that they do not balance.
    """

    forces: Array
    left: float

    @property
    def balanced(self) -> bool:
        """Return whether the load case is in equilibrium."""
        return self.left <= 10.0 * LEFT_OVER


@with_one_blas_thread
def pressed(bed: Bed, graph: PartsGraph, case: LoadCase, friction: float = 0.0) -> Pressed:
    """Return the forces of one load case."""
    there = np.asarray(case.present[bed.pairs].all(axis=1))
    forces = np.zeros_like(bed.points)
    wrenches = case_wrenches(case, graph)
    if friction > 0.0:
        forces[there], left = _rubbing(bed, graph, case, friction, there, wrenches)
    else:
        system = bed.system.subset(there).holding(case.free)
        size, left = _frictionless(system, bed.areas[there], system.scaled(wrenches))
        forces[there] = size[:, None] * bed.normals[there]
    return Pressed(forces=forces, left=left)


def _rubbing(
    bed: Bed, graph: PartsGraph, case: LoadCase, friction: float, there: BoolArray, wrenches: Array
) -> tuple[Array, float]:
    from mocca_robot.statics.coulomb import standing  # compiled code: loaded where it is used

    parts, pairs = graph.assembly.parts, bed.pairs
    here = {tuple(map(int, pair)) for pair in np.unique(pairs[there], axis=0)}
    clamping = {p: f for p, f in clamped(friction, parts, pairs).items() if p in here or p[::-1] in here}
    contacts = FrictionalContacts.of(
        pairs[there], bed.points[there], bed.normals[there], case.free, between(friction, parts, pairs[there]),
        about=bed.system.about, length=bed.system.length, weights=bed.areas[there], clamping=clamping,
        tangential_ratio=tangential_ratio(friction),
    )  # fmt: skip
    found = standing(contacts, wrenches)
    return found.forces, found.unbalanced if found.stands else 1.0


def _frictionless(system: ContactSystem, areas: Array, w: Array) -> tuple[Array, float]:
    """Return (C,) forces along the normals and the share of `w` (n,) that they leave unbalanced."""
    scale = float(np.linalg.norm(w))
    if scale == 0.0 or not len(areas):
        return np.zeros(len(areas)), float(scale > 0.0)
    rows, w = system.matrix, w / scale
    stiff = areas / areas.mean()
    blocks = _Blocks.of(system)
    u = np.zeros(rows.shape[1])
    active = np.ones(len(areas), dtype=np.bool_)
    best, forces, since = np.inf, np.zeros(len(areas)), 0
    for _ in range(STEPS):
        hessian = blocks.matrix(stiff * active)
        hessian = hessian + SOFT * float(hessian.diagonal().max(initial=TINY)) * sp.eye_array(len(u), format="csc")
        gap = rows @ u
        gradient = w + rows.T @ (stiff * np.maximum(0.0, -gap))
        if best == np.inf:  # the first step glues all contacts
            gradient = w
        step = splu(hessian).solve(gradient)
        if not np.abs(step).max() < FLOWN:
            break
        u = u + _length(gap, rows @ step, stiff, float(w @ step)) * step if best < np.inf else step
        gap = rows @ u
        push = stiff * np.maximum(0.0, -gap)
        left = float(np.linalg.norm(w + rows.T @ push))
        since = 0 if left < 0.9 * best else since + 1
        if left < best:
            best, forces = left, push
        if left <= 0.01 * LEFT_OVER or since >= STALLED or not np.abs(u).max() < FLOWN:
            break
        active = gap < 0.0
    return forces * scale, best


def _length(gap: Array, change: Array, stiff: Array, power: float) -> float:
    """Return how far to go along a step: where the energy, whose slope is piecewise linear, is least."""
    with np.errstate(divide="ignore", invalid="ignore"):
        breaks = np.where(change != 0.0, -gap / change, np.inf)

    def slope(t: float) -> float:
        return float((stiff * np.minimum(0.0, gap + t * change)) @ change) - power

    low, high = 0.0, 1.0
    while slope(high) < 0.0 and high < FLOWN:
        low, high = high, 4.0 * high
    inside = np.sort(breaks[(breaks > low) & (breaks < high)])
    while len(inside):
        middle = len(inside) // 2
        if slope(float(inside[middle])) < 0.0:
            low, inside = float(inside[middle]), inside[middle + 1 :]
        else:
            high, inside = float(inside[middle]), inside[:middle]
    at_low, at_high = slope(low), slope(high)
    return low if at_high == at_low else low - at_low * (high - low) / (at_high - at_low)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Rows by pair of parts, for sums of outer products."""

    rows: Sequence[Array]
    bounds: IntArray
    index: tuple[IntArray, IntArray]
    size: int

    @classmethod
    def of(cls, system: ContactSystem) -> _Blocks:
        pairs, dof = system.pairs, system.dof
        bounds = np.r_[0, np.flatnonzero((np.diff(pairs, axis=0) != 0).any(axis=1)) + 1, len(pairs)]
        both = np.concatenate([-system.rays_i, system.rays_j], axis=1)
        rows, across, down = [], [], []
        for start, end in pairwise(bounds):
            columns = system.columns[pairs[start]]
            kept = np.repeat(columns >= 0, dof)
            places = (columns[:, None] + np.arange(dof)).ravel()[kept]
            rows.append(both[start:end, kept])
            across.append(np.repeat(places, len(places)))
            down.append(np.tile(places, len(places)))
        return cls(rows, bounds, (np.concatenate(across), np.concatenate(down)), dof * int(system.free.sum()))

    def matrix(self, weights: Array) -> sp.csc_array:
        """Return Σ w b bᵀ, sparse."""
        sums = [((b.T * weights[start:end]) @ b).ravel() for b, (start, end) in zip(self.rows, pairwise(self.bounds))]
        return sp.csc_array((np.concatenate(sums), self.index), shape=(self.size, self.size))
