"""What `check` finds out about an assembly as it is, in words and as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Interlocking
from mocca_robot.cli import reasons
from mocca_robot.cli.reasons import NegativeVerdict
from mocca_robot.contacts.contact import NearMiss
from mocca_robot.errors import quoted
from mocca_robot.motion.insertion import insertion_verdicts
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report import reserves, tilt_words
from mocca_robot.report.markup import plural
from mocca_robot.statics.cases import CaseVerdict, critical_tilts, solve_case
from mocca_robot.statics.coulomb_tilt import FrictionTilt
from mocca_robot.statics.friction_cases import TANGENTIAL_BAND, tilt_band, tilt_with_friction
from mocca_robot.statics.load_factor import load_factors
from mocca_robot.statics.loads import load_cases, state_cases, tilt_azimuths
from mocca_robot.statics.mobility import Mobility, mobility
from mocca_robot.statics.moving_support import support_factors
from mocca_robot.statics.tilt_reserve import TiltReserve, tilt_reserve
from mocca_robot.verdicts.verification import Verification, part_overlap

BESIDE_RAD = 2e-3
"""Difference from which on a second figure beside a critical tilt is worth a line: 0.1°."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Checkup:
    """An assembly as it is.

    Attributes:
        graph, near_misses: the input with its contacts, and what nearly is one.
        friction: Coulomb coefficient of every verdict here.
        verification: the cases that the goals ask for, and every part's way in.
        states: every intermediate assembly.
        azimuths, tilts: radians; the critical tilt towards each azimuth.
        friction_tilts: the same with what is known of them, with friction only.
        band: radians; the least critical tilt with softer and stiffer tangential springs, with friction only.
        key: part that is held for interlocking, if any.
        key_mobility: what can move while the key is held.
        mobility: what can move in the finished structure.
        findings: negative verdicts.
        reserve: the smallest reserve against tilting with this friction; None where nothing has to stand.
        dry_reserve: the same without friction, where there is some.
    """

    graph: PartsGraph
    near_misses: tuple[NearMiss, ...]
    friction: float
    verification: Verification
    states: tuple[CaseVerdict, ...]
    azimuths: Array
    tilts: tuple[float, ...]
    friction_tilts: tuple[FrictionTilt, ...]
    band: tuple[float, float] | None
    key: str | None
    key_mobility: Mobility | None
    mobility: Mobility
    findings: tuple[NegativeVerdict, ...]
    reserve: TiltReserve | None
    dry_reserve: TiltReserve | None


def checkup(
    graph: PartsGraph,
    near_misses: tuple[NearMiss, ...],
    friction: float,
    key: str | None,
    azimuths: int,
    margin_rad: float,
) -> Checkup:
    """Return everything that statics says about an assembly with its contacts as they are.

    `margin_rad` is the reserve against tilting that a design is asked for.
    """
    assembly = graph.assembly
    keys = [g.key for g in assembly.goals if isinstance(g, Interlocking)]
    goals = assembly.goals if key is None or key in keys else (*assembly.goals, Interlocking(key))
    key = key or next(iter(keys), None)
    cases = tuple(solve_case(graph, case, friction) for case in load_cases(graph, goals))
    factors = (*load_factors(graph, friction), *support_factors(graph, friction))
    verification = Verification(
        graph,
        cases,
        insertion_verdicts(graph),
        part_overlap(assembly),
        factors,
    )
    states = tuple(solve_case(graph, case, friction) for case in state_cases(graph))
    angles = tilt_azimuths(assembly.dimension, azimuths)
    rubbing = tuple(tilt_with_friction(graph, float(a), friction) for a in angles if friction > 0.0)
    tilts = tuple(t.critical_rad for t in rubbing) or critical_tilts(graph, angles)
    weakest = int(np.argmin(tilts))
    band = tilt_band(graph, float(angles[weakest]), friction) if rubbing and tilts[weakest] > 0.0 else None
    held = _held(graph, key)
    anything = mobility(graph)
    findings = [*reasons.statics_findings(assembly, verification), *reasons.hanging_findings(graph)]
    if key is not None and held is not None and not held.locked and not any(f.case == "interlocking" for f in findings):
        findings.append(reasons.loose_finding(key, held))
    if anything.locked:
        findings.append(reasons.deadlock_finding(assembly))
    asked = [c.case for c in cases]
    return Checkup(
        graph=graph,
        near_misses=near_misses,
        friction=friction,
        verification=verification,
        states=states,
        azimuths=angles,
        tilts=tilts,
        friction_tilts=rubbing,
        band=band,
        key=key,
        key_mobility=held,
        mobility=anything,
        findings=tuple(findings),
        reserve=tilt_reserve(graph, margin_rad, azimuths, asked, friction),
        dry_reserve=tilt_reserve(graph, margin_rad, azimuths, asked) if friction > 0.0 else None,
    )


