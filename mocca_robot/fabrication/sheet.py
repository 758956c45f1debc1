"""Flat parts → outlines to cut, offset for kerf and clearance, laid out on a sheet without overlap; millimetres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.errors import InputError
from mocca_robot.fabrication.options import CutOptions
from mocca_robot.geometry.polygons import to_shapely

MITRE_LIMIT = 4.0
"""Offset corners sharper than 29° are cut off at four times the offset instead of growing long spikes."""

LARGEST_LABEL_MM = 6.0


@dataclass(frozen=True, eq=False)
class CutPart:
    """One part on the sheet.

    Attributes:
        name: the part's name.
        rings: outline and holes, (n, 2) each, y up, mm.
        label_at: (2,) centre of the name, inside the part.
        label_height: of its capitals, mm.
    """

    name: str
    rings: tuple[Array, ...]
    label_at: Array
    label_height: float


@dataclass(frozen=True, eq=False)
class Sheet:
    """Parts on a sheet whose lower left corner is the origin; mm."""

    width: float
    height: float
    parts: tuple[CutPart, ...]


def nested(assembly: Assembly, options: CutOptions) -> Sheet:
    """Return the sheet with every part of a flat assembly, in shelves, the tallest first.

    Each outline moves outwards by (kerf − clearance)/2. Raises InputError for solids, for parts that do not
    survive the offset and for parts wider than the sheet both ways.
    """
    spacing, width = options.spacing * 1e3, options.sheet_width * 1e3
    outlines = {p.name: _outline(p.name, p.shape, options) for p in assembly.parts}
    turned = {name: _fitting(name, outline, width - 2 * spacing) for name, outline in outlines.items()}
    extent = {name: np.array(shapely.bounds(s)).reshape(2, 2) for name, s in turned.items()}
    order = sorted(turned, key=lambda n: -np.ptp(extent[n], axis=0)[1])
    x = y = spacing
    shelf = 0.0
    placed: dict[str, CutPart] = {}
    for name in order:
        size = np.ptp(extent[name], axis=0)
        if x > spacing and x + size[0] > width - spacing:
            x, y, shelf = spacing, y + shelf + spacing, 0.0
        placed[name] = _placed(name, turned[name], np.array([x, y]) - extent[name][0])
        x, shelf = x + size[0] + spacing, max(shelf, float(size[1]))
    return Sheet(width, y + shelf + spacing, tuple(placed[p.name] for p in assembly.parts))


def _outline(name: str, shape: object, options: CutOptions) -> shapely.Polygon:
    if not isinstance(shape, Polygon):
        raise InputError(f"Part '{name}' is solid; cutting drawings are for flat parts. Export meshes instead.")
    exact = shapely.transform(to_shapely(shape), lambda x: x * 1e3)
    offset = (options.kerf - options.clearance) / 2 * 1e3
    if offset == 0.0:
        return exact
    moved = exact.buffer(offset, join_style="mitre", mitre_limit=MITRE_LIMIT)
    whole = moved.geom_type == "Polygon" and not moved.is_empty
    if not whole or len(moved.interiors) != len(exact.interiors):
        raise InputError(
            f"Part '{name}' falls apart, or loses a hole, when its outline moves by {offset:.3g} mm "
            f"(kerf {options.kerf * 1e3:.3g} mm, clearance {options.clearance * 1e3:.3g} mm); use smaller ones."
        )
    return moved


def _fitting(name: str, outline: shapely.Polygon, width: float) -> shapely.Polygon:
    """Return the outline as it is, or turned by 90° when only that fits the width."""
    x0, y0, x1, y1 = outline.bounds
    if x1 - x0 <= width:
        return outline
    if y1 - y0 > width:
        raise InputError(
            f"Part '{name}' is {x1 - x0:.4g} mm by {y1 - y0:.4g} mm, the sheet leaves {width:.4g} mm between its "
            "margins; set cut.sheet_width to that of a wider sheet."
        )
    return shapely.transform(outline, lambda p: p @ np.array([[0.0, 1.0], [-1.0, 0.0]]))


def _placed(name: str, outline: shapely.Polygon, shift: Array) -> CutPart:
    moved = shapely.transform(outline, lambda p: p + shift)
    rings = tuple(np.asarray(r.coords)[:-1] for r in (moved.exterior, *moved.interiors))
    reach = float(np.ptp(rings[0], axis=0).max())
    room = shapely.maximum_inscribed_circle(moved, tolerance=0.01 * reach)
    # A name of n letters is about 0.65 n times as wide as high and has to fit the circle.
    height = min(LARGEST_LABEL_MM, 2 * room.length / float(np.hypot(1.0, 0.65 * len(name))))
    return CutPart(name, rings, np.asarray(room.coords[0]), height)
