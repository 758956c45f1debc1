"""The verdict at a glance: four questions, answered in plain words with their figures."""

from __future__ import annotations

import math

import numpy as np

from mocca_robot.assembly import Lateral
from mocca_robot.report.case_words import case_words, goal_words
from mocca_robot.report.data import ReportData
from mocca_robot.report.findings import disagreements, smallest_tilt, states, tilt_gaps
from mocca_robot.report.markup import degrees, esc, listed, plural, significant
from mocca_robot.report.tilt_words import friction_words, limit_words
from mocca_robot.statics.cases import CaseVerdict
from mocca_robot.verdicts.agreement import towards
from mocca_robot.verdicts.verification import Verification

SHOWN_RAD = 1e-4
"""An angle that misses what was asked by less reads the same in the report."""


def asked_tilt(data: ReportData) -> float | None:
    """Return the tilt the goals ask for, radians; None when they do not."""
    asked = [g.angle_rad for g in data.design.assembly.goals if isinstance(g, Lateral)]
    return max(asked, default=None)


def summary(data: ReportData) -> str:
    """Return the title, one sentence of verdict, the four cards and the alarms."""
    assembly = data.design.assembly
    curved = sum(not j.is_planar for j in data.design.joints)
    goals = "; ".join(goal_words(g) for g in assembly.goals)
    alpha = assembly.alpha_rad
    asked = f", every part inserted from within ±{degrees(alpha, 1)}" if alpha is not None else ""
    return (
        f"<h1>{esc(assembly.name)}</h1>"
        f'<p class="mute">{assembly.dimension}D · {plural(len(assembly.parts), "part")} '
        f"({int(assembly.fixed.sum())} fixed) · {plural(len(data.design.joints), 'joint')}, {curved} curved · "
        f"asked for: {esc(goals)}{asked}</p>"
        f'<p class="lead">{_sentence(data)}</p>'
        f'<div class="cards">{_stands(data)}{_assemblable(data)}{_physics(data)}{_margin(data)}</div>'
        f"{_alarm(data)}"
    )


def _sentence(data: ReportData) -> str:
    before, after = _fallen(data.before), _fallen(data.after)
    name = esc(data.design.assembly.name)
    counted = "" if data.design.friction is None else f" It {data.design.friction.words}."
    if not after and before and _only_locking(data):
        return (
            f"<b>{name}</b> comes apart with flat contacts ({listed(before[0].moving, 4)} would move). With the "
            "designed joints it locks: as long as its key is held, no part can move against another."
        )
    if not after and before:
        return (
            f"<b>{name}</b> falls with flat contacts ({esc(case_words(before[0].case.name))}: "
            f"{listed(before[0].moving, 4)} would move). With the designed joints it stands, "
            f"without glue{' or screws' if counted else ', screws or friction'}{_short(data)}.{counted}"
        )
    if not after:
        flat = "it would stand with flat contacts, too"
        return f"<b>{name}</b> stands with the designed joints; {flat}{_short(data)}.{counted}"
    worst = max(after, key=lambda c: np.nan_to_num(c.result.infeasibility, nan=1.0))
    return (
        f"<b>{name}</b> does not hold {plural(len(after), 'load case')}; the worst is "
        f"“{esc(case_words(worst.case.name))}”, where {listed(worst.moving, 4)} would move."
    )


def _short(data: ReportData) -> str:
    """Return that less reserve was reached than was asked for, to follow a verdict; nothing where it was reached."""
    reserve = data.reserve
    if reserve is None or not reserve.missed:
        return ""
    reached, asked = degrees(reserve.critical_rad, 2), degrees(reserve.asked_rad, 2)
    return f", but falls at a tilt of {reached} where {asked} was asked for"


def _only_locking(data: ReportData) -> bool:
    """Return whether the design was asked to interlock and nothing else: gravity is not among its loads then."""
    return bool(data.after.cases) and all(c.case.gravity is None for c in data.after.cases)


def _fallen(verification: Verification) -> list[CaseVerdict]:
    return [c for c in verification.cases if not c.result.stands]


def card(kind: str, question: str, answer: str, words: str) -> str:
    """Return one card; `answer` is text, `words` markup."""
    return (
        f'<div class="card {kind}"><div class="q">{esc(question)}</div><div class="a">{esc(answer)}</div>'
        f'<div class="w">{words}</div></div>'
    )


def _stands(data: ReportData) -> str:
    cases, fallen = data.after.cases, _fallen(data.after)
    largest = max((c.result.infeasibility for c in cases), default=0.0)
    figure = f"largest infeasibility E/|w|² = {significant(largest, 2)}"
    if _only_locking(data):
        locked, answer = ("bad", "Comes apart") if fallen else ("ok", "Locks")
        return card(locked, "Does it lock?", answer, f"Every contact pushed apart, the key held; {figure}.")
    if not fallen:
        return card("ok", "Does it stand?", "Stands", f"{plural(len(cases), 'load case')} in equilibrium; {figure}.")
    unsure = [c for c in fallen if c.result.status == "inaccurate"]
    if len(unsure) == len(fallen):
        return card("warn", "Does it stand?", "Not decided", f"The solver was too inaccurate in {len(unsure)} cases.")
    words = f"{len(fallen)} of {plural(len(cases), 'load case')} not in equilibrium; {figure}."
    if all(c.only_clamped for c in fallen):
        words += " Some friction forces would hold it, but nothing brings them about."
        return card("bad", "Does it stand?", "Only clamped", words)
    return card("bad", "Does it stand?", "Falls", words)


