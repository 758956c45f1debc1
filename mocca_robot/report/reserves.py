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
    """Return the table of load factors, of the result beside the input; nothing without loads."""
    before = {f.name: f for f in data.before.load_factors}
    rows = [
        [
            esc(found.name),
            esc(size_words(data.design.source, found.name)),
            _figure(before.get(found.name)),
            _figure(found),
            listed(found.moving) if found.moving else "nothing",
        ]
        for found in data.after.load_factors
    ]
    if not rows:
        return ""
    words = (
        "<p>How many times each load the structure carries beside its own weight before it first falls, and what moves "
        "then. A combination's loads grow together. ∞: any amount stands.</p>"
    )
    head = ("Load", "Size", "λ of the input", "λ of the result", "Who moves")
    return section("reserves", "Loads and reserves", words + table(head, rows, caption="Load factors", numeric=(2, 3)))


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
