"""Flat assemblies as films that need no player: one SVG in which the parts go in, are let go, and stay or fall."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.report import drawing2d
from mocca_robot.report.drawing2d import View
from mocca_robot.report.markup import esc, px
from mocca_robot.report.palette import fills
from mocca_robot.report.pictures import shared_view

STEP_S, PAUSE_S, HOLD_S, REST_S = 0.45, 0.7, 2.2, 1.0
"""Seconds per part on its way in, before the parts are let go, while they are free, and before it starts again."""
APPROACH = 0.3
"""A part starts its way in this share of the assembly's size before its place."""
INSTANTS = 14
"""Positions of each part on its way down."""
GAP, HEAD = 24.0, 30.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Shot:
    """One assembly of the film.

    Attributes:
        assembly, title: what is shown, and the words above it.
        ways: insertion direction per part; parts without one come from above.
        stands: the verdict that appears once the parts are let go; None when nobody gave one.
        falling: (T, F, 3) displacements x, y, turn of the parts `moving` once they are let go, as physics recorded
            them at even times; None when the assembly stays.
        moving: (F,) part indices.
    """

    assembly: Assembly
    title: str
    ways: Mapping[str, Array]
    stands: bool | None = None
    falling: Array | None = None
    moving: IntArray | None = None


def film(shots: Sequence[Shot], colours: Sequence[int], size_px: float = 340.0) -> str:
    """Return an SVG element (its style apart, see `figures.stand_alone`) that plays `shots` side by side for ever.

    Readers who ask for reduced motion see the finished assemblies.
    """
    view = shared_view([s.assembly for s in shots], size_px)
    free = max(int((~s.assembly.fixed).sum()) for s in shots)
    clock = _Clock(free)
    width = len(shots) * (view.width + GAP) + GAP
    height = view.height + HEAD + GAP
    body, rules = [], []
    for k, shot in enumerate(shots):
        x = GAP + k * (view.width + GAP)
        drawn, styles = _shot(shot, colours, view, clock, f"f{k}")
        rules.append(styles)
        clip = f'<clipPath id="clip{k}"><rect width="{px(view.width)}" height="{px(view.height)}"/></clipPath>'
        body.append(
            f'<g transform="translate({px(x)} {px(HEAD)})">{clip}<g clip-path="url(#clip{k})">{drawn}</g></g>'
            f'<text class="value" text-anchor="middle" x="{px(x + view.width / 2)}" y="24">{esc(shot.title)}'
            f"{_outcome(shot, f'f{k}')}</text>"
        )
    motion = "@media (prefers-reduced-motion:no-preference){" + "".join(rules) + clock.outcome() + "}"
    label = f"{shots[0].assembly.name}: " + ", ".join(s.title for s in shots)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{esc(label)}" '
        f'viewBox="0 0 {px(width)} {px(height)}" width="{px(width)}" height="{px(height)}"><style>{motion}</style>'
        f'<rect class="paper" rx="8" width="{px(width)}" height="{px(height)}"/>{"".join(body)}</svg>'
    )


class _Clock:
    """When what happens, as percentages of the film."""

    def __init__(self, free: int) -> None:
        self.build = free * STEP_S
        self.whole = self.build + PAUSE_S + HOLD_S + REST_S
        self.let_go = self.build + PAUSE_S
        self.down = self.let_go + HOLD_S

    def at(self, seconds: float) -> str:
        return f"{100.0 * seconds / self.whole:.2f}%"

    def rule(self, name: str, frames: Sequence[tuple[float, str]]) -> str:
        """Return keyframes and the rule that plays them on the element `name`."""
        inside = "".join(f"{self.at(t)}{{{what}}}" for t, what in frames)
        return f"@keyframes {name}{{{inside}}}#{name}{{animation:{name} {self.whole:.2f}s linear infinite}}"

    def outcome(self) -> str:
        """Return the rule that shows a verdict once the parts are let go."""
        before, after = self.at(self.let_go), self.at(self.let_go + 0.4)
        return (
            f"@keyframes outcome{{0%,{before}{{opacity:0}}{after},100%{{opacity:1}}}}"
            f".outcome{{animation:outcome {self.whole:.2f}s linear infinite}}"
        )


def _outcome(shot: Shot, key: str) -> str:
    if shot.stands is None:
        return ""
    words, cls = ("stands", "ok") if shot.stands else ("falls", "bad")
    return f'<tspan class="outcome {cls}" id="{key}-says"> {words}</tspan>'


def _shot(shot: Shot, colours: Sequence[int], view: View, clock: _Clock, key: str) -> tuple[str, str]:
    """Return the drawing of one assembly, and the rules that move its parts."""
    classes, drawn, rules, order = fills(), [], [], 0
    falls = dict(zip((shot.moving if shot.moving is not None else np.zeros(0, dtype=np.int64)).tolist(), range(10**6)))
    for k, part in enumerate(shot.assembly.parts):
        assert isinstance(part.shape, Polygon)
        name = f"{key}p{k}"
        path = drawing2d.path_of(part.shape, view)
        x, y = view(part.centroid)[0]
        origin = f'style="transform-origin:{px(x)}px {px(y)}px"'
        drawn.append(f'<path id="{name}" class="part {classes[colours[k]]}" {origin} d="{path}"/>')
        if part.fixed:
            continue
        way = np.asarray(shot.ways.get(part.name, np.array([0.0, -1.0])))
        frames = _arrival(-APPROACH * shot.assembly.size * view.scale * way, order, clock)
        if shot.falling is not None and k in falls:
            frames += _fall(shot.falling[:, falls[k]], view.scale, clock)
        rules.append(clock.rule(name, frames))
        order += 1
    return "".join(drawn), "".join(rules)


HOME = "opacity:1;transform:translate(0,0) rotate(0deg)"


def _arrival(start_px: Array, order: int, clock: _Clock) -> list[tuple[float, str]]:
    """Return the frames in which a part appears and slows down into its place."""
    begins, frames = order * STEP_S, []
    far = f"transform:translate({px(start_px[0])}px,{px(-start_px[1])}px) rotate(0deg)"
    frames += [(0.0, f"opacity:0;{far}")] + ([(begins, f"opacity:0;{far}")] if begins else [])
    for share in (0.3, 0.6, 1.0):
        left = (1.0 - share) ** 2 * start_px
        spot = f"opacity:1;transform:translate({px(left[0])}px,{px(-left[1])}px) rotate(0deg)"
        frames.append((begins + share * STEP_S, spot))
    return [*frames, (clock.let_go, HOME), (clock.whole, HOME)]


def _fall(displacements: Array, scale: float, clock: _Clock) -> list[tuple[float, str]]:
    """Return the frames after the parts are let go, in place of the ones in which they stay."""
    chosen = np.unique(np.linspace(0, len(displacements) - 1, INSTANTS).round().astype(int))
    frames = []
    for k in chosen:
        x, y, turn = displacements[k]
        when = clock.let_go + HOLD_S * k / max(len(displacements) - 1, 1)
        spot = f"translate({px(x * scale)}px,{px(-y * scale)}px) rotate({px(-np.rad2deg(turn))}deg)"
        frames.append((when, f"opacity:1;transform:{spot}"))
    return [*frames, (clock.whole, frames[-1][1])]
