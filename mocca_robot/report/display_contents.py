"""What is shown of each kind of value: its picture, its verdicts as marks, its rows as a table."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, singledispatch

import numpy as np

from mocca_robot.assembly import Assembly
from mocca_robot.design import Design
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import StoredDesign
from mocca_robot.joints.joint import Joint
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report.case_words import case_words
from mocca_robot.report.markup import badge, degrees, esc, listed, significant, table
from mocca_robot.report.palette import part_colours
from mocca_robot.report.pictures import Picture, draw, shared_view
from mocca_robot.statics.cases import CaseVerdict
from mocca_robot.statics.solution import Status
from mocca_robot.strength.uses import AssemblyStrength
from mocca_robot.verdicts.physics import Simulation
from mocca_robot.verdicts.verification import Verification, verify

ROWS = 12
"""Rows of a table; the caption says how many there are."""
MARKS = {"stands": "ok", "does not stand": "bad", "not decided": "warn"}


def contents(what: object) -> str:
    """Return picture, verdict and table of `what` as markup. Raises InputError for what cannot be shown."""
    return (
        f'<div class="shown"><p><b>{esc(title(what))}</b></p>{_verdict(what)}{drawing(what) or ""}{_table(what)}</div>'
    )


@singledispatch
def title(what: object) -> str:
    """Return the name of `what` and what there is of it (not escaped)."""
    if isinstance(inside := getattr(what, "design", None), Design):
        return title(inside)
    raise InputError(
        f"A value of type {type(what).__name__} cannot be shown. Hand in an Assembly, a design, a PartsGraph, or what "
        "verify(), solve_case(), simulate() or assess() returns."
    )


@title.register
def _(what: Assembly) -> str:
    return f"{what.name}: {what.said}"


@title.register(Design)
@title.register(StoredDesign)
def _(what: Design | StoredDesign) -> str:
    return f"{what.assembly.name}: {what.assembly.said}, {len(what.joints)} joints"


@title.register
def _(what: PartsGraph) -> str:
    return title(what.assembly)


@title.register
def _(what: Verification) -> str:
    return title(what.graph.assembly)


@title.register
def _(what: CaseVerdict) -> str:
    return case_words(what.case.name)


@title.register
def _(what: Simulation) -> str:
    return f"{what.name}: {what.engine}"


@title.register
def _(what: AssemblyStrength) -> str:
    return f"Strength of {len(what.parts)} parts"


@singledispatch
def drawing(what: object) -> str | None:
    """Return the picture of `what` as an SVG element; None where there is none."""
    inside = getattr(what, "design", None)
    return drawing(inside) if isinstance(inside, Design) else None


@drawing.register
def _(what: Assembly) -> str:
    return _drawn(_graph(what))


@drawing.register
def _(what: PartsGraph) -> str:
    return _drawn(what)


@drawing.register
def _(what: Verification) -> str:
    worst = sorted(what.cases, key=lambda c: -float(np.nan_to_num(c.result.infeasibility, nan=1.0)))
    return _drawn(what.graph, cases=worst[:1])


@drawing.register
def _(what: Design) -> str:
    return _drawn(_judged(what).graph, joints=what.joints)


@drawing.register
def _(what: StoredDesign) -> str:
    return _drawn(_judged(what).graph)


def _drawn(graph: PartsGraph, cases: Sequence[CaseVerdict] = (), joints: Sequence[Joint] = ()) -> str:
    picture = Picture(graph=graph, colours=part_colours(graph), cases=cases, joints=joints)
    return draw(picture, shared_view([graph.assembly]), graph.assembly.name)


@lru_cache(maxsize=4)
def _graph(assembly: Assembly) -> PartsGraph:
    return PartsGraph.of(assembly)


@lru_cache(maxsize=4)
def _judged(design: Design | StoredDesign) -> Verification:
    """Return the verdicts on a design from its geometry: it is asked for them several times while it is shown."""
    return verify(design)


@singledispatch
def _verdict(what: object) -> str:
    inside = getattr(what, "design", None)
    return _verdict(inside) if isinstance(inside, Design) else ""


@_verdict.register
def _(what: Verification) -> str:
    blocked = [i.part for i in what.insertions if not i.assemblable]
    way = badge("bad", "cannot be put together") if blocked else badge("ok", "can be put together")
    by = f' <span class="mute">cannot go in as asked: {listed(blocked)}</span>' if blocked else ""
    return f"<p>{badge(MARKS[what.standing], what.standing)}{way}{by}</p>"


@_verdict.register(Design)
@_verdict.register(StoredDesign)
def _(what: Design | StoredDesign) -> str:
    return _verdict(_judged(what))


@_verdict.register
def _(what: Assembly) -> str:
    return f'<p>{badge("none", "not judged")}<span class="mute"><code>verify</code> says whether it stands.</span></p>'


@_verdict.register
def _(what: CaseVerdict) -> str:
    return f"<p>{_mark(what)}</p>"


@_verdict.register
def _(what: Simulation) -> str:
    fallen, inside = what.needs_support, [t for t in what.trials if t.inside]
    marks = []
    if what.states:
        held = len(what.states) - len(fallen)
        marks.append(badge("bad" if fallen else "ok", f"{held} of {len(what.states)} states stand"))
    if inside:
        passed = sum(t.succeeded for t in inside)
        marks.append(badge("ok" if passed == len(inside) else "bad", f"{passed} of {len(inside)} insertions succeed"))
    marks += [badge("warn", "interrupted")] if what.interrupted else []
    return f"<p>{''.join(marks) or badge('none', 'nothing asked')}</p>"


@_verdict.register
def _(what: AssemblyStrength) -> str:
    bears = f"bears {significant(what.reached)} times its loads, {significant(what.safety)} asked"
    return f"<p>{badge('ok' if what.holds else 'bad', 'holds' if what.holds else 'breaks')}{esc(bears)}</p>"


@singledispatch
def _table(what: object) -> str:
    inside = getattr(what, "design", None)
    return _table(inside) if isinstance(inside, Design) else ""


@_table.register
def _(what: Assembly) -> str:
    rows = [(esc(p.name), "fixed" if p.fixed else "", f"{significant(p.mass)} kg", esc(p.material)) for p in what.parts]
    return _rows(("part", "", "mass", "material"), rows, "parts, in assembly order", (2,))


@_table.register
def _(what: PartsGraph) -> str:
    return _table(what.assembly)


@_table.register
def _(what: Verification) -> str:
    return _cases(what.cases)


@_table.register(Design)
@_table.register(StoredDesign)
def _(what: Design | StoredDesign) -> str:
    return _cases(_judged(what).cases)


@_table.register
def _(what: CaseVerdict) -> str:
    return _cases([what])


@_table.register
def _(what: Simulation) -> str:
    states = [(esc(s.placed), esc(s.verdict), esc((s.statics or "–").replace("_", " "))) for s in what.states]
    tilts = [
        (degrees(t.azimuth_rad, 0), significant(t.friction), degrees(t.critical_rad), degrees(t.statics_rad))
        for t in what.tilt
    ]
    out = _rows(("just after placing", "physics", "statics"), states, "states", ()) if states else ""
    heads = ("towards", "friction", "physics", "statics")
    return out + (_rows(heads, tilts, "critical tilts", (0, 1, 2, 3)) if tilts else "")


@_table.register
def _(what: AssemblyStrength) -> str:
    ordered = sorted(what.parts, key=lambda p: p.reached)
    rows = [(esc(p.part), esc(p.material), f"{significant(p.reached)} times") for p in ordered]
    return _rows(("part", "material", "bears its loads"), rows, "parts, the weakest first", (2,))


def _cases(cases: Sequence[CaseVerdict]) -> str:
    rows = [
        (esc(case_words(c.case.name)), _mark(c), significant(c.result.infeasibility, 2), listed(c.moving, 4))
        for c in cases
    ]
    return _rows(("load case", "verdict", "E/|w|²", "would move"), rows, "load cases", (2,))


def _mark(case: CaseVerdict) -> str:
    kind = {Status.EQUILIBRIUM: "ok", Status.NOT_IN_EQUILIBRIUM: "bad", Status.INACCURATE: "warn"}[case.result.status]
    return badge(kind, str(case.result.status).replace("_", " "))


def _rows(head: Sequence[str], rows: Sequence[Sequence[str]], noun: str, numeric: Sequence[int]) -> str:
    caption = noun if len(rows) <= ROWS else f"{noun}: the first {ROWS} of {len(rows)}"
    return table(head, rows[:ROWS], caption=caption, numeric=numeric)
