"""How high solid bumps may get: clear of the part's boundary and of every other joint (Fig. 14).

A bump enters one part: P_j when its height is positive, P_i when it is negative. Each of its points keeps
`margin` away from the part's other faces, and is nearer to its own rectangle than to any other joint's rectangle
on that part, by `margin`. The latter is what keeps joints apart for good: points in the cells of two rectangles
are at least `margin` from each other, whatever the two heights are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.bicubic import Rectangles
from mocca_robot.tolerances import TINY, TOLERANCES

STEPS = 24
"""Steps along u; each at least halves what is left of the way to the limit."""
CONVERGED = 1e-3
"""Relative step below which a march stops short of its limit, on the safe side."""
CHUNK = 40_000
"""Point–triangle pairs evaluated at once: small enough for the processor's cache."""

_AT = np.array([1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6])
_SHARE = np.array([0.5, 1.0, 1.0, 1.0, 0.5])
_SAMPLES = np.array([(x, y) for x in range(5) for y in range(5) if (x == 2) == (y == 2) or x in (0, 4) or y in (0, 4)])


def height_limits(
    assembly: Assembly,
    contacts: Sequence[Contact],
    rectangles: Rectangles,
    u: Array,
    margin: Array | float,
    lean: float = 0.0,
    flank: float = 1 / 3,
    samples: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """Return the lowest and highest bump (E,), (E,), metres along u, h_min ≤ 0 ≤ h_max.

    `contacts` and `rectangles` are those of all E joints that may become curved, `u` (E, 3) their principal
    directions. The limits hold for every direction u' with |u' − u| ≤ `lean`, so that one call serves an
    optimiser that leans u. A rectangle closer to a face or to another rectangle than 2·`margin` is asked to keep
    half of that distance. `flank` is the width of the bumps' flanks, as a share of the rectangle's sides; bumps with
    wider ones have at least as much room; `samples` takes its place where surfaces are no bumps over rectangles: points
    (E, S, 2) in shares of the rectangles, and how far up (S,) they are. Conservative between the samples only as far as
    the margin goes.
    """
    count = len(contacts)
    if count == 0:
        return np.zeros(0), np.zeros(0)
    unit = u / np.linalg.norm(u, axis=1)[:, None]
    margins = np.broadcast_to(np.asarray(margin, dtype=np.float64), (count,))
    joint = np.concatenate([np.arange(count), np.arange(count)])
    side = np.repeat([0, 1], count)
    part = np.array([c.parts for c in contacts])[joint, side]
    travel = np.where(side[:, None] == 1, unit[joint], -unit[joint])
    faces = [_other_faces(assembly, int(p), contacts[e]) for p, e in zip(part, joint)]
    neighbours = [joint[(part == p) & (joint != e)] for p, e in zip(part, joint)]
    room = np.empty(2 * count)
    places, share = _bump_samples(count, flank) if samples is None else samples
    load = np.array([max(len(f), 2 * len(m), 1) for f, m in zip(faces, neighbours)])
    order = np.argsort(-load, kind="stable")
    start = 0
    while start < len(order):
        some = order[start : start + max(1, CHUNK // (len(share) * int(load[order[start]])))]
        obstacles = _Facing.of([faces[r] for r in some], [neighbours[r] for r in some], rectangles)
        at = (places[joint[some]], share)
        room[some] = _room(obstacles, rectangles, joint[some], travel[some], margins[joint[some]], lean, at)
        start += len(some)
    room = np.minimum(room, assembly.size)
    return -room[:count], room[count:]


def _other_faces(assembly: Assembly, part: int, contact: Contact) -> Array:
    """Return (F, 3, 3) corners of the part's triangles that do not lie in the contact's plane."""
    mesh = assembly.parts[part].shape
    assert isinstance(mesh, Mesh)
    corners = mesh.vertices[mesh.faces]
    off = np.abs((corners - contact.polygon[0]) @ contact.normal).max(axis=1)
    return np.asarray(corners[off > 2.0 * TOLERANCES.contact_gap * assembly.size])


@dataclass(frozen=True, eq=False, kw_only=True)
class _Facing:
    """What n bumps keep away from, padded to the same number for each.

    Attributes:
        corners, edges: (n, F, 3, 3) triangles; the k-th edge starts at the k-th corner.
        normals: (n, F, 3) unit.
        face: (n, F) which triangles are real.
        origin, axes, sides: (n, M, 3), (n, M, 3, 3), (n, M, 2) rectangles of other joints.
        rectangle: (n, M) which rectangles are real.
    """

    corners: Array
    edges: Array
    normals: Array
    face: BoolArray
    origin: Array
    axes: Array
    sides: Array
    rectangle: BoolArray

    @classmethod
    def of(cls, faces: Sequence[Array], neighbours: Sequence[IntArray], rectangles: Rectangles) -> _Facing:
        """Return the obstacles of n bumps: triangles (F, 3, 3) and indices of rectangles for each."""
        most = max(1, *(len(f) for f in faces))
        corners, face = np.zeros((len(faces), most, 3, 3)), np.zeros((len(faces), most), dtype=np.bool_)
        for row, triangles in enumerate(faces):
            corners[row, : len(triangles)], face[row, : len(triangles)] = triangles, True
        most = max(1, *(len(m) for m in neighbours))
        index, real = np.zeros((len(faces), most), dtype=np.int64), np.zeros((len(faces), most), dtype=np.bool_)
        for row, other in enumerate(neighbours):
            index[row, : len(other)], real[row, : len(other)] = other, True
        edges = np.roll(corners, -1, axis=2) - corners
        normals = np.cross(edges[:, :, 0], edges[:, :, 1])
        normals /= np.maximum(np.linalg.norm(normals, axis=2), TINY)[..., None]
        origin, axes = rectangles.origin[index], rectangles.axes[index]
        return cls(
            corners=corners,
            edges=edges,
            normals=normals,
            face=face,
            origin=origin,
            axes=axes,
            sides=_sides(rectangles)[index],
            rectangle=real,
        )

    def face_distance(self, points: Array) -> Array:
        """Return (n, S) the distance of points (n, S, 3) to the nearest triangle of their row."""
        inside = np.ones((*points.shape[:2], self.corners.shape[1]), dtype=np.bool_)
        nearest = np.full(inside.shape, np.inf)
        square = (points**2).sum(axis=2)[..., None]
        for k in range(3):
            a, e = self.corners[:, :, k], self.edges[:, :, k]
            along = _dot(points, e) - (a * e).sum(axis=2)[:, None]
            length = np.maximum((e**2).sum(axis=2), TINY)[:, None]
            t = np.clip(along / length, 0.0, 1.0)
            offset = square - 2.0 * _dot(points, a) + (a**2).sum(axis=2)[:, None]
            nearest = np.minimum(nearest, offset - t * (2.0 * along - t * length))
            inward = np.cross(self.normals, e)
            inside &= _dot(points, inward) >= (a * inward).sum(axis=2)[:, None]
        height = _dot(points, self.normals) - (self.corners[:, :, 0] * self.normals).sum(axis=2)[:, None]
        distance = np.where(inside, height**2, np.maximum(nearest, 0.0))
        return np.asarray(np.sqrt(np.where(self.face[:, None], distance, np.inf).min(axis=2)))

    def rectangle_distance(self, points: Array) -> Array:
        """Return (n, S) the distance of points (n, S, 3) to the nearest rectangle of another joint."""
        offset = points[:, :, None] - self.origin[:, None]  # (n, S, M, 3)
        distance = _to_rectangle(np.einsum("nsmd,nmkd->nsmk", offset, self.axes), self.sides[:, None])
        return np.asarray(np.where(self.rectangle[:, None], distance, np.inf).min(axis=2))


def _dot(points: Array, vectors: Array) -> Array:
    """Return (n, S, F) products of points (n, S, 3) and vectors (n, F, 3)."""
    return np.asarray(points @ vectors.transpose(0, 2, 1))


def _sides(rectangles: Rectangles) -> Array:
    return np.stack([np.linalg.norm(e, axis=1) for e in (rectangles.edge_x, rectangles.edge_y)], axis=1)


def _to_rectangle(local: Array, sides: Array) -> Array:
    """Return the distance of points (…, 3) in a rectangle's own frame to the rectangle with `sides` (…, 2)."""
    beside = np.maximum(np.maximum(-local[..., :2], local[..., :2] - sides), 0.0)
    return np.asarray(np.sqrt((beside**2).sum(axis=-1) + local[..., 2] ** 2))


def _bump_samples(count: int, flank: float) -> tuple[Array, Array]:
    """Return where (count, S, 2) bumps with flanks of a width are asked for room, and how far up (S,) that is."""
    stretch = 3.0 * flank  # the samples are those of flanks a third wide
    at = np.select([_AT < 0.5, _AT > 0.5], [_AT * stretch, 1.0 - (1.0 - _AT) * stretch], 0.5)
    return np.broadcast_to(at[_SAMPLES], (count, *_SAMPLES.shape)), _SHARE[_SAMPLES].prod(axis=1)


def _room(
    obstacles: _Facing,
    rectangles: Rectangles,
    own: IntArray,
    travel: Array,
    margin: Array,
    lean: float,
    samples: tuple[Array, Array],
) -> Array:
    """Return (n,) how high the bumps of joints `own` may rise along `travel` (n, 3); `samples` as `_bump_samples`.

    Marches every sample by what its distances guarantee: distances change by at most 1 per metre, differences of
    two distances by at most 2, and a lean of the direction shifts a point at height t by t·lean.
    """
    xy, share = samples
    centre = rectangles.origin[own]
    base = xy[..., :1] * rectangles.edge_x[own][:, None] + xy[..., 1:] * rectangles.edge_y[own][:, None]
    origin = obstacles.corners[:, :1, 0]
    local = replace(obstacles, corners=obstacles.corners - origin[:, :, None], origin=obstacles.origin - origin)
    start = base + centre[:, None] - origin
    keep_faces = np.minimum(margin[:, None], 0.5 * local.face_distance(start))
    keep_others = np.minimum(margin[:, None], 0.5 * local.rectangle_distance(start))
    t = np.zeros(base.shape[:2])
    for _ in range(STEPS):
        moved = t[..., None] * travel[:, None]
        in_frame = np.einsum("nsd,nkd->nsk", base + moved, rectangles.axes[own])
        own_distance = _to_rectangle(in_frame, _sides(rectangles)[own][:, None])
        free = (local.face_distance(start + moved) - keep_faces - lean * t) / (1.0 + lean)
        away = local.rectangle_distance(start + moved) - own_distance - keep_others - 2.0 * lean * t
        step = np.maximum(np.minimum(free, away / (2.0 + 2.0 * lean)), 0.0)
        t += step
        if (step <= CONVERGED * t).all() or not np.isfinite(t).all():
            break
    return np.asarray((t / share).min(axis=1))
