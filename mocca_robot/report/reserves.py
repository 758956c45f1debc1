"""How much of every load a structure takes: in words, as a table of the report, and as data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from mocca_robot.assembly import Assembly
from mocca_robot.report.data import ReportData
from mocca_robot.report.load_words import load_size, move_words
from mocca_robot.report.markup import esc, listed, significant, table
from mocca_robot.report.sections import section
from mocca_robot.statics.load_factor import LoadFactor
from mocca_robot.verdicts.agreement import towards
from mocca_robot.verdicts.physics import LoadVerdict


def factor_words(found: LoadFactor) -> str:
    """Return how much of a load the structure takes, as a sentence (not escaped)."""
    when = f" just after placing '{found.placed}'" if found.placed else ""
    if found.factor is None and found.move is not None:
        return f"'{found.name}': not decided: the support is driven into something that cannot give way"
    if found.factor is None:
        return f"how much of '{found.name}' it takes{when} is not decided: the solver was inaccurate"
    if found.steps == 0:
        return f"'{found.name}': presses on nothing that can move; look at its place and its direction"
    if math.isinf(found.factor):
        far = "stands however far it goes (tried up to half the structure's size)"
        return f"'{found.name}': {'any amount stands' if found.move is None else far}"
    names = ", ".join(f"'{name}'" for name in found.moving[:4]) + (", …" if len(found.moving) > 4 else "")
    if found.factor == 0.0:
        return f"'{found.name}': stands with none of it{when}; {names} would move"
    if found.move is not None:
        gone = move_words(found.factor * found.move[0], found.factor * found.move[1])
        return f"'{found.name}': stands until its support has moved by {gone}; then {names} would fall"
    return f"'{found.name}': stands up to {significant(found.factor, 4)} times it{when}; then {names} would move"


def size_words(assembly: Assembly, name: str) -> str:
    """Return a load's size, or what a combination is made of (not escaped)."""
    for action in assembly.actions:
        if action.name == name:
            return load_size(action)
    combination = next(c for c in assembly.combinations if c.name == name)
    return " + ".join([f"{combination.gravity:g} own weight", *(f"{f:g} {n}" for n, f in combination.factors.items())])


def reserves(data: ReportData) -> str:
    """Return how much it takes: load factors of the result beside the input and physics, then the critical tilts.

    Nothing without loads.
    """
    before = {f.name: f for f in data.before.load_factors}
    physics = {f.name: f for f in data.simulation.loads} if data.simulation else {}
    rows = [
        [
            esc(found.name),
            esc(size_words(data.design.source, found.name)),
            _figure(before.get(found.name)),
            _figure(found),
            _measured(physics.get(found.name)),
            listed(found.moving) if found.moving else "nothing",
        ]
        for found in data.after.load_factors
    ]
    if not rows:
        return ""
    words = (
        "<p>How many times each load the structure carries beside its own weight before it first falls, and what moves "
        "then; of a support that moves, how many times its move. A combination's loads grow together. ∞: any amount "
        "stands. Physics lets the structure go under ever other multiples, and stops at twice what statics says.</p>"
    )
    head = ("Load", "Size", "λ of the input", "λ of the result", "λ in physics", "Who moves")
    tables = table(head, rows, caption="Load factors", numeric=(2, 3, 4)) + _tilts(data)
    return section("reserves", "How much it takes", words + tables)


def _measured(found: LoadVerdict | None) -> str:
    if found is None:
        return "–"
    rubs = f" (friction {found.friction:g})" if found.friction else ""
    if math.isinf(found.factor):
        return f"over {significant(found.tried, 3)}{rubs}"
    return f"{significant(found.factor, 4)} ± {significant(found.within, 1)}{rubs}"


def _tilts(data: ReportData) -> str:
    """Return the tilt towards the weakest side for every friction, by statics and in physics, as a table."""
    dimension, rows = data.design.assembly.dimension, []
    for mu in sorted({t.friction for t in data.tilts}):
        weakest = min((t for t in data.tilts if t.friction == mu), key=lambda t: t.after_rad)
        measured = [t for t in (data.simulation.tilt if data.simulation else ()) if t.friction == mu]
        least = f"{math.degrees(min(t.critical_rad for t in measured)):.2f}°" if measured else "–"
        side = towards(weakest.azimuth_rad, dimension)
        rows.append([f"{mu:g}", f"{math.degrees(weakest.after_rad):.2f}°", side, least])
    head = ("Friction", "Smallest critical tilt", "Towards", "In physics")
    return table(head, rows, caption="And without loads, the ground tilts", numeric=(0, 1, 3)) if rows else ""


def _figure(found: LoadFactor | None) -> str:
    if found is None or found.factor is None or found.steps == 0:
        return "–"
    return "∞" if math.isinf(found.factor) else significant(found.factor, 4)


def factors_data(found: Sequence[LoadFactor]) -> list[dict[str, Any]]:
    """Return load factors for JSON: `factor` null with `unlimited` true where any amount stands.

    A load that presses on nothing that can move has neither: no problem was solved for it.
    """
    return [
        {
            "load": f.name,
            "factor": None if f.factor is None or math.isinf(f.factor) else f.factor,
            "unlimited": f.factor is not None and math.isinf(f.factor) and f.steps > 0,
            "decided": f.factor is not None,
            "placed": f.placed or None,
            "moving": list(f.moving),
            **_moved(f),
        }
        for f in found
    ]


def _moved(found: LoadFactor) -> dict[str, float]:
    """Return how far a support goes before the structure falls, for JSON; nothing for loads."""
    if found.move is None or found.factor is None or math.isinf(found.factor):
        return {}
    metres, radians = (found.factor * size for size in found.move)
    return {"moved_m": metres, "turned_deg": math.degrees(radians)}
