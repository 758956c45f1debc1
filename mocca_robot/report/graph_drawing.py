"""The parts-graph drawn: parts in sequence on a line, an arc for every pair that touches; as SVG, and as DOT."""

from __future__ import annotations

from collections import Counter

import numpy as np

from mocca_robot.motion.parts_graph import Meeting, PartsGraph
from mocca_robot.report.markup import degrees, esc, plural, px
from mocca_robot.report.palette import FIXED, LIGHT, part_colours

STROKES = {"planar": "#8a94a3", "n": "#0b62a4", "z": "#c2410c", "bicubic": "#0b62a4", "tenon": "#7a5195"}
OTHER, SEVERAL = "#2e7d32", "#b0126b"
NAMED = 40
"""Up to so many parts are drawn with their names; more only with their numbers."""
BOX, RISE, HIGHEST = 22.0, 0.55, 280.0
"""Height of a part's box, px; rise of an arc as a share of half its span, and of the highest arc at most, px."""


def kinds(meeting: Meeting) -> str:
    """Return the kinds of a pair's joints in words, such as '2 × n, planar'."""
    counted = Counter(joint.kind for joint in meeting.joints)
    return ", ".join(kind if count == 1 else f"{count} × {kind}" for kind, count in counted.items())


def graph_svg(graph: PartsGraph) -> str:
    """Return the graph as an SVG that stands alone: an arc leads from each part to the neighbours placed before it."""
    parts = graph.assembly.parts
    order = sorted(graph.there)
    labels = {p: f"{p + 1} {parts[p].name}" if len(order) <= NAMED else str(p + 1) for p in order}
    widths = {p: _width(labels[p]) for p in order}
    starts = np.cumsum([16.0, *(widths[p] + 18.0 for p in order)])
    middle = {p: float(s) + 0.5 * widths[p] for p, s in zip(order, starts)}
    spans = [middle[m.later] - middle[m.earlier] for m in graph.meetings]
    longest = 0.5 * max(spans, default=1.0)
    rise = min(RISE, HIGHEST / longest)
    line = 34.0 + rise * longest
    used = dict.fromkeys(_stroke_of(m)[0] for m in graph.meetings)
    width = max(float(starts[-1]), 16.0 + 130.0 * len(used))
    drawn = [_arc(graph, m, middle, line, rise) for m in sorted(graph.meetings, key=lambda m: m.earlier - m.later)]
    fills = [FIXED if c < 0 else LIGHT[c] for c in part_colours(graph)]
    drawn += [_box(graph, p, labels[p], fills[p], middle[p], line) for p in order]
    for k, kind in enumerate(used):
        x, y = 16.0 + 130.0 * k, line + BOX + 26.0
        stroke = STROKES.get(kind, SEVERAL if kind == "several kinds" else OTHER)
        drawn.append(f'<path d="M {px(x)} {px(y)} h 24" stroke="{stroke}"{_dashes(kind)} stroke-width="2"/>')
        drawn.append(f'<text x="{px(x + 30.0)}" y="{px(y + 4.0)}">{esc(kind)}</text>')
    height = line + BOX + 42.0
    title = f"Parts-graph of {graph.assembly.name}: {plural(len(order), 'part')}, {plural(len(spans), 'pair')}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {px(width)} {px(height)}" width="{px(width)}" '
        f'height="{px(height)}" role="img" font-family="sans-serif" font-size="12" fill="#1f2933">'
        f"<title>{esc(title)}</title>{''.join(drawn)}</svg>\n"
    )


def _stroke_of(meeting: Meeting) -> tuple[str, str]:
    found = {joint.kind for joint in meeting.joints}
    curved = sorted(found - {"planar"}) or ["planar"]
    if len(curved) > 1:
        return "several kinds", SEVERAL
    return curved[0], STROKES.get(curved[0], OTHER)


def _dashes(kind: str) -> str:
    return ' stroke-dasharray="4 3"' if kind == "planar" else ""


def _arc(graph: PartsGraph, meeting: Meeting, middle: dict[int, float], line: float, rise: float) -> str:
    """Return the arc from the later part to the earlier one, which its head points at."""
    start, end = middle[meeting.later], middle[meeting.earlier]
    reach = 0.5 * (start - end)
    kind, stroke = _stroke_of(meeting)
    names = (graph.assembly.parts[p].name for p in (meeting.later, meeting.earlier))
    title = f"{' → '.join(names)}: {kinds(meeting)}"
    path = f"M {px(start)} {px(line)} A {px(reach)} {px(rise * reach)} 0 0 0 {px(end)} {px(line)}"
    head = f"M {px(end - 3.5)} {px(line - 8.0)} L {px(end)} {px(line)} L {px(end + 3.5)} {px(line - 8.0)} Z"
    return (
        f'<g><title>{esc(title)}</title><path d="{path}" fill="none" stroke="{stroke}" stroke-width="1.8"'
        f'{_dashes(kind)}/><path d="{head}" fill="{stroke}"/></g>'
    )


def _width(label: str) -> float:
    return 7.0 * len(label) + 14.0


def _box(graph: PartsGraph, part: int, label: str, fill: str, middle: float, line: float) -> str:
    node, width = graph.placed(part), _width(label)
    title = f"{node.part.name}: fixed"
    if not node.part.fixed:
        way = ", ".join(f"{v:+.2f}" for v in np.round(node.direction, 2) + 0.0)
        room = degrees(max(node.motion.alpha_rad, 0.0))
        title = f"{node.part.name}: goes in along ({way}); its widest cone is ±{room}"
    return (
        f'<g><title>{esc(title)}</title><rect x="{px(middle - 0.5 * width)}" y="{px(line)}" width="{px(width)}" '
        f'height="{px(BOX)}" rx="4" fill="{fill}" stroke="#52606d"/>'
        f'<text x="{px(middle)}" y="{px(line + 15.0)}" text-anchor="middle">{esc(label)}</text></g>'
    )


def graph_dot(graph: PartsGraph) -> str:
    """Return the graph in Graphviz' DOT language: nodes in sequence with α of their widest cone, edges with kinds."""
    lines = [f"digraph {_quoted(graph.assembly.name)} {{", "  rankdir=BT;", "  node [shape=box, style=rounded];"]
    for part in sorted(graph.there):
        node = graph.placed(part)
        told = "fixed" if node.part.fixed else f"±{degrees(max(node.motion.alpha_rad, 0.0))}"
        style = ', style="rounded,filled", fillcolor=lightgrey' if node.part.fixed else ""
        label = _quoted(f"{part + 1} {node.part.name}\n{told}")
        lines.append(f"  {part + 1} [label={label}{style}];")
    for meeting in graph.meetings:
        style = ", style=dashed" if _stroke_of(meeting)[0] == "planar" else ""
        lines.append(f"  {meeting.later + 1} -> {meeting.earlier + 1} [label={_quoted(kinds(meeting))}{style}];")
    return "\n".join([*lines, "}"]) + "\n"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
