"""Every tolerance of the project, each with its reason. All are relative: none depends on the model's scale."""

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

    part_overlap: float = 1e-9
    """Largest overlap of two built 2D parts, as a share of the smaller part's area."""

    mesh_overlap: float = 1e-6
    """Largest overlap of two built 3D parts, as a share of the smaller part's volume."""


TOLERANCES = Tolerances()
