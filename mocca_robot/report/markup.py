"""Text into HTML, SVG and script without surprises: names are user input and are escaped wherever they land."""

from __future__ import annotations

import html
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib import resources

from mocca_robot.arrays import Array

_ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def esc(value: object) -> str:
    """Return `value` as text for an element or a quoted attribute; characters XML forbids become '\ufffd'."""
    return html.escape(_ILLEGAL.sub("\ufffd", str(value)), quote=True)


def script_json(value: object) -> str:
    """Return `value` as JSON that cannot end the script element it stands in; non-finite numbers become null."""
    text = json.dumps(_finite(value), ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _finite(value: object) -> object:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(k): _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return value


def px(value: float) -> str:
    """Return a coordinate with two decimals, without trailing zeros."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def point_list(points: Array) -> str:
    """Return (n, 2) points as 'x,y x,y …'."""
    return " ".join(f"{px(x)},{px(y)}" for x, y in points)


def degrees(radians: float | None, digits: int = 1) -> str:
    """Return an angle in degrees with its sign, '–' when there is none."""
    if radians is None or not math.isfinite(radians):
        return "–"
    value = f"{math.degrees(radians):.{digits}f}"
    return f"{value.lstrip('-') if float(value) == 0 else value.replace('-', '−')}°"


def millimetres(metres: float) -> str:
    """Return a length in millimetres with three significant digits."""
    if not math.isfinite(metres):
        return "–"
    return f"{significant(metres * 1e3)} mm"


def significant(value: float, digits: int = 3) -> str:
    """Return `value` with `digits` significant digits, in powers of ten only where that is shorter to read."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    magnitude = math.floor(math.log10(abs(value)))
    if -4 <= magnitude < 6:
        text = f"{value:.{max(digits - 1 - magnitude, 0)}f}"
        text = text.rstrip("0").rstrip(".") if "." in text else text
        return text.replace("-", "−")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    sign = "⁻" if int(exponent) < 0 else ""
    raised = str(abs(int(exponent))).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa.replace('-', '−')}·10{sign}{raised}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]], *, caption: str, numeric: Sequence[int] = ()) -> str:
    """Return an HTML table of cells that are markup already; columns in `numeric` align right."""
    cls = [' class="num"' if k in numeric else "" for k in range(len(head))]
    top = "".join(f'<th scope="col"{c}>{h}</th>' for h, c in zip(head, cls))
    body = "\n".join(
        "<tr>" + "".join(f"<td{c}>{cell}</td>" for cell, c in zip(row, cls, strict=True)) + "</tr>" for row in rows
    )
    return (
        f'<div class="scroll"><table><caption>{esc(caption)}</caption>'
        f"<thead><tr>{top}</tr></thead><tbody>\n{body}\n</tbody></table></div>"
    )


def badge(kind: str, text: str) -> str:
    """Return a verdict mark; `kind` is 'ok', 'bad', 'warn' or 'none'. The sign says it without the colour, too."""
    sign = {"ok": "✓", "bad": "✗", "warn": "△", "none": "–"}[kind]
    return f'<span class="badge {kind}"><span aria-hidden="true">{sign}</span> {esc(text)}</span>'


def plural(count: int, noun: str) -> str:
    """Return '1 part', '2 parts'."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def listed(names: Sequence[str], limit: int = 8) -> str:
    """Return names as escaped code, the rest as a count."""
    shown = ", ".join(f"<code>{esc(n)}</code>" for n in names[:limit])
    return shown + (f" and {len(names) - limit} more" if len(names) > limit else "")


@cache
def asset(name: str) -> str:
    """Return the text of a file in `mocca_robot/report/assets`."""
    return (resources.files("mocca_robot.report") / "assets" / name).read_text(encoding="utf-8")
