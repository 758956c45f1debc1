"""All bicubic bumps of an assembly as arrays, for the optimiser: parameters → tessellated patches → derivative.

The height of a patch is h·f(x)·f(y) over its rectangle, along u (see `mocca_robot.joints.bicubic`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import scipy.sparse as sp

from mocca_robot.arrays import Array, IntArray, read_only
from mocca_robot.joints.rectangle import Rectangle

FLANK_SEGMENTS = 3
"""Straight pieces per flank: 98 triangles a patch; its steepest piece has 96 % of the curved patch's slope."""
MIN_NORMAL_SHARE = 0.3
"""Smallest u·n: beyond this lean (72°) a height field over the contact is mostly sideways."""
MAX_LEAN = float(np.sqrt(1.0 / MIN_NORMAL_SHARE**2 - 1.0))
"""Largest tan of the angle between u and the contact normal."""


@dataclass(frozen=True, eq=False)
class Rectangles:
    """E rectangles as arrays: `origin`, `edge_x`, `edge_y`, each (E, 3), metres; edge_x × edge_y along the normal."""

    origin: Array
    edge_x: Array
    edge_y: Array

    @classmethod
    def of(cls, rectangles: Sequence[Rectangle]) -> Rectangles:
        """Return the rectangles stacked."""
        return cls(
            read_only(np.array([r.origin for r in rectangles]).reshape(-1, 3)),
            read_only(np.array([r.l1 * r.axis_x for r in rectangles]).reshape(-1, 3)),
            read_only(np.array([r.l2 * r.axis_y for r in rectangles]).reshape(-1, 3)),
        )

    @cached_property
    def axes(self) -> Array:
        """Return (E, 3, 3): rows are the unit axes x, y and the contact normal."""
        x = self.edge_x / np.linalg.norm(self.edge_x, axis=1)[:, None]
        y = self.edge_y / np.linalg.norm(self.edge_y, axis=1)[:, None]
        return read_only(np.stack([x, y, np.cross(x, y)], axis=1))

    def __len__(self) -> int:
        return len(self.origin)


@dataclass(frozen=True, eq=False)
class BumpParameters:
    """The parameters Φ of E bumps; also the shape of a gradient with respect to them.

    Attributes:
        height: (E,) h along u, metres; positive into P_j.
        lean: (E, 2) tangential components of u over its normal one, in the rectangle's axes; 0 = upright.
        low, high: (E, 2) corners of the bump inside its rectangle, as fractions of l1 and l2.
    """

    height: Array
    lean: Array
    low: Array
    high: Array

    @classmethod
    def flat(cls, count: int) -> BumpParameters:
        """Return upright bumps of no height over their whole rectangles."""
        return cls(np.zeros(count), np.zeros((count, 2)), np.zeros((count, 2)), np.ones((count, 2)))

    @property
    def vector(self) -> Array:
        """Return (7·E,) all numbers: heights, leans, low and high corners."""
        return np.concatenate([self.height, self.lean.ravel(), self.low.ravel(), self.high.ravel()])

    @classmethod
    def from_vector(cls, vector: Array) -> BumpParameters:
        """Return the parameters whose `vector` this is."""
        e = len(vector) // 7
        lean, low, high = vector[e:].reshape(3, e, 2)
        return cls(vector[:e], lean, low, high)

    def directions(self, rectangles: Rectangles) -> Array:
        """Return u (E, 3): unit, world."""
        local = np.concatenate([self.lean, np.ones((len(self.lean), 1))], axis=1)
        local /= np.linalg.norm(local, axis=1)[:, None]
        return np.asarray(np.einsum("ek,ekd->ed", local, rectangles.axes))


