"""Loads in a picture: arrows that end where they act, each load with its name and size beside the first of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mocca_robot.actions import Action, BodyAcceleration, SupportMove
from mocca_robot.arrays import Array
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report.drawing2d import View, arrow
from mocca_robot.report.load_words import load_size
from mocca_robot.report.markup import esc, px
from mocca_robot.statics.applied import applied_forces

REACH = 0.1
"""Length of the arrows, as a share of the assembly's size; how large a load is, its label says."""
CELL = 0.1
"""Width of the pieces into which lines and pressed faces are cut, as a share of the size: one arrow each, none nearer
to another than half of it."""
MOST = 60
"""Arrows of one load; of more only the largest forces are drawn."""
LINE_PX, GLYPH_PX, BESIDE_PX = 13.0, 6.8, 5.0
"""Height of a line of text, width of a letter, and distance from the arrow, in pixels."""


def loads_layer(graph: PartsGraph, view: View, axes: Array | None = None) -> str:
    """Return the loads of an assembly as arrows with their sizes; `axes` (3, 3) is the camera of a solid one."""
    drawn: list[str] = []
    taken: list[tuple[float, float]] = []
    for action in graph.assembly.actions:
        words = f"{action.name}: {load_size(action)}"
        tails = []
        for start, end in _arrows(graph, action):
            a, b = view(np.array([start, end]) if axes is None else np.array([start, end]) @ axes[:2].T)
            drawn.append(arrow(a, b, "load", words))
            tails.append(a)
        if tails:
            drawn.append(_label(words, min(tails, key=lambda p: (p[1], p[0])), view, taken))
    return f'<g class="layer loads">{"".join(drawn)}</g>' if drawn else ""


def _arrows(graph: PartsGraph, action: Action) -> Iterator[tuple[Array, Array]]:
    """Yield start and end (d,) of every arrow of a load, in the world."""
    assembly = graph.assembly
    length = REACH * assembly.size
    if isinstance(action, SupportMove):
        if action.shift.any():
            centre = assembly.parts[assembly.index(action.part)].centroid
            yield centre, centre + length * action.shift / np.linalg.norm(action.shift)
        return
    if isinstance(action, BodyAcceleration):
        masses = np.array([p.mass for p in assembly.parts])
        centre = np.average([p.centroid for p in assembly.parts], axis=0, weights=masses)
        yield centre, centre + length * action.acceleration / np.linalg.norm(action.acceleration)
        return
    found = applied_forces(graph, action, CELL * assembly.size)
    ends: list[Array] = []
    for _, force, point in sorted(found, key=lambda f: -float(np.linalg.norm(f[1]))):
        apart = min((float(np.linalg.norm(point - end)) for end in ends), default=np.inf)
        if force.any() and apart > 0.5 * CELL * assembly.size and len(ends) < MOST:
            ends.append(point)
            yield point - length * force / np.linalg.norm(force), point


def _label(words: str, tail: Array, view: View, taken: list[tuple[float, float]]) -> str:
    """Return a text beside an arrow's tail, within the picture, and on no other label."""
    width = GLYPH_PX * len(words)
    x = float(np.clip(tail[0] + BESIDE_PX, 2.0, max(2.0, view.width - width)))
    y = float(np.clip(tail[1] - BESIDE_PX, LINE_PX, view.height - 2.0))
    while any(abs(y - other) < LINE_PX and abs(x - start) < width for start, other in taken):
        y += LINE_PX
    taken.append((x, y))
    return f'<text class="load-size" x="{px(x)}" y="{px(y)}" font-size="11">{esc(words)}</text>'
