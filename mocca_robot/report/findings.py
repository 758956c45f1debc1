"""What statics and physics say, side by side: per state, per tilt, per insertion, and where they disagree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from mocca_robot.assembly import Interlocking, SupportFree
from mocca_robot.report.data import ReportData
from mocca_robot.statics.cases import CaseVerdict
from mocca_robot.tolerances import TILT_AGREEMENT_DEG, tilts_apart


@dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """One state of the sequence: the assembly just after `part` was placed.

    `statics` and `physics` are the verdicts (None = not known), `moving` the parts that move by either. The finished
    assembly needs support, too, where it was asked only to interlock: its key has to be held.
    """

    part: str
    statics: bool | None
    physics: bool | None
    moving: tuple[str, ...]
    verdict: CaseVerdict | None
    needs_support: bool

    @property
    def agree(self) -> bool | None:
        """Return whether both say the same; None when one is silent."""
        return None if self.statics is None or self.physics is None else self.statics == self.physics


def states(data: ReportData) -> tuple[State, ...]:
    """Return one entry per free part, in assembly order."""
    assembly = data.design.assembly
    asked = any(isinstance(g, SupportFree) for g in assembly.goals)
    keyed = bool(assembly.goals) and all(isinstance(g, Interlocking) for g in assembly.goals)
    by_name = {v.case.name: v for v in data.states}
    simulated = {str(s.get("placed")): s for s in entries(data, "states")}
    found = []
    for k, part in enumerate(assembly.parts):
        if part.fixed:
            continue
        verdict = by_name.get(f"state_{part.name}")
        physics = simulated.get(part.name, {})
        statics = decided(verdict) if verdict else _flag(physics.get("statics_stable"))
        stable = _flag(physics.get("stable"))
        names = set(verdict.moving if verdict else ()) | {str(m) for m in physics.get("moved", [])}
        moving = tuple(n for n in assembly.sequence if n in names)
        finished = k == len(assembly.parts) - 1 and not keyed
        falls = statics is False or stable is False
        found.append(
            State(
                part=part.name,
                statics=statics,
                physics=stable,
                moving=moving,
                verdict=verdict,
                needs_support=falls and not asked and not finished,
            )
        )
    return tuple(found)


def decided(verdict: CaseVerdict) -> bool | None:
    """Return whether the case stands; None when the solver was too inaccurate to say."""
    return None if verdict.result.status == "inaccurate" else verdict.result.stands


def entries(data: ReportData, key: str) -> list[Mapping[str, Any]]:
    """Return the list `key` of simulation.json, empty when there is none."""
    found = (data.simulation or {}).get(key) or []
    return [e for e in found if isinstance(e, Mapping)]


def disagreements(data: ReportData) -> tuple[str, ...]:
    """Return every contradiction between statics, physics and the design's own claims, one sentence each.

    Those of `below_bound` are none.
    """
    found: list[str] = []
    simulated = {str(s.get("placed")): s for s in entries(data, "states")}
    for state in states(data):
        if state.agree is False:
            says = "stands" if state.statics else "falls"
            other = "stands" if state.physics else "falls"
            text = f"After placing '{state.part}' the assembly {says} by statics and {other} in MuJoCo"
            found.append(f"{text}{because(simulated.get(state.part, {}))}.")
    found += [_tilt_apart(data, e) for e in _tilts_apart(data) if not is_below_bound(e)]
    found += _insertions(data)
    verified = {c.case.name: c for c in data.after.cases}
    for case in data.design.load_cases:
        mine = verified.get(case.name)
        if mine is not None and case.infeasibility_after < 1e-12 and decided(mine) is False:
            found.append(f"The design claims equilibrium for '{case.name}'; the built geometry does not hold it.")
    found += _told(data, found)
    return tuple(found)


def below_bound(data: ReportData) -> tuple[str, ...]:
    """Return the tilts with friction at which MuJoCo lets the structure fall before statics must, in words."""
    return tuple(_tilt_apart(data, e) for e in _tilts_apart(data) if is_below_bound(e))


def is_below_bound(entry: Mapping[str, Any]) -> bool:
    """Return whether MuJoCo says less than statics of a tilt with friction, and experiments looked for the cause.

    That forces exist that Coulomb's law allows is necessary for rest, not sufficient: nothing need bring them about,
    so that statics bounds such a tilt from above and both can be right. Without friction they are the only ones.
    """
    early = float(entry.get("critical_deg") or 0.0) < float(entry.get("statics_deg") or 0.0)
    return early and bool(entry.get("friction") and entry.get("cause")) and not entry.get("runs_without_verdict_deg")


def _tilts_apart(data: ReportData) -> list[Mapping[str, Any]]:
    known = [(e, e.get("critical_deg"), _statics_tilt(data, e)) for e in entries(data, "tilt")]
    pairs = [(e, a, b) for e, a, b in known if a is not None and b is not None]
    dimension = data.design.assembly.dimension
    return [e for e, a, b in pairs if tilts_apart(float(a), float(b), float(e.get("within_deg") or 0.0), dimension)]


def _tilt_apart(data: ReportData, entry: Mapping[str, Any]) -> str:
    words = _tilt_words(entry, float(entry["critical_deg"]), _statics_tilt(data, entry) or 0.0)
    return f"{words}; more than {TILT_AGREEMENT_DEG[data.design.assembly.dimension]:g}° apart{because(entry)}."


def _insertions(data: ReportData) -> list[str]:
    """Return where insertion in physics contradicts geometry.

    A trial onto parts that were free to move, in a state that needs support, is no contradiction.
    """
    found = []
    assemblable = {i.part: i.assemblable for i in data.after.insertions}
    sequence = states(data)
    before = {late.part: early.statics for early, late in pairwise(sequence)}
    for entry in entries(data, "insertion"):
        part, inside, outside = str(entry.get("part")), entry.get("inside") or {}, entry.get("outside") or {}
        failed, total = int(inside.get("trials", 0)) - int(inside.get("succeeded", 0)), int(inside.get("trials", 0))
        reasons = ""
        if isinstance(entry.get("trials"), list):
            bad = [t for t in entry["trials"] if t.get("kind") != "outside" and not t.get("succeeded")]
            bad = [t for t in bad if not (t.get("below") == "free" and before.get(part) is False)]
            failed = len(bad)
            said = Counter(str(t.get("reason", "")).split(":")[0] for t in bad)
            reasons = f" ({'; '.join(f'{n} × {r}' for r, n in said.most_common(3) if r)})"
        if failed > 0 and assemblable.get(part, False):
            found.append(f"'{part}' does not go in in MuJoCo in {failed} of {total} trials inside its cone{reasons}.")
        if int(outside.get("succeeded", 0)) > 0:
            found.append(f"'{part}' goes in along {outside['succeeded']} directions that geometry says are blocked.")
    return found


def because(entry: Mapping[str, Any]) -> str:
    """Return the cause that experiments gave for a disagreement in simulation.json, '' when there is none."""
    cause = str(entry.get("cause") or "")
    return f"; cause: {cause}" if cause else ""


def _tilt_words(entry: Mapping[str, Any], measured: float, expected: float) -> str:
    towards, friction = float(entry.get("azimuth_deg", 0)), float(entry.get("friction", 0) or 0)
    return (
        f"Critical tilt towards {towards:.0f}° (friction {friction:g}): "
        f"{expected:.2f}° by statics, {measured:.2f}° in MuJoCo"
    )


def _told(data: ReportData, found: list[str]) -> list[str]:
    """Return the simulation's own disagreements, less those about a state or tilt that `found` has already."""
    told = [str(d) for d in (data.simulation or {}).get("disagreements") or []]
    states_known = any(f.startswith("After placing") for f in found)
    tilts_known = any(f.startswith("Critical tilt") for f in found)
    tilts_known |= any(is_below_bound(e) for e in entries(data, "tilt"))
    known = (("state after", states_known), ("tilt towards", tilts_known))
    return [f"MuJoCo run: {d}" for d in told if not any(d.startswith(head) and have for head, have in known)]


