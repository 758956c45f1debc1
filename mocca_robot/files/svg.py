"""SVG drawings → flat parts: one closed path each, named by its id, y up, metres."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from mocca_robot.assembly import DEFAULT_THICKNESS, Array, Polygon, signed_area
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.curves import conformed, elevated, flattened
from mocca_robot.files.documents import read_text
from mocca_robot.files.rings import checked_polygon
from mocca_robot.files.svg_tree import Outline, outlines, parse_length, parse_xml

MAX_SVG_BYTES = 16 * 1024 * 1024
LARGEST = 1e12
"""Of a coordinate, in drawing units."""
MAX_CURVES = 100_000
MAX_PATH_DATA = 2_000_000
CLOSED = 1e-6
"""Paths whose ends are closer than this share of the drawing are closed: editors round to about six digits."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """What an SVG holds.

    Attributes:
        parts: (name, polygon) in document order.
        unit: unit of the numbers in the drawing ('mm', …; 'drawing unit' when its viewBox scales freely).
        unit_m: metres per drawing unit.
        notes: what was left out.
    """

    parts: tuple[tuple[str, Polygon], ...]
    unit: str
    unit_m: float
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Subpath:
    """A chain of cubic curves (n, 4, 2) in drawing coordinates, and whether the path says that it is closed."""

    curves: Array
    closed: bool


def read_svg(path: Path, units: str | None = None, scale: float = 1.0, thickness: float = DEFAULT_THICKNESS) -> Drawing:
    """Return the parts of an SVG drawing: every visible path, polygon, rect, circle or ellipse is one.

    A path inside another one of the same element is a hole. Curves are flattened so that parts that share one
    get the same points. `units` is the unit of the drawing's numbers; without it the drawing's own width and
    height (`width="200mm"`) decide.

    Raises InputError for open or crossing paths, several pieces in one path, unknown or contradictory units.
    """
    where = f"'{path}'"
    root = parse_xml(read_text(path, MAX_SVG_BYTES), where)
    unit, unit_m = _drawing_unit(root, units, where)
    shapes, notes = outlines(root, where)
    _require_names(shapes, where)
    factor = unit_m * scale
    if (written := sum(len(s.path) for s in shapes)) > MAX_PATH_DATA:
        raise InputError(
            f"{where} has {written:,} characters of path data; at most {MAX_PATH_DATA:,} are read. Simplify its paths."
        )
    subpaths = [_subpaths(shape) for shape in shapes]
    polylines = _flattened(subpaths)
    parts = []
    for shape, mine, lines in zip(shapes, subpaths, polylines):
        parts.append((shape.name, _part(shape.name, mine, lines, factor, unit, thickness)))
    if not parts:
        raise InputError(f"{where} holds no visible closed path; draw one closed path per part.")
    return Drawing(tuple(parts), unit, factor, notes)


def _require_names(shapes: list[Outline], where: str) -> None:
    seen: set[str] = set()
    for shape in shapes:
        fields.part_name(shape.name, f"{where}: an id")
        if shape.name in seen:
            raise InputError(f"{where}: two paths have the id '{shape.name}'; give every part its own id.")
        seen.add(shape.name)


def _drawing_unit(root: ET.Element, declared: str | None, where: str) -> tuple[str, float]:
    """Return the name and metres of one drawing unit, from `declared` or the drawing's physical size."""
    physical = _physical_unit_m(root, where)
    if declared is not None:
        unit_m = fields.UNITS_M[declared]
        if physical is not None and abs(physical / unit_m - 1.0) > 1e-3:
            raise InputError(
                f"{where} says that one of its units is {physical * 1e3:.6g} mm (width and viewBox), but units: "
                f"{declared} says {unit_m * 1e3:.6g} mm; remove one of the two, or use 'scale'."
            )
        return declared, unit_m
    if physical is None:
        raise InputError(
            f"{where} has no physical size (its width is {fields.shown(root.get('width', 'missing'))}); say what its "
            "numbers are with 'units: mm' in a configuration (or units: px), or save it with width and height in mm."
        )
    known = [u for u, m in fields.UNITS_M.items() if abs(physical / m - 1.0) < 1e-4]
    return (known[0] if known else "drawing units"), physical


def _physical_unit_m(root: ET.Element, where: str) -> float | None:
    """Return metres per drawing unit when width or height carry a unit; None when neither does."""
    sizes = {}
    for key in ("width", "height"):
        text = root.get(key, "").strip()
        if re.search(r"[a-z]$", text) and not text.endswith("%") and text != "auto":
            sizes[key] = parse_length(text, f"{where}: its {key}") * fields.UNITS_M["px"]
    if not sizes:
        return None
    box = root.get("viewBox")
    if not box:
        return fields.UNITS_M["px"]
    try:
        values = [float(v) for v in re.split(r"[\s,]+", box.strip())]
    except ValueError:
        values = []
    if len(values) != 4 or not all(0 < v < 1e12 for v in values[2:]):
        raise InputError(f"{where}: its viewBox is {fields.shown(box)}; it needs four numbers with a positive size.")
    units = [sizes[k] / v for k, v in (("width", values[2]), ("height", values[3])) if k in sizes]
    if min(units) <= 0:
        raise InputError(f"{where}: its width or height is zero; give it a positive physical size.")
    if max(units) / min(units) > 1.001 and root.get("preserveAspectRatio", "").startswith("none"):
        raise InputError(
            f"{where} mixes units: {units[0] * 1e3:.6g} mm per unit across, {units[-1] * 1e3:.6g} mm upwards; "
            "give width and height the same proportions as the viewBox."
        )
    return min(units)


