"""The sequence player: every state of the assembly, with the part on its way in and the verdict on each state."""

from __future__ import annotations

import numpy as np

from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.report import drawing2d
from mocca_robot.report.data import ReportData
from mocca_robot.report.film import films
from mocca_robot.report.findings import State, states
from mocca_robot.report.markup import badge, esc, listed, px, script_json, table
from mocca_robot.report.palette import fills, part_colours
from mocca_robot.report.scene3d import scene
from mocca_robot.report.sections import section

APPROACH = 0.35
"""A part starts its way in this share of the assembly's size before its place."""


def sequence(data: ReportData) -> str:
    """Return the player and, for readers without a script, the table of all states."""
    found = states(data)
    assembly = data.design.assembly
    fixed = int(assembly.fixed.sum())
    steps = [{"title": f"{fixed} fixed part{'s' if fixed != 1 else ''} on the ground", "html": ""}]
    steps += [{"title": f"{k + 1}. {s.part}", "html": _verdict(s)} for k, s in enumerate(found)]
    flat = assembly.dimension == 2
    stage = _stage_2d(data, found) if flat else _stage_3d(data, found)
    count = len(found)
    slider = (
        f'<input type="range" id="time" min="0" max="{count}" step="0.02" value="{count}" aria-label="Assembly step"/>'
    )
    controls = (
        '<div class="controls needs-script"><button type="button" id="play">▶ Play</button>'
        '<button type="button" id="back" aria-label="One step back">◀</button>'
        f'<button type="button" id="forward" aria-label="One step forward">▶</button>{slider}'
        '<button type="button" id="film" hidden="hidden">▶ What MuJoCo saw</button>'
        f'<span id="count" class="mute">{count} of {count}</span></div>'
    )
    panel = '<div class="verdict needs-script" id="verdict" aria-live="polite"></div>'
    player = f'<div class="player"><div>{stage}{controls}</div>{panel}</div>'
    payload = f'<script type="application/json" id="steps">{script_json(steps)}</script>'
    payload += f'<script type="application/json" id="films">{script_json(films(data, found))}</script>'
    return section("sequence", "Assembly, state by state", player + payload + _table(found))


def _statics(state: State) -> str:
    if state.statics is None:
        return badge("none", "not decided")
    return badge("ok", "stands") if state.statics else badge("bad", "falls")


def _physics(state: State) -> str:
    if state.physics is None:
        return badge("none", "not simulated")
    mark = badge("ok", "stands") if state.physics else badge("bad", "falls")
    rubs = state.seen.friction if state.seen else None
    return f"{mark} with friction {rubs:g}" if rubs else mark


def _remark(state: State) -> str:
    remarks = []
    if state.agree is False:
        remarks.append(badge("bad", "statics and physics disagree"))
    if state.needs_support:
        remarks.append(badge("warn", "needs support"))
    if state.moving:
        remarks.append(f"moves: {listed(state.moving, 6)}")
    return " ".join(remarks)


def _verdict(state: State) -> str:
    remark = _remark(state)
    return f"<dl><dt>Statics</dt><dd>{_statics(state)}</dd><dt>MuJoCo</dt><dd>{_physics(state)}</dd></dl>" + (
        f"<p>{remark}</p>" if remark else "<p>Every part stays where it is.</p>" if state.statics else ""
    )


def _table(found: tuple[State, ...]) -> str:
    rows = [
        [
            f'<button type="button" class="step" data-step="{k + 1}">{k + 1}</button>',
            f"<code>{esc(state.part)}</code>",
            _statics(state),
            _physics(state),
            _remark(state) or "–",
        ]
        for k, state in enumerate(found)
    ]
    head = ("Step", "Places", "Statics", "MuJoCo", "Remark")
    return f'<div class="steps">{table(head, rows, caption="Verdict on every state of the sequence")}</div>'


def _stage_2d(data: ReportData, found: tuple[State, ...]) -> str:
    assembly = data.design.assembly
    colours, classes = part_colours(data.after.graph), fills()
    ways = {i.part: np.asarray(i.direction) for i in data.design.insertion}
    travel = {name: -APPROACH * assembly.size * way for name, way in ways.items()}
    reached = [drawing2d.corners(assembly)]
    reached += [_outline(assembly, name) + shift for name, shift in travel.items()]
    view = drawing2d.view_of(np.concatenate(reached), 620.0, 0.03)
    drawn, order = [], {s.part: k for k, s in enumerate(found)}
    for k, part in enumerate(assembly.parts):
        assert isinstance(part.shape, Polygon)
        shift = travel.get(part.name, np.array([0.0, APPROACH * assembly.size])) * view.scale
        moving = (
            "" if part.fixed else f' data-step="{order[part.name]}" data-dx="{px(shift[0])}" data-dy="{px(-shift[1])}"'
        )
        name = drawing2d.label(part.name, part.shape, view)
        shape = f'<path class="part {classes[colours[k]]}" d="{drawing2d.path_of(part.shape, view)}"/>'
        x, y = view(part.centroid)[0]
        at = f'data-part="{k}" data-x="{px(x)}" data-y="{px(y)}"'
        drawn.append(f'<g class="piece" {at}{moving}>{shape}{name}</g>')
    for k, state in enumerate(found):
        if state.verdict is not None and state.verdict.moving:
            ghosts = drawing2d.collapse_layer(assembly, state.verdict, view)
            drawn.append(f'<g class="fails" data-step="{k + 1}" style="display:none">{ghosts}</g>')
    label = f"Assembly sequence of {assembly.name}"
    drawing = view.svg("".join(drawn), label, "drawing")
    return f'<div class="stage" id="stage2d" data-scale="{view.scale:.6g}">{drawing}</div>'


def _outline(assembly: Assembly, name: str) -> np.ndarray:
    shape = assembly.parts[assembly.index(name)].shape
    assert isinstance(shape, Polygon)
    return shape.exterior


def _stage_3d(data: ReportData, found: tuple[State, ...]) -> str:
    boxes = (("names", "names"), ("cones", "cones"), ("forces", "forces"), ("collapse", "collapse motion"))
    toggles = "".join(
        f'<label><input type="checkbox" class="scene-toggle" data-show="{key}"/>{words}</label>' for key, words in boxes
    )
    which = "".join(
        f'<label><input type="radio" name="which" value="{value}"{checked}/>{value}</label>'
        for value, checked in (("result", ' checked="checked"'), ("input", ""))
    )
    explode = '<label>exploded <input type="range" id="explode" min="0" max="1" step="0.01" value="0"/></label>'
    fallback = f"Interactive 3D view of {esc(data.design.assembly.name)}; drag to turn, wheel to zoom."
    return (
        f'<div class="stage" id="stage3d"><canvas id="view" tabindex="0" role="img" aria-label="{fallback}"></canvas>'
        '<div id="tags" aria-hidden="true"></div></div>'
        f'<div class="controls needs-script">{which}{toggles}{explode}</div>'
        f'<script type="application/json" id="scene">{script_json(scene(data, found, APPROACH))}</script>'
    )
