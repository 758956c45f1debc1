"""What physics measured beside what statics and geometry say: critical tilts and insertions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mocca_robot.report.cone_plots import direction_map
from mocca_robot.report.data import ReportData
from mocca_robot.report.markup import badge, degrees, esc, listed, significant, table
from mocca_robot.report.sections import section
from mocca_robot.report.summary import asked_tilt
from mocca_robot.report.tilt_plots import TiltSeries, tilt_plot
from mocca_robot.verdicts.agreement import towards
from mocca_robot.verdicts.physics import PartInsertion, Tries


def tilt(data: ReportData) -> str:
    """Return the critical tilt by statics beside that in physics: a plot per friction coefficient, and a table."""
    simulated = data.simulation.tilt if data.simulation else ()
    if not data.tilts and not simulated:
        return ""
    dimension = data.design.assembly.dimension
    frictions = sorted({t.friction for t in data.tilts} | {t.friction for t in simulated})
    figures, rows = [], []
    for mu in frictions:
        mine = [t for t in data.tilts if t.friction == mu]
        theirs = [t for t in simulated if t.friction == mu]
        series = []
        known = {round(float(np.rad2deg(t.azimuth_rad)), 6): t for t in mine}
        statics = {a: float(np.rad2deg(t.after_rad)) for a, t in known.items()}
        measured = {round(float(np.rad2deg(t.azimuth_rad)), 6): t for t in theirs}
        statics = {a: float(np.rad2deg(t.statics_rad)) for a, t in measured.items()} | statics
        physics = {a: float(np.rad2deg(t.critical_rad)) for a, t in measured.items()}
        inputs = {a: float(np.rad2deg(t.before_rad)) for a, t in known.items() if t.before_rad is not None}
        for name, style, values in (
            ("statics", "statics", statics),
            ("friction engine" if mu > 0.0 else "MuJoCo", "physics", physics),
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
            apart = "–" if b is None else f"{np.rad2deg(measured[azimuth].apart_rad):.2f}°"
            cells = ["–" if v is None else f"{v:.2f}°" for v in (inputs.get(azimuth), a, b)]
            rows.append([towards(float(np.deg2rad(azimuth)), dimension), f"{mu:g}", *cells, apart])
    head = ("Towards", "Friction", "Input, statics", "Statics", "Physics", "Apart, at most")
    words = (
        "<p>How far the ground can tilt before something moves: by statics, and in physics, which is MuJoCo without "
        "friction and an engine that does not lift what slides with it.</p>"
    )
    body = f'{words}<div class="figures">{"".join(figures)}</div>'
    return section("tilt", "Tilt", body + table(head, rows, caption="Critical tilt", numeric=(1, 2, 3, 4, 5)))


def insertion(data: ReportData) -> str:
    """Return how each part goes in: its cone by geometry, MuJoCo's trials, and in 3D the map of directions."""
    simulated = {e.part: e for e in data.simulation.insertion} if data.simulation else {}
    rows = []
    for verdict in data.after.insertions:
        entry = simulated.get(verdict.part)
        inside, outside = (entry.inside, entry.outside) if entry else (Tries.of(()), Tries.of(()))
        mark = badge("ok", "goes in") if verdict.assemblable else badge("bad", "blocked")
        rows.append(
            [
                f"<code>{esc(verdict.part)}</code>",
                mark,
                degrees(verdict.required_rad),
                degrees(verdict.alpha_rad),
                listed(verdict.blockers, 4) if verdict.blockers else "–",
                _share(inside),
                f"{significant(inside.peak_force, 2)} N" if entry else "–",
                f"{outside.succeeded} of {outside.trials}" if outside.trials else "–",
            ]
        )
    head = ("Part", "By geometry", "Asked ±", "Free ±", "Blockers", "MuJoCo inside", "Peak force", "Passed outside")
    words = (
        "<p>“Free” is the half-angle of the cone about the insertion direction along which the part meets nothing "
        "placed before it. Inside it every trial in MuJoCo should succeed; outside it none (negative control).</p>"
    )
    body = words + table(head, rows, caption="Insertion of every part", numeric=(2, 3, 6))
    return section("insertion", "Insertion", body + _maps(data, simulated))


def _share(tries: Tries) -> str:
    if not tries.trials:
        return "–"
    share = 100.0 * tries.succeeded / tries.trials
    return f'<span class="bar"><i style="width:{share:.0f}%"></i></span>{tries.succeeded} of {tries.trials}'


def _maps(data: ReportData, simulated: Mapping[str, PartInsertion]) -> str:
    assembly = data.design.assembly
    if assembly.dimension == 2:
        return ""
    drawn = []
    for item in data.design.insertion:
        entry = simulated.get(item.part)
        plot = direction_map(
            data.after.graph.motion(assembly.index(item.part)).normals,
            -np.asarray(item.direction),
            assembly.alpha_rad or 0.0,
            entry.trials if entry else (),
        )
        drawn.append(f"<figure>{plot}<figcaption>{esc(item.part)}</figcaption></figure>")
    words = "Directions around each part's way out: filled = free, ring = asked for, dots = trials, crosses = failed"
    opened = ' open="open"' if len(drawn) <= 24 else ""
    return f'<details{opened}><summary>{words}</summary><div class="minis">{"".join(drawn)}</div></details>'
