"""DXF drawings → flat parts: closed outlines, named by block, text or layer, y up, metres."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import DEFAULT_THICKNESS
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.curves import elevated
from mocca_robot.files.documents import existing_path
from mocca_robot.files.drawing import CLOSED, Drawing, add_chain, polygons, require_few
from mocca_robot.files.outlines import Group, numbered, shapes_of

MAX_DXF_BYTES = 32 * 1024 * 1024
MAX_ENTITIES = 50_000
MAX_DEPTH = 10
"""Blocks inside blocks."""
OUTLINES = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "LWPOLYLINE", "POLYLINE", "SPLINE")
ARC_PIECES = 12
"""Cubics of an arc, 30° each at most."""
INSUNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 13: "um"}
"""The drawing's $INSUNITS → its unit; 0 says nothing."""
BROKEN = (ArithmeticError, AttributeError, LookupError, MemoryError, RecursionError, TypeError, ValueError)
"""What reading a damaged drawing can raise."""
FLAT = 1e-4
"""Share of the drawing's size up to which heights count as flat."""


def read_dxf(path: Path, units: str | None = None, scale: float = 1.0, thickness: float = DEFAULT_THICKNESS) -> Drawing:
    """Return the parts of a DXF drawing (text or binary): closed polylines, circles, ellipses and splines, and lines
    and arcs that meet end to end.

    Every block reference is one part, named by its block. Elsewhere every outline is one, and outlines inside it are
    its holes; it is named by a text inside it, or by its layer, numbered where a layer holds several. `units` is the
    unit of the drawing's numbers; without it the drawing's own $INSUNITS decides.

    Raises InputError for open, branching or crossing outlines, unknown or contradictory units, and what is not flat.
    """
    import ezdxf

    where = f"'{path}'"
    document = _document(path, where)
    unit = _unit(document, units, where)
    walker = _BlockWalker(document, where)
    try:
        walker.walk(document.modelspace(), None, 0)
    except (ezdxf.DXFError, *BROKEN) as error:
        raise _damaged(error, where) from None
    groups = [g for g in walker.groups.values() if g.closed or g.loose]
    shapes, _ = numbered([s for g in groups for s in shapes_of(g, walker.texts, where, unit)])
    notes = [f"{where}: {n} {kind} left out (only outlines become parts)" for kind, n in walker.left_out.items()]
    notes += [f"{where}: {note}" for g in groups for note in g.notes]
    factor = fields.UNITS_M[unit] * scale
    parts = polygons(shapes, where, factor, unit, thickness, y_up=True, notes=notes)
    return Drawing(parts, unit, factor, tuple(notes))


def _document(path: Path, where: str) -> Any:
    import ezdxf
    from ezdxf import recover

    logging.getLogger("ezdxf").addHandler(logging.NullHandler())  # its repairs are not for the terminal
    existing_path(path)
    if not path.is_file():
        raise InputError(f"{where} is not a regular file; export the drawing as DXF again.")
    if (size := path.stat().st_size) > MAX_DXF_BYTES:
        raise InputError(
            f"{where} has {size / 1e6:.4g} MB; at most {MAX_DXF_BYTES / 1e6:.4g} MB are read. Simplify it."
        )
    try:
        document, _ = recover.readfile(path)
    except OSError as error:
        raise InputError(f"{where} cannot be read as DXF: {error}. Export it again (DWG is another format).") from None
    except (
        ezdxf.DXFError,
        ArithmeticError,
        AttributeError,
        LookupError,
        RecursionError,
        TypeError,
        ValueError,
    ) as error:
        raise _damaged(error, where) from None
    return document


def _damaged(error: Exception, where: str) -> InputError:
    said = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
    return InputError(f"{where} is damaged or no DXF: {said}. Export it again, as R2000 or later.")


def _unit(document: Any, declared: str | None, where: str) -> str:
    written = document.header.get("$INSUNITS", 0)
    known = INSUNITS.get(written)
    if declared is not None:
        if known is not None and known != declared:
            raise InputError(
                f"{where} says that its unit is {known} ($INSUNITS), but units: {declared}; remove one of the two, or "
                "use 'scale'."
            )
        return declared
    if known is None:
        said = "no unit" if written in (0, None) else f"the unit number {fields.shown(written)}"
        raise InputError(
            f"{where} has {said} ($INSUNITS); say what its numbers are with 'units: mm' in a configuration, or set the "
            "drawing's insertion units and export it again."
        )
    return known


