"""Drawn profiles: the user's own height field by control points, scaled and turned over as the loads ask for."""

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


@dataclass(frozen=True)
class Drawn:
    """A profile of control heights, in rows along the rectangle's longer side; numbers: height, size.

    `profile` are the heights as shares of the largest one, −1 to 1.
    """

    profile: tuple[tuple[float, ...], ...]
    pieces: int = FLANK_SEGMENTS

    name: ClassVar[str] = "drawn"
    heights: ClassVar[tuple[int, ...]] = (0,)
    sharp: ClassVar[bool] = False
    follows_outline: ClassVar[bool] = False
    sizes: ClassVar[tuple[float, float]] = (SMALLEST, 1.0)

    @property
    def flank(self) -> float:
        """Return the width of the narrower cells."""
        return 1.0 / (1 + max(len(self.profile), len(self.profile[0])))

    @cached_property
    def grid(self) -> Grid:
        """Return the grid of control heights."""
        return Grid(KnotAxis.even(len(self.profile[0])), KnotAxis.even(len(self.profile)), self.pieces)

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
        """Return the profile's shares (K,), and the heights (E,)."""
        return self.grid.basis @ np.ravel(self.profile), rows[:, 0]

    def radius(self, rows: Array) -> Array:
        """Return (E,) the radius at the knots, where it is tightest: width² / (6 rise)."""
        rises = [float(r.max()) for r in self.grid.steepest_rises(np.ravel(self.profile)[None])]
        return np.asarray(
            (self.flank * rows[:, 1]) ** 2 / (6.0 * np.maximum(max(rises) * np.abs(rows[:, 0]), ROUNDING))
        )

    def catalogue(self, options: JointOptions) -> list[Array]:
        """Return the profile in several heights, either way up."""
        allowed = [h for h in (0.06, 0.12, 0.2, 0.3, 0.4) if h <= options.max_height]
        return [np.array([sign * h, 1.0]) for h in allowed for sign in (1.0, -1.0)]

    def joint(self, site: JointSite, row: Array, u: Array) -> Joint:
        """Return the joint of one row along u (3,)."""
        covered = site.middle(float(row[1]))
        heights = (row[0] * site.length * np.ravel(self.profile)).tolist()
        columns = {"columns": float(len(self.profile[0]))}
        return grid_joint(site.contact, self.name, covered, u, self.grid, heights, columns)


def stored_drawn(contact: Contact, rectangle: Rectangle, u: Array, numbers: Mapping[str, float], pieces: int) -> Joint:
    """Return the joint from its stored numbers. Raises KeyError and ValueError where they make none."""
    heights, columns = heights_from(numbers), int(numbers["columns"])
    if columns < 1 or len(heights) % columns:
        raise ValueError(f"{len(heights)} heights in {columns} columns")
    grid = Grid(KnotAxis.even(columns), KnotAxis.even(len(heights) // columns), pieces)
    return grid_joint(contact, Drawn.name, rectangle, u, grid, heights, {"columns": float(columns)})
