"""What geometry and verdicts are judged by, and small numbers that many modules need, each with its reason.

None depends on the model's scale. What one module alone needs stands at its top, with a name and a reason; the settings
of physics are in `sim.settings`. A test finds small numbers that have no name.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """Relative tolerances; lengths are multiples of the assembly's size (its bounding-box diagonal)."""

    contact_gap: float = 1e-5
    """Faces closer than this touch. Vector editors write about six digits; a 1 m model then holds 10 µm."""

    contact_angle_rad: float = 1e-3
    """Faces that differ by less are parallel: over a face of a tenth of the model this is 1e-4 of its size."""

    near_miss: float = 5e-3
    """Parallel faces with a gap between `contact_gap` and this are reported: they were probably meant to touch."""

    overlap_depth: float = 2e-5
    """Parts that penetrate deeper than this overlap. Twice the contact gap, so that touching never overlaps."""

    min_contact: float = 1e-4
    """Shared stretches shorter than this are corners that meet, not contacts."""

    equilibrium_residual: float = 1e-6
    """|s|/|w| below which Eq. 8 counts as solved: double precision leaves about 1e-9 after the solvers."""

    kkt: float = 1e-7
    """Relative KKT residual above which a solution is 'inaccurate' and gives no verdict."""


TOLERANCES = Tolerances()

PART_OVERLAP = {2: 1e-9, 3: 1e-6}
"""By dimension: largest overlap of two built parts, as a share of the smaller one: rounding, not penetration."""

NEARLY_PARALLEL_RAD = 0.05
"""Faces that differ by less and nearly touch were probably meant to: nobody draws a gap of 3° on purpose."""

ANGLE_ROUNDING_RAD = 1e-9
"""How much an angle may fall short of what is asked by rounding alone."""

CASE_HELD = 1e-12
"""E/|w|² of a required case that holds: the square of `equilibrium_residual`."""
CASE_SOLVED = 1e-13
"""E/|w|² at which a search for joints may stop: |s|/|w| below half of the verdict's tolerance."""
MARGIN_SOLVED = 1e-9
"""E/|w|² of a margin case that counts as zero: a margin is a wish, and costs steps."""
VIOLATED = 1e-6
"""Hinge of a constraint on joints, dimensionless, that counts as none."""

TINY = 1e-300
"""The least denominator, where one may be zero: far below anything that is measured."""
EXACT = 1e-12
"""Relative difference of two numbers that are the same: what one or two operations in double precision leave."""
ROUNDING = 1e-9
"""The same along a chain of operations."""
COARSE = 1e-6
"""The same where a file of six digits, a mesh or a solver with a tolerance of its own lies in between."""
ON_GROUND = 1e-3
"""Height, relative to the assembly's, up to which a part's lowest point counts as on the ground."""
VISIBLE = 1e-3
"""Share of the largest force from which on an arrow is drawn."""
SAME_KG = 1e-3
"""How much a payload may read back from what was sent: controllers round it."""
LEAST_WAIT_S = 1e-3
"""A socket's time limit of zero would mean never to wait."""
MM = 1e-3
"""A millimetre, in metres."""
PLANE = 1e-4
"""Height, relative to the contact's length, below which a bump counts as plane: nobody can make it."""