def tilt_gaps(data: ReportData) -> tuple[float, ...]:
    """Return how far apart, in degrees, statics and MuJoCo may be at most for every critical tilt that both decide.

    Those of `below_bound` are left out.
    """
    compared = [e for e in entries(data, "tilt") if not is_below_bound(e)]
    known = [(e, e.get("critical_deg"), _statics_tilt(data, e)) for e in compared]
    pairs = [(e, a, b) for e, a, b in known if a is not None and b is not None]
    return tuple(abs(a - b) + float(e.get("within_deg") or 0.0) for e, a, b in pairs)


def _statics_tilt(data: ReportData, entry: Mapping[str, Any]) -> float | None:
    """Return statics' critical tilt in degrees for an entry of simulation.json: the report's own, or the entry's."""
    azimuth, friction = float(entry.get("azimuth_deg") or 0.0), float(entry.get("friction") or 0.0)
    for tilt in data.tilts:
        if abs(np.rad2deg(tilt.azimuth_rad) - azimuth) < 1e-3 and abs(tilt.friction - friction) < 1e-9:
            return float(np.rad2deg(tilt.after_rad))
    told = entry.get("statics_deg")
    return None if told is None else float(told)


def smallest_tilt(data: ReportData) -> tuple[float, float, str] | None:
    """Return (tilt, azimuth, source) of the smallest frictionless critical tilt, radians; None when unknown."""
    known = [(t.after_rad, t.azimuth_rad, "statics") for t in data.tilts if t.friction == 0.0]
    for entry in entries(data, "tilt"):
        if entry.get("critical_deg") is not None and not entry.get("friction"):
            azimuth = np.deg2rad(float(entry.get("azimuth_deg", 0.0)))
            known.append((float(np.deg2rad(entry["critical_deg"])), float(azimuth), "MuJoCo"))
    return min(known, default=None)


def _flag(value: object) -> bool | None:
    return None if value is None else bool(value)
