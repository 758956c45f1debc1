"""Numbers of the room that several modules share, or that only keep rounding away; each with its reason."""

from __future__ import annotations

TINY = 1e-300
"""Keeps zero out of denominators; no quantity here is as small."""
NEAR = 1e-6
"""Share of a part's size below which places are the same: a micrometre of a metre."""
ROUNDING = 1e-9
"""Share of a size, an area or a use that is rounding alone."""
EXACT = 1e-12
"""Share of a length along an outline that rounding moves a place."""
NO_AREA = 1e-7
"""Cuts below this share of a part's size squared are where a plane touches a corner."""
NEEDLE = 1e-8
"""Cuts thinner than this (det I / tr² I) bend about one axis only; a beam says nothing about them."""
STEP_ASIDE = 1e-4
"""Share of an outline's length by which cuts start beside its corners."""
