"""Several bumps side by side on one contact, each with its own height: two along the longer side, or two by two."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import ClassVar

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.bumps import FLANK_SEGMENTS
from mocca_robot.joints.families.family import Patch
from mocca_robot.joints.families.heights import columns_of
from mocca_robot.joints.families.sites import JointSite, JointSites, about_middle
from mocca_robot.joints.families.tensor import Grid, KnotAxis, grid_joint, heights_from
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions
from mocca_robot.joints.rectangle import Rectangle
from mocca_robot.tolerances import ROUNDING

ONE = KnotAxis((0.0, 1 / 3, 2 / 3, 1.0), (-1, 0, 0, -1))
TWO = KnotAxis((0.0, 1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6, 1.0), (-1, 0, 0, -1, 1, 1, -1))
SMALLEST = 0.6
"""Smallest group of bumps, as a share of its rectangle's sides."""


@dataclass(frozen=True)
class Several:
    """2 × `rows_of` bumps; numbers: height of the first, size of the group, heights of the others."""

    rows_of: int = 1
    pieces: int = FLANK_SEGMENTS

    sharp: ClassVar[bool] = False
    follows_outline: ClassVar[bool] = False
    flank: ClassVar[float] = 1 / 6
    sizes: ClassVar[tuple[float, float]] = (SMALLEST, 1.0)

    @property
    def name(self) -> str:
        """Return 'twins' or 'four'."""
        return "twins" if self.rows_of == 1 else "four"

    @property
    def heights(self) -> tuple[int, ...]:
        """Return the columns of the heights."""
        return columns_of(2 * self.rows_of)

    @cached_property
    def grid(self) -> Grid:
        """Return the grid: a control height per bump."""
        return Grid(TWO, ONE if self.rows_of == 1 else TWO, self.pieces)

    @property
    def patch(self) -> Patch:
        """Return the tessellation."""
        return self.grid.patch

    def tallest(self, options: JointOptions) -> float:
        """Return the largest height as a share of the shorter side: bumps half as wide are half as high."""
        return options.max_height if self.rows_of == 1 else 0.5 * options.max_height

    def positions(self, sites: JointSites, rows: Array) -> Array:
        """Return (E, K, 2) the grid about the rectangles' middles."""
        return about_middle(self.grid.xy, rows[:, 1])

    def rise(self, rows: Array) -> tuple[Array, Array]:
        """Return heights (E, K), and ones (E,)."""
        return rows[:, list(self.heights)] @ self.grid.basis.T, np.ones(len(rows))

    def radius(self, rows: Array) -> Array:
        """Return (E,) the radius at the knots, where it is tightest: width² / (6 rise), flanks a sixth wide."""
        rise = np.abs(rows[:, list(self.heights)]).max(axis=1)
        return np.asarray((rows[:, 1] / 6.0) ** 2 / (6.0 * np.maximum(rise, ROUNDING)))

    def catalogue(self, options: JointOptions) -> list[Array]:
        """Return bumps of either sign, shallow to sharp: all alike, and dents beside bumps."""
        signs = [s for s in product((1.0, -1.0), repeat=2 * self.rows_of) if self.rows_of == 1 or sum(s) in (-4, 0, 4)]
        allowed = [h for h in (0.06, 0.12, 0.2) if h <= self.tallest(options)]
        return [np.array([h * s[0], 1.0, *(h * x for x in s[1:])]) for h in allowed for s in signs]

    def joint(self, site: JointSite, row: Array, u: Array) -> Joint:
        """Return the joint of one row along u (3,)."""
        covered = site.middle(float(row[1]))
        heights = (row[list(self.heights)] * site.length).tolist()
        return grid_joint(site.contact, self.name, covered, u, self.grid, heights)


def stored_several(
    kind: str, contact: Contact, rectangle: Rectangle, u: Array, numbers: Mapping[str, float], pieces: int
) -> Joint:
    """Return the joint from its stored numbers. Raises KeyError and ValueError where they make none."""
    family, heights = Several(1 if kind == "twins" else 2, pieces), heights_from(numbers)
    if len(heights) != len(family.heights):
        raise ValueError(f"{len(heights)} heights; {kind} have {len(family.heights)}")
    return grid_joint(contact, kind, rectangle, u, family.grid, heights)
