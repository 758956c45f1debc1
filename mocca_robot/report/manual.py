"""The assembly manual: one step per part with its way in drawn, what to hold, and the bill of parts; HTML and PDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh, Polygon
from mocca_robot.design import Insertion
from mocca_robot.fabrication.bill import bill, size
from mocca_robot.files.output import write_atomic
from mocca_robot.geometry.frames import tangents
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report import drawing2d, drawing3d, raster
from mocca_robot.report.builder_words import kilograms, way_words
from mocca_robot.report.drawing2d import View
from mocca_robot.report.figures import stand_alone
from mocca_robot.report.markup import asset, degrees, esc, plural, point_list, px, significant
from mocca_robot.report.typeset import write_pdf
from mocca_robot.statics.cases import CaseVerdict

PLACED, NEW = "#e3e7ec", "#ee8866"
TRAVEL = 0.22
"""How far in front of its seat a part is drawn, as a share of the assembly's size."""
HEAD = ("item", "how many", "no.", "parts", "size, mm", "density, kg/m³", "mass, kg")
BLOCKED = "No free direction was found for it: build another sequence, or see the report."
TEMPLATE = "manual.typ"


@dataclass(frozen=True)
class ManualStep:
    """One part: its number in the sequence, its name, a picture (SVG that stands alone), what to do in sentences."""

    number: int
    part: str
    picture: str
    words: tuple[str, ...]


@dataclass(frozen=True)
class Manual:
    """What a manual holds: title, opening lines, pictures of the ground and of the whole, and the steps."""

    title: str
    lead: tuple[str, ...]
    overview: tuple[str, ...]
    steps: tuple[ManualStep, ...]
    rows: tuple[tuple[str, ...], ...]


def manual(graph: PartsGraph, ways: Sequence[Insertion], states: Sequence[CaseVerdict]) -> Manual:
    """Return the manual of an assembly in the order of its sequence.

    The graph tells what a part comes to touch, `ways` how each free part goes in, `states` (one per free part, see
    `state_cases`) what falls meanwhile and has to be held.
    """
    assembly = graph.assembly
    by_part = {w.part: w for w in ways}
    falls = {s.case.name.removeprefix("state_"): s for s in states}
    view = _view(assembly, by_part)
    ground = [k for k, p in enumerate(assembly.parts) if p.fixed]
    steps = []
    for k in graph.free:
        part = assembly.parts[k]
        way = by_part.get(part.name)
        touches = graph.neighbours_before(k)
        words = _words(assembly, k, way, touches, falls.get(part.name), last=k == graph.free[-1])
        label = f"step {k + 1}: {part.name}"
        steps.append(
            ManualStep(k + 1, part.name, _picture(assembly, list(range(k)), k, way, view, label), tuple(words))
        )
    names = ", ".join(assembly.parts[k].name for k in ground)
    mass = sum(p.mass for p in assembly.parts)
    lead = (
        *_warnings(graph, by_part, states),
        f"{len(assembly.parts)} parts, {kilograms(mass)} in all. Place first, fixed to the ground: {names}.",
        "Every other part follows in the order of its number. The arrow is the way it goes in; any direction inside "
        "the wedge or cone around it will do.",
    )
    overview = (
        _picture(assembly, ground, None, None, view, "what stands on the ground"),
        _picture(assembly, list(range(len(assembly.parts))), None, None, view, "the finished structure"),
    )
    return Manual(assembly.name, lead, overview, tuple(steps), _rows(assembly))


def _warnings(graph: PartsGraph, ways: Mapping[str, Insertion], states: Sequence[CaseVerdict]) -> list[str]:
    """Return what somebody has to know before the first step: whether it stands in the end, and who cannot go in."""
    names = [graph.assembly.parts[k].name for k in graph.free]
    blocked = [name for name in names if name not in ways or ways[name].alpha_rad < 0]
    out = []
    if states and states[-1].moving:
        moving = ", ".join(states[-1].moving)
        out.append(f"Warning: this structure does not stand by itself. Without support {moving} would fall.")
    if blocked:
        out.append(f"Warning: no free way in was found for {', '.join(blocked)}.")
    held = sum(1 for state in states[:-1] if state.moving)
    if held:
        out.append(f"In {plural(held, 'step')} of {len(states)} parts have to be held; the step says which.")
    return out