def _held(graph: PartsGraph, key: str | None) -> Mobility | None:
    """Return what moves while the interlocking load case holds what it holds: the key and the fixed parts."""
    if key is None:
        return None
    (case,) = load_cases(graph, (Interlocking(key),))
    return mobility(graph, case.held)


def lines(found: Checkup, built: bool = False) -> list[str]:
    """Return the check-up as text, one verdict a line, the evidence last.

    The flat contacts of an input bound what any joint could offer; those of a `built` design are joints already.
    """
    assembly, contacts = found.graph.assembly, found.graph.contacts
    fixed = quoted([p.name for p in assembly.parts if p.fixed])
    mass = sum(p.mass for p in assembly.parts)
    out = [
        f"{assembly.name}: {assembly.dimension}D, {len(assembly.parts)} parts, {mass:.3g} kg, "
        f"{assembly.size:.3g} m in size; fixed: {fixed}",
        f"contacts: {len(contacts)} between {plural(len({c.parts for c in contacts}), 'pair')}",
    ]
    for miss in found.near_misses:
        a, b = miss.parts
        out.append(
            f"near miss: '{a}' and '{b}' are {miss.gap_m * 1e3:.3g} mm apart; close the gap if they should touch"
        )
    friction = f", friction {found.friction:g}" if found.friction else ", no friction"
    for state in found.states:
        verdict = "stands" if state.result.stands else f"falls: {quoted(state.moving)} would move"
        if state.only_clamped:
            verdict = f"stands only clamped: {quoted(state.moving)} would slide out"
        if state.result.status == "inaccurate":
            verdict = "not decided, the solver was inaccurate"
            if state.rubbing is not None:
                verdict = "not decided: neither rest nor a lasting fall was found"
        name = state.case.name.removeprefix("state_")
        out.append(f"after '{name}': {verdict} (E/|w|² = {state.result.infeasibility:.2g}{friction})")
    tilts = ", ".join(f"{_azimuth(assembly, a)} {np.rad2deg(t):.2f}°" for a, t in zip(found.azimuths, found.tilts))
    out.append(f"critical tilt: {tilts}")
    out += _about_tilts(found)
    both = (r for r in (found.reserve, found.dry_reserve) if r is not None)
    out += ["reserve: " + tilt_words.tilt_words(reserve, assembly.dimension) for reserve in both]
    out += [reserves.factor_words(factor) for factor in found.verification.load_factors]
    if found.key is not None and found.key_mobility is not None:
        loose = found.key_mobility
        says = "everything interlocks" if loose.locked else f"{quoted(loose.moving)} can move"
        out.append(f"with '{found.key}' held: {says}")
    for way in found.verification.insertions:
        by = f"; in its way: {quoted(way.blockers)}" if way.blockers else ""
        room = f"can be inserted within ±{reasons.degrees(way.alpha_rad)}"
        room += "" if built else "; no joint can widen that"
        if way.alpha_rad < 0:
            room = "cannot be inserted from any direction" + ("" if built else "; no joint can change that")
        out.append(f"'{way.part}' {room}{by}")
    supports = reasons.supports(assembly, found.states)
    if supports:
        out.append(f"needs support after placing {quoted(supports, 20)}")
    out += [f"✗ {f.text}" for f in found.findings] or [
        f"✓ {tilt_words.positive_words(found.reserve, found.verification.load_factors)}"
    ]
    return out


