"""plan.html: a plan as it is meant to go, part by part, with a player; complete in one file."""

from __future__ import annotations

from pathlib import Path

from mocca_robot.files.output import write_atomic
from mocca_robot.plan.cycle import CycleTime, cycle_times
from mocca_robot.plan.plan import Plan
from mocca_robot.report.markup import esc, table
from mocca_robot.report.page import document
from mocca_robot.report.rehearsal import CellFilm, player
from mocca_robot.report.sections import section

NOTE = (
    "The waypoints as they are written, without forces and without physics: <code>mocca-robot rehearse</code> shows "
    "what would happen, and <code>mocca-robot execute</code> checks the plan."
)


def write_plan_page(path: Path, plan: Plan, name: str, film: CellFilm) -> Path:
    """Return `path` after writing the page of `plan` for the design `name` there."""
    return write_atomic(Path(path), plan_page(plan, name, film))


def plan_page(plan: Plan, name: str, film: CellFilm) -> str:
    """Return the page as one HTML document. Same plan, same text."""
    cycles = cycle_times(plan)
    minutes = sum(c.moving_s + c.standing_s for c in cycles) / 60.0
    lead = (
        f"{len(plan.steps)} parts by a {esc(plan.robot)} with {esc(plan.gripper)} in the cell "
        f"{esc(plan.cell.name)}; about {minutes:.1f} minutes (preset {esc(plan.cell.limits.preset)})."
    )
    header = f'<header class="top"><h1>{esc(name)}: plan</h1><p>{lead}</p><p>{NOTE}</p></header>'
    body = section("player", "As planned", player(film)) + section("parts", "Part by part", _parts(cycles, film))
    return document(f"{name}: plan", header, body, ["rehearsal.js", "viewer3d.js"])


def _parts(cycles: tuple[CycleTime, ...], film: CellFilm) -> str:
    times = {c.part: c.time_s for c in film.chapters}
    rows = [
        [
            f'<button type="button" class="step" data-time="{times.get(c.part, 0.0):.3f}">{esc(c.part)}</button>',
            f"{c.moving_s:.1f} s",
            f"{c.standing_s:.1f} s",
            esc(", ".join(f"{k} {100 * s / c.moving_s:.0f} %" for k, s in list(c.limits.items())[:3])),
        ]
        for c in cycles
    ]
    return table(("Part", "In motion", "Standing (about)", "Limited by"), rows, caption="Every part's cycle")