@dataclass(frozen=True, eq=False)
class BumpPattern:
    """The tessellation that all patches share: K vertices, T triangles.

    Attributes:
        xy: (K, 2) positions in the unit square.
        share: (K,) heights f(x)·f(y) as a share of h.
        triangles: (T, 3), counter-clockwise from above.
        rim: (R,) boundary vertices, counter-clockwise.
    """

    xy: Array
    share: Array
    triangles: IntArray
    rim: IntArray

    @cached_property
    def incidence(self) -> sp.csr_array:
        """Return (K, 3·T): which triangle corners each vertex is."""
        corners = self.triangles.size
        return sp.csr_array(
            (np.ones(corners), (self.triangles.ravel(), np.arange(corners))), shape=(len(self.xy), corners)
        )


@cache
def bump_pattern(flank_segments: int = FLANK_SEGMENTS, kind: str = "n") -> BumpPattern:
    """Return the pattern of n-type ('n') or z-type ('z') patches with `flank_segments` pieces per flank.

    One piece per flank gives the piecewise-planar variant: a truncated pyramid. Cells are cut by the diagonal
    that points at the middle, which keeps the corners no steeper than the flanks.
    """
    t = np.arange(flank_segments + 1) / flank_segments
    rise = t**2 * (3.0 - 2.0 * t)
    n_x = np.concatenate([t / 3, 1.0 - t[::-1] / 3])
    n_f = np.concatenate([rise, rise[::-1]])
    x, f = n_x, n_f
    if kind == "z":
        x = np.concatenate([t / 4, 0.25 + t[1:] / 2, 0.75 + t[1:] / 4])
        f = np.concatenate([rise, 1.0 - 2.0 * rise[1:], rise[1:] - 1.0])
    elif kind != "n":
        raise ValueError(f"unknown kind of patch '{kind}'; known: n, z")
    columns, rows = len(x), len(n_x)
    index = np.arange(columns * rows).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, 1:].ravel(), index[1:, :-1].ravel()
    middle_x, middle_y = 0.5 * (x[1:] + x[:-1]) - 0.5, 0.5 * (n_x[1:] + n_x[:-1]) - 0.5
    if kind == "z":
        middle_x = np.abs(middle_x) - 0.25
        middle_x[x[1:] > 0.5 + 1e-9] *= -1.0
    main = (middle_y[:, None] * middle_x[None]).ravel() >= 0
    first = np.where(main[:, None], np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    second = np.where(main[:, None], np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1))
    triangles = np.stack([first, second], axis=1).reshape(-1, 3)
    rim = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    xy = np.stack(np.meshgrid(x, n_x), axis=-1).reshape(-1, 2)
    return BumpPattern(read_only(xy), read_only(np.outer(n_f, f).ravel()), triangles, rim)


