"""What a designer may say about joints: bounds on their shape and how much robustness to ask for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FURTHER = ("outline", "rib", "free", "several", "heights")
"""Families of solid joints that are tried where plain bumps and frusta do not hold; the last one only where named: its
many numbers make searches slow."""
FLAT_KINDS, SOLID_KINDS = ("n", "z"), ("n", "frustum", *FURTHER)
"""Families by the dimension of the parts."""


@dataclass(frozen=True, kw_only=True)
class JointOptions:
    """Bounds and robustness of cone joints. Lengths in metres, angles in radians.

    Attributes:
        kinds: families the designer may use. Flat parts know n- and z-type joints, solid ones n-type joints, frusta and
            the `families` of `mocca_robot.joints.families.known`; n-type ones are always allowed. Families with sharp
            edges are left out where there is a smallest radius.
        alike: whether all curved joints have one shape, in proportion to their contacts.
        control_heights: along each side of joints of the family 'heights'.
        profile: rows of control heights, as shares of the largest one, that take the place of plain bumps; empty: none.
        max_slope_rad: steepest angle between a joint's normal and the contact's; 70° keeps points blunt.
        min_radius: smallest radius of curvature; set it to the cutting tool's radius. 0 = no bound.
        margin: distance a joint keeps to the part's boundary and to other joints, as a share of its contact's
            length (2D) or of the rectangle's shorter side (3D).
        min_distance: the same as an absolute lower bound.
        min_contact: contacts with a smaller length (2D) or square root of area (3D) stay planar.
        max_height: largest bump height as a share of the contact's length (2D) or shorter side (3D); frusta, see
            `tallest_frustum`.
        piecewise_planar: flat flanks instead of curved ones, for saws and wires; `min_radius` does not apply.
        tilt_margin_rad: extra tilt, in every azimuth, that the design aims to survive in each required state; infinite:
            the largest that is found.
        inset: share by which contacts are narrowed and joints flattened while designing, so that the built
            structure holds its loads with forces strictly inside its joints.
        alpha_margin_rad: insertion cone asked for beyond α while designing.
        friction: Coulomb coefficient that a design may count on, divided by `friction_safety`; 0 = none.
        friction_safety: factor on `friction`, at least 1.
    """

    kinds: tuple[str, ...] = ("n", "z", "frustum", *FURTHER[:-1])
    alike: bool = False
    control_heights: int = 4
    profile: tuple[tuple[float, ...], ...] = ()
    max_slope_rad: float = float(np.deg2rad(70.0))
    min_radius: float = 0.0
    margin: float = 0.06
    min_distance: float = 0.0
    min_contact: float = 0.0
    max_height: float = 0.6
    piecewise_planar: bool = False
    tilt_margin_rad: float = float(np.deg2rad(1.0))
    inset: float = 0.02
    alpha_margin_rad: float = float(np.deg2rad(0.5))
    friction: float = 0.0
    friction_safety: float = 1.5

    @property
    def frusta(self) -> bool:
        """Return whether solid joints may be frusta."""
        return "frustum" in self.kinds and self.min_radius <= 0.0

    @property
    def plain(self) -> str:
        """Return the family of solid joints that is tried first: bumps, or the user's own profile."""
        return "drawn" if self.profile else "n"

    @property
    def tallest_frustum(self) -> float:
        """Return the largest height of a frustum as a share of its shorter side.

        A curved bump is half as steep again in the middle of its flanks as they are on average. A frustum as steep
        as it, on flanks as wide, is half as high again.
        """
        return 1.5 * self.max_height

    @property
    def counted_friction(self) -> float:
        """Return the coefficient that designing counts on."""
        return self.friction / self.friction_safety
