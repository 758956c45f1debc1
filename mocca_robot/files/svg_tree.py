"""SVG elements → outlines in drawing coordinates: transforms applied, clones expanded, hidden ones out."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.files.fields import UNITS_M, shown
from mocca_robot.files.svg_css import Styles, is_hidden, svg_transform

MAX_ELEMENTS = 50_000
MAX_DEPTH = 100
_SHAPES = {"path", "rect", "circle", "ellipse", "polygon", "polyline", "line"}
_GROUPS = {"g", "a", "switch"}
_NAMES = ("{http://www.inkscape.org/namespaces/inkscape}label", "{http://www.serif.com/}id", "data-name")
"""Where Inkscape, Affinity and Illustrator keep what people typed."""
_GENERATED = re.compile(r"(?:path|rect|circle|ellipse|polygon|polyline|line|use|g|SVGID|XMLID)[-_]?\d+(?:[-_]\d+)*_?|")
"""Ids that an editor made up."""
_ESCAPED = re.compile(r"_x([0-9A-Fa-f]{2,4})_")
"""Illustrator's way of writing spaces and umlauts in ids."""
_XLINK = "{http://www.w3.org/1999/xlink}href"
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


@dataclass(frozen=True, eq=False)
class Outline:
    """One shape.

    Attributes:
        name: what the editor shows: a label, else an id that somebody wrote, else the name of a group around it alone.
        path: its path data.
        matrix: (2, 3), takes it into the drawing's coordinates.
        group: the name of the group that it lies in, and a number that tells groups apart.
    """

    name: str
    path: str
    matrix: Array
    group: tuple[str, int] = ("", 0)


def parse_xml(text: str, where: str) -> ET.Element:
    """Return the root of an SVG. Raises InputError for broken XML, entity declarations and other documents."""
    if re.search(r"<!ENTITY", text, re.IGNORECASE):
        raise InputError(f"{where} declares XML entities, which are not read; save it as plain SVG.")
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        line, column = error.position
        raise InputError(
            f"{where} is not valid SVG at line {line}, column {column + 1}: {error.msg.split(':')[0]}; "
            "it may be truncated. Save it again from the editor."
        ) from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where} is not valid SVG: {error}.") from None
    if _tag(root) != "svg":
        raise InputError(f"{where} is XML but not SVG: its root is <{_tag(root)[:40]}>.")
    return root


def outlines(root: ET.Element, where: str) -> tuple[list[Outline], tuple[str, ...]]:
    """Return the visible shapes of a drawing in document order, and a note for each kind of thing left out."""
    walker = _ElementWalker(root, where)
    found = list(walker.walk(root, np.eye(2, 3), 0))
    notes = tuple(
        f"{where}: {count} <{tag}> left out (only outlines become parts)" for tag, count in walker.left_out.items()
    )
    return found, notes


