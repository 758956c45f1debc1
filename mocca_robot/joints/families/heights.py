"""Bumps with k × k control heights: dents beside bumps, saddles, planes that lean; k = 2 frees the plain bump's four.

With four equal heights the surface of k = 2 is the plain bump. Heights that fall along one axis make a z in that
direction, heights of one sign at opposite corners a saddle. For larger k the same bump has steeper flanks, and as many
of them as there are changes of height.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.bumps import FLANK_SEGMENTS
from mocca_robot.joints.families.bump import SMALLEST
from mocca_robot.joints.families.family import Patch
from mocca_robot.joints.families.sites import JointSite, JointSites, about_middle
from mocca_robot.joints.families.tensor import Grid, KnotAxis, grid_joint, heights_from
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions
from mocca_robot.joints.rectangle import Rectangle
from mocca_robot.tolerances import ROUNDING

FEWEST, MOST = 2, 6
"""Control heights along a side."""


def columns_of(count: int) -> tuple[int, ...]:
    """Return the columns of a row that hold `count` heights: the second number is the size."""
    return (0, *range(2, count + 1))


@dataclass(frozen=True)
class Heights:
    """k × k control heights; numbers: first height, size, the other heights, row by row along the rectangle's x."""

    k: int = 2
    pieces: int = FLANK_SEGMENTS

    sharp: ClassVar[bool] = False
    follows_outline: ClassVar[bool] = False
    sizes: ClassVar[tuple[float, float]] = (SMALLEST, 1.0)

    @property
    def name(self) -> str:
        """Return 'free' for four heights, else 'heights_k'."""
        return "free" if self.k == 2 else f"heights_{self.k}"

    @property
    def heights(self) -> tuple[int, ...]:
        """Return the columns of the heights."""
        return columns_of(self.k**2)

    @property
    def flank(self) -> float:
        """Return the width of a cell."""
        return 1.0 / (self.k + 1)

    @cached_property
    def grid(self) -> Grid:
        """Return the grid of control heights."""
        return Grid(KnotAxis.even(self.k), KnotAxis.even(self.k), self.pieces)

    @property
    def patch(self) -> Patch:
        """Return the tessellation."""
        return self.grid.patch

    def tallest(self, options: JointOptions) -> float:
        """Return the largest height as a share of the shorter side."""
        return options.max_height

    def positions(self, sites: JointSites, rows: Array) -> Array:
        """Return (E, K, 2) the grid about the rectangles' middles."""
        return about_middle(self.grid.xy, rows[:, 1])

    def rise(self, rows: Array) -> tuple[Array, Array]:
        """Return heights (E, K), and ones (E,)."""
        return rows[:, list(self.heights)] @ self.grid.basis.T, np.ones(len(rows))

    def radius(self, rows: Array) -> Array:
        """Return (E,) the radius at the knots, where it is tightest: width² / (6 rise)."""
        rises = [rise.max(axis=1) for rise in self.grid.steepest_rises(rows[:, list(self.heights)])]
        return np.asarray((self.flank * rows[:, 1]) ** 2 / (6.0 * np.maximum(np.maximum(*rises), ROUNDING)))

    def catalogue(self, options: JointOptions) -> list[Array]:
        """Return what one height cannot do, shallow to sharp: saddles and z in both directions, of either sign."""
        place = np.linspace(-1.0, 1.0, self.k)
        x, y = np.tile(place, self.k), np.repeat(place, self.k)
        forms = [f / np.abs(f).max() for f in (x, y, x * y, x + y, x - y)]
        allowed = [h for h in (0.08, 0.15, 0.25) if h <= options.max_height]
        return [self.row(sign * h * form) for h in allowed for form in forms for sign in (1.0, -1.0)]

    def row(self, heights: Array, size: float = 1.0) -> Array:
        """Return the row of control heights (k²,) given in shorter sides."""
        return np.array([heights[0], size, *heights[1:]])

    def joint(self, site: JointSite, row: Array, u: Array) -> Joint:
        """Return the joint of one row along u (3,)."""
        covered = site.middle(float(row[1]))
        heights = (row[list(self.heights)] * site.length).tolist()
        return grid_joint(site.contact, self.name, covered, u, self.grid, heights)


def stored_heights_joint(
    contact: Contact, rectangle: Rectangle, u: Array, parameters: Mapping[str, float], pieces: int
) -> Joint:
    """Return the joint from its stored numbers. Raises KeyError and ValueError where they make none."""
    heights = heights_from(parameters)
    family = Heights(round(len(heights) ** 0.5), pieces)
    if family.k**2 != len(heights) or not FEWEST <= family.k <= MOST:
        raise ValueError(f"{len(heights)} control heights, which are not {FEWEST}² to {MOST}²")
    return grid_joint(contact, family.name, rectangle, u, family.grid, heights)
