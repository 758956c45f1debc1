"""What statics and physics say of every state, side by side, and where they contradict each other.

Whether physics agrees, and how that is said, `mocca_robot.verdicts.agreement` decides.
"""

from __future__ import annotations

from dataclasses import dataclass

from mocca_robot.assembly import Interlocking, SupportFree
from mocca_robot.report.data import ReportData
from mocca_robot.statics.cases import CaseVerdict
from mocca_robot.statics.solution import Status
from mocca_robot.tolerances import CASE_HELD
from mocca_robot.verdicts.agreement import Remark, agree, called, gaps_rad, remarks
from mocca_robot.verdicts.physics import StateVerdict, Verdict


@dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """One state of the sequence: the assembly just after `part` was placed.

    `statics` and `physics` are the verdicts (None = not known), `agree` whether they say the same with the same
    friction (None where one is silent), `moving` the parts that move by either, `seen` all that physics says. The
    finished assembly needs support, too, where it was asked only to interlock: its key has to be held.
    """

    part: str
    statics: bool | None
    physics: bool | None
    agree: bool | None
    moving: tuple[str, ...]
    verdict: CaseVerdict | None
    needs_support: bool
    seen: StateVerdict | None = None


def states(data: ReportData) -> tuple[State, ...]:
    """Return one entry per free part, in assembly order."""
    assembly = data.design.assembly
    asked = any(isinstance(g, SupportFree) for g in assembly.goals)
    keyed = bool(assembly.goals) and all(isinstance(g, Interlocking) for g in assembly.goals)
    by_name = {v.case.name: v for v in data.states}
    simulated = {s.placed: s for s in data.simulation.states} if data.simulation else {}
    found = []
    for k, part in enumerate(assembly.parts):
        if part.fixed:
            continue
        verdict, seen = by_name.get(f"state_{part.name}"), simulated.get(part.name)
        status = verdict.result.status if verdict else seen.statics if seen else None
        statics = None if status in (None, Status.INACCURATE) else status is Status.EQUILIBRIUM
        stable = None if seen is None or seen.verdict is Verdict.FAILED else seen.stands
        compared = None if seen is None else agree(seen.verdict, seen.statics or status)
        names = {*(verdict.moving if verdict else ()), *(seen.moved if seen else ())}
        finished = k == len(assembly.parts) - 1 and not keyed
        falls = statics is False or stable is False
        found.append(
            State(
                part=part.name,
                statics=statics,
                physics=stable,
                agree=compared,
                moving=tuple(n for n in assembly.sequence if n in names),
                verdict=verdict,
                needs_support=falls and not asked and not finished,
                seen=seen,
            )
        )
    return tuple(found)


def decided(verdict: CaseVerdict) -> bool | None:
    """Return whether the case stands; None when the solver was too inaccurate to say."""
    return None if verdict.result.status is Status.INACCURATE else verdict.result.stands


def disagreements(data: ReportData) -> tuple[str, ...]:
    """Return every contradiction between statics, physics and the design's own claims, one sentence each."""
    found = [r.text for r in _remarks(data) if r.contradicts]
    verified = {c.case.name: c for c in data.after.cases}
    for case in data.design.load_cases:
        mine = verified.get(case.name)
        if mine is not None and case.infeasibility_after < CASE_HELD and decided(mine) is False:
            found.append(f"The design claims equilibrium for '{case.name}'; the built geometry does not hold it.")
    return tuple(found)


def _remarks(data: ReportData) -> tuple[Remark, ...]:
    if data.simulation is None:
        return ()
    insertions = data.after.insertions
    return remarks(data.design.assembly, data.simulation, insertions=insertions, states=data.states)


def tilt_gaps(data: ReportData) -> tuple[float, ...]:
    """Return how far apart, radians, statics and physics may be at most on every tilt."""
    return gaps_rad(data.simulation.tilt) if data.simulation else ()


def smallest_tilt(data: ReportData) -> tuple[float, float, str] | None:
    """Return (tilt, azimuth, source) of the smallest critical tilt, radians; None when unknown.

    With the friction that the design is judged with.
    """
    mu = data.design.judged_friction
    known = [(t.after_rad, t.azimuth_rad, "statics") for t in data.tilts if t.friction == mu]
    if data.simulation is not None:
        simulated = [t for t in data.simulation.tilt if t.friction == mu]
        known += [(t.critical_rad, t.azimuth_rad, called(data.simulation.engine_of(t))) for t in simulated]
    return min(known, default=None)
