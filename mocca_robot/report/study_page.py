"""The page of a study: what was varied, how many points hold, figures over the first parameter, the whole table."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mocca_robot.files.output import write_atomic
from mocca_robot.report.charts import Axis, Series, chart
from mocca_robot.report.figures import stand_alone
from mocca_robot.report.markup import badge, esc, plural, significant, table
from mocca_robot.report.page import document
from mocca_robot.report.sections import section

FIGURES: tuple[tuple[str, str, bool], ...] = (
    ("infeasibility_before", "E/|w|² of the input", True),
    ("tilt_deg", "critical tilt by statics, degrees", False),
    ("mujoco_tilt_deg", "critical tilt in MuJoCo, degrees", False),
    ("narrowest_cone_deg", "narrowest insertion cone, degrees", False),
    ("curved_joints", "curved joints", False),
    ("cases_standing", "load cases in equilibrium", False),
    ("mujoco_states_standing", "states that stand in MuJoCo", False),
    ("seconds", "seconds per point", True),
)
"""Column, words, logarithmic: what is drawn where it is known and not the same everywhere."""
MARKS = {"holds": "ok", "unusable": "none", "failed": "warn", "not computed": "none"}


def study_figures(data: Mapping[str, Any]) -> dict[str, str]:
    """Return the figures of a study (the content of study.json) as SVG for a page, by column.

    Each is drawn over the first varied key, a line per combination of the others; points that do not hold stand alone,
    with open marks.
    """
    points: Sequence[Mapping[str, Any]] = data["points"]
    first, *others = data["vary"]
    across = _axis(first, data["vary"][first])
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for point in points:
        others_here = others if data["combine"] == "grid" else ()
        name = ", ".join(_text(point["values"][k]) for k in others_here)
        groups.setdefault(name, []).append(point)
    drawn = {}
    for column, words, log in FIGURES:
        known = [p.get(column) for p in points if _finite(p.get(column))]
        if len(set(known)) < 2:
            continue
        series = [_series(name, mine, first, column, across) for name, mine in groups.items()]
        key = ", ".join(others) if data["combine"] == "grid" else ""
        drawn[column] = chart(words[0].upper() + words[1:], series, across, Axis(words, log), key)
    return drawn


def write_study_page(folder: Path, data: Mapping[str, Any]) -> dict[str, Path]:
    """Return the page and figures of a study, written to `folder`: study.html and one SVG per figure."""
    drawn = study_figures(data)
    files = {name: write_atomic(folder / f"{name}.svg", stand_alone(svg)) for name, svg in drawn.items()}
    return {**files, "page": write_atomic(folder / "study.html", study_page(data, drawn))}


def study_page(data: Mapping[str, Any], drawn: Mapping[str, str]) -> str:
    """Return the page as one HTML document. Same data, same text."""
    points: Sequence[Mapping[str, Any]] = data["points"]
    counts: dict[str, int] = {}
    for point in points:
        counts[point["status"]] = counts.get(point["status"], 0) + 1
    told = " ".join(f"{badge(_mark(s), f'{n} {s}')}" for s, n in counts.items())
    vary = "; ".join(f"<code>{esc(k)}</code> over {plural(len(v), 'value')}" for k, v in data["vary"].items())
    note = "<p>The study was interrupted; the same command goes on from here.</p>" if data["interrupted"] else ""
    header = (
        f'<header class="top"><h1>{esc(data["name"])}</h1><p class="mute">A study of <code>{esc(data["base"])}</code>: '
        f"{vary}, {plural(len(points), 'point')}.</p><p>{told}</p>{note}</header>"
    )
    figures = "".join(f"<figure>{svg}</figure>" for svg in drawn.values())
    hint = '<p class="mute">Open marks: the point does not hold what is asked of it.</p>'
    body = section("figures", "Figures", f'<div class="figures">{figures}</div>{hint}') if drawn else ""
    body += section("points", "Points", _table(data))
    return document(str(data["name"]), header, body, [])


def _table(data: Mapping[str, Any]) -> str:
    points: Sequence[Mapping[str, Any]] = data["points"]
    keys = list(data["vary"])
    hidden = ("values", "status", "reason")
    names = list(dict.fromkeys(n for p in points for n in p if n not in hidden))
    rows = []
    for p in points:
        mark = badge(_mark(p["status"]), p["status"])
        cells = [esc(_text(p["values"][k])) for k in keys]
        figures = [_figure(p.get(n)) for n in names]
        rows.append(
            [
                *cells,
                mark,
                esc(p["reason"]),
                *figures,
                f"<details><summary>command</summary><code>{esc(_command(data, p))}</code></details>",
            ]
        )
    head = [*(esc(k) for k in keys), "verdict", "reason", *(esc(n.replace("_", " ")) for n in names), "by itself"]
    first = len(keys) + 2
    return table(head, rows, caption="Every point", numeric=range(first, first + len(names)))


def _command(data: Mapping[str, Any], point: Mapping[str, Any]) -> str:
    """Return the command that makes this point with all its files."""
    settings = {**data["set"], **point["values"]}
    options = " ".join(f"--set {shlex.quote(f'{k}={_yaml(v)}')}" for k, v in settings.items())
    what = "run" if "simulate" in data["stages"] else "design" if "design" in data["stages"] else "check"
    return f"mocca-robot {what} {shlex.quote(str(data['base']))} {options}"


def _yaml(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _series(name: str, points: Sequence[Mapping[str, Any]], first: str, column: str, across: Axis) -> Series:
    x, y, hollow = [], [], []
    for p in points:
        value = p["values"][first]
        x.append(float(across.categories.index(_text(value))) if across.categories else float(value))
        y.append(float(p[column]) if _finite(p.get(column)) else math.nan)
        hollow.append(p["status"] != "holds")
    return Series(name, tuple(x), tuple(y), tuple(hollow), joined=not across.categories)


def _axis(key: str, values: Sequence[Any]) -> Axis:
    """Return a numeric axis for numbers, logarithmic where they grow by factors; else one with their texts."""
    if not all(_finite(v) for v in values):
        return Axis(key, categories=tuple(dict.fromkeys(_text(v) for v in values)))
    low, high = min(values), max(values)
    return Axis(key, log=low > 0 and high / low >= 50)


def _finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _figure(value: Any) -> str:
    if value is None:
        return "–"
    return significant(float(value), 4) if _finite(value) else esc(value)


def _text(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _mark(status: str) -> str:
    return MARKS.get(status, "bad")