def document(found: Checkup) -> dict[str, Any]:
    """Return the check-up for JSON."""
    return {
        "name": found.graph.assembly.name,
        "dimension": found.graph.assembly.dimension,
        "parts": [{"name": p.name, "fixed": p.fixed, "mass_kg": p.mass} for p in found.graph.assembly.parts],
        "contacts": len(found.graph.contacts),
        "near_misses": [{"parts": list(m.parts), "gap_m": m.gap_m} for m in found.near_misses],
        "friction": found.friction,
        "cases": reasons.cases_data(found.verification.cases),
        "states": reasons.cases_data(found.states),
        "needs_support": list(reasons.supports(found.graph.assembly, found.states)),
        "tilt": [
            {"azimuth_deg": float(np.rad2deg(a)), "critical_deg": float(np.rad2deg(t)), **more}
            for a, t, more in zip(found.azimuths, found.tilts, _tilt_figures(found))
        ],
        **_band(found),
        **tilt_words.both_data(found.reserve, found.dry_reserve),
        "load_factors": reserves.factors_data(found.verification.load_factors),
        "key": found.key,
        "interlocks": None if found.key_mobility is None else found.key_mobility.locked,
        "deadlock": found.mobility.locked,
        "insertions": reasons.insertions_data(found.verification.insertions),
        "part_overlap": found.verification.part_overlap,
        "findings": reasons.findings_data(found.findings),
    }


def _about_tilts(found: Checkup) -> list[str]:
    """Return the second figures beside critical tilts with friction."""
    out = []
    if any(t.bound_rad - t.critical_rad > BESIDE_RAD for t in found.friction_tilts):
        bounds = ", ".join(
            f"{_azimuth(found.graph.assembly, a)} {np.rad2deg(t.bound_rad):.2f}°"
            for a, t in zip(found.azimuths, found.friction_tilts)
        )
        out.append(f"clamped it could stand up to: {bounds} (friction forces exist, but nothing brings them about)")
    for a, t in zip(found.azimuths, found.friction_tilts):
        if t.undecided:
            stands, falls = (f"{np.rad2deg(x):.2f}°" for x in (t.stands_rad, t.falls_rad))
            where = _azimuth(found.graph.assembly, a).removesuffix(":")
            out.append(f"not decided towards {where}: it stands up to {stands} and does not at {falls}")
    if found.band is not None and found.band[1] - found.band[0] > BESIDE_RAD:
        low, high = (f"{np.rad2deg(x):.2f}°" for x in found.band)
        least, most = TANGENTIAL_BAND
        out.append(f"the smallest of them lies between {low} and {high} for k_t/k_n from {least:g} to {most:g}")
    return out


def _tilt_figures(found: Checkup) -> list[dict[str, Any]]:
    """Return what is known of every critical tilt with friction, for JSON."""
    if not found.friction_tilts:
        return [{} for _ in found.azimuths]
    return [
        {
            "stands_deg": float(np.rad2deg(t.stands_rad)),
            "fails_deg": float(np.rad2deg(t.fails_rad)),
            "falls_deg": float(np.rad2deg(t.falls_rad)),
            "bound_deg": float(np.rad2deg(t.bound_rad)),
            "fails_as": None if t.failure is None else str(t.failure.standing),
        }
        for t in found.friction_tilts
    ]


def _band(found: Checkup) -> dict[str, Any]:
    if found.friction == 0.0:
        return {}
    return {"least_tilt_band_deg": None if found.band is None else [float(np.rad2deg(x)) for x in found.band]}


def _azimuth(assembly: Assembly, azimuth_rad: float) -> str:
    if assembly.dimension == 2:
        return "right" if np.cos(azimuth_rad) >= 0 else "left"
    return f"{np.rad2deg(azimuth_rad):.0f}°:"
