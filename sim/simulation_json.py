"""A simulation as `simulation.json` and back: degrees, metres, newtons, for other programs to read."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.output import write_json
from mocca_robot.files.versions import SIMULATION
from mocca_robot.statics.solution import Status
from sim.insertion.trial import InsertionTrial
from sim.simulation import ConeSummary, Simulation
from sim.states import StateResult
from sim.tilt import TiltReport


def write_simulation(simulation: Simulation, path: str | Path) -> Path:
    """Return `path` after writing the simulation there."""
    return write_json(Path(path), simulation_to_data(simulation))


def read_simulation(path: str | Path) -> dict[str, Any]:
    """Return the file's data. Raises InputError when it is not a simulation, or a newer one."""
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"'{path}' is not a readable JSON file: {error}") from None
    current, notes = SIMULATION.current(fields.mapping(data, f"'{path}'"), f"'{path}'")
    return {**current, "notes": [*notes, *current.get("notes", [])]} if notes else current


def simulation_to_data(simulation: Simulation) -> dict[str, Any]:
    """Return plain JSON values; `stable` is null where a run gave no verdict."""
    data: dict[str, Any] = {
        "format": SIMULATION.name,
        "version": SIMULATION.version,
        "name": simulation.name,
        "engine": simulation.engine,
        "seconds": float(simulation.seconds.get("total", 0.0)),
        "seconds_by_stage": {k: float(v) for k, v in simulation.seconds.items()},
        "interrupted": simulation.interrupted,
        "disagreements": list(simulation.disagreements),
        "notes": list(simulation.notes),
        "states": [_state(s) for s in simulation.states],
        "tilt": [_tilt(t) for t in simulation.tilt],
        "insertion": [_insertion(c, simulation.insertion) for c in simulation.cones],
    }
    if simulation.robust is not None:
        r = simulation.robust
        interval = {"low": r.low, "high": r.high, "confidence": r.confidence}
        data["robust"] = {"trials": r.trials, "succeeded": r.succeeded, "rate": r.rate, **interval}
        data["robust"] |= {"failures": dict(r.failures), "distributions": asdict(r.options)}
    return data


def _state(s: StateResult) -> dict[str, Any]:
    return {
        "placed": s.placed,
        "stable": None if s.verdict == "failed" else s.stands,
        "statics_stable": None if s.statics == Status.INACCURATE else s.statics == Status.EQUILIBRIUM,
        "moved": list(s.moved),
        "max_displacement_m": s.max_displacement,
        "agrees": s.agrees,
        "reason": s.reason,
        "cause": s.cause,
        "statics_moved": list(s.statics_moved),
        "max_displacement_share": s.max_share,
        "final_speed_m_s": s.final_speed,
        "simulated_s": s.duration,
        "motion": {"parts": list(s.parts), "times_s": list(s.times), "poses": [list(map(list, p)) for p in s.poses]},
    }


def _tilt(t: TiltReport) -> dict[str, Any]:
    return {
        "azimuth_deg": float(np.rad2deg(t.azimuth_rad)),
        "critical_deg": float(np.rad2deg(t.critical_rad)),
        "within_deg": float(np.rad2deg(t.within_rad)),
        "statics_deg": float(np.rad2deg(t.statics_rad)),
        "friction": t.friction,
        "moved": list(t.moved),
        "runs_without_verdict_deg": [float(np.rad2deg(a)) for a in t.failed],
        "cause": t.cause,
    }


def _insertion(cone: ConeSummary, trials: Sequence[InsertionTrial]) -> dict[str, Any]:
    mine = [t for t in trials if t.part == cone.part]
    inside, outside = [t for t in mine if t.kind != "outside"], [t for t in mine if t.kind == "outside"]
    return {
        "part": cone.part,
        "inside": _counts(inside),
        "outside": _counts(outside),
        "axis": list(cone.axis),
        "cone_deg": float(np.rad2deg(cone.tried_rad)),
        "realised_cone_deg": float(np.rad2deg(cone.realised_rad)),
        "trials": [_trial(t) for t in mine],
    }


def _counts(trials: Sequence[InsertionTrial]) -> dict[str, Any]:
    return {
        "trials": len(trials),
        "succeeded": sum(t.succeeded for t in trials),
        "peak_force_n": max((t.peak_force for t in trials), default=0.0),
        "peak_force_share_of_allowed": max((t.peak_force / t.allowed_force for t in trials), default=0.0),
    }


def _trial(t: InsertionTrial) -> dict[str, Any]:
    return {
        "kind": t.kind,
        "direction": list(t.direction),
        "clearance_m": t.clearance,
        "error_m": t.error,
        "below": t.below,
        "succeeded": t.succeeded,
        "reason": t.reason,
        "peak_force_n": t.peak_force,
        "allowed_force_n": t.allowed_force,
        "penetration_m": t.peak_penetration,
        "tracking_error_m": t.tracking_error,
        "moved_below": list(t.moved_below),
    }