class _BlockWalker:
    """Sorts what a drawing shows into groups; blocks inside blocks are followed to a bounded depth and number."""

    def __init__(self, document: Any, where: str) -> None:
        self.document = document
        self.where = where
        self.groups: dict[object, Group] = {}
        self.texts: list[tuple[str, tuple[float, float]]] = []
        self.left_out: Counter[str] = Counter()
        self.seen = 0
        self.curves = 0

    def walk(self, entities: Iterable[Any], group: Group | None, depth: int) -> None:
        for entity in entities:
            self.seen += 1
            if self.seen > MAX_ENTITIES or depth > MAX_DEPTH:
                raise InputError(
                    f"{self.where} has more than {MAX_ENTITIES:,} elements, or blocks inside blocks more than "
                    f"{MAX_DEPTH} deep; simplify it."
                )
            kind = entity.dxftype()
            if self._is_hidden(entity):
                self.left_out["hidden element"] += 1
            elif kind == "INSERT":
                self._insert(entity, depth)
            elif kind in OUTLINES:
                self._outline(entity, group or self._layer(entity))
            elif kind in ("TEXT", "MTEXT"):
                self._text(entity)
            else:
                self.left_out[kind[:30]] += 1

    def _is_hidden(self, entity: Any) -> bool:
        if entity.dxf.get("invisible", 0):
            return True
        name = entity.dxf.get("layer", "0")
        layer = self.document.layers.get(name) if name in self.document.layers else None
        return layer is not None and (layer.is_off() or layer.is_frozen())

    def _layer(self, entity: Any) -> Group:
        name = str(entity.dxf.get("layer", "0"))
        return self.groups.setdefault(("layer", name.lower()), Group("part" if name == "0" else name))

    def _insert(self, entity: Any, depth: int) -> None:
        name = str(entity.dxf.get("name", ""))
        if entity.mcount > 1:
            raise InputError(
                f"{self.where}: block '{name[:60]}' is inserted as an array; explode it into single blocks."
            )
        # Blocks inside blocks are parts of their own; what lies in the outer one beside them is one more.
        group = self.groups.setdefault(("block", len(self.groups)), Group(name, is_block=True))
        before = self.seen
        try:
            inside = list(entity.virtual_entities())
        except BROKEN as error:
            raise InputError(f"{self.where}: block '{name[:60]}' cannot be read: {str(error)[:120]}.") from None
        self.seen = before
        self.walk(inside, group, depth + 1)

    def _text(self, entity: Any) -> None:
        long = entity.dxftype() == "MTEXT"
        said = entity.plain_text() if long else str(entity.dxf.get("text", ""))
        aligned = not long and (entity.dxf.get("halign", 0) or entity.dxf.get("valign", 0))
        at = (entity.dxf.get("align_point") if aligned else None) or entity.dxf.get("insert")
        if said.strip() and at is not None:
            self.texts.append((" ".join(said.split()), (float(at[0]), float(at[1]))))

    def _outline(self, entity: Any, group: Group) -> None:
        curves, closed = _curves(entity, f"{self.where}: {entity.dxftype()} on layer '{group.name[:60]}'")
        self.curves += len(curves)
        require_few(self.curves, self.where)
        if closed:
            add_chain(group.closed, curves, True)
        elif curves:
            group.loose.append(np.array(curves))


def _curves(entity: Any, where: str) -> tuple[list[Array], bool]:
    """Return the cubics (4, 2) of one element in drawing coordinates, and whether it is closed."""
    from ezdxf import path as ezpath

    try:
        drawn = ezpath.make_path(entity, segments=ARC_PIECES)
        points = [drawn.start]
        found: list[list[Any]] = []
        for command in drawn.commands():
            start = points[-1]
            inner = [getattr(command, name) for name in ("ctrl", "ctrl1", "ctrl2") if hasattr(command, name)]
            found.append([start, *inner, command.end])
            points.append(command.end)
    except BROKEN as error:
        raise InputError(f"{where} cannot be read: {str(error)[:120] or type(error).__name__}; redraw it.") from None
    numbers = np.array([[p.x, p.y, p.z] for curve in found for p in curve])
    if len(numbers) == 0:
        return [], False
    if not (np.abs(numbers) < fields.LARGEST).all():
        raise InputError(f"{where} has a coordinate that is not finite (or beyond {fields.LARGEST:g}); redraw it.")
    size = float(np.linalg.norm(np.ptp(numbers, axis=0)))
    if np.ptp(numbers[:, 2]) > FLAT * size:
        raise InputError(
            f"{where} is not flat: its heights run from {numbers[:, 2].min():.6g} to {numbers[:, 2].max():.6g}; draw "
            "parts in the xy-plane, or hand solids in as meshes."
        )
    curves = [elevated([(float(p.x), float(p.y)) for p in curve]) for curve in found]
    closed = bool(getattr(entity, "closed", False) or getattr(entity, "is_closed", False))
    gap = float(np.linalg.norm(curves[-1][3] - curves[0][0]))
    return curves, closed or gap <= CLOSED * size
