"""The plain bump of solids: a bicubic patch of one height (see `mocca_robot.joints.bicubic`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.joints.bicubic import bicubic_joint
from mocca_robot.joints.bumps import FLANK_SEGMENTS, BumpPattern, bump_pattern
from mocca_robot.joints.families.family import Patch
from mocca_robot.joints.families.sites import JointSite, JointSites, about_middle
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions
from mocca_robot.tolerances import ROUNDING

SMALLEST = 0.4
"""Smallest bump, as a share of its rectangle's sides."""


@dataclass(frozen=True)
class Bump:
    """Bicubic bumps with `segments` straight pieces per flank; numbers: height, size."""

    segments: int = FLANK_SEGMENTS

    name: ClassVar[str] = "n"
    heights: ClassVar[tuple[int, ...]] = (0,)
    sharp: ClassVar[bool] = False
    follows_outline: ClassVar[bool] = False
    flank: ClassVar[float] = 1 / 3
    sizes: ClassVar[tuple[float, float]] = (SMALLEST, 1.0)

    @cached_property
    def pattern(self) -> BumpPattern:
        """Return the tessellation with its heights."""
        return bump_pattern(self.segments, "n")

    @cached_property
    def patch(self) -> Patch:
        """Return the tessellation; the steepest strips of the flanks tell of it."""
        triangles, telling = self.pattern.triangles, self._telling
        return Patch(triangles=triangles, rim=self.pattern.rim, telling=telling, at=triangles[telling])

    @property
    def _telling(self) -> IntArray:
        corners = self.pattern.xy[self.pattern.triangles].mean(axis=1)
        strip = np.minimum(corners, 1.0 - corners) * 3.0 * self.segments
        if self.segments == 1:  # every flank is one plane
            return np.asarray(np.flatnonzero((strip < 1.0).any(axis=1)))
        steep = (strip > 1.0) & (strip < FLANK_SEGMENTS - 1.0)
        inner = strip > 1.0
        return np.asarray(np.flatnonzero((steep[:, 0] & inner[:, 1]) | (steep[:, 1] & inner[:, 0])))

    def tallest(self, options: JointOptions) -> float:
        """Return the largest height as a share of the shorter side."""
        return options.max_height

    def positions(self, sites: JointSites, rows: Array) -> Array:
        """Return (E, K, 2) the pattern about the rectangles' middles."""
        return about_middle(self.pattern.xy, rows[:, 1])

    def rise(self, rows: Array) -> tuple[Array, Array]:
        """Return the pattern's shares (K,) and the heights (E,)."""
        return self.pattern.share, rows[:, 0]

    def radius(self, rows: Array) -> Array:
        """Return (E,) the radius at the knots, where it is tightest: width² / (6 rise), flanks a third wide."""
        flank = rows[:, 1] / 3.0
        return np.asarray(flank**2 / (6.0 * np.maximum(np.abs(rows[:, 0]), ROUNDING)))

    def catalogue(self, options: JointOptions) -> list[Array]:
        """Return bumps of either sign, shallow to sharp."""
        bumps = ((0.06, 1.0), (0.12, 1.0), (0.2, 1.0), (0.3, 1.0), (0.4, 1.0), (0.15, 0.6), (0.24, 0.6))
        allowed = [(h, size) for h, size in bumps if h <= options.max_height]
        return [np.array([sign * h, size]) for h, size in allowed for sign in (1.0, -1.0)]

    def joint(self, site: JointSite, row: Array, u: Array) -> Joint:
        """Return the joint of one row along u (3,)."""
        height = float(row[0] * site.length)
        return bicubic_joint(site.contact, site.middle(float(row[1])), height, u, self.segments)
