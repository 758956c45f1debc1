"""Figures over a parameter: well-formed whatever they are given, true to scale, told apart without colour."""

from __future__ import annotations

import itertools
import math
import re
import xml.etree.ElementTree as ET

import pytest

from mocca_robot.report.charts import DASHES, STYLES, Axis, Series, chart, fitted_exponent
from mocca_robot.report.figures import stand_alone

SVG = "{http://www.w3.org/2000/svg}"


def marks(svg: str) -> list[ET.Element]:
    return [e for e in ET.fromstring(svg).iter() if "mark" in (e.get("class") or "")]


def places(svg: str) -> list[tuple[float, float]]:
    """Return the centres of the round marks inside the axes."""
    return [(float(e.get("cx", 0)), float(e.get("cy", 0))) for e in marks(svg) if float(e.get("cx", 0)) < 401]


def test_equal_factors_are_equal_steps_on_logarithmic_axes() -> None:
    svg = chart("t", [Series("", (1, 10, 100, 1000), (2, 20, 200, 2000))], Axis("n", log=True), Axis("s", log=True))
    xs, ys = zip(*places(svg))
    steps = [b - a for a, b in itertools.pairwise(xs)]
    rises = [a - b for a, b in itertools.pairwise(ys)]
    assert steps == pytest.approx([steps[0]] * 3, abs=0.02) and steps[0] > 0
    assert rises == pytest.approx([rises[0]] * 3, abs=0.02) and rises[0] > 0


def test_numbers_that_an_axis_cannot_show_are_left_out() -> None:
    series = [Series("", (0, 1, 2, 3, 4), (1, -1, 0, math.nan, 5))]
    assert len(places(chart("t", series, Axis("x"), Axis("y", log=True)))) == 2
    assert len(places(chart("t", series, Axis("x", log=True), Axis("y", log=True)))) == 1
    assert "There is no number to show." in chart("t", [Series("", (1,), (math.inf,))], Axis("x"), Axis("y"))


def test_failed_points_are_open_and_leave_the_line() -> None:
    svg = chart("t", [Series("", (1, 2, 3), (1, 5, 1), (False, True, False))], Axis("x"), Axis("y"))
    assert sum("open" in (m.get("class") or "") for m in marks(svg)) == 1
    line = next(e for e in ET.fromstring(svg).iter() if "series" in (e.get("class") or ""))
    assert (line.get("d") or "").count("L") == 1


def test_series_differ_without_colour() -> None:
    series = [Series(f"s{k}", (1, 2), (k, k + 1)) for k in range(STYLES)]
    root = ET.fromstring(chart("t", series, Axis("x"), Axis("y")))
    lines = [e for e in root.iter() if "series" in (e.get("class") or "")]
    assert {line.get("stroke-dasharray") or "" for line in lines} == set(DASHES)
    shapes = {re.sub(r"^M[\d. -]+", "", m.get("d") or "circle") for m in marks(ET.tostring(root, encoding="unicode"))}
    assert len(shapes) == STYLES


def test_a_figure_that_stands_alone_needs_no_variables_and_no_names_get_out() -> None:
    whole = stand_alone(chart("a < b & c", [Series("<i>", (1, 2), (1, 2))], Axis("x"), Axis("y"), "k & l"))
    assert "var(" not in whole
    assert ET.fromstring(whole).tag == f"{SVG}svg"


def test_categories_stand_at_their_names() -> None:
    svg = chart("t", [Series("", (0, 1), (1, 2), joined=False)], Axis("x", categories=("a", "b")), Axis("y"))
    texts = {e.text: e for e in ET.fromstring(svg).iter(f"{SVG}text")}
    for (x, _), name in zip(places(svg), "ab"):
        assert float(texts[name].get("x", 0)) == pytest.approx(x, abs=0.02)


def test_the_exponent_of_a_power_law_is_found() -> None:
    x = (50, 100, 200, 2000)
    assert fitted_exponent(x, [3.0 * n**1.37 for n in x]) == pytest.approx((1.37, 3.0))
    with pytest.raises(ValueError, match="two points"):
        fitted_exponent((2, 2), (1, 3))
