"""Verdicts in words: what does not hold, which parts move or block, and what a user can do about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mocca_robot.assembly import Assembly, Interlocking, SupportFree
from mocca_robot.errors import quoted
from mocca_robot.motion.insertion import InsertionVerdict
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report.case_words import case_words
from mocca_robot.report.tilt_words import limit_words
from mocca_robot.statics.cases import CaseVerdict, moving_parts
from mocca_robot.statics.mobility import Mobility, loose_with_key
from mocca_robot.statics.tilt_reserve import TiltReserve
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD, PART_OVERLAP
from mocca_robot.verdicts.agreement import Remark, towards
from mocca_robot.verdicts.verification import Verification

if TYPE_CHECKING:
    from planners.cone_joints.outcome import Designed


@dataclass(frozen=True)
class NegativeVerdict:
    """A negative verdict.

    Attributes:
        kind: 'falls', 'clamped', 'inaccurate', 'blocked', 'overlap', 'impossible', 'narrow', 'deadlock', 'loose',
            'disagreement', 'jams', 'not_written', 'reserve', 'breaks'.
        text: the evidence for people, one or two sentences.
        parts: names of the parts concerned.
        case: load case or state, when there is one.
    """

    kind: str
    text: str
    parts: tuple[str, ...] = ()
    case: str | None = None


def degrees(angle_rad: float) -> str:
    """Return an angle as '12.3°'."""
    return f"{np.rad2deg(angle_rad):.1f}°"


def statics_findings(assembly: Assembly, verification: Verification, remedy: str = "") -> list[NegativeVerdict]:
    """Return what statics and geometry hold against an assembly."""
    found = [f for case in verification.cases if (f := case_finding(case, remedy)) is not None]
    loose = None if any(f.case == "interlocking" for f in found) else loose_with_key(verification.graph)
    if loose is not None:
        key = next(g.key for g in assembly.goals if isinstance(g, Interlocking))
        found.append(loose_finding(key, loose))
    found += [insertion_finding(i) for i in verification.insertions if not i.assemblable]
    return found


def loose_finding(key: str, loose: Mobility) -> NegativeVerdict:
    """Return that parts can leave while the key is held."""
    text = f"Does not interlock: with '{key}' held, {quoted(loose.moving)} can still move."
    if not loose.opens:
        text += " It slides along flat contacts; ask for {kind: lateral, angle_deg: 5} as well, and they get joints."
    return NegativeVerdict("loose", text, loose.moving, "interlocking")


def overlap_findings(assembly: Assembly, verification: Verification) -> list[NegativeVerdict]:
    """Return that built parts penetrate each other. Input may do so within the tolerance of contacts."""
    limit = PART_OVERLAP[assembly.dimension]
    if verification.part_overlap <= limit:
        return []
    share = verification.part_overlap
    return [NegativeVerdict("overlap", f"Built parts overlap by {share:.2g} of the smaller one; {limit:g} is allowed.")]


def case_finding(verdict: CaseVerdict, remedy: str = "") -> NegativeVerdict | None:
    """Return why a load case does not hold; None when it does."""
    if verdict.result.stands:
        return None
    name, words = verdict.case.name, case_words(verdict.case.name)
    if verdict.result.status == "inaccurate":
        text = f"Not decided ({words}): the solver's residual {verdict.result.kkt:.1g} is too large for a verdict."
        if verdict.rubbing is not None:
            left = verdict.rubbing.unbalanced
            text = f"Not decided ({words}): neither rest nor a lasting fall was found; {left:.1g} of the load is left."
        return NegativeVerdict("inaccurate", text, (), name)
    if verdict.only_clamped:
        text = (
            f"Stands only clamped ({words}): some friction forces would hold it, but nothing brings them about; "
            f"{quoted(verdict.moving)} would slide out."
        )
        return NegativeVerdict("clamped", text, verdict.moving, name)
    text = (
        f"Does not stand ({words}): {quoted(verdict.moving)} would move, "
        f"E/|w|² = {verdict.result.infeasibility:.2g}.{f' {remedy}' if remedy else ''}"
    )
    return NegativeVerdict("falls", text, verdict.moving, name)


def insertion_finding(verdict: InsertionVerdict) -> NegativeVerdict:
    """Return why a part cannot be inserted as asked."""
    by = f" by {quoted(verdict.blockers)}" if verdict.blockers else ""
    asked = "" if verdict.required_rad is None else f" within ±{degrees(verdict.required_rad)}"
    if verdict.alpha_rad <= -ANGLE_ROUNDING_RAD:
        why = f"it is enclosed{by}; no direction is free. Place it earlier in the sequence"
    elif verdict.collides:
        why = f"on its way it is hit{by}. Change the sequence, or its insertion direction"
    else:
        why = f"its way is narrowed to ±{degrees(max(verdict.alpha_rad, 0.0))}{by}"
    return NegativeVerdict(
        "blocked", f"'{verdict.part}' cannot be inserted{asked}: {why}.", (verdict.part, *verdict.blockers)
    )


def hanging_findings(graph: PartsGraph) -> list[NegativeVerdict]:
    """Return the parts that touch nothing of what is there when they are placed."""
    names, found = graph.assembly.sequence, []
    for part in graph.free:
        if not graph.neighbours_before(part) and graph.neighbours_after(part):
            first = [names[p] for p in graph.neighbours_after(part)]
            found.append(
                NegativeVerdict(
                    "falls",
                    f"'{names[part]}' hangs in the air when it is placed: it touches nothing that is there, and needs "
                    f"support. Place {quoted(first)} before it.",
                    (names[part], *first),
                    f"state_{names[part]}",
                )
            )
    return found


def deadlock_finding(assembly: Assembly) -> NegativeVerdict:
    """Return that nothing can move."""
    text = "Deadlock: no part can move at all, so the structure can be neither assembled nor taken apart."
    return NegativeVerdict("deadlock", text, tuple(p.name for p in assembly.parts if not p.fixed))


def reserve_finding(reserve: TiltReserve, dimension: int) -> NegativeVerdict:
    """Return that a reserve against tilting which somebody wrote down is not reached."""
    limited = limit_words(reserve)
    reached, asked = np.rad2deg([reserve.critical_rad, reserve.asked_rad])
    text = (
        f"Less reserve than joints.tilt_margin_deg asks for: it falls at a tilt of {reached:.2f}° towards "
        f"{towards(reserve.azimuth_rad, dimension)}, not {asked:.2f}°{'; ' if limited else ''}{limited}."
    )
    return NegativeVerdict("reserve", text, reserve.moving, reserve.case)


def design_findings(assembly: Assembly, designed: Designed) -> list[NegativeVerdict]:
    """Return the certificates of a design run: what no joint within the bounds can do, with remedies."""
    found = []
    if designed.impossible is not None:
        case, proof = designed.impossible
        moving = moving_parts(assembly, proof.motions)
        text = (
            f"No joint within the bounds holds this load case ({case_words(case)}): even if every point of every "
            f"contact could push in every allowed direction, {quoted(moving)} would move, E/|w|² = "
            f"{proof.infeasibility:.2g}. Steeper or higher joints (joints.max_slope_deg, joints.max_height) or another "
            "cut may help; α does not matter here."
        )
        found.append(NegativeVerdict("impossible", text, moving, case))
    for part in designed.narrow:
        room = f"at most ±{degrees(part.alpha_rad)}" if part.alpha_rad >= 0 else "no free direction"
        text = (
            f"'{part.part}' cannot get its cone of ±{degrees(part.required_rad)}: its flat contacts with "
            f"{quoted(part.blockers)} leave {room}, and no joint can widen that. Place it earlier in the sequence, cut "
            "those contacts at another angle, or ask for a smaller alpha_deg."
        )
        found.append(NegativeVerdict("narrow", text, (part.part, *part.blockers)))
    return found


def physics_findings(remarks: Sequence[Remark]) -> list[NegativeVerdict]:
    """Return what physics holds against an assembly."""
    return [NegativeVerdict(str(r.kind), r.text, r.parts, r.case) for r in remarks if r.held]


def supports(assembly: Assembly, states: Sequence[CaseVerdict]) -> tuple[str, ...]:
    """Return the parts after whose placing the assembly needs support; empty where the goals forbid that anyway."""
    if any(isinstance(g, SupportFree) for g in assembly.goals):
        return ()
    return tuple(s.case.name.removeprefix("state_") for s in states[:-1] if not s.result.stands)


def cases_data(cases: Sequence[CaseVerdict]) -> list[dict[str, Any]]:
    """Return load cases for JSON."""
    return [
        {
            "case": c.case.name,
            "status": str(c.result.status),
            "infeasibility": c.result.infeasibility,
            "moving": list(c.moving),
            **({} if c.rubbing is None else {"standing": str(c.rubbing.standing), "travel": c.rubbing.travel}),
        }
        for c in cases
    ]


def insertions_data(verdicts: Sequence[InsertionVerdict]) -> list[dict[str, Any]]:
    """Return insertions for JSON, in degrees."""
    return [
        {
            "part": i.part,
            "alpha_deg": float(np.rad2deg(i.alpha_rad)),
            "required_deg": None if i.required_rad is None else float(np.rad2deg(i.required_rad)),
            "assemblable": i.assemblable,
            "blockers": list(i.blockers),
        }
        for i in verdicts
    ]


def findings_data(findings: Sequence[NegativeVerdict]) -> list[dict[str, Any]]:
    """Return findings for JSON."""
    return [asdict(f) for f in findings]
