"""SVG drawings → flat parts: one closed path each, named by its id, y up, metres."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import DEFAULT_THICKNESS
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.curves import elevated, elliptic_arc
from mocca_robot.files.documents import read_text
from mocca_robot.files.drawing import Drawing, Shape, Subpath, add_chain, is_open, polygons, require_few
from mocca_robot.files.outlines import Group, numbered, shapes_of
from mocca_robot.files.svg_css import is_background
from mocca_robot.files.svg_tree import Outline, outlines, parse_length, parse_xml

SAME_UNIT, KNOWN_UNIT = 1e-3, 1e-4
"""How much a drawing's unit, as its size tells it, may differ from the one it is said to have, and from a known one."""

MAX_SVG_BYTES = 16 * 1024 * 1024
MAX_PATH_DATA = 2_000_000
MAX_ARCS = 10_000


def read_svg(path: Path, units: str | None = None, scale: float = 1.0, thickness: float = DEFAULT_THICKNESS) -> Drawing:
    """Return the parts of an SVG drawing: every visible path, polygon, rect, circle or ellipse is one.

    Open lines of one group are joined end to end; where more than two meet, every area between them is a part. A path
    inside another one of the same element is a hole. Curves are flattened so that parts that share one get the same
    points. `units` is the unit of the drawing's numbers; without it the drawing's own width and height
    (`width="200mm"`) decide.

    Raises InputError for open or crossing paths, several pieces in one path, unknown or contradictory units.
    """
    where = f"'{path}'"
    root = parse_xml(read_text(path, MAX_SVG_BYTES), where)
    unit, unit_m = _drawing_unit(root, units, where)
    shapes, notes = outlines(root, where)
    factor = unit_m * scale
    if (written := sum(len(s.path) for s in shapes)) > MAX_PATH_DATA:
        raise InputError(
            f"{where} has {written:,} characters of path data; at most {MAX_PATH_DATA:,} are read. Simplify its paths."
        )
    _require_few_arcs(shapes, where)
    drawn, curves = [], 0
    for shape in shapes:
        drawn.append((shape, tuple(_subpaths(shape))))
        curves += sum(len(p.curves) for p in drawn[-1][1])
        require_few(curves, where)
    said = list(notes)
    found, renamed = numbered(_joined(_without_background(drawn, root, where, said), where, unit, said))
    said += [f"{where}: {note}" for note in renamed]
    parts = polygons(found, where, factor, unit, thickness, y_up=False, notes=said)
    return Drawing(parts, unit, factor, tuple(said))


