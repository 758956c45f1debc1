"""The closing lines of `design`, `simulate` and `run`, and the same as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mocca_robot.assembly import Assembly
from mocca_robot.cli import reasons
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode, positive_if
from mocca_robot.cli.stages import DesignOutcome
from mocca_robot.design import Design
from mocca_robot.errors import quoted
from mocca_robot.report import reserves, tilt_words
from mocca_robot.report.case_words import goal_words
from mocca_robot.report.strength import MILLIMETRES, strength_words
from mocca_robot.strength.strength_json import strength_to_data
from mocca_robot.verdicts.agreement import agree, times
from mocca_robot.verdicts.physics import LoadVerdict, Simulation, StateVerdict, TiltVerdict, Tries
from mocca_robot.verdicts.simulation_json import simulation_to_data


def introduce(assembly: Assembly, contacts: int, console: Console) -> None:
    """Say what was read and what is asked of it."""
    fixed = int(assembly.fixed.sum())
    asked = "; ".join(goal_words(g) for g in assembly.goals)
    alpha = "" if assembly.alpha_rad is None else f"; every part goes in within ±{reasons.degrees(assembly.alpha_rad)}"
    console.say(
        f"{assembly.name}: {assembly.dimension}D, {len(assembly.parts)} parts ({fixed} fixed), {contacts} contacts"
    )
    console.say(f"asked for: {asked}{alpha}")


def first_words(outcome: DesignOutcome, console: Console) -> str:
    """Return what is known before physics is asked, which takes longest, and where to look at it meanwhile."""
    findings = len(outcome.findings)
    verdict = f"{findings} negative verdict{'s' * (findings != 1)}" if findings else "every verdict positive"
    seconds = sum(console.seconds.values())
    return f"after {seconds:.1f} s: {verdict} by statics, see {outcome.files['report']}; physics follows"


def conclude(
    outcome: DesignOutcome, console: Console, *, interrupted: bool = False, further: Mapping[str, Any] | None = None
) -> int:
    """Return the exit status after saying the verdicts, their evidence, the times and where the files are."""
    say_verdicts(outcome, console)
    supports = reasons.supports(outcome.design.assembly, outcome.states)
    if supports:
        console.say(f"needs support after placing {quoted(supports, 20)}")
    for note in dict.fromkeys(_notes(outcome)):
        console.say(f"note: {note}")
    for finding in outcome.findings:
        console.say(f"✗ {finding.text}")
    if interrupted:
        console.say("Interrupted: the verdicts cover what was finished; the same command goes on from there.")
    elif not outcome.findings:
        console.say(f"✓ {tilt_words.positive_words(outcome.reserve, outcome.after.load_factors)}")
    console.say(console.times())
    for kind, path in outcome.files.items():
        if kind != "report":
            console.say(f"{path}")
    if "report" in outcome.files:
        console.say(f"{outcome.files['report']}")
    status = ExitCode.INTERRUPTED if interrupted else positive_if(not outcome.findings)
    return console.finish(status, {**document(outcome, supports), "interrupted": interrupted, **(further or {})})


def say_verdicts(outcome: DesignOutcome, console: Console) -> None:
    """Say what statics, geometry and physics found."""
    design = outcome.design
    if design.source is not design.assembly:
        console.say(f"input:     {_standing(outcome.before.cases, design)}")
    curved = sum(not j.is_planar for j in design.joints)
    joints = f"; {curved} of {len(design.joints)} joints curved" if design.joints and curved else ""
    console.say(f"statics:   {_standing(outcome.after.cases, design)}{joints}")
    if design.friction is not None:
        console.say(f"friction:  the design {design.friction.words}")
    insertions = outcome.after.insertions
    if insertions:
        tightest = min(insertions, key=lambda i: i.alpha_rad)
        free = sum(i.assemblable for i in insertions)
        room = f"tightest is '{tightest.part}', ±{reasons.degrees(tightest.alpha_rad)}"
        if tightest.alpha_rad < 0:
            room = f"'{tightest.part}' has no free direction"
        console.say(f"insertion: {free} of {len(insertions)} parts go in as asked; {room}")
    if outcome.reserve is not None:
        dimension = design.assembly.dimension
        console.say(f"reserve:   {tilt_words.tilt_words(outcome.reserve, dimension)}")
        told = outcome.reserve.missed or outcome.reserve.largest
        if told and (limited := tilt_words.limit_words(outcome.reserve)):
            console.say(f"           {limited}")
    if outcome.dry_reserve is not None:
        console.say(f"reserve:   {tilt_words.tilt_words(outcome.dry_reserve, design.assembly.dimension)}")
    for factor in outcome.after.load_factors:
        console.say(f"load:      {reserves.factor_words(factor)}")
    if outcome.strength is not None:
        console.say(f"strength:  {strength_words(outcome.strength, *MILLIMETRES)}")
    if outcome.simulation is not None:
        console.say(f"physics:   {physics_words(outcome.simulation)}")


def physics_words(simulation: Simulation) -> str:
    """Return what physics found, in one line."""
    said = []
    if states := simulation.states:
        same = sum(agree(s.verdict, s.statics) is True for s in states)
        stand = sum(s.stands for s in states)
        said.append(f"{stand} of {len(states)} states stand, {same} agree with statics")
    if simulation.tilt:
        said.append(f"falls at a tilt of {_critical_tilts(simulation.tilt)}")
    if simulation.loads:
        said.append(_loads(simulation.loads))
    if simulation.trials:
        inside, outside = (Tries.of([t for t in simulation.trials if t.inside is side]) for side in (True, False))
        said.append(
            f"{inside.succeeded} of {inside.trials} insertions inside the cones succeed, "
            f"{outside.succeeded} of {outside.trials} outside"
        )
    if (robust := simulation.robust) is not None:
        said.append(
            f"{robust.succeeded} of {robust.trials} disturbed builds stand "
            f"({robust.low:.0%} to {robust.high:.0%} at {robust.confidence:.0%} confidence)"
        )
    verdicts: tuple[StateVerdict | TiltVerdict | LoadVerdict, ...] = (
        *simulation.states,
        *simulation.tilt,
        *simulation.loads,
    )
    engines = dict.fromkeys([simulation.engine, *(simulation.engine_of(v) for v in verdicts)])
    return f"{', '.join(engines)}: " + ("; ".join(said) or "nothing was asked")


def _critical_tilts(tilts: Sequence[TiltVerdict]) -> str:
    """Return the tilt towards the weakest side for every friction, and how far statics is off on any side."""
    said = []
    for friction in sorted({t.friction for t in tilts}):
        mine = [t for t in tilts if t.friction == friction]
        least, apart = np.rad2deg([min(t.critical_rad for t in mine), max(t.apart_rad for t in mine)])
        given = f" with friction {friction:g}" if friction else ""
        said.append(f"{least:.2f}°{given} (statics at most {apart:.2f}° apart)")
    return ", ".join(said)


def _loads(loads: Sequence[LoadVerdict]) -> str:
    """Return the load of which least stands, and how far statics is off on any."""
    least = min(loads, key=lambda f: f.factor)
    apart = max(f.apart for f in loads)
    return f"takes {times(least)} '{least.name}' (statics at most {apart:.1%} apart)"


def document(outcome: DesignOutcome, supports: tuple[str, ...]) -> dict[str, Any]:
    """Return the outcome for JSON."""
    assembly = outcome.design.assembly
    simulation = {} if outcome.simulation is None else simulation_to_data(outcome.simulation, assembly)
    return {
        "name": assembly.name,
        "dimension": assembly.dimension,
        "parts": len(assembly.parts),
        "contacts": len(outcome.before.contacts),
        "curved_joints": sum(not j.is_planar for j in outcome.design.joints),
        "findings": reasons.findings_data(outcome.findings),
        "needs_support": list(supports),
        "input_cases": reasons.cases_data(outcome.before.cases),
        "cases": reasons.cases_data(outcome.after.cases),
        "states": reasons.cases_data(outcome.states),
        **tilt_words.both_data(outcome.reserve, outcome.dry_reserve),
        "strength": None if outcome.strength is None else strength_to_data(outcome.strength, assembly.name),
        "load_factors": reserves.factors_data(outcome.after.load_factors),
        "insertions": reasons.insertions_data(outcome.after.insertions),
        "part_overlap": outcome.after.part_overlap,
        "simulation": {k: v for k, v in simulation.items() if k not in ("states", "insertion")} or None,
        "friction": None if outcome.design.friction is None else outcome.design.friction.data(),
        "notes": _notes(outcome),
        "files": {kind: str(path) for kind, path in outcome.files.items()},
    }


def _notes(outcome: DesignOutcome) -> list[str]:
    """Return the design's notes, and what is worth knowing of physics and held against nothing."""
    return [*outcome.design.notes, *(r.text for r in outcome.remarks if not r.held)]


def _standing(cases: Any, design: Design) -> str:
    rubbing = f"with friction {design.friction.coefficient:g}" if design.friction else "without friction"
    stand = sum(c.result.stands for c in cases)
    worst = max(
        (c for c in cases if not c.result.stands),
        key=lambda c: np.nan_to_num(c.result.infeasibility, nan=1.0),
        default=None,
    )
    if worst is None:
        return f"stands, {stand} of {len(cases)} load cases in equilibrium {rubbing}"
    return f"{stand} of {len(cases)} load cases in equilibrium; {quoted(worst.moving, 4)} would move"
