"""What every family of solid joints offers: rows of numbers → tessellated height fields, for all joints at once.

The first number of a row is a height, as a share of the shorter side of the rectangle on the contact; the second says
how much of the rectangle's sides is covered. Families with more heights have them from the third number on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from mocca_robot.arrays import Array, IntArray
from mocca_robot.joints.families.sites import JointSite, JointSites
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions


@dataclass(frozen=True, eq=False, kw_only=True)
class Patch:
    """The tessellation that all joints of a family share: K vertices, T triangles.

    Attributes:
        triangles: (T, 3), counter-clockwise from above.
        rim: (R,) boundary vertices, counter-clockwise.
        telling: (A,) triangles that stand for the whole patch while designing: a subset of the normals spans a smaller
            cone, so what holds with them holds with all (Theorem 3.2).
        at: (A, 3) vertices whose mean is the point of each telling triangle at which it is asked.
    """

    triangles: IntArray
    rim: IntArray
    telling: IntArray
    at: IntArray

    @property
    def asked_at_middles(self) -> bool:
        """Return whether every telling triangle is asked in its middle."""
        return self.at is self.triangles or bool((self.at == self.triangles[self.telling]).all())


class Family(Protocol):
    """One family. A row of `numbers` numbers makes a joint; columns `heights` are heights, all zero = planar."""

    @property
    def name(self) -> str:
        """Return the name, unique among families."""

    @property
    def heights(self) -> tuple[int, ...]:
        """Return the columns of a row that are heights."""

    @property
    def sharp(self) -> bool:
        """Return whether the surface has edges, which no round tool can cut."""

    @property
    def flank(self) -> float:
        """Return the narrowest flank, as a share of the rectangle's sides; wider ones have at least as much room."""

    @property
    def follows_outline(self) -> bool:
        """Return whether the surface reaches beyond the rectangle, to the contact's outline."""

    @property
    def sizes(self) -> tuple[float, float]:
        """Return the bounds of the second number."""

    @property
    def patch(self) -> Patch:
        """Return the tessellation."""

    def tallest(self, options: JointOptions) -> float:
        """Return the largest height as a share of the shorter side."""

    def positions(self, sites: JointSites, rows: Array) -> Array:
        """Return (E, K, 2) where the vertices stand, in shares of the rectangles, for rows (E, S)."""

    def rise(self, rows: Array) -> tuple[Array, Array]:
        """Return shares, (K,) or (E, K), and scales (E,): heights are share · scale, in shorter sides, along u."""

    def radius(self, rows: Array) -> Array:
        """Return (E,) the smallest radius of curvature in shorter sides; of sharp families it is not asked."""

    def catalogue(self, options: JointOptions) -> list[Array]:
        """Return realisable rows, shallow to steep, to choose from."""

    def joint(self, site: JointSite, row: Array, u: Array) -> Joint:
        """Return the joint of one row along u (3,)."""