def _words(
    assembly: Assembly, index: int, way: Insertion | None, touches: Sequence[int], state: CaseVerdict | None, last: bool
) -> list[str]:
    part = assembly.parts[index]
    edges = " × ".join(f"{v * 1e3:.4g}" for v in size(part))
    out = [f"{edges} mm, {kilograms(part.mass)}."]
    if way is None or way.alpha_rad < 0:
        out.append(BLOCKED)
    else:
        numbers = ", ".join(f"{v:+.2f}" for v in np.round(way.direction, 2) + 0.0)
        out.append(f"Goes in {way_words(way.direction)} (direction {numbers}), up to {degrees(way.alpha_rad)} off.")
    if touches:
        out.append(f"Comes to touch {', '.join(assembly.parts[k].name for k in touches)}.")
    if state is not None and state.moving:
        rest = "it does not stand by itself" if last else "until further parts hold them"
        out.append(f"Hold {', '.join(state.moving)}: {rest}.")
    return out


def _rows(assembly: Assembly) -> tuple[tuple[str, ...], ...]:
    rows = []
    for number, item in enumerate(bill(assembly), 1):
        edges = " × ".join(f"{v * 1e3:.4g}" for v in item.size_m)
        numbers = ", ".join(map(str, item.numbers))
        names = ", ".join(item.names) + (" (fixed)" if item.fixed else "")
        mass = significant(item.mass_kg, 4)
        rows.append((str(number), str(len(item.names)), numbers, names, edges, f"{item.density:g}", mass))
    return tuple(rows)


def _view(assembly: Assembly, ways: Mapping[str, Insertion]) -> View:
    points = [drawing2d.corners(assembly)]
    for part in assembly.parts:
        if part.name in ways:
            away = -TRAVEL * assembly.size * np.asarray(ways[part.name].direction)
            mine = part.shape.exterior if isinstance(part.shape, Polygon) else part.shape.vertices
            points.append(mine + away)
    flat = np.concatenate(points)
    return drawing2d.view_of(flat if flat.shape[1] == 2 else flat @ drawing3d.camera()[:2].T, 380.0, 0.04)


def _picture(
    assembly: Assembly, placed: Sequence[int], new: int | None, way: Insertion | None, view: View, label: str
) -> str:
    away = np.zeros(assembly.dimension)
    if way is not None:
        away = -TRAVEL * assembly.size * np.asarray(way.direction)
    draw = _flat if assembly.dimension == 2 else _solid
    layers = [draw(assembly, placed, new, away, view)]
    if new is not None and way is not None:
        seat = np.asarray(assembly.parts[new].centroid)
        layers += [_cone(seat, way, assembly.size, view)] if way.alpha_rad > 0 else []
        start, end = view(_plane(np.array([seat + away, seat])))
        layers.append(drawing2d.arrow(start, end, "way-in", f"{way.part} goes in this way"))
    return stand_alone(view.svg("\n".join(layers), label))


def _flat(assembly: Assembly, placed: Sequence[int], new: int | None, away: Array, view: View) -> str:
    drawn = []
    for k in placed:
        shape = assembly.parts[k].shape
        assert isinstance(shape, Polygon)
        style = "" if assembly.parts[k].fixed else f' style="fill:{PLACED}"'
        cls = "part fixed" if assembly.parts[k].fixed else "part"
        drawn.append(f'<path class="{cls}"{style} d="{drawing2d.path_of(shape, view)}"/>')
    if new is not None:
        shape = assembly.parts[new].shape
        assert isinstance(shape, Polygon)
        moved = Polygon(shape.exterior + away, tuple(h + away for h in shape.holes), shape.thickness)
        drawn.append(f'<path class="ghost" d="{drawing2d.path_of(shape, view)}"/>')
        drawn.append(f'<path class="part" style="fill:{NEW}" d="{drawing2d.path_of(moved, view)}"/>')
    return "\n".join(drawn)