class _ElementWalker:
    def __init__(self, root: ET.Element, where: str) -> None:
        self.where = where
        self.seen = 0
        self.unnamed = 0
        self.left_out: dict[str, int] = {}
        self.by_id = {e.get("id", ""): e for e in root.iter() if e.get("id")}
        self.styles = Styles(root)

    def walk(
        self,
        element: ET.Element,
        matrix: Array,
        depth: int,
        alias: str = "",
        group: tuple[str, int] = ("", 0),
        cloned: bool = False,
    ) -> Iterator[Outline]:
        self.seen += 1
        if self.seen > MAX_ELEMENTS or depth > MAX_DEPTH:
            raise InputError(
                f"{self.where} has more than {MAX_ELEMENTS} elements or {MAX_DEPTH} nested groups, "
                "clones counted; simplify it."
            )
        tag = _tag(element)
        style = self.styles.of(element, tag)
        if is_hidden(style, element):
            self.left_out["hidden element"] = self.left_out.get("hidden element", 0) + 1
            return
        called = self._called(element)
        moved = svg_transform(style, called)
        matrix = composed(matrix, parse_transform(element.get("transform", "") if moved is None else moved, called))
        if tag in _GROUPS or (tag == "svg" and depth == 0):
            shapes = [c for c in element if _tag(c) in _SHAPES | _GROUPS | {"use"}]
            inner = (_own_name(element) or group[0], self.seen) if depth else group
            around = (alias if cloned else _own_name(element) or alias) if len(shapes) == 1 and depth else ""
            for child in element:
                yield from self.walk(child, matrix, depth + 1, around if child in shapes else "", inner, cloned)
        elif tag == "use":
            yield from self._clone(element, matrix, depth)
        elif tag in _SHAPES:
            data = path_data(element, self._called(element))
            if data:
                yield Outline(alias if cloned and alias else self._name(element, alias), data, matrix, group)
        elif tag == "svg":
            raise InputError(f"{self.where} holds an <svg> inside an <svg>; ungroup it in the editor.")
        elif tag in {"text", "image", "symbol", "foreignObject"}:
            self.left_out[tag] = self.left_out.get(tag, 0) + 1

    def _clone(self, element: ET.Element, matrix: Array, depth: int) -> Iterator[Outline]:
        reference = element.get("href") or element.get(_XLINK) or ""
        target = self.by_id.get(reference[1:]) if reference.startswith("#") else None
        called = self._called(element)
        if target is None or _tag(target) in {"symbol", "svg"}:
            raise InputError(
                f"{self.where}: the clone {called} refers to '{reference[:60]}', which is no shape or group of this "
                "drawing; unlink clones in the editor."
            )
        shift = np.array([[1.0, 0.0, _length(element, "x", called)], [0.0, 1.0, _length(element, "y", called)]])
        alias = _own_name(element) or element.get("id") or ""
        yield from self.walk(target, composed(matrix, shift), depth + 1, alias, cloned=True)

    def _name(self, element: ET.Element, alias: str) -> str:
        name = _own_name(element) or alias or element.get("id")
        if name:
            return name
        self.unnamed += 1
        return f"part_{self.unnamed:02d}"

    def _called(self, element: ET.Element) -> str:
        name = _own_name(element) or element.get("id")
        return f"'{name[:60]}'" if name else f"<{_tag(element)}> without id"


def _own_name(element: ET.Element) -> str:
    """Return what an element is called in its editor; empty where only a generated id tells it apart."""
    for key in _NAMES:
        if name := element.get(key, "").strip():
            return " ".join(name.split())
    name = _ESCAPED.sub(lambda found: chr(int(found[1], 16)), element.get("id", "")).strip()
    return "" if _GENERATED.fullmatch(name) else name


def _tag(element: ET.Element) -> str:
    return element.tag.rsplit("}", 1)[-1] if isinstance(element.tag, str) else ""


def composed(outer: Array, inner: Array) -> Array:
    """Return the (2, 3) matrix of `inner` followed by `outer`."""
    return np.concatenate([outer[:, :2] @ inner[:, :2], (outer[:, :2] @ inner[:, 2] + outer[:, 2])[:, None]], axis=1)


def parse_transform(text: str, called: str) -> Array:
    """Return the (2, 3) matrix of an SVG transform list; raises InputError when it is not one."""
    matrix = np.eye(2, 3)
    rest = text.strip()
    while rest:
        found = re.match(r"(\w+)\s*\(([^()]*)\)[\s,]*", rest)
        if not found:
            raise InputError(f"The transform of {called} is {shown(text)}, which is no SVG transform.")
        values = [float(v) for v in _NUMBER.findall(found[2])]
        extra = re.sub(r"[\s,]", "", _NUMBER.sub("", found[2]))
        step = None if extra else _transform(found[1], values)
        if step is None or not np.isfinite(step).all():
            raise InputError(f"The transform of {called} holds {shown(found[0])}, which is no SVG transform.")
        matrix = composed(matrix, step)
        rest = rest[found.end() :]
    return matrix


