"""Ribs: a bump or a z drawn along one side of the rectangle, all of its length, with ends as steep as its flanks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.bumps import FLANK_SEGMENTS
from mocca_robot.joints.families.family import Patch
from mocca_robot.joints.families.sites import JointSite, JointSites
from mocca_robot.joints.families.tensor import Grid, KnotAxis, grid_joint, heights_from
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions
from mocca_robot.joints.rectangle import Rectangle
from mocca_robot.tolerances import EXACT, ROUNDING

NARROWEST = 0.3
"""Narrowest rib, as a share of the side that it lies across."""


@dataclass(frozen=True)
class Rib:
    """A rib along the rectangle's longer side (`along` 0) or the shorter one (1).

    Numbers: height at one flank, width as a share of the side across, height at the other flank.
    """

    along: int = 0
    pieces: int = FLANK_SEGMENTS

    heights: ClassVar[tuple[int, ...]] = (0, 2)
    sharp: ClassVar[bool] = False
    follows_outline: ClassVar[bool] = False
    flank: ClassVar[float] = 0.1
    sizes: ClassVar[tuple[float, float]] = (NARROWEST, 1.0)

    @property
    def name(self) -> str:
        """Return 'rib' or 'rib_across', by the side that it is drawn along."""
        return ("rib", "rib_across")[self.along]

    @cached_property
    def grid(self) -> Grid:
        """Return the grid of two control heights."""
        drawn, across = KnotAxis((0.0, 1 / 3, 2 / 3, 1.0), (-1, 0, 0, -1)), KnotAxis.even(2)
        return Grid(drawn, across, self.pieces) if self.along == 0 else Grid(across, drawn, self.pieces)

    @property
    def patch(self) -> Patch:
        """Return the tessellation."""
        return self.grid.patch

    def tallest(self, options: JointOptions) -> float:
        """Return the largest height as a share of the shorter side."""
        return options.max_height

    def positions(self, sites: JointSites, rows: Array) -> Array:
        """Return (E, K, 2) the grid, narrow across and with narrow ends."""
        return self._placed(rows[:, 1], 1.0 / sites.aspect)

    def _placed(self, width: Array, ratio: Array) -> Array:
        """Return positions (E, K, 2) for widths (E,) and the ratio (E,) of the longer to the shorter side."""
        across = 1 - self.along
        longer = ratio if self.along == 0 else 1.0 / ratio
        end = np.minimum(width / (3.0 * longer), 1 / 3)[:, None]
        t = self.grid.xy[:, self.along]
        drawn = np.where(t < 1 / 3, 3.0 * t * end, np.where(t > 2 / 3, 1.0 - 3.0 * (1.0 - t) * end, 0.0))
        inner = (t >= 1 / 3 - EXACT) & (t <= 2 / 3 + EXACT)
        drawn = np.where(inner, end + (3.0 * t - 1.0) * (1.0 - 2.0 * end), drawn)
        xy = np.empty((len(width), len(t), 2))
        xy[:, :, self.along] = drawn
        xy[:, :, across] = 0.5 + width[:, None] * (self.grid.xy[:, across] - 0.5)
        return xy

    def rise(self, rows: Array) -> tuple[Array, Array]:
        """Return heights (E, K), and ones (E,)."""
        return rows[:, list(self.heights)] @ self.grid.basis.T, np.ones(len(rows))

    def radius(self, rows: Array) -> Array:
        """Return (E,) the radius at the knots, where it is tightest: width² / (6 rise)."""
        rise = np.maximum(np.abs(rows[:, [0, 2]]).max(axis=1), np.abs(rows[:, 0] - rows[:, 2]))
        return np.asarray((rows[:, 1] / 3.0) ** 2 / (6.0 * np.maximum(rise, ROUNDING)))

    def catalogue(self, options: JointOptions) -> list[Array]:
        """Return ribs and z of either sign, shallow to sharp."""
        forms = ((0.1, 0.6), (0.2, 0.6), (0.3, 1.0), (0.15, 0.4))
        allowed = [(h, width) for h, width in forms if h <= options.max_height]
        return [np.array([s * h, width, s * z * h]) for h, width in allowed for z in (1.0, -1.0) for s in (1.0, -1.0)]

    def joint(self, site: JointSite, row: Array, u: Array) -> Joint:
        """Return the joint of one row along u (3,)."""
        heights = (row[list(self.heights)] * site.length).tolist()
        return self.drawn(site.contact, site.rectangle, u, heights, float(row[1]))

    def drawn(self, contact: Contact, rectangle: Rectangle, u: Array, heights: list[float], width: float) -> Joint:
        """Return the joint for heights in metres and a width as a share of the side across."""
        if not 0.0 < width <= 1.0:
            raise ValueError(f"a rib as wide as {width:g} of its rectangle")
        xy = self._placed(np.array([width]), np.array([rectangle.l1 / rectangle.l2]))[0]
        return grid_joint(contact, self.name, rectangle, u, self.grid, heights, {"width": width}, xy)


def stored_rib(
    kind: str, contact: Contact, rectangle: Rectangle, u: Array, numbers: Mapping[str, float], pieces: int
) -> Joint:
    """Return the joint from its stored numbers. Raises KeyError and ValueError where they make none."""
    heights = heights_from(numbers)
    if len(heights) != 2:
        raise ValueError(f"{len(heights)} heights; a rib has two")
    return Rib(int(kind == "rib_across"), pieces).drawn(contact, rectangle, u, heights, numbers["width"])
