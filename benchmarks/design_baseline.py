"""Design: time against the number of parts beside direct search and the paper's programme (Fig. 17), and against the
paper's own table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.measurement import Measurement, ToolAnswer, measure
from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.config.config import load
from mocca_robot.joints.options import JointOptions
from planners.baselines.direct_search import Gradient, direct_search
from planners.baselines.paper_programme import paper_design
from planners.cone_joints.designer import design

LEAN_RAD = float(np.deg2rad(20.0))
SIZES = (4, 8, 16, 32)
LONG_SIZES = (64, 128)
"""Only without `quick`, and only for what takes seconds there."""
QUICK_LIMIT_S, LIMIT_S, LIMIT_OF_DIFFERENCES_S = 30.0, 120.0, 480.0
"""Of one run; finite differences take more than a hundred times as long as the default at 32 parts."""
CONFIGS = Path(__file__).parents[1] / "configs"
PAPER_MINUTES = {
    "m": 1.00,
    "horse": 9.82,
    "pavilion": 2.19,
    "lilium_tower": 203.78,
    "scarecrow": 0.08,
    "sphere": 2.98,
    "stack": 0.04,
    "tree": 0.37,
    "leaning_tower_10": 0.23,
    "leaning_tower_20": 0.45,
    "leaning_tower_30": 0.38,
    "leaning_tower_support_free": 0.68,
    "deer": 0.70,
    "igloo": 61.11,
}
"""Optimisation time in the paper's Table 1: Knitro in C++, 64 cores."""

NO_MARGIN = JointOptions(tilt_margin_rad=0.0, inset=0.0, alpha_margin_rad=0.0)
"""What the two others aim for: the load itself, without a reserve."""


def leaning_wall(parts: int, lean_rad: float = LEAN_RAD) -> Assembly:
    """Return a running-bond wall of `parts` parts on a bed that leans: one fixed base, the rest bricks of 100 × 50 mm.

    About as wide as high, so that it could stand; flat contacts let it slide off. α is not asked for, as in Fig. 17.
    """
    width, height = 0.1, 0.05
    columns = max(1, round(float(np.sqrt(parts / 2.0))))
    c, s = np.cos(lean_rad), np.sin(lean_rad)
    turn = np.array([[c, s], [-s, c]])
    bed = np.array([[0.0, 0.0], [columns * width, 0.0]]) @ turn.T
    low = float(bed[:, 1].min()) - height
    base = np.array([[bed[0, 0], low], [bed[1, 0], low], bed[1], bed[0]])
    found = [Part("base", Polygon(base), fixed=True)]
    course = 0
    while len(found) < parts:
        cuts = np.arange(columns + 1) * width
        if course % 2:
            cuts = np.r_[0.0, cuts[:-1] + 0.5 * width, columns * width]
        for x0, x1 in list(pairwise(cuts))[: parts - len(found)]:
            y0, y1 = course * height, (course + 1) * height
            corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) @ turn.T
            found.append(Part(f"p{len(found):03d}", Polygon(corners)))
        course += 1
    return Assembly(f"wall-{parts}", tuple(found), alpha_rad=None)


def _ours(assembly: Assembly, options: JointOptions | None = None) -> ToolAnswer:
    found = design(assembly, options)
    return ToolAnswer(_words(found.achieved, [c.infeasibility_after for c in found.design.load_cases]))


def _words(achieved: bool, infeasibility: object) -> str:
    left = float(np.max(np.asarray(infeasibility, dtype=np.float64), initial=0.0))
    return "holds" if achieved else f"falls short, E {left:.1e}"


def _programme(assembly: Assembly) -> ToolAnswer:
    found = paper_design(assembly, NO_MARGIN)
    return ToolAnswer(f"{_words(found.achieved, found.infeasibility)}, {found.rounds} rounds")


def _search(assembly: Assembly, differences: bool = False) -> ToolAnswer:
    gradient: Gradient = "finite differences" if differences else "envelope"
    found = direct_search(assembly, NO_MARGIN, gradient=gradient, evaluations=100_000 if differences else 400)
    return ToolAnswer(f"{_words(found.achieved, found.infeasibility)}, {found.evaluations} evaluations")


TOOLS: dict[str, tuple[int, Callable[[Assembly], ToolAnswer]]] = {
    "ours": (128, _ours),
    "ours, no reserve": (128, lambda a: _ours(a, NO_MARGIN)),
    "paper's programme": (128, _programme),
    "direct search": (128, _search),
    "direct, differences": (32, lambda a: _search(a, differences=True)),
}
"""What is compared, and up to how many parts."""


def baseline(quick: bool, only: str | None) -> Iterator[Measurement]:
    """Yield design time over the number of parts: ours, the paper's two stages, direct search (Fig. 17)."""
    for parts in SIZES if quick else (*SIZES, *LONG_SIZES):
        assembly = leaning_wall(parts)
        if only is not None and only not in assembly.name:
            continue
        for tool, (largest, run) in TOOLS.items():
            if parts > largest or (quick and tool.endswith("differences") and parts > 16):
                continue
            limit = LIMIT_OF_DIFFERENCES_S if tool.endswith("differences") else LIMIT_S
            limit = QUICK_LIMIT_S if quick else limit
            yield measure("baseline", assembly.name, tool, partial(run, assembly), limit_s=limit, repeats=3)


def configs(quick: bool, only: str | None) -> Iterator[Measurement]:
    """Yield the design time of every configuration, beside the paper's; `quick` leaves large solids out."""
    for path in sorted(CONFIGS.glob("*.yaml")):
        minutes = PAPER_MINUTES.get(path.stem)
        if minutes is None or (only is not None and only not in path.stem):
            continue
        config = load(path)
        if quick and config.assembly.dimension == 3 and len(config.assembly.parts) > 40:
            continue
        ours = measure(
            "configs", path.stem, "ours", partial(_ours, config.assembly, config.joints), limit_s=300.0, repeats=3
        )
        if ours.verdict == "holds":
            ratio = 60.0 * minutes / ours.seconds
            ours = replace(ours, verdict=f"holds; {ratio:.0f}× less than the paper's")
        yield ours
        nothing = float("nan")
        yield Measurement(
            bench="configs",
            case=path.stem,
            tool="paper, 64 cores",
            seconds=60.0 * minutes,
            repeats=0,
            verdict="published",
            kkt=nothing,
            memory_mb=nothing,
        )