def _solid(assembly: Assembly, placed: Sequence[int], new: int | None, away: Array, view: View) -> str:
    chosen = [*placed, *([] if new is None else [new])]
    if not chosen:
        return ""
    meshes = []
    for k in chosen:
        shape = assembly.parts[k].shape
        assert isinstance(shape, Mesh)
        meshes.append(Mesh(shape.vertices + away, shape.faces) if k == new else shape)
    scale = drawing3d.DENSITY * drawing3d.FINER
    extent = round(view.width * scale), round(view.height * scale)
    seen = raster.look(meshes, drawing3d.camera(), view.scale * scale, view.low, *extent)
    fills = [NEW if k == new else PLACED for k in chosen]
    pixels = raster.painted(seen, fills, [assembly.parts[k].fixed for k in chosen], drawing3d.FINER)
    across, down = (px(n / drawing3d.DENSITY) for n in (pixels.shape[1], pixels.shape[0]))
    return f'<image x="0" y="0" width="{across}" height="{down}" href="{raster.data_uri(pixels)}"/>'


def _cone(seat: Array, way: Insertion, scale: float, view: View) -> str:
    """Return the cone of directions from which the part may come, as long as the arrow, its apex in the seat."""
    axis = -np.asarray(way.direction)
    alpha = min(way.alpha_rad, np.deg2rad(80.0))
    if len(axis) == 2:
        (side,) = tangents(axis)
        turns = np.linspace(-alpha, alpha, 25)
        rim = np.cos(turns)[:, None] * axis + np.sin(turns)[:, None] * side
    else:
        first, second = tangents(axis)
        turns = np.linspace(0.0, 2 * np.pi, 49)
        around = np.cos(turns)[:, None] * first + np.sin(turns)[:, None] * second
        rim = np.cos(alpha) * axis + np.sin(alpha) * around
    points = view(_plane(np.vstack([seat, seat + 0.8 * TRAVEL * scale * rim])))
    hull = shapely.convex_hull(shapely.MultiPoint(points))
    if hull.geom_type != "Polygon":
        return ""
    outline = np.asarray(hull.exterior.coords)[:-1]
    style = 'style="fill:#0b62a4;fill-opacity:.16;stroke:#0b62a4;stroke-width:.8"'
    return f'<polygon {style} points="{point_list(outline)}"/>'


def _plane(points: Array) -> Array:
    return points if points.shape[1] == 2 else points @ drawing3d.camera()[:2].T


def write_manual(what: Manual, path: Path) -> Path:
    """Return `path` after writing the manual there: .pdf through typst, anything else as one HTML page.

    Raises EnvironmentNeeded when typst is missing or the file cannot be written.
    """
    if path.suffix.lower() != ".pdf":
        return write_atomic(path, html(what))
    pictures = {f"overview_{k}.svg": p for k, p in enumerate(what.overview)}
    pictures |= {f"step_{s.number}.svg": s.picture for s in what.steps}
    data: dict[str, Any] = {
        "title": what.title,
        "lead": list(what.lead),
        "overview": [f"overview_{k}.svg" for k in range(len(what.overview))],
        "bill": {"head": list(HEAD), "rows": [list(r) for r in what.rows]},
        "steps": [
            {"number": str(s.number), "part": s.part, "words": list(s.words), "picture": f"step_{s.number}.svg"}
            for s in what.steps
        ],
    }
    return write_pdf(TEMPLATE, data, pictures, path)


def html(what: Manual) -> str:
    """Return the manual as one page that asks the network for nothing and breaks well on paper."""
    head = "".join(f"<th>{esc(h)}</th>" for h in HEAD)
    rows = "\n".join("<tr>" + "".join(f"<td>{esc(c)}</td>" for c in row) + "</tr>" for row in what.rows)
    steps = "\n".join(
        f'<section class="step"><div>{s.picture}</div><div><h2><b>{s.number}</b> {esc(s.part)}</h2>'
        + "".join(f"<p>{esc(w)}</p>" for w in s.words)
        + "</div></section>"
        for s in what.steps
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/>'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
        'img-src data:"/><meta name="viewport" content="width=device-width, initial-scale=1"/>'
        f"<title>{esc(what.title)}: assembly manual</title><style>{asset('manual.css')}</style></head>\n<body>"
        f"<h1>{esc(what.title)}</h1>\n{''.join(f'<p>{esc(line)}</p>' for line in what.lead)}\n"
        f'<div class="overview">{"".join(f"<div>{p}</div>" for p in what.overview)}</div>\n'
        f"<h2>Parts</h2>\n<table><thead><tr>{head}</tr></thead><tbody>\n{rows}\n</tbody></table>\n{steps}\n"
        "<footer>Made by mocca-robot.</footer></body></html>\n"
    )