def _subpaths(outline: Outline) -> list[_Subpath]:
    """Return the chains of one outline, transformed into drawing coordinates."""
    from svgelements import Arc, Close, Move
    from svgelements import Path as SvgPath

    d = outline.path
    if not re.fullmatch(r"[MmZzLlHhVvCcSsQqTtAaeE0-9+\-.,\s]*", d) or not d.startswith(("M", "m")):
        raise InputError(f"Part '{outline.name}': its path data {fields.shown(d)} is no SVG path; save it again.")
    try:
        segments = list(SvgPath(d))
    except (ValueError, IndexError, TypeError, AttributeError, ZeroDivisionError, OverflowError):
        raise InputError(
            f"Part '{outline.name}': its path data ends too early or is no SVG path; save it again."
        ) from None
    found: list[_Subpath] = []
    chain: list[Array] = []
    _require_usable(segments, outline.name)
    for segment in segments:
        if isinstance(segment, Move):
            _finish(found, chain, False)
            chain = []
        elif isinstance(segment, Close):
            chain.append(elevated([_xy(segment.start), _xy(segment.end)]))
            _finish(found, chain, True)
            chain = []
        elif isinstance(segment, Arc):
            chain.extend(_arc_curves(segment))
        else:
            chain.append(elevated([_xy(p) for p in segment]))
    _finish(found, chain, False)
    linear, shift = outline.matrix[:, :2], outline.matrix[:, 2]
    placed = [_Subpath(s.curves @ linear.T + shift, s.closed) for s in found]
    if not all((np.abs(s.curves) < LARGEST).all() for s in placed):
        raise InputError(f"Part '{outline.name}': a coordinate is beyond {LARGEST:g}; check its transforms.")
    return placed


def _require_usable(segments: list[Any], name: str) -> None:
    """Raise InputError when a coordinate is missing, not finite, or beyond what doubles can compute with."""
    for segment in segments:
        points = [p for p in segment if p is not None]
        numbers = [v for p in points for v in _xy(p)] + [float(getattr(segment, "sweep", 0.0) or 0.0)]
        if not all(abs(v) < LARGEST for v in numbers):
            raise InputError(f"Part '{name}': a coordinate is not finite (or beyond {LARGEST:g}); redraw it.")
        if segment.end is None:
            raise InputError(f"Part '{name}': its path closes before it begins; save it again.")


def _finish(found: list[_Subpath], chain: list[Array], closed: bool) -> None:
    curves = np.array(chain)
    if len(chain) and np.ptp(curves.reshape(-1, 2), axis=0).max() > 0:
        found.append(_Subpath(curves, closed))


def _arc_curves(arc: Any) -> list[Array]:
    """Return cubics of at most 30° each: 4e-7 of the radius off, and the same ones for the reversed arc."""
    pieces = max(1, int(np.ceil(abs(arc.sweep) / (np.pi / 6) - 1e-6)))
    curves = [np.array([_xy(p) for p in c]) for c in arc.as_cubic_curves(pieces)]
    if not curves:
        return [elevated([_xy(arc.start), _xy(arc.end)])]
    curves[0][0], curves[-1][3] = _xy(arc.start), _xy(arc.end)
    return curves


def _xy(point: Any) -> tuple[float, float]:
    return float(point.x), float(point.y)


def _flattened(subpaths: list[list[_Subpath]]) -> list[list[Array]]:
    """Return for each outline one polyline (n, 2) per subpath; curves of all outlines are matched together."""
    every = [s.curves for mine in subpaths for s in mine]
    if not every:
        return [[] for _ in subpaths]
    curves = np.concatenate(every)
    if len(curves) > MAX_CURVES:
        raise InputError(f"The drawing has {len(curves)} lines and curves; at most {MAX_CURVES} are read. Simplify it.")
    size = float(np.linalg.norm(np.ptp(curves[:, [0, 3]].reshape(-1, 2), axis=0)))
    pieces = iter(conformed(curves, flattened(curves, size), size))
    return [
        [np.concatenate([next(pieces)[:-1] for _ in s.curves] + [s.curves[-1, 3:]]) for s in mine] for mine in subpaths
    ]


def _part(
    name: str, subpaths: list[_Subpath], lines: list[Array], factor: float, unit: str, thickness: float
) -> Polygon:
    def spoken(point: Array) -> str:
        return f"({point[0] / factor:.6g}, {-point[1] / factor:.6g}) {unit}"

    if not lines:
        raise InputError(f"Part '{name}': its path has no extent; draw a closed outline or delete it.")
    size = float(np.linalg.norm(np.ptp(np.concatenate(lines), axis=0)))
    rings = []
    for subpath, line in zip(subpaths, lines):
        gap = float(np.linalg.norm(line[-1] - line[0]))
        up = line * np.array([factor, -factor])
        if not subpath.closed and gap > CLOSED * size:
            raise InputError(
                f"Part '{name}': its path is open, from {spoken(up[0])} to {spoken(up[-1])} ({gap:.4g} {unit} apart); "
                "close it in the editor."
            )
        keep = np.linalg.norm(np.diff(line, axis=0), axis=1) > 1e-9 * size
        ring = up[:-1][keep]
        rings.append(ring)
    rings.sort(key=lambda r: -abs(signed_area(r)) if len(r) else 0.0)
    _require_one_piece(name, rings, spoken)
    return checked_polygon(name, rings, thickness, spoken)


def _require_one_piece(name: str, rings: list[Array], spoken: Callable[[Array], str]) -> None:
    sound = [shapely.Polygon(r) for r in rings if len(r) >= 3]
    for ring, shape in zip(rings[1:], sound[1:]):
        if sound[0].is_valid and shape.is_valid and sound[0].disjoint(shape):
            raise InputError(
                f"Part '{name}' consists of separate pieces, at {spoken(rings[0][0])} and {spoken(ring[0])}; "
                "break the path apart: one closed path per part."
            )
