"""What MuJoCo holds against an assembly, and where it contradicts statics, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mocca_robot.assembly import Assembly, SupportFree
from mocca_robot.cli.reasons import NegativeVerdict, quoted
from mocca_robot.report.findings import because, is_below_bound
from mocca_robot.tolerances import tilts_apart


def simulation_findings(assembly: Assembly, simulation: Mapping[str, Any]) -> list[NegativeVerdict]:
    """Return what physics holds against an assembly, from the data of simulation.json."""
    found = [NegativeVerdict("disagreement", text) for text in _disagreements(assembly, simulation)]
    states = simulation.get("states", ())
    required = states if any(isinstance(g, SupportFree) for g in assembly.goals) else states[-1:]
    if all(g.kind == "interlocking" for g in assembly.goals):
        required = []
    for state in required:
        if state["stable"] is False:
            moved = tuple(state["moved"])
            text = f"Does not stand in MuJoCo after placing '{state['placed']}': {quoted(moved)} moved."
            found.append(NegativeVerdict("falls", text, moved, f"state_{state['placed']}"))
    for state in states:
        if state["stable"] is None:
            text = f"MuJoCo gave no verdict after placing '{state['placed']}': {state.get('reason', 'the run failed')}."
            found.append(NegativeVerdict("inaccurate", text, (), f"state_{state['placed']}"))
    for entry in simulation.get("insertion", ()):
        inside, outside = entry["inside"], entry["outside"]
        failed = inside["trials"] - inside["succeeded"]
        if failed:
            reasons = {str(t.get("reason")) for t in entry.get("trials", ()) if t["kind"] != "outside"} - {"", "None"}
            jam = next((t for t in entry.get("trials", ()) if t["kind"] != "outside" and not t["succeeded"]), None)
            why = f" ({jam['reason']})" if jam is not None and reasons else ""
            text = f"'{entry['part']}' jams in {failed} of {inside['trials']} insertions inside its cone{why}."
            found.append(NegativeVerdict("jams", text, (entry["part"],)))
        if outside["succeeded"]:
            text = (
                f"'{entry['part']}' goes in along {outside['succeeded']} of {outside['trials']} directions outside its "
                "cone, which geometry says are blocked."
            )
            found.append(NegativeVerdict("disagreement", text, (entry["part"],)))
    return found


def _disagreements(assembly: Assembly, simulation: Mapping[str, Any]) -> list[str]:
    found = []
    for state in simulation.get("states", ()):
        if state["stable"] is not None and state["statics_stable"] is not None and not state["agrees"]:
            physics, statics = ("stands" if state[k] else "falls" for k in ("stable", "statics_stable"))
            text = f"After placing '{state['placed']}' it {physics} in MuJoCo and {statics} by statics"
            found.append(f"{text}{because(state)}.")
    for tilt in simulation.get("tilt", ()):
        if tilt["runs_without_verdict_deg"]:
            count = len(tilt["runs_without_verdict_deg"])
            found.append(f"{count} of MuJoCo's runs gave no verdict at a {_tilt_words(assembly, tilt)}.")
        elif _apart(assembly, tilt) and not is_below_bound(tilt):
            found.append(_disagreement(assembly, tilt))
    return found


def explained(assembly: Assembly, simulation: Mapping[str, Any]) -> list[str]:
    """Return the tilts with friction at which MuJoCo lets it fall before statics must, in words, with their causes.

    They are listed among the disagreements of simulation.json and apart from them in the report, and hold nothing
    against a design: it counts on no friction, and statics bounds such a tilt from above (`findings.is_below_bound`).
    """
    apart = [t for t in simulation.get("tilt", ()) if _apart(assembly, t) and is_below_bound(t)]
    return [_disagreement(assembly, t) for t in apart]


def _disagreement(assembly: Assembly, tilt: Mapping[str, Any]) -> str:
    return f"MuJoCo and statics disagree on the {_tilt_words(assembly, tilt)}{because(tilt)}."


def _apart(assembly: Assembly, tilt: Mapping[str, Any]) -> bool:
    critical, statics, within = tilt["critical_deg"], tilt["statics_deg"], tilt.get("within_deg") or 0.0
    return tilts_apart(float(critical), float(statics), float(within), assembly.dimension)


def _tilt_words(assembly: Assembly, tilt: Mapping[str, Any]) -> str:
    where = f"{tilt['azimuth_deg']:.0f}°"
    if assembly.dimension == 2:
        where = "the right" if np.cos(np.deg2rad(tilt["azimuth_deg"])) >= 0 else "the left"
    return (
        f"tilt towards {where} (friction {tilt['friction']:g}): {tilt['critical_deg']:.2f}° in MuJoCo, "
        f"{tilt['statics_deg']:.2f}° by statics"
    )
