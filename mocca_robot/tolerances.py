"""What geometry and verdicts are judged by, each with its reason; none depends on the model's scale.

Thresholds at which a solver stops stand beside it, those of physics in `sim.settings`.
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
