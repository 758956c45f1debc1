"""The closing lines of `design`, `simulate` and `run`, and the same as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mocca_robot.assembly import Assembly
from mocca_robot.cli import physics_evidence, reasons
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode, positive_if
from mocca_robot.cli.stages import DesignOutcome
from mocca_robot.report.summary import goal_words


def introduce(assembly: Assembly, contacts: int, console: Console) -> None:
    """Say what was read and what is asked of it."""
    fixed = int(assembly.fixed.sum())
    asked = "; ".join(goal_words(g) for g in assembly.goals)
    alpha = "" if assembly.alpha_rad is None else f"; every part goes in within ±{reasons.degrees(assembly.alpha_rad)}"
    console.say(
        f"{assembly.name}: {assembly.dimension}D, {len(assembly.parts)} parts ({fixed} fixed), {contacts} contacts"
    )
    console.say(f"asked for: {asked}{alpha}")


def conclude(
    outcome: DesignOutcome, console: Console, *, interrupted: bool = False, further: Mapping[str, Any] | None = None
) -> int:
    """Return the exit status after saying the verdicts, their evidence, the times and where the files are."""
    say_verdicts(outcome, console)
    supports = reasons.supports(outcome.design.assembly, outcome.states)
    if supports:
        console.say(f"needs support after placing {reasons.quoted(supports, 20)}")
    explained = physics_evidence.explained(outcome.design.assembly, outcome.simulation or {})
    for note in dict.fromkeys((*outcome.design.notes, *explained)):
        console.say(f"note: {note}")
    for finding in outcome.findings:
        console.say(f"✗ {finding.text}")
    if interrupted:
        console.say("Interrupted: the verdicts cover what was finished; the same command goes on from there.")
    elif not outcome.findings:
        console.say("✓ every verdict is positive")
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
        console.say(f"input:     {_standing(outcome.before.cases)}")
    curved = sum(not j.is_planar for j in design.joints)
    joints = f"; {curved} of {len(design.joints)} joints curved" if design.joints and curved else ""
    console.say(f"statics:   {_standing(outcome.after.cases)}{joints}")
    insertions = outcome.after.insertions
    if insertions:
        tightest = min(insertions, key=lambda i: i.alpha_rad)
        free = sum(i.assemblable for i in insertions)
        room = f"tightest is '{tightest.part}', ±{reasons.degrees(tightest.alpha_rad)}"
        if tightest.alpha_rad < 0:
            room = f"'{tightest.part}' has no free direction"
        console.say(f"insertion: {free} of {len(insertions)} parts go in as asked; {room}")
    if outcome.simulation is not None:
        console.say(f"physics:   {physics_words(outcome.simulation)}")


def physics_words(simulation: Mapping[str, Any]) -> str:
    """Return what physics found, in one line."""
    states, tilts, insertion = (simulation.get(k) or [] for k in ("states", "tilt", "insertion"))
    said = []
    if states:
        stand = sum(s["stable"] is True for s in states)
        said.append(f"{stand} of {len(states)} states stand, {sum(s['agrees'] for s in states)} agree with statics")
    if tilts:
        said.append(f"falls at a tilt of {_critical_tilts(tilts)}")
    if insertion:
        trials, passed = (sum(e["inside"][k] for e in insertion) for k in ("trials", "succeeded"))
        wrong, through = (sum(e["outside"][k] for e in insertion) for k in ("trials", "succeeded"))
        said.append(f"{passed} of {trials} insertions inside the cones succeed, {through} of {wrong} outside")
    robust = simulation.get("robust")
    if robust:
        said.append(
            f"{robust['succeeded']} of {robust['trials']} disturbed builds stand "
            f"({robust['low']:.0%} to {robust['high']:.0%} at {robust['confidence']:.0%} confidence)"
        )
    return f"{simulation.get('engine', 'MuJoCo')}: " + ("; ".join(said) or "nothing was asked")


def _critical_tilts(tilts: Sequence[Mapping[str, Any]]) -> str:
    """Return the tilt towards the weakest side for every friction, and how far statics is off on any side."""
    said = []
    for friction in sorted({float(t["friction"]) for t in tilts}):
        mine = [t for t in tilts if t["friction"] == friction]
        least = min(float(t["critical_deg"]) for t in mine)
        apart = max(abs(t["critical_deg"] - t["statics_deg"]) + t.get("within_deg", 0.0) for t in mine)
        given = f" with friction {friction:g}" if friction else ""
        said.append(f"{least:.2f}°{given} (statics at most {apart:.2f}° apart)")
    return ", ".join(said)


def document(outcome: DesignOutcome, supports: tuple[str, ...]) -> dict[str, Any]:
    """Return the outcome for JSON."""
    assembly = outcome.design.assembly
    simulation = outcome.simulation or {}
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
        "insertions": reasons.insertions_data(outcome.after.insertions),
        "part_overlap": outcome.after.part_overlap,
        "simulation": {k: v for k, v in simulation.items() if k not in ("states", "insertion")} or None,
        "notes": [*outcome.design.notes, *physics_evidence.explained(assembly, simulation)],
        "files": {kind: str(path) for kind, path in outcome.files.items()},
    }


def _standing(cases: Any) -> str:
    stand = sum(c.result.stands for c in cases)
    worst = max(
        (c for c in cases if not c.result.stands),
        key=lambda c: np.nan_to_num(c.result.infeasibility, nan=1.0),
        default=None,
    )
    if worst is None:
        return f"stands, {stand} of {len(cases)} load cases in equilibrium without friction"
    return f"{stand} of {len(cases)} load cases in equilibrium; {reasons.quoted(worst.moving, 4)} would move"
