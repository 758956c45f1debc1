"""Curves of a drawing, from whatever file they come → flat parts: shared curves matched, y up, metres."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Polygon, signed_area
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.curves import conformed, copies_of, flattened
from mocca_robot.files.rings import checked_polygon
from mocca_robot.tolerances import ROUNDING

MAX_CURVES = 100_000
"""Lines and curves of a drawing."""
MAX_COPIES = 500
"""Lines or curves on top of each other: every part that shares an edge draws it once."""
CLOSED = 1e-6
"""Paths whose ends are closer than this share of the drawing are closed: editors round to about six digits."""


GAP = 1e-4
"""Ends of an outline that are closer than this share of its size are joined, and it is said."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """What a drawing holds.

    Attributes:
        parts: (name, polygon) in document order.
        unit: unit of the numbers in the drawing ('mm', …; 'drawing unit' when an SVG's viewBox scales freely).
        unit_m: metres per drawing unit.
        notes: what was left out.
    """

    parts: tuple[tuple[str, Polygon], ...]
    unit: str
    unit_m: float
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Subpath:
    """A chain of cubic curves (n, 4, 2) in drawing coordinates, y down, and whether it is said to be closed."""

    curves: Array
    closed: bool


def is_open(subpath: Subpath) -> bool:
    """Return whether a chain of curves has ends that lie apart."""
    size = float(np.linalg.norm(np.ptp(subpath.curves.reshape(-1, 2), axis=0)))
    gap = float(np.linalg.norm(subpath.curves[-1, 3] - subpath.curves[0, 0]))
    return not subpath.closed and gap > GAP * size


@dataclass(frozen=True, eq=False)
class Shape:
    """One part as it is drawn: its outline and its holes, in any order."""

    name: str
    subpaths: tuple[Subpath, ...]


def add_chain(found: list[Subpath], chain: Sequence[Array], closed: bool) -> None:
    """Append a chain of cubics (4, 2) to `found`, without those that have no extent."""
    curves = np.array(chain)
    if len(chain):
        curves = curves[np.ptp(curves, axis=1).max(axis=1) > 0]
    if len(curves):
        found.append(Subpath(curves, closed))


def require_few(curves: int, where: str) -> None:
    """Raise InputError when a drawing has more lines and curves than are read."""
    if curves > MAX_CURVES:
        raise InputError(
            f"{where} has more than {MAX_CURVES:,} lines and curves, which is the limit. Simplify its paths, or draw "
            "arcs and curves instead of short lines."
        )


def polygons(
    shapes: Sequence[Shape],
    where: str,
    factor: float,
    unit: str,
    thickness: float,
    *,
    y_up: bool,
    notes: list[str] | None = None,
) -> tuple[tuple[str, Polygon], ...]:
    """Return name and polygon of every shape: `factor` metres per unit, which messages call `unit`.

    Curves are flattened so that parts that share one get the same points; gaps that were closed are added to `notes`.
    Raises InputError for names used twice,
    open or crossing outlines, several pieces in one shape, and a drawing without shapes.
    """
    if not shapes:
        raise InputError(f"{where} holds no visible closed path; draw one closed path per part.")
    _require_names(shapes, where)
    require_few(sum(len(p.curves) for s in shapes for p in s.subpaths), where)
    sign = 1.0 if y_up else -1.0
    return tuple(
        (shape.name, _part(shape, lines, factor, sign, unit, thickness, [] if notes is None else notes))
        for shape, lines in zip(shapes, _flattened(shapes, where))
    )


def _require_names(shapes: Sequence[Shape], where: str) -> None:
    seen: set[str] = set()
    for shape in shapes:
        fields.part_name(shape.name, f"{where}: the name of a part")
        if shape.name in seen:
            raise InputError(f"{where}: two parts have the name '{shape.name}'; give every part its own.")
        seen.add(shape.name)


def _flattened(shapes: Sequence[Shape], where: str) -> list[list[Array]]:
    """Return for each shape one polyline (n, 2) per subpath; curves of all shapes are matched together."""
    every = [p.curves for s in shapes for p in s.subpaths]
    if not every:
        return [[] for _ in shapes]
    curves = np.concatenate(every)
    if not (np.abs(curves) < fields.LARGEST).all():
        raise InputError(f"{where}: a coordinate is beyond {fields.LARGEST:g}; check its transforms.")
    size = float(np.linalg.norm(np.ptp(curves[:, [0, 3]].reshape(-1, 2), axis=0)))
    _require_few_copies(curves, size, where)
    pieces = iter(conformed(curves, flattened(curves, size), size))
    return [
        [np.concatenate([next(pieces)[:-1] for _ in p.curves] + [p.curves[-1, 3:]]) for p in s.subpaths] for s in shapes
    ]


def _require_few_copies(curves: Array, size: float, where: str) -> None:
    """Raise InputError when many curves lie on top of each other: matching them takes the square of their number."""
    copies = copies_of(curves, size)
    if copies.max() > MAX_COPIES:
        x, y = curves[int(copies.argmax()), 0]
        raise InputError(
            f"{where} has {copies.max():,} lines or curves on top of each other, at ({x:.6g}, {y:.6g}); at most "
            f"{MAX_COPIES} are read. Remove the copies (or detail finer than 1/100,000 of the drawing)."
        )


def _part(
    shape: Shape, lines: list[Array], factor: float, sign: float, unit: str, thickness: float, notes: list[str]
) -> Polygon:
    def spoken(point: Array) -> str:
        return f"({point[0] / factor:.6g}, {sign * point[1] / factor:.6g}) {unit}"

    name = shape.name
    if not lines:
        raise InputError(f"Part '{name}': its path has no extent; draw a closed outline or delete it.")
    size = float(np.linalg.norm(np.ptp(np.concatenate(lines), axis=0)))
    rings = []
    for subpath, line in zip(shape.subpaths, lines):
        gap = float(np.linalg.norm(line[-1] - line[0]))
        up = line * np.array([factor, sign * factor])
        if not subpath.closed and CLOSED * size < gap <= GAP * size:
            notes.append(f"Part '{name}': a gap of {gap:.4g} {unit} at {spoken(up[0])} closed")
        elif not subpath.closed and gap > CLOSED * size:
            raise InputError(
                f"Part '{name}': its path is open, from {spoken(up[0])} to {spoken(up[-1])} ({gap:.4g} {unit} apart); "
                "close it (in Inkscape: select both end nodes, then Join; in Rhino: CloseCrv; in Illustrator: "
                "Object, Path, Join)."
            )
        keep = np.linalg.norm(np.diff(line, axis=0), axis=1) > ROUNDING * size
        rings.append(up[:-1][keep])
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
