"""What MuJoCo measured beside what statics and geometry say: critical tilts and insertions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mocca_robot.report.cone_plots import direction_map
from mocca_robot.report.data import ReportData
from mocca_robot.report.drawing2d import way_out_normals
from mocca_robot.report.findings import entries
from mocca_robot.report.markup import badge, degrees, esc, listed, significant, table
from mocca_robot.report.sections import section
from mocca_robot.report.summary import asked_tilt
from mocca_robot.report.tilt_plots import TiltSeries, tilt_plot


def tilt(data: ReportData) -> str:
    """Return the critical tilt by statics beside MuJoCo's, one plot per friction coefficient, and their table."""
    simulated = entries(data, "tilt")
    if not data.tilts and not simulated:
        return ""
    dimension = data.design.assembly.dimension
    frictions = sorted({t.friction for t in data.tilts} | {float(t.get("friction") or 0.0) for t in simulated})
    figures, rows = [], []
    for mu in frictions:
        mine = [t for t in data.tilts if t.friction == mu]
        theirs = [t for t in simulated if float(t.get("friction") or 0.0) == mu]
        series = []
        known = {round(float(np.rad2deg(t.azimuth_rad)), 6): t for t in mine}
        statics = {a: float(np.rad2deg(t.after_rad)) for a, t in known.items()}
        physics: dict[float, float] = {}
        within: dict[float, float] = {}
        for entry in theirs:
            azimuth = round(float(entry.get("azimuth_deg") or 0.0), 6)
            if entry.get("statics_deg") is not None:
                statics.setdefault(azimuth, float(entry["statics_deg"]))
            if entry.get("critical_deg") is not None:
                physics[azimuth] = float(entry["critical_deg"])
                within[azimuth] = float(entry.get("within_deg") or 0.0)
        inputs = {a: float(np.rad2deg(t.before_rad)) for a, t in known.items() if t.before_rad is not None}
        for name, style, values in (
            ("statics", "statics", statics),
            ("MuJoCo", "physics", physics),
            ("input, statics", "input", inputs),
        ):
            if values and (style != "input" or max(values.values()) > 0.05):
                angles = tuple(float(np.deg2rad(v)) for v in values.values())
                series.append(TiltSeries(name, style, tuple(float(np.deg2rad(a)) for a in values), angles))
        if series:
            drawn = tilt_plot(series, dimension, asked_tilt(data))
            figures.append(f"<figure>{drawn}<figcaption>Friction coefficient {mu:g}.</figcaption></figure>")
        for azimuth in sorted({*statics, *physics}):
            a, b = statics.get(azimuth), physics.get(azimuth)
            apart = "–" if a is None or b is None else f"{abs(a - b) + within[azimuth]:.2f}°"
            cells = ["–" if v is None else f"{v:.2f}°" for v in (inputs.get(azimuth), a, b)]
            rows.append([_towards(azimuth, dimension), f"{mu:g}", *cells, apart])
    head = ("Towards", "Friction", "Input, statics", "Statics", "MuJoCo", "Apart, at most")
    words = "<p>How far the ground can tilt before something moves: by a linear program, and by letting MuJoCo go.</p>"
    body = f'{words}<div class="figures">{"".join(figures)}</div>'
    return section("tilt", "Tilt", body + table(head, rows, caption="Critical tilt", numeric=(1, 2, 3, 4, 5)))


def _towards(azimuth_deg: float, dimension: int) -> str:
    if dimension == 2:
        return "right" if np.cos(np.deg2rad(azimuth_deg)) >= 0 else "left"
    return f"{azimuth_deg:.0f}°"


def insertion(data: ReportData) -> str:
    """Return how each part goes in: its cone by geometry, MuJoCo's trials, and in 3D the map of directions."""
    simulated = {str(e.get("part")): e for e in entries(data, "insertion")}
    rows = []
    for verdict in data.after.insertions:
        entry = simulated.get(verdict.part, {})
        inside, outside = entry.get("inside") or {}, entry.get("outside") or {}
        mark = badge("ok", "goes in") if verdict.assemblable else badge("bad", "blocked")
        rows.append(
            [
                f"<code>{esc(verdict.part)}</code>",
                mark,
                degrees(verdict.required_rad),
                degrees(verdict.alpha_rad),
                listed(verdict.blockers, 4) if verdict.blockers else "–",
                _share(inside),
                f"{significant(float(inside['peak_force_n']), 2)} N" if inside.get("peak_force_n") is not None else "–",
                f"{outside.get('succeeded', 0)} of {outside['trials']}" if outside.get("trials") else "–",
            ]
        )
    head = ("Part", "By geometry", "Asked ±", "Free ±", "Blockers", "MuJoCo inside", "Peak force", "Passed outside")
    words = (
        "<p>“Free” is the half-angle of the cone about the insertion direction along which the part meets nothing "
        "placed before it. Inside it every trial in MuJoCo should succeed; outside it none (negative control).</p>"
    )
    body = words + table(head, rows, caption="Insertion of every part", numeric=(2, 3, 6))
    return section("insertion", "Insertion", body + _maps(data, simulated))


def _share(trials: Mapping[str, Any]) -> str:
    total = int(trials.get("trials", 0))
    if not total:
        return "–"
    share = 100.0 * int(trials.get("succeeded", 0)) / total
    return f'<span class="bar"><i style="width:{share:.0f}%"></i></span>{trials.get("succeeded", 0)} of {total}'


def _maps(data: ReportData, simulated: Mapping[str, Mapping[str, Any]]) -> str:
    assembly = data.design.assembly
    if assembly.dimension == 2:
        return ""
    normals = way_out_normals(assembly, data.after.contacts)
    drawn = []
    for item in data.design.insertion:
        trials = simulated.get(item.part, {}).get("trials")
        plot = direction_map(
            normals.get(assembly.index(item.part), np.zeros((0, 3))),
            -np.asarray(item.direction),
            assembly.alpha_rad or 0.0,
            trials if isinstance(trials, list) else (),
        )
        drawn.append(f"<figure>{plot}<figcaption>{esc(item.part)}</figcaption></figure>")
    words = "Directions around each part's way out: filled = free, ring = asked for, dots = trials, crosses = failed"
    opened = ' open="open"' if len(drawn) <= 24 else ""
    return f'<details{opened}><summary>{words}</summary><div class="minis">{"".join(drawn)}</div></details>'
