"""Vector figures that stand alone, for documents and papers: every SVG carries its own style and needs no page."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocca_robot.errors import InputError
from mocca_robot.files.output import write_atomic
from mocca_robot.report import pictures
from mocca_robot.report.animation import Shot, film
from mocca_robot.report.data import ReportData
from mocca_robot.report.markup import asset, esc, px
from mocca_robot.report.palette import part_colours
from mocca_robot.report.pictures import HATCH, Picture
from mocca_robot.report.summary import asked_tilt
from mocca_robot.report.tilt_plots import TiltSeries, tilt_plot
from mocca_robot.report.typeset import write_png


def design_figure(data: ReportData) -> str:
    """Return input and result side by side as one SVG: collapse motion where it falls, contact forces where not."""
    source, built = data.design.source, data.design.assembly
    colours = part_colours(data.after.graph)
    view = pictures.shared_view([source, built], 420.0)
    joints = data.design.joints if built.dimension == 2 else ()
    left = Picture(graph=data.before.graph, colours=colours, cases=data.before.cases[:1], names=False)
    right = Picture(
        graph=data.after.graph,
        colours=colours,
        cases=data.after.cases[:1],
        joints=joints,
        names=False,
    )
    drawn = [pictures.draw(left, view, "input"), pictures.draw(right, view, "result")]
    return beside(drawn, ["input", "result"], view.width, view.height, built.name)


def collapse_figure(data: ReportData) -> str:
    """Return the input with the collapse motion of its worst load case as SVG; without ghosts where it stands."""
    source = data.design.source
    view = pictures.shared_view([source], 420.0)
    cases = sorted(data.before.cases, key=lambda c: -float(np.nan_to_num(c.result.infeasibility)))[:1]
    colours = part_colours(data.before.graph)
    picture = Picture(graph=data.before.graph, colours=colours, cases=cases)
    return stand_alone(pictures.draw(picture, view, f"{source.name}: collapse motion"))


def cones_figure(data: ReportData) -> str:
    """Return a flat result with its parts' motion cones and insertion directions as SVG."""
    built = data.design.assembly
    view = pictures.shared_view([built], 420.0)
    colours = part_colours(data.after.graph)
    picture = Picture(graph=data.after.graph, colours=colours, insertions=data.design.insertion, names=False)
    return stand_alone(pictures.draw(picture, view, f"{built.name}: motion cones"))


def film_figure(data: ReportData) -> str:
    """Return a flat result as an animated SVG: put together in sequence, with the verdict of statics at the end."""
    built = data.design.assembly
    ways = {i.part: i.direction for i in data.design.insertion}
    stands = all(c.result.stands for c in data.after.cases if c.case.gravity is not None)
    shot = Shot(assembly=built, title=built.name, ways=ways, stands=stands)
    return stand_alone(film([shot], part_colours(data.after.graph), 420.0))


def tilt_figure(data: ReportData) -> str | None:
    """Return the critical tilt, statics beside physics, as SVG; None when none was computed."""
    mu = data.design.judged_friction
    series = []
    if mine := [t for t in data.tilts if t.friction == mu]:
        azimuths, angles = tuple(t.azimuth_rad for t in mine), tuple(t.after_rad for t in mine)
        series.append(TiltSeries("statics", "statics", azimuths, angles))
    if found := [t for t in data.simulation.tilt if t.friction == mu] if data.simulation else []:
        azimuths, angles = tuple(t.azimuth_rad for t in found), tuple(t.critical_rad for t in found)
        series.append(TiltSeries("friction engine" if mu else "MuJoCo", "physics", azimuths, angles))
    if not series:
        return None
    return stand_alone(tilt_plot(series, data.design.assembly.dimension, asked_tilt(data)))


def write_figures(folder: Path, data: ReportData) -> tuple[Path, ...]:
    """Return the SVG files written to `folder`: design, collapse, in 2D cones and film, and tilt where it is known."""
    drawn = {"design.svg": design_figure(data), "collapse.svg": collapse_figure(data)}
    if data.design.assembly.dimension == 2:
        drawn["cones.svg"] = cones_figure(data)
        drawn["film.svg"] = film_figure(data)
    if (tilt := tilt_figure(data)) is not None:
        drawn["tilt.svg"] = tilt
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in drawn.items():
        (folder / name).write_text(text, encoding="utf-8")
    return tuple(folder / name for name in drawn)


def write_picture(svg: str, path: str | Path) -> Path:
    """Return `path` after writing a stand-alone SVG there, as .svg or .png. Raises InputError for other endings."""
    target = Path(path)
    if target.suffix.lower() == ".png":
        return write_png(svg, target)
    if target.suffix.lower() != ".svg":
        raise InputError(f"'{target}' ends in '{target.suffix}'; a picture is an .svg or a .png.")
    return write_atomic(target, svg)


def beside(drawings: Sequence[str], titles: Sequence[str], width: float, height: float, label: str) -> str:
    """Return several drawings of one size next to each other, each under its title, as one SVG."""
    gap, head = 16.0, 22.0
    total = len(drawings) * (width + gap) - gap
    body = []
    for k, (drawn, title) in enumerate(zip(drawings, titles, strict=True)):
        x = k * (width + gap)
        text = f'<text class="value" text-anchor="middle" x="{px(x + width / 2)}" y="15">{esc(title)}</text>'
        body.append(f'{text}<g transform="translate({px(x)} {px(head)})">{drawn}</g>')
    size = f'viewBox="0 0 {px(total)} {px(height + head)}" width="{px(total)}" height="{px(height + head)}"'
    return stand_alone(
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{esc(label)}" {size}>{"".join(body)}</svg>'
    )


def stand_alone(svg: str) -> str:
    """Return `svg` with the drawing style (light theme, colours written out) and the hatching inside."""
    head = svg.index(">") + 1
    return f"{svg[:head]}<style>{_plain_style()}</style><defs>{HATCH}</defs>{svg[head:]}\n"


def _plain_style() -> str:
    """Vector editors know no CSS variables: write the light theme's values out."""
    root = asset("style.css").split("}", 1)[0]
    values = dict(re.findall(r"--([\w-]+):([^;}]+)", root))
    return re.sub(r"var\(--([\w-]+)\)", lambda m: values[m.group(1)], asset("drawing.css"))
