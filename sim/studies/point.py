"""One point of a study: a configuration → a row of plain values, the same wherever it is computed."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from mocca_robot.config.config import Config
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.errors import MoccaError
from mocca_robot.files.design_json import read_design, write_design
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.runtime.threads import with_one_blas_thread
from mocca_robot.statics.cases import critical_tilts
from mocca_robot.statics.loads import tilt_azimuths
from mocca_robot.verdicts.agreement import contradictions
from mocca_robot.verdicts.verification import Verification, verify

Row: TypeAlias = dict[str, Any]
"""Status, reason and figures of a point, by column."""

UNUSABLE, FAILED = "unusable", "failed"
"""The values cannot be used; an error in the programme, or a worker that died."""

HOLDS, FALLS, BLOCKED, IMPOSSIBLE, NARROW = "holds", "falls", "blocked", "impossible", "narrow"
"""All as asked; a load case fails; a part does not go in; no joint can hold it; no joint can give a part its α."""


@dataclass(frozen=True, eq=False)
class Task:
    """What a worker needs to evaluate a point: no file of the study's has to be there."""

    config: Config
    stages: tuple[str, ...]


def evaluate(task: Task) -> Row:
    """Return the row of a point; a point that cannot be used or fails is a row with its reason, never an error."""
    started = time.perf_counter()
    try:
        row = _evaluate(task)
    except MoccaError as error:
        row = {"status": UNUSABLE, "reason": str(error)}
    except Exception as error:
        row = {"status": FAILED, "reason": f"{type(error).__name__}: {error}"}
    return {**row, "seconds": time.perf_counter() - started}


@with_one_blas_thread  # wherever it runs: sums in another order differ in their last digits
def _evaluate(task: Task) -> Row:
    config = task.config
    report = find_contacts(config.assembly)
    require_sound(config.assembly, report)
    row: Row = {"parts": len(config.assembly.parts), "contacts": len(report.contacts)}
    if "design" not in task.stages:
        verification = verify(config.assembly, friction=config.friction, directions=dict(config.insertion))
        graph = verification.graph
        row |= _verdict(verification)
    else:
        found, graph = _design(config, report)
        row |= found
    if "tilt" in task.stages:
        row |= _tilts(graph, config)
    if "simulate" in task.stages:
        row |= _simulate(graph, config)
    status, reason = row.pop("status"), row.pop("reason")
    return {"status": status, "reason": reason, **row}


def _design(config: Config, report: Any) -> tuple[Row, PartsGraph]:
    """Return the figures of a design, and its parts, ways in and contacts as they are read back from its files."""
    from planners.cone_joints.largest_tilt import design_as_asked

    found = design_as_asked(config.assembly, config.joints, insertion=dict(config.insertion) or None, contacts=report)
    with tempfile.TemporaryDirectory(prefix="mocca-point-") as folder:
        stored = read_design(write_design(found.design, Path(folder)))
    ways = {i.part: i.direction for i in stored.insertion}
    verification = verify(stored.assembly, directions=ways)
    row = {
        "curved_joints": sum(not j.is_planar for j in found.design.joints),
        "infeasibility_before": max((c.infeasibility_before for c in found.design.load_cases), default=0.0),
        "evaluations": found.evaluations,
        **_verdict(verification),
    }
    if found.impossible is not None:
        case, proof = found.impossible
        reason = f"no joint within the bounds holds {case}: E/|w|² {proof.infeasibility:.2g} is left, which is proved"
        row |= {"status": IMPOSSIBLE, "reason": reason}
    elif found.narrow:
        part = min(found.narrow, key=lambda n: n.alpha_rad)
        room = f"±{np.rad2deg(max(part.alpha_rad, 0.0)):.2f}°"
        row |= {"status": NARROW, "reason": f"flat contacts leave '{part.part}' {room}, less than α asks for"}
    return row, verification.graph


def _verdict(verification: Verification) -> Row:
    falls = [c for c in verification.cases if not c.result.stands]
    blocked = [i for i in verification.insertions if not i.assemblable]
    status, reason = HOLDS, ""
    if falls:
        worst = max(falls, key=lambda c: float(np.nan_to_num(c.result.infeasibility, nan=1.0)))
        status, reason = FALLS, f"{worst.case.name}: {', '.join(worst.moving[:4])} would move"
    elif blocked:
        status, reason = BLOCKED, f"'{blocked[0].part}' cannot be inserted as asked"
    narrowest = min((i.alpha_rad for i in verification.insertions), default=None)
    return {
        "status": status,
        "reason": reason,
        "cases": len(verification.cases),
        "cases_standing": len(verification.cases) - len(falls),
        "infeasibility": max((float(c.result.infeasibility) for c in verification.cases), default=0.0),
        "narrowest_cone_deg": None if narrowest is None else float(np.rad2deg(narrowest)),
        "parts_blocked": len(blocked),
    }


def _tilts(graph: PartsGraph, config: Config) -> Row:
    azimuths = tilt_azimuths(graph.assembly.dimension, config.simulate.azimuths)
    tilts = critical_tilts(graph, azimuths, config.friction)
    least = int(np.argmin(tilts))
    return {
        "tilt_deg": float(np.rad2deg(tilts[least])),
        "tilt_azimuth_deg": float(np.rad2deg(azimuths[least])),
    }


def _simulate(graph: PartsGraph, config: Config) -> Row:
    from sim.questions import Questions
    from sim.simulate import simulate

    asked = Questions(
        friction=config.simulate.friction,
        azimuths=config.simulate.azimuths,
        directions=config.simulate.directions,
        seed=config.simulate.seed,
        threads=1,
    )
    found = simulate(graph.assembly, graph.chosen, asked)
    level = [t.critical_rad for t in found.tilt if t.friction == 0.0]
    inside = [t for t in found.trials if t.inside]
    return {
        "mujoco_states_standing": sum(s.stands for s in found.states),
        "mujoco_states": len(found.states),
        "mujoco_tilt_deg": float(np.rad2deg(min(level))) if level else None,
        "mujoco_insertions_inside": len(inside),
        "mujoco_insertions_succeeded": sum(t.succeeded for t in inside),
        "mujoco_disagreements": len(contradictions(graph.assembly, found)),
    }
