"""Figures over a parameter: lines with marks, told apart by shape and dash as well as by colour."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.report.markup import esc, px, significant
from mocca_robot.tolerances import EXACT, ROUNDING, TINY

PLAIN = 1e-3
"""Smaller numbers are written as powers of ten."""

WIDTH, HEIGHT = 560.0, 330.0
LEFT, TOP, RIGHT, BOTTOM = 70.0, 30.0, 160.0, 48.0
STYLES = 6
"""Number of colours, marks and dashes; further series begin anew."""
DASHES = ("", "7 3", "2 3", "9 3 2 3", "4 4", "1 2")


@dataclass(frozen=True)
class Series:
    """One line.

    Attributes:
        name: shown at its right end.
        x, y: coordinates; a y that is no finite number leaves a gap.
        hollow: points that are marked as failed: an open mark, left out of the line.
        joined: whether a line joins the points.
    """

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    hollow: tuple[bool, ...] = ()
    joined: bool = True


@dataclass(frozen=True)
class Axis:
    """One axis: its label, whether it is logarithmic, and the texts of 0, 1, 2, … where it has no numbers."""

    label: str
    log: bool = False
    categories: tuple[str, ...] = ()


def chart(title: str, series: Sequence[Series], across: Axis, up: Axis, key: str = "") -> str:
    """Return the figure as SVG, for a page or, after `figures.stand_alone`, for a file.

    `key` is the heading above the names of the series. Numbers that a logarithmic axis cannot show are left out;
    without any number the figure says so.
    """
    size = f'viewBox="0 0 {px(WIDTH)} {px(HEIGHT)}" width="{px(WIDTH)}" height="{px(HEIGHT)}"'
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="chart" role="img" aria-label="{esc(title)}" {size}>'
        f'<title>{esc(title)}</title><text class="title" x="{px(LEFT)}" y="17">{esc(title)}</text>'
    )
    shown = [_clean(s, across, up) for s in series]
    every = [s for s in shown if len(s[1])]
    if not every:
        middle = f'x="{px(0.5 * (LEFT + WIDTH - RIGHT))}" y="{px(HEIGHT / 2)}"'
        return f'{head}<text class="tick" text-anchor="middle" {middle}>There is no number to show.</text></svg>'
    x_scale = _Scale.of(np.concatenate([s[1] for s in every]), across, LEFT, WIDTH - RIGHT)
    y_scale = _Scale.of(np.concatenate([s[2] for s in every]), up, HEIGHT - BOTTOM, TOP)
    body = [_grid(x_scale, y_scale, across, up)]
    if key:
        body.append(f'<text class="tick" x="{px(WIDTH - RIGHT + 14)}" y="{px(TOP + 4)}">{esc(key)}</text>')
    row = 0
    for k, (one, x, y, hollow) in enumerate(shown):
        if not len(x):
            continue
        points = np.stack([x_scale.at(x), y_scale.at(y)], axis=1)
        body.append(_line(one, points, hollow, k % STYLES))
        if len(series) > 1 or one.name:
            body.append(_entry(one.name, row, k % STYLES, bool(key)))
            row += 1
    return f"{head}{''.join(body)}</svg>"


def fitted_exponent(x: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """Return (exponent, factor) of the power law factor · x^exponent nearest to the points, by least squares of logs.

    Raises ValueError with fewer than two different positive x.
    """
    a, b = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    keep = (a > 0) & (b > 0) & np.isfinite(a) & np.isfinite(b)
    if len(np.unique(a[keep])) < 2:
        raise ValueError("An exponent needs at least two points at different places.")
    slope, offset = np.polyfit(np.log(a[keep]), np.log(b[keep]), 1)
    return float(slope), float(np.exp(offset))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Scale:
    """Values → pixels, with the places of its ticks."""

    low: float
    high: float
    start: float
    end: float
    log: bool
    ticks: tuple[float, ...]

    @classmethod
    def of(cls, values: Array, axis: Axis, start: float, end: float) -> _Scale:
        if axis.categories:
            count = len(axis.categories)
            return cls(
                low=-0.5, high=count - 0.5, start=start, end=end, log=False, ticks=tuple(float(k) for k in range(count))
            )
        low, high = float(values.min()), float(values.max())
        if axis.log:
            bottom, top = math.floor(math.log10(low) + ROUNDING), math.ceil(math.log10(high) - ROUNDING)
            if top == bottom:
                top += 1
            every = max(1, math.ceil((top - bottom) / 7))
            powers = range(bottom, top + 1, every)
            return cls(
                low=10.0**bottom, high=10.0**top, start=start, end=end, log=True, ticks=tuple(10.0**p for p in powers)
            )
        if high - low < EXACT * max(abs(high), abs(low), TINY):
            low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
        raw = (high - low) / 5
        base = 10.0 ** math.floor(math.log10(raw))
        step = next(m * base for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * base >= raw * (1 - ROUNDING))
        first, last = math.floor(low / step + ROUNDING), math.ceil(high / step - ROUNDING)
        ticks = tuple(k * step for k in range(first, last + 1))
        return cls(low=ticks[0], high=ticks[-1], start=start, end=end, log=False, ticks=ticks)

    def at(self, values: Array) -> Array:
        """Return pixels."""
        v, low, high = (np.log10(x) if self.log else np.asarray(x) for x in (values, self.low, self.high))
        return np.asarray(self.start + (self.end - self.start) * (v - low) / (high - low))


def _clean(one: Series, across: Axis, up: Axis) -> tuple[Series, Array, Array, BoolArray]:
    x, y = np.asarray(one.x, dtype=np.float64), np.asarray(one.y, dtype=np.float64)
    hollow = np.asarray(one.hollow if len(one.hollow) else np.zeros(len(x)), dtype=np.bool_)
    keep = np.isfinite(x) & np.isfinite(y) & ((x > 0) | (not across.log)) & ((y > 0) | (not up.log))
    order = np.argsort(x[keep], kind="stable")
    return one, x[keep][order], y[keep][order], hollow[keep][order]


def _grid(x: _Scale, y: _Scale, across: Axis, up: Axis) -> str:
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    out = []
    for tick in y.ticks:
        level = float(y.at(np.array(tick)))
        text = up.categories[int(tick)] if up.categories else _number(tick, up.log)
        out.append(f'<path class="grid" d="M{px(LEFT)} {px(level)}H{px(right)}"/>')
        out.append(f'<text class="tick" text-anchor="end" x="{px(LEFT - 7)}" y="{px(level + 4)}">{esc(text)}</text>')
    for tick in x.ticks:
        place = float(x.at(np.array(tick)))
        text = across.categories[int(tick)] if across.categories else _number(tick, across.log)
        out.append(f'<path class="grid" d="M{px(place)} {px(bottom)}v5"/>')
        out.append(
            f'<text class="tick" text-anchor="middle" x="{px(place)}" y="{px(bottom + 18)}">{esc(text[:14])}</text>'
        )
    out.append(f'<path class="axis" d="M{px(LEFT)} {px(TOP)}V{px(bottom)}H{px(right)}"/>')
    middle = f'text-anchor="middle" x="{px(0.5 * (LEFT + right))}" y="{px(HEIGHT - 10)}"'
    out.append(f'<text class="tick" {middle}>{esc(across.label)}</text>')
    turned = f'text-anchor="middle" transform="translate(15 {px(0.5 * (TOP + bottom))}) rotate(-90)"'
    out.append(f'<text class="tick" {turned}>{esc(up.label)}</text>')
    return "".join(out)


def _number(value: float, log: bool) -> str:
    if log and not PLAIN <= value < 1e5:
        raised = str(round(math.log10(value))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        return f"10{raised}"
    return significant(value, 4)


def _line(one: Series, points: Array, hollow: BoolArray, style: int) -> str:
    out = []
    line = points[~hollow]
    if one.joined and len(line) > 1:
        path = "M" + "L".join(f"{px(x)} {px(y)}" for x, y in line)
        dash = f' stroke-dasharray="{DASHES[style]}"' if DASHES[style] else ""
        out.append(f'<path class="series s{style}" d="{path}"{dash}/>')
    for (x, y), open_ in zip(points, hollow):
        out.append(_mark(float(x), float(y), style, bool(open_)))
    return "".join(out)


def _mark(x: float, y: float, style: int, hollow: bool) -> str:
    """Return a circle, square, triangle, rhombus, triangle on its point, or cross about a place."""
    cls = f"mark s{style}{' open' if hollow else ''}"
    if style == 0:
        return f'<circle class="{cls}" cx="{px(x)}" cy="{px(y)}" r="3.6"/>'
    shapes = (
        "m-3.3 -3.3h6.6v6.6h-6.6z",
        "m0 -4.4l4.2 7.4h-8.4z",
        "m0 -4.8l4.8 4.8l-4.8 4.8l-4.8 -4.8z",
        "m0 4.4l4.2 -7.4h-8.4z",
        "m-1.3 -4h2.6v2.7h2.7v2.6h-2.7v2.7h-2.6v-2.7h-2.7v-2.6h2.7z",
    )
    return f'<path class="{cls}" d="M{px(x)} {px(y)}{shapes[style - 1]}"/>'


def _entry(name: str, row: int, style: int, below_key: bool) -> str:
    x, y = WIDTH - RIGHT + 18, TOP + 18 * (row + below_key)
    text = name if len(name) <= 20 else f"{name[:19]}…"
    return f'{_mark(x, y, style, False)}<text class="tick" x="{px(x + 10)}" y="{px(y + 4)}">{esc(text)}</text>'
