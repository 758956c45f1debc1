"""Planning: every configuration of the paper in the cell that builds it; parts planned, seconds a part, second look."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median

from benchmarks.measurement import Measurement, ToolAnswer, measure
from mocca_robot.config.config import load
from planners.cone_joints.designer import design
from planners.robot.build_plan import build_plan
from planners.robot.cell import read_cell
from planners.robot.recheck import recheck

ROOT = Path(__file__).parents[1]
FLAT, SOLID, LARGE = "ur5e_2f85", "ur10e_suction", "ur20_suction"
CELLS = {
    **dict.fromkeys(("m", "scarecrow", "stack", "tree", "deer"), (FLAT, 0.24)),
    **dict.fromkeys(("leaning_tower_10", "leaning_tower_20", "leaning_tower_30"), (FLAT, 0.24)),
    "leaning_tower_support_free": (FLAT, 0.24),
    "sphere": (SOLID, 0.14),
    "horse": (SOLID, 0.3),
    "pavilion": (SOLID, 0.6),
    "lilium_tower": (LARGE, 0.42),
    "igloo": (LARGE, 0.5),
}
"""Cell and longest side in metres: what `mocca-robot plan --cell … --size …` is given."""
QUICK = ("scarecrow", "leaning_tower_support_free", "sphere")
LIMIT_S = 1200.0


def plans(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield one row per configuration; every part counts as supported once it is placed. Its seconds are all of
    planning's CPU time; the verdict has the median wall time per part and what the second look found.
    """
    for name, (cell_name, size) in CELLS.items():
        if (only and only not in name) or (quick and name not in QUICK):
            continue

        def ours(name: str = name, cell_name: str = cell_name, size: float = size) -> ToolAnswer:
            config = load(ROOT / "configs" / f"{name}.yaml")
            made = design(config.assembly, config.joints, insertion=config.insertion).design
            cell = replace(read_cell(ROOT / "configs" / "cells" / f"{cell_name}.yaml"), build_size_m=size)
            free = [p.name for p in made.assembly.parts if not p.fixed]
            built = build_plan(made, cell, "0" * 64, supports=free, partial=True)
            missing = [r.part for r in built.reports if not r.placed]
            wrong = [] if built.plan is None else recheck(built.plan, built.cell, built.site, built.tray)
            second = "no plan" if built.plan is None else f"second look: {len(wrong)} findings"
            lacking = f", not placed: {' '.join(missing)}" if missing else ""
            seconds = median(r.seconds for r in built.reports)
            return ToolAnswer(
                f"{cell_name} {size:g} m: {len(built.reports) - len(missing)} of {len(built.reports)} parts, "
                f"median {seconds:.2f} s a part, {second}{lacking}"
            )

        yield measure("plans", name, "ours", ours, limit_s=LIMIT_S, repeats=1)
