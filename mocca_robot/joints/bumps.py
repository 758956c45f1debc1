"""All bicubic bumps of an assembly as arrays, for the optimiser: parameters → tessellated patches → derivative.

The height of a patch is h·f(x)·f(y) over its rectangle, along u (see `mocca_robot.joints.bicubic`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from mocca_robot.arrays import Array, IntArray, read_only
from mocca_robot.joints.rectangle import Rectangle
from mocca_robot.tolerances import ROUNDING

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
    """The parameters Φ of E bumps.

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
        middle_x[x[1:] > 0.5 + ROUNDING] *= -1.0
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

    @property
    def points(self) -> Array:
        """Return (E, R, 3), R = 3·T: the corners of every triangle."""
        e = len(self.vertices)
        return np.asarray(self.vertices[:, self.pattern.triangles].reshape(e, -1, 3))

    @property
    def normals(self) -> Array:
        """Return (E, R, 3): the triangle's normal at each of `points`."""
        return np.repeat(self.facet_normals, 3, axis=1)


def bump_rays(
    rectangles: Rectangles, parameters: BumpParameters, flank_segments: int = FLANK_SEGMENTS, kind: str = "n"
) -> Bumps:
    """Return the tessellated patches of E joints at once: their `points` and `normals`.

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
    normals /= np.linalg.norm(normals, axis=2)[..., None]
    return Bumps(
        rectangles=rectangles,
        parameters=parameters,
        pattern=pattern,
        vertices=vertices,
        facet_normals=normals,
    )


def lean_of(rectangles: Rectangles, u: Array) -> Array:
    """Return the lean (E, 2) whose directions are `u` (E, 3). Raises ValueError where u·n < 0.3 |u|."""
    local = np.einsum("ed,ekd->ek", u, rectangles.axes)
    share = local[:, 2] / np.linalg.norm(u, axis=1)
    if len(share) and share.min() < MIN_NORMAL_SHARE - ROUNDING:
        worst = int(share.argmin())
        raise ValueError(f"u of joint {worst} has u·n = {share[worst]:.3f}; at least {MIN_NORMAL_SHARE} is needed")
    return np.asarray(local[:, :2] / local[:, 2:])