def _assemblable(data: ReportData) -> str:
    question = "Can it be put together?"
    insertions = data.after.insertions
    if not insertions:
        return card("none", question, "Nothing to insert", "Every part is fixed.")
    blocked = [i for i in insertions if not i.assemblable]
    tightest = min(insertions, key=lambda i: i.alpha_rad)
    figure = f"tightest: <code>{esc(tightest.part)}</code> leaves within ±{degrees(max(tightest.alpha_rad, 0.0))}"
    if blocked:
        first = blocked[0]
        by = f", hindered by {listed(first.blockers, 3)}" if first.blockers else ""
        words = f"{listed([i.part for i in blocked], 4)} cannot go in as asked{by}; {figure}."
        return card("bad", question, "Blocked", words)
    asked = tightest.required_rad
    if asked is None:
        return card("ok", question, "Yes", f"Each part has a free way in; {figure} (no cone was asked for).")
    words = f"asked ±{degrees(asked)}; {figure}, {degrees(tightest.alpha_rad - asked)} to spare."
    return card("ok", question, f"Within ±{degrees(asked, 0)}", words)


def _physics(data: ReportData) -> str:
    question = "Does physics agree?"
    if data.simulation is None:
        return card("none", question, "Not simulated", "Run <code>mocca-robot simulate</code> to ask MuJoCo.")
    compared = [s for s in states(data) if s.agree is not None]
    same = sum(s.agree is True for s in compared)
    tilts = tilt_gaps(data)
    said = [f"{same} of {plural(len(compared), 'state')} the same verdict"] if compared else []
    said += [f"critical tilt within {np.rad2deg(max(tilts)):.2f}°"] if tilts else []
    inside = [t for t in data.simulation.trials if t.inside]
    passed = sum(t.succeeded for t in inside)
    said += [f"{passed} of {len(inside)} insertions inside the cones succeed"] if inside else []
    words = "; ".join(said)
    if disagreements(data):
        return card("bad", question, "Disagrees", f"{words}. See the list below.")
    if not said:
        return card("none", question, "Nothing compared", "The simulation holds no states, tilts or insertions.")
    return card("ok", question, "Agrees", f"{words}.")


def _margin(data: ReportData) -> str:
    question = "How much margin?"
    found, asked = smallest_tilt(data), asked_tilt(data)
    if found is None or not math.isfinite(found[0]):
        return card("none", question, "Not measured", "No critical tilt was computed.")
    angle, azimuth, source = found
    if _only_locking(data):
        words = f"Nothing moves while the key is held. Let go, it stands up to a tilt of {degrees(angle)}."
        return card("none", question, "Key held", words)
    mu, dimension = data.design.judged_friction, data.design.assembly.dimension
    by = f"by {source}, {f'friction {mu:g}' if mu else 'no friction'}"
    words = f"smallest critical tilt, towards {towards(azimuth, dimension)} ({by})"
    before = [t.before_rad for t in data.tilts if t.before_rad is not None and t.friction == mu]
    words += f"; the input: {degrees(min(before))}" if before else ""
    reserve, least = data.reserve, angle
    if reserve is not None and reserve.critical_rad < angle - SHOWN_RAD:
        least, side = reserve.critical_rad, towards(reserve.azimuth_rad, dimension)
        state = esc(case_words(reserve.case))
        state = f"{state}, towards {side} ({friction_words(reserve)})"
        words = f"{state}. Finished and with no other load: {degrees(angle)}, {words}"
    met = asked is None or angle >= asked - SHOWN_RAD
    if reserve is not None and reserve.missed:
        words += f"; asked for {degrees(reserve.asked_rad)}"
        if limited := limit_words(reserve):
            words += f". {esc(limited[:1].upper() + limited[1:])}"
        return card("warn" if met else "bad", question, f"Tilts by {degrees(least)}", words + ".")
    if asked is not None:
        words += f"; asked for {degrees(asked)}"
        return card("ok" if met else "bad", question, f"Tilts by {degrees(least)}", words + ".")
    return card("ok" if least > np.deg2rad(1.0) else "warn", question, f"Tilts by {degrees(least)}", words + ".")


def _alarm(data: ReportData) -> str:
    found = disagreements(data)
    out = ""
    told = [text for text in data.negative if text not in found]
    if told:
        items = "".join(f"<li>{esc(text)}</li>" for text in told)
        out += (
            f'<section class="alarm" id="negative" role="alert"><h2>What does not hold</h2><ul>{items}</ul></section>'
        )
    if found:
        items = "".join(f"<li>{esc(d)}</li>" for d in found)
        head = f"{plural(len(found), 'disagreement')} between design, statics, geometry and physics"
        out += f'<section class="alarm" id="disagreements" role="alert"><h2>{head}</h2><ul>{items}</ul></section>'
    return out
