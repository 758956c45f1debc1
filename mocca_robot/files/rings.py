"""Corners of a drawing → a sound Polygon, or an error that says where the outline is broken."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np
import shapely
from shapely.validation import explain_validity

from mocca_robot.arrays import Array
from mocca_robot.assembly import Polygon
from mocca_robot.errors import InputError

MAX_CORNERS = 200_000
"""Of one part; a million would still load, but no joint of it could be seen."""

MIN_AREA = 1e-12
"""Smallest area of a part as a share of its squared bounding-box diagonal: below lies rounding noise."""


def checked_polygon(
    name: str,
    rings: Sequence[Array],
    thickness: float,
    spoken: Callable[[Array], str],
) -> Polygon:
    """Return the polygon of part `name` whose first ring (n, 2) is the exterior and the others holes; metres.

    Repeated corners are dropped, all others stay bit for bit. `spoken` turns a point (2,) in metres into the
    coordinates the user wrote. Raises InputError for zero area, self-intersections, and holes that are
    outside, touch along a line or overlap.
    """
    cleaned = [_without_repeats(ring) for ring in rings]
    for kind, ring in zip(["outline", *["hole"] * len(cleaned)], cleaned):
        _require_area(name, kind, ring, spoken)
        outline = shapely.Polygon(ring)
        if not outline.is_valid:
            raise InputError(
                f"Part '{name}': its {kind} crosses or touches itself{_place(outline, spoken)}; "
                "redraw it so that the line never meets itself (in Inkscape: Path, Union, or move the nodes apart; "
                "in Rhino: CurveBoolean; in Illustrator: Pathfinder, Unite)."
            )
    exterior, holes = cleaned[0], cleaned[1:]
    shell = shapely.Polygon(exterior)
    for hole in holes:
        if not shell.contains(shapely.Polygon(hole)):
            raise InputError(
                f"Part '{name}': the hole at {spoken(hole[0])} is not inside the part's outline; "
                "move it inside or remove it."
            )
    whole = shapely.Polygon(exterior, holes)
    if not whole.is_valid:
        raise InputError(
            f"Part '{name}': its holes overlap, or cut it apart,{_place(whole, spoken)}; keep holes apart."
        )
    return Polygon(exterior, tuple(holes), thickness)


def _without_repeats(ring: Array) -> Array:
    """Return the ring without corners that equal their predecessor (also around the end)."""
    if len(ring) < 2:
        return ring
    repeated = (ring == np.roll(ring, 1, axis=0)).all(axis=1)
    return np.asarray(ring[~repeated])


def _require_area(name: str, kind: str, ring: Array, spoken: Callable[[Array], str]) -> None:
    if len(ring) > MAX_CORNERS:
        raise InputError(f"Part '{name}': its {kind} has {len(ring)} corners; at most {MAX_CORNERS} are read.")
    if len(ring) == 0:
        raise InputError(f"Part '{name}': its {kind} has no extent; draw at least three different corners.")
    if len(ring) < 3:
        raise InputError(
            f"Part '{name}': its {kind} at {spoken(ring[0])} has {len(ring)} different corners; it needs at least 3."
        )
    extent = float(np.linalg.norm(ring.max(axis=0) - ring.min(axis=0)))
    # Not the ring's own area: that of a figure of eight is zero, and its crossing is what has to be said.
    if shapely.convex_hull(shapely.MultiPoint(ring)).area <= MIN_AREA * extent**2:
        raise InputError(
            f"Part '{name}': its {kind} at {spoken(ring[0])} encloses no area; give it width or remove it."
        )


def _place(broken: shapely.Polygon, spoken: Callable[[Array], str]) -> str:
    found = re.search(r"\[([^ \]]+) ([^ \]]+)\]", explain_validity(broken))
    if not found:
        return ""
    return f" at {spoken(np.array([float(found[1]), float(found[2])]))}"
