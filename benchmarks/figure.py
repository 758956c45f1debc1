"""Time over size as a figure that stands alone: an SVG with both axes logarithmic, one line a tool."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.measurement import Measurement
from mocca_robot.report.charts import Axis, Series, chart
from mocca_robot.report.figures import stand_alone


def time_figure(rows: Sequence[Measurement], title: str, across: str = "parts") -> str:
    """Return seconds over the number at the end of each case's name ('wall-16'), as SVG text.

    Rows that failed, timed out or found nothing have an open mark. Raises ValueError without finite times.
    """
    good = [r for r in rows if np.isfinite(r.seconds) and r.case.rpartition("-")[2].isdigit()]
    if not good:
        raise ValueError("There is no finite time to draw.")
    series = []
    for tool in dict.fromkeys(r.tool for r in good):
        mine = [r for r in good if r.tool == tool]
        size = tuple(float(r.case.rpartition("-")[2]) for r in mine)
        failed = tuple(r.verdict.startswith(("falls", "timeout", "failed")) for r in mine)
        series.append(Series(tool, size, tuple(max(r.seconds, 1e-6) for r in mine), failed))
    return stand_alone(chart(title, series, Axis(across, log=True), Axis("CPU seconds", log=True)))
