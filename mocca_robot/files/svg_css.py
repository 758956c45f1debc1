"""What style sheets and style attributes of an SVG say that changes its shapes: whether they show, and transforms."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.files.fields import UNITS_M, shown

ON_RIM = 1e-3
"""Share of a box's side by which a corner may lie off its rim."""

MOST_RULES = 5000
"""Of all style sheets of a drawing; editors write one per look."""
_VALUE = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([a-z%]*)")
_ANGLES = {"deg": 1.0, "": 1.0, "rad": 180.0 / math.pi, "grad": 0.9, "turn": 360.0}


class Styles:
    """The declarations that hold for each element; selectors are tags, classes, ids, and `*`."""

    def __init__(self, root: ET.Element) -> None:
        self.rules: dict[str, dict[str, str]] = {}
        count = 0
        for element in root.iter():
            if not isinstance(element.tag, str) or element.tag.rsplit("}", 1)[-1] != "style":
                continue
            text = re.sub(r"/\*.*?\*/", "", "".join(element.itertext()), flags=re.DOTALL)
            for selectors, body in re.findall(r"([^{}]+)\{([^{}]*)\}", text):
                for selector in selectors.split(","):
                    count += 1
                    if count <= MOST_RULES:
                        self.rules.setdefault(selector.strip(), {}).update(_declarations(body))

    def of(self, element: ET.Element, tag: str) -> dict[str, str]:
        """Return property → value: style sheets from the general to the special, then the element's own style."""
        found: dict[str, str] = {}
        classes = element.get("class", "").split()
        names = ["*", tag, *(f".{c}" for c in classes), *(f"{tag}.{c}" for c in classes), f"#{element.get('id')}"]
        for name in names:
            found.update(self.rules.get(name, {}))
        found.update(_declarations(element.get("style", "")))
        return found


def _declarations(text: str) -> dict[str, str]:
    pairs = (d.split(":", 1) for d in text.split(";") if ":" in d)
    return {k.strip().lower(): v.replace("!important", "").strip() for k, v in pairs}


def is_hidden(style: dict[str, str], element: ET.Element) -> bool:
    """Return whether an element does not show."""
    display = style.get("display", element.get("display", ""))
    visibility = style.get("visibility", element.get("visibility", ""))
    return display == "none" or visibility in ("hidden", "collapse")


def svg_transform(style: dict[str, str], called: str) -> str | None:
    """Return the transform of a style in the words of SVG's attribute, in degrees and px; None where it has none.

    Raises InputError for what has no counterpart there, such as percentages and turns in space.
    """
    text = style.get("transform", "none")
    if text == "none":
        return None
    steps = [_step(name.lower(), body, called) for name, body in re.findall(r"([\w-]+)\s*\(([^()]*)\)", text)]
    if not steps:
        raise _unknown(text, called)
    origin = style.get("transform-origin", "0 0")
    words = origin.replace("left", "0").replace("top", "0").split()
    x, y = [*_values(" ".join(words[:2]), called, length=True), 0.0, 0.0][:2]
    if (x, y) == (0.0, 0.0):
        return " ".join(steps)
    return " ".join([f"translate({x!r} {y!r})", *steps, f"translate({-x!r} {-y!r})"])


def _step(name: str, body: str, called: str) -> str:
    along = {"x": (1.0, 0.0), "y": (0.0, 1.0)}.get(name[-1])
    if name == "matrix":
        return f"matrix({' '.join(repr(v) for v in _values(body, called))})"
    if name in ("translate", "translatex", "translatey"):
        values = _values(body, called, length=True)
        if along and len(values) == 1:
            values = [v * values[0] for v in along]
        return f"translate({' '.join(map(repr, values))})"
    if name in ("scale", "scalex", "scaley"):
        values = _values(body, called)
        if along and len(values) == 1:
            values = [values[0] if v else 1.0 for v in along]
        return f"scale({' '.join(map(repr, values))})"
    if name in ("rotate", "rotatez", "skewx", "skewy"):
        values = _values(body, called, angle=True)
        return f"{name.replace('rotatez', 'rotate').replace('skewx', 'skewX').replace('skewy', 'skewY')}({values[0]!r})"
    raise _unknown(f"{name}({body})", called)


def _values(text: str, called: str, *, length: bool = False, angle: bool = False) -> list[float]:
    found = []
    for value, unit in _VALUE.findall(text):
        factor: float | None = 1.0 if not unit else None
        if length and unit in UNITS_M:
            factor = UNITS_M[unit] / UNITS_M["px"]
        if angle:
            factor = _ANGLES.get(unit)
        if factor is None:
            raise _unknown(text, called)
        found.append(float(value) * factor)
    if not found or _VALUE.sub("", text).replace(",", " ").strip() or not np.isfinite(found).all():
        raise _unknown(text, called)
    return found


def _unknown(text: str, called: str) -> InputError:
    return InputError(
        f"The style of {called} has the transform {shown(text)}, which is not read here; apply it in the editor (in "
        'Inkscape: Object to Path; in Illustrator: Expand), or write it as an attribute: transform="translate(20 40)".'
    )


def is_background(corners: Array, low: Array, high: Array) -> bool:
    """Return whether an outline (n, 2) is the rectangle from `low` to `high` (2,)."""
    size = high - low
    if len(corners) not in (4, 5) or not (size > 0).all():
        return False
    share = (corners - low) / size
    on_rim = (np.minimum(np.abs(share), np.abs(share - 1.0)) < ON_RIM).all()
    return bool(on_rim and (np.ptp(share, axis=0) > 0.998).all())