@dataclass(frozen=True, eq=False, kw_only=True)
class Bumps:
    """E tessellated patches.

    Attributes:
        pattern: the shared tessellation.
        vertices: (E, K, 3), metres, world.
        facet_normals: (E, T, 3) unit, from P_i into P_j.
    """

    rectangles: Rectangles
    parameters: BumpParameters
    pattern: BumpPattern
    vertices: Array
    facet_normals: Array
    _double_areas: Array

    @property
    def points(self) -> Array:
        """Return (E, R, 3), R = 3·T: the corners of every triangle."""
        e = len(self.vertices)
        return np.asarray(self.vertices[:, self.pattern.triangles].reshape(e, -1, 3))

    @property
    def normals(self) -> Array:
        """Return (E, R, 3): the triangle's normal at each of `points`."""
        return np.repeat(self.facet_normals, 3, axis=1)

    def pullback(self, d_points: Array, d_normals: Array) -> BumpParameters:
        """Return the gradient with respect to the parameters of a number with the given gradients (E, R, 3).

        For E (Eq. 8) the envelope theorem gives them: dE/dG = r fᵀ, r the residual and f the contact forces.
        """
        e, t = len(self.vertices), len(self.pattern.triangles)
        corners = self.vertices[:, self.pattern.triangles]
        n = self.facet_normals
        d_n = d_normals.reshape(e, t, 3, 3).sum(axis=2)
        d_cross = (d_n - (d_n * n).sum(axis=2, keepdims=True) * n) / self._double_areas[..., None]
        ab, ac = corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]
        d_corners = d_points.reshape(e, t, 3, 3).copy()
        d_b, d_c = np.cross(ac, d_cross), np.cross(d_cross, ab)
        d_corners[:, :, 1] += d_b
        d_corners[:, :, 2] += d_c
        d_corners[:, :, 0] -= d_b + d_c
        d_columns = d_corners.reshape(e, -1, 3).transpose(1, 0, 2).reshape(3 * t, -1)
        d_vertices = (self.pattern.incidence @ d_columns).reshape(-1, e, 3).transpose(1, 0, 2)
        return self._pullback_vertices(d_vertices)

    def transferred(self) -> tuple[Array, Array]:
        """Return the volume (E,), m³, and first moment (E, 3), m⁴, that each bump moves from P_j to P_i."""
        origin = self.rectangles.origin
        a, b, c = (self.vertices[:, self.pattern.triangles[:, k]] - origin[:, None] for k in range(3))
        six_v = np.einsum("etd,etd->et", a, np.cross(b, c))
        first = np.einsum("et,etd->ed", six_v, a + b + c) / 24.0
        volume = six_v.sum(axis=1) / 6.0
        return volume, first + volume[:, None] * origin

    def _pullback_vertices(self, d_vertices: Array) -> BumpParameters:
        p, r, pattern = self.parameters, self.rectangles, self.pattern
        u = p.directions(r)
        along = np.einsum("ekd,k->ed", d_vertices, pattern.share)
        d_height = (along * u).sum(axis=1)
        d_u = p.height[:, None] * along
        norm = np.sqrt(1.0 + (p.lean**2).sum(axis=1))[:, None]
        tangential = d_u - (d_u * u).sum(axis=1)[:, None] * u
        d_lean = np.einsum("ed,ekd->ek", tangential, r.axes[:, :2]) / norm
        edges = np.stack([r.edge_x, r.edge_y], axis=1)  # (E, 2, 3)
        d_position = np.einsum("ekd,end->ekn", d_vertices, edges)
        d_high = (d_position * pattern.xy).sum(axis=1)
        return BumpParameters(d_height, d_lean, d_position.sum(axis=1) - d_high, d_high)


def bump_rays(
    rectangles: Rectangles, parameters: BumpParameters, flank_segments: int = FLANK_SEGMENTS, kind: str = "n"
) -> Bumps:
    """Return the tessellated patches of E joints at once: their `points`, `normals` and derivative.

    The flat rest of each contact is not among them: add `contact_rays` of the contacts.
    """
    pattern = bump_pattern(flank_segments, kind)
    xy = parameters.low[:, None] + (parameters.high - parameters.low)[:, None] * pattern.xy  # (E, K, 2)
    rise = parameters.height[:, None] * parameters.directions(rectangles)
    vertices = (
        rectangles.origin[:, None]
        + xy[..., :1] * rectangles.edge_x[:, None]
        + xy[..., 1:] * rectangles.edge_y[:, None]
        + pattern.share[:, None] * rise[:, None]
    )
    a, b, c = (vertices[:, pattern.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    double_areas = np.linalg.norm(normals, axis=2)
    normals /= double_areas[..., None]
    return Bumps(
        rectangles=rectangles,
        parameters=parameters,
        pattern=pattern,
        vertices=vertices,
        facet_normals=normals,
        _double_areas=double_areas,
    )


def lean_of(rectangles: Rectangles, u: Array) -> Array:
    """Return the lean (E, 2) whose directions are `u` (E, 3). Raises ValueError where u·n < 0.3 |u|."""
    local = np.einsum("ed,ekd->ek", u, rectangles.axes)
    share = local[:, 2] / np.linalg.norm(u, axis=1)
    if len(share) and share.min() < MIN_NORMAL_SHARE - 1e-9:
        worst = int(share.argmin())
        raise ValueError(f"u of joint {worst} has u·n = {share[worst]:.3f}; at least {MIN_NORMAL_SHARE} is needed")
    return np.asarray(local[:, :2] / local[:, 2:])
