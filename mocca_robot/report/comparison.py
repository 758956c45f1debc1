"""The page of `mocca-robot compare`: variants of one assembly side by side, each with every verdict on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mocca_robot.assembly import Assembly
from mocca_robot.design import Insertion
from mocca_robot.files.output import write_atomic
from mocca_robot.joints.joint import Joint
from mocca_robot.report import pictures
from mocca_robot.report.case_words import case_words
from mocca_robot.report.markup import badge, degrees, esc, listed, significant, table
from mocca_robot.report.page import document
from mocca_robot.report.palette import part_colours
from mocca_robot.report.pictures import Picture
from mocca_robot.report.sections import APART, case_mark, section
from mocca_robot.statics.solution import Status
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD, COARSE
from mocca_robot.verdicts.agreement import agree
from mocca_robot.verdicts.physics import Verdict
from mocca_robot.verdicts.verification import Verification


@dataclass(frozen=True, eq=False, kw_only=True)
class Variant:
    """One way to join the same parts.

    Attributes:
        name: 'planar', 'single direction', 'cone joints', …
        assembly: built geometry; verification: what statics and geometry say about it.
        joints, insertion: drawn in 2D.
        friction: Coulomb coefficient of every verdict.
        physics_stands: MuJoCo's verdict on the finished state, with friction the friction engine's; None when there is
            none.
        tilt_rad: critical tilt by statics, the smallest over azimuths; None when not computed.
        physics_tilt_rad: the same in physics.
        goes_in: every part can be inserted in sequence along at least one direction; None when not checked.
        deadlocked: no part can leave the finished structure while the others stay; None when not checked.
        remarks: shown below the picture.
    """

    name: str
    assembly: Assembly
    verification: Verification
    joints: tuple[Joint, ...] = ()
    insertion: tuple[Insertion, ...] = ()
    friction: float = 0.0
    physics_stands: bool | None = None
    tilt_rad: float | None = None
    physics_tilt_rad: float | None = None
    goes_in: bool | None = None
    deadlocked: bool | None = None
    remarks: tuple[str, ...] = ()


def write_comparison(path: Path, title: str, variants: Sequence[Variant]) -> Path:
    """Return `path` after writing the comparison page there, one self-contained HTML file."""
    return write_atomic(Path(path), comparison_page(title, variants))


def comparison_page(title: str, variants: Sequence[Variant]) -> str:
    """Return the comparison of at least one variant as one HTML document. Same variants, same text."""
    standing = [v.name for v in variants if v.verification.stands]
    useful = [v.name for v in variants if v.verification.stands and v.verification.assemblable and not v.deadlocked]
    said = f"{len(standing)} of {len(variants)} variants stand"
    said += f"; {listed(useful)} can also be put together as asked." if useful else "; none can be assembled as asked."
    header = f'<header class="top"><h1>{esc(title)}</h1><p class="lead">{said}</p></header>'
    body = section("variants", "Side by side", _panels(variants)) + section("verdicts", "Verdicts", _verdicts(variants))
    return document(title, header, body + section("cases", "Load cases", _cases(variants)), [])


def _panels(variants: Sequence[Variant]) -> str:
    view = pictures.shared_view([v.assembly for v in variants])
    wide = pictures.shared_view([v.assembly for v in variants], apart=APART)
    colours = part_colours(variants[0].verification.graph)
    panels = []
    for variant in variants:
        checked, flat = variant.verification, variant.assembly.dimension == 2
        fallen = [c for c in checked.cases if not c.result.stands]
        shown = (fallen or list(checked.cases))[:1]
        joints, insertion = (variant.joints, variant.insertion) if flat else ((), ())
        picture = Picture(
            graph=checked.graph,
            colours=colours,
            cases=shown,
            joints=joints,
            insertions=insertion,
            names=False,
        )
        drawn = pictures.draw(picture, view, f"{variant.assembly.name}, {variant.name}")
        if not flat:
            opened = Picture(graph=checked.graph, colours=colours, apart=APART)
            drawn += pictures.draw(opened, wide, f"{variant.assembly.name}, {variant.name}, taken apart")
        remarks = "".join(f"<p>{esc(r)}</p>" for r in variant.remarks)
        caption = f"<b>{esc(variant.name)}</b> {_stands(variant)}{remarks}"
        panels.append(f"<figure>{drawn}<figcaption>{caption}</figcaption></figure>")
    narrow = " narrow" if len(panels) > 3 else ""
    return f'<div class="figures{narrow}">{"".join(panels)}</div>'


def _stands(variant: Variant) -> str:
    if any(c.result.status == "inaccurate" for c in variant.verification.cases):
        return badge("warn", "inaccurate")
    if variant.verification.stands:
        return badge("ok", "stands")
    clamped = all(c.only_clamped for c in variant.verification.cases if not c.result.stands)
    return badge("bad", "stands only clamped" if clamped else "falls")


def _disagrees(variant: Variant) -> bool:
    """Return whether physics and statics differ on the finished state, under gravity, a key held."""
    if variant.physics_stands is None:
        return False
    physics = Verdict.STANDS if variant.physics_stands else Verdict.FELL
    cases = variant.verification.cases
    shown = [c for c in cases if c.case.name in ("gravity", "gravity_key_held")] or list(cases)
    fallen = [c.result.status for c in shown if not c.result.stands]
    decided = [status for status in fallen if status is not Status.INACCURATE]
    return agree(physics, (decided or fallen or [Status.EQUILIBRIUM])[0]) is False


def _flag(value: bool | None, yes: str, no: str, silent: str, good: bool = True) -> str:
    if value is None:
        return badge("none", silent)
    return badge("ok" if value == good else "bad", yes if value else no)


def _verdicts(variants: Sequence[Variant]) -> str:
    rows = []
    for v in variants:
        largest = max((c.result.infeasibility for c in v.verification.cases), default=0.0)
        tightest = min(v.verification.insertions, key=lambda i: i.alpha_rad, default=None)
        cone = (
            "–" if tightest is None else f"±{degrees(max(tightest.alpha_rad, 0.0))} (<code>{esc(tightest.part)}</code>)"
        )
        if tightest is not None and tightest.alpha_rad < -ANGLE_ROUNDING_RAD:
            cone = f"none (<code>{esc(tightest.part)}</code>)"
        asked = "–" if v.assembly.alpha_rad is None else f"±{degrees(v.assembly.alpha_rad)}"
        physics = _flag(v.physics_stands, "stands", "falls", "not simulated")
        if _disagrees(v):
            physics += " " + badge("bad", "disagrees")
        tilt = (
            "–"
            if v.tilt_rad is None
            else degrees(v.tilt_rad)
            if v.physics_tilt_rad is None
            else (f"{degrees(v.tilt_rad)} / {degrees(v.physics_tilt_rad)}")
        )
        goes_in = _flag(v.verification.assemblable, "as asked", "blocked", "–")
        if v.goes_in and not v.verification.assemblable:
            goes_in = badge(
                "warn", "one way only" if tightest and tightest.alpha_rad < COARSE else "narrower than asked"
            )
        locked = _flag(v.deadlocked, "deadlocked", "free", "not checked", good=False)
        cells = [esc(v.name), _stands(v), significant(largest, 2), physics, tilt, goes_in, cone, asked, locked]
        rows.append(cells)
    physics = "Physics" if any(v.friction for v in variants) else "MuJoCo"
    head = (
        "Variant", "Statics", "Largest E", physics, f"Critical tilt (statics / {physics})", "Assembly",
        "Narrowest cone", "Asked", "Deadlock",
    )  # fmt: skip
    return table(head, rows, caption="Every verdict on every variant", numeric=(2,))


def _cases(variants: Sequence[Variant]) -> str:
    names = list(dict.fromkeys(c.case.name for v in variants for c in v.verification.cases))
    rows = []
    for name in names:
        cells = [esc(case_words(name))]
        for variant in variants:
            found = [c for c in variant.verification.cases if c.case.name == name]
            moving = f" {listed(found[0].moving, 3)}" if found and found[0].moving else ""
            cells.append(f"{case_mark(found[0])}{moving}" if found else "–")
        rows.append(cells)
    return table(("Load case", *(esc(v.name) for v in variants)), rows, caption="Equilibrium by statics, who moves")
