"""Time over size as a figure that stands alone: an SVG with both axes logarithmic, one line a tool."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from benchmarks.measurement import Measurement

WIDTH, HEIGHT = 640.0, 400.0
LEFT, TOP, RIGHT, BOTTOM = 64.0, 16.0, 172.0, 46.0
COLOURS = ("#1f6fb4", "#7fb3dd", "#2e9e6b", "#c9622a", "#8a3ffc", "#666666")
STYLE = "text{font:12px system-ui,sans-serif;fill:#222}.grid{stroke:#ddd}.axis{stroke:#222}"


def time_figure(rows: Sequence[Measurement], title: str) -> str:
    """Return seconds over the number at the end of each case's name ('wall-16'), as SVG text.

    Rows that failed, timed out or found nothing have a hollow mark. Raises ValueError without finite times.
    """
    good = [r for r in rows if np.isfinite(r.seconds) and r.case.rpartition("-")[2].isdigit()]
    if not good:
        raise ValueError("There is no finite time to draw.")
    size = np.array([float(r.case.rpartition("-")[2]) for r in good])
    seconds = np.array([max(r.seconds, 1e-6) for r in good])
    low, high = np.floor(np.log10(seconds.min())), np.ceil(np.log10(seconds.max()))
    high = max(high, low + 1.0)
    span = max(float(np.log2(size.max() / size.min())), 1.0)

    def x(n: float) -> float:
        return float(LEFT + (WIDTH - LEFT - RIGHT) * np.log2(n / size.min()) / span)

    def y(t: float) -> float:
        return float(TOP + (HEIGHT - TOP - BOTTOM) * (high - np.log10(t)) / (high - low))

    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" width="{WIDTH:g}">',
        f"<title>{escape(title)}</title><style>{STYLE}</style>",
        f'<rect width="{WIDTH:g}" height="{HEIGHT:g}" fill="#fff"/>',
    ]
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    for power in np.arange(low, high + 1.0):
        level = y(10.0**power)
        out.append(f'<path class="grid" d="M{LEFT:g} {level:.1f}H{right:g}"/>')
        out.append(f'<text x="{LEFT - 6:g}" y="{level + 4:.1f}" text-anchor="end">{10.0**power:g} s</text>')
    for n in np.unique(size):
        out.append(f'<text x="{x(n):.1f}" y="{bottom + 18:g}" text-anchor="middle">{n:g}</text>')
    out.append(f'<path class="axis" fill="none" d="M{LEFT:g} {TOP:g}V{bottom:g}H{right:g}"/>')
    out.append(f'<text x="{0.5 * (LEFT + right):g}" y="{HEIGHT - 8:g}" text-anchor="middle">parts</text>')
    for k, tool in enumerate(dict.fromkeys(r.tool for r in good)):
        colour = COLOURS[k % len(COLOURS)]
        mine = sorted((float(n), float(t), r) for n, t, r in zip(size, seconds, good) if r.tool == tool)
        line = "L".join(f"{x(n):.1f} {y(t):.1f}" for n, t, _ in mine)
        out.append(f'<path d="M{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
        for n, t, row in mine:
            fill = colour if row.verdict.startswith("holds") else "#fff"
            mark = f'<circle cx="{x(n):.1f}" cy="{y(t):.1f}" r="4" fill="{fill}" stroke="{colour}" stroke-width="1.5">'
            out.append(f"{mark}<title>{escape(f'{tool}, {n:g} parts: {t:.3g} s, {row.verdict}')}</title></circle>")
        level = TOP + 12 + 20 * k
        out.append(f'<path d="M{right + 10:g} {level - 4:g}h18" stroke="{colour}" stroke-width="2"/>')
        out.append(f'<text x="{right + 34:g}" y="{level:g}">{escape(tool)}</text>')
    out.append("</svg>")
    return "\n".join(out)