def _without_background(
    drawn: list[tuple[Outline, tuple[Subpath, ...]]], root: ET.Element, where: str, notes: list[str]
) -> list[tuple[Outline, tuple[Subpath, ...]]]:
    """Return the shapes without a rectangle that covers the whole page behind others; it is said in `notes`."""
    box = [float(v) for v in re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", root.get("viewBox", ""))]
    if len(box) != 4 or len(drawn) < 3:
        return drawn
    low = np.array(box[:2])
    outline, subpaths = drawn[0]
    corners = np.concatenate([p.curves[:, 0] for p in subpaths]) if subpaths else np.zeros((0, 2))
    if len(subpaths) != 1 or not is_background(corners, low, low + box[2:]):
        return drawn
    notes.append(f"{where}: '{outline.name}', a rectangle over the whole page, left out (a background is no part)")
    return drawn[1:]


def _joined(drawn: list[tuple[Outline, tuple[Subpath, ...]]], where: str, unit: str, notes: list[str]) -> list[Shape]:
    """Return the shapes, with open lines of one group joined; what was assumed is added to `notes`."""
    loose: dict[int, list[Array]] = {}
    for outline, subpaths in drawn:
        if subpaths and all(is_open(p) for p in subpaths):
            loose.setdefault(outline.group[1], []).extend(p.curves for p in subpaths)
    found: list[Shape] = []
    for outline, subpaths in drawn:
        name, key = outline.group
        if subpaths and all(is_open(p) for p in subpaths) and len(loose.get(key, ())) != 1:
            group = Group(name or "part", loose=loose.pop(key, []))
            found += shapes_of(group, (), where, unit)
            notes += [f"{where}: {note}" for note in group.notes]
        else:
            found.append(Shape(outline.name, subpaths))
    return found


def _require_few_arcs(shapes: list[Outline], where: str) -> None:
    """Raise InputError before parsing what takes minutes; where flags are written without spaces, a few more pass."""
    runs = (run for s in shapes for run in re.findall(r"[Aa]([^MmZzLlHhVvCcSsQqTtAa]*)", s.path))
    arcs = sum(len(re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", run)) // 7 for run in runs)
    if arcs > MAX_ARCS:
        raise InputError(
            f"{where} has {arcs:,} arcs; at most {MAX_ARCS:,} are read. Simplify its paths, or split the drawing."
        )


def _drawing_unit(root: ET.Element, declared: str | None, where: str) -> tuple[str, float]:
    """Return the name and metres of one drawing unit, from `declared` or the drawing's physical size."""
    physical = _physical_unit_m(root, where)
    if declared is not None:
        unit_m = fields.UNITS_M[declared]
        if physical is not None and abs(physical / unit_m - 1.0) > SAME_UNIT:
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
    known = [u for u, m in fields.UNITS_M.items() if abs(physical / m - 1.0) < KNOWN_UNIT]
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


def _subpaths(outline: Outline) -> list[Subpath]:
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
    found: list[Subpath] = []
    chain: list[Array] = []
    _require_usable(segments, outline.name)
    for segment in segments:
        if isinstance(segment, Move):
            add_chain(found, chain, False)
            chain = []
        elif isinstance(segment, Close):
            chain.append(elevated([_xy(segment.start), _xy(segment.end)]))
            add_chain(found, chain, True)
            chain = []
        elif isinstance(segment, Arc):
            chain.extend(_arc_curves(segment))
        else:
            chain.append(elevated([_xy(p) for p in segment]))
    add_chain(found, chain, False)
    linear, shift = outline.matrix[:, :2], outline.matrix[:, 2]
    placed = [Subpath(s.curves @ linear.T + shift, s.closed) for s in found]
    if not all((np.abs(s.curves) < fields.LARGEST).all() for s in placed):
        raise InputError(f"Part '{outline.name}': a coordinate is beyond {fields.LARGEST:g}; check its transforms.")
    return placed


def _require_usable(segments: list[Any], name: str) -> None:
    """Raise InputError when a coordinate is missing, not finite, or beyond what doubles can compute with."""
    for segment in segments:
        points = [p for p in segment if p is not None]
        numbers = [v for p in points for v in _xy(p)] + [float(getattr(segment, "sweep", 0.0) or 0.0)]
        if not all(abs(v) < fields.LARGEST for v in numbers):
            raise InputError(f"Part '{name}': a coordinate is not finite (or beyond {fields.LARGEST:g}); redraw it.")
        if segment.end is None:
            raise InputError(f"Part '{name}': its path closes before it begins; save it again.")


def _arc_curves(arc: Any) -> list[Array]:
    """Return the cubics of one arc; a straight line where its ellipse has no width."""
    start, end, center = (np.array(_xy(p)) for p in (arc.start, arc.end, arc.center))
    u = np.array(_xy(arc.prx)) - center
    rx, ry = float(np.linalg.norm(u)), float(arc.ry)
    if rx == 0.0 or ry == 0.0 or arc.sweep == 0.0:
        return [elevated([_xy(arc.start), _xy(arc.end)])]
    v = np.array([-u[1], u[0]]) * (ry / rx)
    from_center = start - center
    curves = elliptic_arc(center, u, v, float(np.arctan2(from_center @ v / ry**2, from_center @ u / rx**2)), arc.sweep)
    curves[0, 0], curves[-1, 3] = start, end
    return list(curves)


def _xy(point: Any) -> tuple[float, float]:
    return float(point.x), float(point.y)
