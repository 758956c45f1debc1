"""Frusta that follow the contact's outline: straight flanks towards the middle of the rectangle, and a flat top.

On a triangle or a trapezoid a rectangle leaves most of the contact unused; these end at the margin all round.
Where an outline cannot be seen from the rectangle's middle, or has holes, a round frustum stands in the rectangle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np

from mocca_robot.arrays import Array, read_only
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.bumps import Rectangles, lean_of
from mocca_robot.joints.families.family import Patch
from mocca_robot.joints.families.ring import CORNERS, ring_of
from mocca_robot.joints.families.sites import JointSite, JointSites
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions
from mocca_robot.joints.patch import joint_with_patch
from mocca_robot.joints.rectangle import Rectangle, rectangle_parameters

UP = read_only(np.repeat([0.0, 1.0], [CORNERS, CORNERS + 1]))
"""How far up the vertices are: the outline, the top's outline, the middle."""
SMALLEST_TOP, LARGEST_TOP = 0.05, 0.6
"""The flat top, as a share of the outline."""


@cache
def _patch() -> Patch:
    around = np.arange(CORNERS)
    after = (around + 1) % CORNERS
    first = np.stack([around, after, CORNERS + after], axis=1)
    second = np.stack([around, CORNERS + after, CORNERS + around], axis=1)
    top = np.stack([CORNERS + around, CORNERS + after, np.full(CORNERS, 2 * CORNERS)], axis=1)
    # A flank is one plane: it is asked at its four corners.
    corners = np.concatenate([around, after, CORNERS + around, CORNERS + after])
    return Patch(
        triangles=np.concatenate([first, second, top]),
        rim=around,
        telling=np.tile(around, 4),
        at=np.repeat(corners[:, None], 3, axis=1),
    )


@dataclass(frozen=True)
class OutlineFrustum:
    """Straight flanks all round the contact; numbers: height, size of the flat top."""

    name: ClassVar[str] = "outline"
    heights: ClassVar[tuple[int, ...]] = (0,)
    sharp: ClassVar[bool] = True
    follows_outline: ClassVar[bool] = True
    flank: ClassVar[float] = 0.5 - 0.5 * LARGEST_TOP
    sizes: ClassVar[tuple[float, float]] = (SMALLEST_TOP, LARGEST_TOP)

    @property
    def patch(self) -> Patch:
        """Return the tessellation: the outline, the top's outline, and the middle."""
        return _patch()

    def tallest(self, options: JointOptions) -> float:
        """Return the largest height as a share of the shorter side."""
        return options.tallest_frustum

    def positions(self, sites: JointSites, rows: Array) -> Array:
        """Return (E, K, 2) rings that shrink towards the rectangles' middles."""
        return self._placed(sites.outlines, rows[:, 1])

    def _placed(self, outlines: Array, top: Array) -> Array:
        """Return positions (E, K, 2) on outlines (E, M, 2) for tops of a share (E,)."""
        inner = 0.5 + top[:, None, None] * (outlines - 0.5)
        return np.concatenate([outlines, inner, np.full((len(top), 1, 2), 0.5)], axis=1)

    def rise(self, rows: Array) -> tuple[Array, Array]:
        """Return the shares (K,) and the heights (E,)."""
        return UP, rows[:, 0]

    def radius(self, rows: Array) -> Array:
        """Return (E,) no radius: edges run down from the corners of the top."""
        return np.zeros(len(rows))

    def catalogue(self, options: JointOptions) -> list[Array]:
        """Return bumps of either sign, shallow to sharp."""
        allowed = [h for h in (0.08, 0.16, 0.25, 0.35, 0.5) if h <= options.max_height]
        return [np.array([sign * h, 0.3]) for h in allowed for sign in (1.0, -1.0)]

    def joint(self, site: JointSite, row: Array, u: Array) -> Joint:
        """Return the joint of one row along u (3,)."""
        return self.built(site, float(row[0] * site.length), float(row[1]), u)

    def built(self, site: JointSite, height: float, top: float, u: Array) -> Joint:
        """Return the joint of a height in metres whose flat top is the share `top` of the outline."""
        if not 0.0 < top < 1.0:
            raise ValueError(f"a top of {top:g} of its outline")
        u = np.asarray(u, dtype=np.float64)
        u = u / np.linalg.norm(u)
        r = site.rectangle
        lean_of(Rectangles.of([r]), u[None])
        at = self._placed(ring_of(site.contact, site.rectangle, site.margin)[None], np.array([top]))[0]
        flat = r.origin + at[:, :1] * r.l1 * r.axis_x + at[:, 1:] * r.l2 * r.axis_y
        vertices = flat + height * UP[:, None] * u
        numbers = rectangle_parameters(r) | {"height_m": height, "top": top, "outline_margin_m": site.margin}
        return joint_with_patch(site.contact, self.name, u, (vertices, self.patch.triangles), self.patch.rim, numbers)


def stored_outline(contact: Contact, rectangle: Rectangle, u: Array, numbers: Mapping[str, float]) -> Joint:
    """Return the joint from its stored numbers. Raises KeyError and ValueError where they make none."""
    site = JointSite(contact, rectangle, numbers["outline_margin_m"])
    return OutlineFrustum().built(site, numbers["height_m"], numbers["top"], u)