def _transform(name: str, v: list[float]) -> Array | None:
    if name == "matrix" and len(v) == 6:
        return np.array([[v[0], v[2], v[4]], [v[1], v[3], v[5]]])
    if name == "translate" and len(v) in (1, 2):
        return np.array([[1.0, 0.0, v[0]], [0.0, 1.0, v[1] if len(v) == 2 else 0.0]])
    if name == "scale" and len(v) in (1, 2):
        return np.array([[v[0], 0.0, 0.0], [0.0, v[-1], 0.0]])
    if name == "rotate" and len(v) in (1, 3):
        c, s = math.cos(math.radians(v[0])), math.sin(math.radians(v[0]))
        x, y = v[1:] if len(v) == 3 else (0.0, 0.0)
        return np.array([[c, -s, x - c * x + s * y], [s, c, y - s * x - c * y]])
    if name == "skewX" and len(v) == 1:
        return np.array([[1.0, math.tan(math.radians(v[0])), 0.0], [0.0, 1.0, 0.0]])
    if name == "skewY" and len(v) == 1:
        return np.array([[1.0, 0.0, 0.0], [math.tan(math.radians(v[0])), 1.0, 0.0]])
    return None


def path_data(element: ET.Element, called: str) -> str:
    """Return any shape as SVG path data; empty when the editor left an empty shape behind."""
    tag = _tag(element)
    if tag == "path":
        return element.get("d", "").strip()
    if tag in {"polygon", "polyline"}:
        points = element.get("points", "").strip()
        return f"M {points} {'Z' if tag == 'polygon' else ''}" if points else ""

    def get(key: str) -> float:
        return _length(element, key, called)

    if tag == "line":
        return f"M {get('x1')!r} {get('y1')!r} L {get('x2')!r} {get('y2')!r}"
    if tag == "rect":
        return _rectangle(get, element.get("rx"), element.get("ry"))
    rx, ry = (get("r"), get("r")) if tag == "circle" else (get("rx"), get("ry"))
    x, y = get("cx"), get("cy")
    corners = [(x, y + ry), (x - rx, y), (x, y - ry), (x + rx, y)]
    arcs = " ".join(f"A {rx!r} {ry!r} 0 0 1 {a!r} {b!r}" for a, b in corners)
    return f"M {x + rx!r} {y!r} {arcs} Z"


def _rectangle(get, rx_given: str | None, ry_given: str | None) -> str:  # type: ignore[no-untyped-def]
    x, y, w, h = get("x"), get("y"), get("width"), get("height")
    rx = get("rx") if rx_given else get("ry")
    ry = get("ry") if ry_given else get("rx")
    rx, ry = min(rx, w / 2), min(ry, h / 2)
    if rx <= 0 or ry <= 0:
        return f"M {x!r} {y!r} L {x + w!r} {y!r} L {x + w!r} {y + h!r} L {x!r} {y + h!r} Z"
    arc = f"A {rx!r} {ry!r} 0 0 1"
    return (
        f"M {x + rx!r} {y!r} L {x + w - rx!r} {y!r} {arc} {x + w!r} {y + ry!r} L {x + w!r} {y + h - ry!r} "
        f"{arc} {x + w - rx!r} {y + h!r} L {x + rx!r} {y + h!r} {arc} {x!r} {y + h - ry!r} "
        f"L {x!r} {y + ry!r} {arc} {x + rx!r} {y!r} Z"
    )


def _length(element: ET.Element, key: str, called: str) -> float:
    """Return an attribute as user units; 0 when absent."""
    return parse_length(element.get(key, "0"), f"'{key}' of {called}")


def parse_length(text: str, where: str) -> float:
    """Return an SVG length in CSS pixels (one user unit when there is no viewBox)."""
    found = _NUMBER.match(text.strip())
    unit = text.strip()[found.end() :] if found else ""
    value = float(found[0]) if found else math.inf
    if not found or not math.isfinite(value) or (unit and unit not in UNITS_M):
        raise InputError(f"{where} is {shown(text)}; write a number with a unit among {', '.join(UNITS_M)}.")
    return value * (UNITS_M[unit] / UNITS_M["px"] if unit else 1.0)
