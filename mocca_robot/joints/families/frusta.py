"""Frusta as a family: straight flanks all round (see `mocca_robot.joints.frustum`)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.joints.bumps import FLANK_SEGMENTS, BumpPattern, bump_pattern
from mocca_robot.joints.families.bump import Bump
from mocca_robot.joints.families.family import Patch
from mocca_robot.joints.families.sites import JointSite, JointSites
from mocca_robot.joints.frustum import LEAST_FLANK, WIDEST_FLANK, frustum_joint, ramp, with_flanks
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions

FIRST_TOP = 0.35
"""The top of a frustum that a search starts from, as a share of its rectangle's sides."""


@dataclass(frozen=True)
class Frustum:
    """Frusta over the whole rectangle; numbers: height, size of the flat top."""

    segments: int = FLANK_SEGMENTS

    name: ClassVar[str] = "frustum"
    heights: ClassVar[tuple[int, ...]] = (0,)
    sharp: ClassVar[bool] = True
    follows_outline: ClassVar[bool] = False
    flank: ClassVar[float] = LEAST_FLANK
    sizes: ClassVar[tuple[float, float]] = (1.0 - 2.0 * WIDEST_FLANK, 1.0 - 2.0 * LEAST_FLANK)

    @cached_property
    def pattern(self) -> BumpPattern:
        """Return the tessellation of bumps, whose vertices are moved."""
        return bump_pattern(self.segments, "n")

    @cached_property
    def patch(self) -> Patch:
        """Return the tessellation; all corners of all flanks tell of it."""
        flank, corner = _flank_corners(self.pattern)
        most = max(len(Bump(self.segments).patch.telling), len(flank))  # as many rays as beside bumps
        telling, at = np.resize(flank, most), np.repeat(np.resize(corner, most)[:, None], 3, axis=1)
        return Patch(triangles=self.pattern.triangles, rim=self.pattern.rim, telling=telling, at=at)

    def tallest(self, options: JointOptions) -> float:
        """Return the largest height as a share of the shorter side."""
        return options.tallest_frustum

    def positions(self, sites: JointSites, rows: Array) -> Array:
        """Return (E, K, 2) the pattern with flanks as wide as the top leaves room for."""
        return with_flanks(self.pattern.xy, 0.5 - 0.5 * rows[:, 1])

    def rise(self, rows: Array) -> tuple[Array, Array]:
        """Return how far up each vertex is (K,), and the heights (E,)."""
        return ramp(self.pattern.xy), rows[:, 0]

    def radius(self, rows: Array) -> Array:
        """Return (E,) no radius."""
        return np.zeros(len(rows))

    def catalogue(self, options: JointOptions) -> list[Array]:
        """Return frusta of either sign, shallow to steep."""
        allowed = [h for h in (0.15, 0.3, 0.5, 0.75) if h <= self.tallest(options)]
        return [np.array([sign * h, FIRST_TOP]) for h in allowed for sign in (1.0, -1.0)]

    def joint(self, site: JointSite, row: Array, u: Array) -> Joint:
        """Return the joint of one row along u (3,)."""
        height = float(row[0] * site.length)
        return frustum_joint(site.contact, site.rectangle, height, u, 0.5 - 0.5 * float(row[1]))


def _flank_corners(pattern: BumpPattern) -> tuple[IntArray, IntArray]:
    """Return 16 pairs of a triangle on a frustum's flank and a vertex at one of the flank's four corners."""
    middles = pattern.xy[pattern.triangles].mean(axis=1)
    found = []
    for axis in (0, 1):
        for end in (0.0, 1.0):
            away = np.abs(middles[:, axis] - end)
            across = np.abs(middles[:, 1 - axis] - 0.5)
            triangle = int(np.flatnonzero((away < 1 / 3) & (across < 1 / 6))[0])
            for up in (0.0, 1 / 3):
                for side in (up, 1.0 - up):
                    corner = np.empty(2)
                    corner[axis], corner[1 - axis] = abs(end - up), side
                    found.append((triangle, int(np.abs(pattern.xy - corner).sum(axis=1).argmin())))
    return np.array([f[0] for f in found]), np.array([f[1] for f in found])
