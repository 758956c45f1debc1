"""The critical tilt as a picture: a protractor in 2D, a polar plot over azimuths in 3D; and plain curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.report.markup import degrees, esc, point_list, px

TICKS = {2: 4, 5: 5, 10: 5, 15: 3, 20: 4, 30: 3, 45: 3, 60: 4, 90: 3}
"""Ends of the scale in degrees, and into how many equal steps each is divided."""


@dataclass(frozen=True)
class TiltSeries:
    """Critical tilts of one engine: `style` is 'statics', 'physics' or 'input', angles in radians."""

    name: str
    style: str
    azimuths_rad: tuple[float, ...]
    angles_rad: tuple[float, ...]


def tilt_plot(series: Sequence[TiltSeries], dimension: int, asked_rad: float | None = None) -> str:
    """Return the critical tilts as SVG: both sides of a protractor in 2D, a closed curve over azimuths in 3D."""
    angles = [a for s in series for a in s.angles_rad] + ([asked_rad] if asked_rad else [])
    limit = _round_up(float(np.rad2deg(max(angles, default=0.1))))
    return _protractor(series, limit, asked_rad) if dimension == 2 else _polar(series, limit, asked_rad)


def _round_up(value_deg: float) -> float:
    return float(next((limit for limit in TICKS if value_deg <= limit), 90))


def _protractor(series: Sequence[TiltSeries], limit: float, asked_rad: float | None) -> str:
    """A fan above a pivot: a needle leaning by the tilt, magnified so that `limit` reaches 70° to either side."""
    width, height, radius = 440.0, 268.0, 190.0
    pivot = np.array([width / 2, height - 38.0])
    gain = 70.0 / limit

    def at(tilt_deg: float, share: float) -> Array:
        lean = np.deg2rad(tilt_deg * gain)
        return np.asarray(pivot + share * radius * np.array([np.sin(lean), -np.cos(lean)]))

    body = []
    for tick in np.linspace(-limit, limit, 2 * TICKS[int(limit)] + 1):
        a, b, text = at(tick, 0.97), at(tick, 1.03), at(tick, 1.11)
        body.append(f'<line class="grid" x1="{px(a[0])}" y1="{px(a[1])}" x2="{px(b[0])}" y2="{px(b[1])}"/>')
        label = f"{abs(tick):g}°"
        body.append(f'<text class="tick" text-anchor="middle" x="{px(text[0])}" y="{px(text[1])}">{label}</text>')
    arc = np.array([at(t, 1.0) for t in np.linspace(-limit, limit, 61)])
    body.insert(0, f'<polyline class="grid" fill="none" points="{point_list(arc)}"/>')
    if asked_rad:
        asked = float(np.rad2deg(asked_rad))
        fan = np.array([pivot, *(at(t, 0.9) for t in np.linspace(-asked, asked, 41))])
        body.append(f'<polygon class="asked" points="{point_list(fan)}"><title>asked for</title></polygon>')
    for k, one in enumerate(series):
        share = 0.86 - 0.13 * k
        signed = [
            float(np.rad2deg(t)) * (1.0 if np.cos(a) >= 0 else -1.0) for a, t in zip(one.azimuths_rad, one.angles_rad)
        ]
        low, high = min([*signed, 0.0]), max([*signed, 0.0])
        fan = np.array([pivot, *(at(t, share) for t in np.linspace(low, high, 41))])
        body.append(f'<polygon class="fan {one.style}" points="{point_list(fan)}"/>')
        for tilt in signed:
            end, text = at(tilt, share), at(tilt, share) + np.array([8.0 if tilt >= 0 else -8.0, 4.0])
            anchor = "start" if tilt >= 0 else "end"
            body.append(
                f'<text class="value {one.style}" text-anchor="{anchor}" x="{px(text[0])}" y="{px(text[1])}">'
                f"{abs(tilt):.1f}°</text>"
            )
            body.append(f'<circle class="dot {one.style}" cx="{px(end[0])}" cy="{px(end[1])}" r="3.2"/>')
    body.append(_sides(width, height))
    return _svg(width, height, body, _legend(series, width, height, asked_rad), "Critical tilt to the left and right")


def _sides(width: float, height: float) -> str:
    y = px(height - 24)
    return (
        f'<text class="tick" x="{px(width * 0.08)}" y="{y}">tilted to the left</text>'
        f'<text class="tick" text-anchor="end" x="{px(width * 0.92)}" y="{y}">tilted to the right</text>'
    )


def _polar(series: Sequence[TiltSeries], limit: float, asked_rad: float | None) -> str:
    width, height, radius = 400.0, 400.0, 150.0
    middle = np.array([width / 2, 182.0])

    def at(azimuth: float, tilt_deg: float) -> Array:
        r = radius * min(tilt_deg / limit, 1.0)
        return np.asarray(middle + r * np.array([np.cos(azimuth), -np.sin(azimuth)]))

    body = []
    for share in np.arange(1, TICKS[int(limit)] + 1) / TICKS[int(limit)]:
        body.append(f'<circle class="grid" cx="{px(middle[0])}" cy="{px(middle[1])}" r="{px(radius * share)}"/>')
        where = middle + np.array([3.0, -radius * share - 2.0])
        body.append(f'<text class="tick" x="{px(where[0])}" y="{px(where[1])}">{limit * share:g}°</text>')
    for degree in range(0, 360, 45):
        a = np.deg2rad(degree)
        rim, text = at(a, limit), middle + (radius + 16) * np.array([np.cos(a), -np.sin(a)])
        spoke = f'x1="{px(middle[0])}" y1="{px(middle[1])}" x2="{px(rim[0])}" y2="{px(rim[1])}"'
        body.append(f'<line class="grid" {spoke}/>')
        anchor = f'text-anchor="middle" x="{px(text[0])}" y="{px(text[1] + 3)}"'
        body.append(f'<text class="tick" {anchor}>{degree}°</text>')
    if asked_rad:
        r = px(radius * float(np.rad2deg(asked_rad)) / limit)
        body.append(f'<circle class="asked" cx="{px(middle[0])}" cy="{px(middle[1])}" r="{r}"/>')
    for one in series:
        order = np.argsort(one.azimuths_rad)
        points = np.array([at(one.azimuths_rad[k], float(np.rad2deg(one.angles_rad[k]))) for k in order])
        body.append(f'<polygon class="fan {one.style}" points="{point_list(points)}"/>')
        for k, (x, y) in zip(order, points):
            title = f"{one.name}, {degrees(one.azimuths_rad[k], 0)}: {degrees(one.angles_rad[k])}"
            body.append(
                f'<circle class="dot {one.style}" cx="{px(x)}" cy="{px(y)}" r="3"><title>{esc(title)}</title></circle>'
            )
    return _svg(width, height, body, _legend(series, width, height, asked_rad), "Critical tilt over azimuths")


def _legend(series: Sequence[TiltSeries], width: float, height: float, asked_rad: float | None) -> str:
    items = [(f"fan {s.style}", s.name) for s in series]
    if asked_rad:
        items.append(("asked", f"asked for ({degrees(asked_rad, 0)})"))
    lengths = [24.0 + 6.3 * len(name) for _, name in items]
    x = width / 2 - sum(lengths) / 2
    drawn = []
    for (cls, name), length in zip(items, lengths):
        drawn.append(f'<rect class="{cls}" x="{px(x)}" y="{px(height - 14)}" width="11" height="9"/>')
        drawn.append(f'<text class="tick" x="{px(x + 15)}" y="{px(height - 6)}">{esc(name)}</text>')
        x += length
    return "".join(drawn)


def _svg(width: float, height: float, body: Sequence[str], legend: str, label: str) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="plot" role="img" aria-label="{esc(label)}" '
        f'viewBox="0 0 {px(width)} {px(height)}" width="{px(width)}" height="{px(height)}">'
        f"<title>{esc(label)}</title>{''.join(body)}{legend}</svg>"
    )
