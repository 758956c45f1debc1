"""A simulation as `simulation.json` and back: degrees, metres, newtons, for other programs to read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mocca_robot.assembly import Assembly
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.documents import parse_json, read_text
from mocca_robot.files.output import write_json
from mocca_robot.files.versions import SIMULATION
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.agreement import agree, contradictions
from mocca_robot.verdicts.physics import (
    InsertionTrial,
    LoadVerdict,
    PartInsertion,
    Robustness,
    Simulation,
    StateVerdict,
    TiltVerdict,
    Tries,
    Verdict,
)

STANDS: Mapping[bool | None, Verdict] = {True: Verdict.STANDS, False: Verdict.FELL, None: Verdict.FAILED}
"""What 'stable' means; null where a run gave no verdict."""
HOLDS: Mapping[bool | None, Status] = {
    True: Status.EQUILIBRIUM,
    False: Status.NOT_IN_EQUILIBRIUM,
    None: Status.INACCURATE,
}
"""What 'statics_stable' means; null where the solver was too inaccurate to say."""
Item = TypeVar("Item")


def write_simulation(simulation: Simulation, path: str | Path, assembly: Assembly) -> Path:
    """Return `path` after writing the simulation of `assembly` there."""
    return write_json(Path(path), simulation_to_data(simulation, assembly))


def read_simulation(path: str | Path) -> Simulation:
    """Return the simulation that a file holds.

    Raises InputError when it is none, or a newer one, and for values that cannot be used.
    """
    return simulation_from_data(parse_json(read_text(Path(path)), f"'{path}'"), f"'{path}'")


def simulation_to_data(simulation: Simulation, assembly: Assembly) -> dict[str, Any]:
    """Return plain JSON values; `assembly` is what was simulated, for saying where physics and statics disagree."""
    data: dict[str, Any] = {
        "format": SIMULATION.name,
        "version": SIMULATION.version,
        "name": simulation.name,
        "engine": simulation.engine,
        "seconds": float(simulation.seconds.get("total", 0.0)),
        "seconds_by_stage": {k: float(v) for k, v in simulation.seconds.items()},
        "interrupted": simulation.interrupted,
        "disagreements": list(contradictions(assembly, simulation)),
        "notes": list(simulation.notes),
        "states": [_state(s) for s in simulation.states],
        "tilt": [_tilt(t) for t in simulation.tilt],
        "loads": [_load(f) for f in simulation.loads],
        "insertion": [_insertion(i) for i in simulation.insertion],
    }
    if (r := simulation.robust) is not None:
        interval = {"low": r.low, "high": r.high, "confidence": r.confidence}
        data["robust"] = {"trials": r.trials, "succeeded": r.succeeded, "rate": r.rate, **interval}
        data["robust"] |= {"failures": dict(r.failures), "distributions": dict(r.distributions)}
    return data


def simulation_from_data(data: object, where: str) -> Simulation:
    """Return the simulation of a document, of this version or an older one; `where` names it in messages.

    Keys that older versions did not write may be missing; what a person would say is found anew. Raises InputError.
    """
    current, notes = SIMULATION.current(fields.mapping(data, where), where)
    found = _Reader(current, where)
    by_stage = {str(k): fields.number(v, f"{where}: seconds of {k}") for k, v in found.table("seconds_by_stage")}
    return Simulation(
        name=found.words("name"),
        engine=found.words("engine"),
        states=found.each("states", _read_state),
        tilt=found.each("tilt", _read_tilt),
        loads=found.each("loads", _read_load),
        insertion=found.each("insertion", _read_insertion),
        robust=_read_robust(found.inner("robust")) if "robust" in current else None,
        seconds=by_stage or {"total": found.number("seconds", 0.0)},
        notes=(*notes, *found.texts("notes")),
        interrupted=bool(found.flag("interrupted")),
    )


def _state(s: StateVerdict) -> dict[str, Any]:
    return {
        "placed": s.placed,
        "stable": _flag_of(STANDS, s.verdict),
        **({} if s.statics is None else {"statics_stable": _flag_of(HOLDS, s.statics)}),
        "moved": list(s.moved),
        "max_displacement_m": s.max_displacement,
        "agrees": agree(s.verdict, s.statics) is True,
        "reason": s.reason,
        "cause": s.cause,
        "statics_moved": list(s.statics_moved),
        "max_displacement_share": s.max_share,
        "final_speed_m_s": s.final_speed,
        "simulated_s": s.duration,
        "motion": {"parts": list(s.parts), "times_s": list(s.times), "poses": [list(map(list, p)) for p in s.poses]},
        **_known(friction=s.friction, engine=s.engine or None),
    }


def _tilt(t: TiltVerdict) -> dict[str, Any]:
    return {
        "azimuth_deg": float(np.rad2deg(t.azimuth_rad)),
        "critical_deg": float(np.rad2deg(t.critical_rad)),
        "within_deg": float(np.rad2deg(t.within_rad)),
        "statics_deg": float(np.rad2deg(t.statics_rad)),
        "friction": t.friction,
        "moved": list(t.moved),
        "runs_without_verdict_deg": [float(np.rad2deg(a)) for a in t.failed],
        "cause": t.cause,
        **_known(engine=t.engine or None),
    }


def _load(f: LoadVerdict) -> dict[str, Any]:
    return {
        "load": f.name,
        "placed": f.placed or None,
        **_limited("factor", f.factor),
        **_limited("statics_factor", f.statics),
        "within": f.within,
        "tried": f.tried,
        "scale": f.scale,
        "friction": f.friction,
        "moved": list(f.moved),
        "runs_without_verdict": list(f.failed),
        "cause": f.cause,
        **_known(engine=f.engine or None),
    }


def _limited(key: str, factor: float) -> dict[str, Any]:
    """Return a factor for JSON, which knows no infinity: null, and a flag beside it."""
    unlimited = bool(np.isinf(factor))
    return {key: None if unlimited else factor, f"{key}_unlimited": unlimited}


def _insertion(entry: PartInsertion) -> dict[str, Any]:
    return {
        "part": entry.part,
        "inside": _counts(entry.inside),
        "outside": _counts(entry.outside),
        "axis": list(entry.axis),
        "cone_deg": float(np.rad2deg(entry.tried_rad)),
        "realised_cone_deg": float(np.rad2deg(entry.realised_rad)),
        "trials": [_trial(t) for t in entry.trials],
        **_known(friction=entry.friction),
    }


def _counts(tries: Tries) -> dict[str, Any]:
    return {
        "trials": tries.trials,
        "succeeded": tries.succeeded,
        "peak_force_n": tries.peak_force,
        "peak_force_share_of_allowed": tries.force_share,
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
        "steps": t.steps,
    }


def _known(**values: Any) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def _flag_of(meaning: Mapping[bool | None, Item], verdict: Item) -> bool | None:
    return next(flag for flag, meant in meaning.items() if meant == verdict)


class _Reader:
    """A mapping of the file, and where it is: checks what is read, each with a message that names its place."""

    def __init__(self, data: object, where: str) -> None:
        self.data, self.where = fields.mapping(data, where), where

    def at(self, key: str) -> str:
        return f"{self.where}: {key}"

    def has(self, key: str) -> bool:
        return key in self.data

    def number(self, key: str, default: float | None = None) -> float:
        return fields.number(self.data.get(key, default), self.at(key))

    def angle(self, key: str, default: float | None = None) -> float:
        return float(np.deg2rad(self.number(key, default)))

    def flag(self, key: str) -> bool | None:
        value = self.data.get(key)
        return None if value is None else fields.boolean(value, self.at(key))

    def count(self, key: str, default: int | None = None) -> int:
        return fields.integer(self.data.get(key, default), self.at(key), 0, 10**12)

    def words(self, key: str, default: str = "") -> str:
        return _string(self.data.get(key, default), self.at(key))

    def texts(self, key: str) -> tuple[str, ...]:
        return tuple(_string(v, f"{self.at(key)}[{k}]") for k, v in enumerate(self.items(key)))

    def numbers(self, key: str) -> tuple[float, ...]:
        return _numbers(self.data.get(key, []), self.at(key))

    def items(self, key: str) -> list[Any]:
        return _listed(self.data.get(key, []), self.at(key))

    def table(self, key: str) -> list[tuple[str, Any]]:
        return list(self.inner(key).data.items())

    def inner(self, key: str) -> _Reader:
        return _Reader(self.data.get(key, {}), self.at(key))

    def each(self, key: str, read: Callable[[_Reader], Item]) -> tuple[Item, ...]:
        return tuple(read(_Reader(v, f"{self.at(key)}[{k}]")) for k, v in enumerate(self.items(key)))


def _string(value: object, where: str) -> str:
    if not isinstance(value, str):
        raise InputError(f"{where} must be a text, not {fields.shown(value)}.")
    return value


def _listed(value: object, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise InputError(f"{where} must be a list, not {fields.shown(value)}.")
    return value


def _numbers(value: object, where: str) -> tuple[float, ...]:
    return tuple(fields.number(v, f"{where}[{k}]") for k, v in enumerate(_listed(value, where)))


def _read_state(found: _Reader) -> StateVerdict:
    motion = found.inner("motion")
    frames = [_listed(frame, motion.at("poses")) for frame in motion.items("poses")]
    return StateVerdict(
        placed=fields.part_name(found.data.get("placed"), found.at("placed")),
        verdict=STANDS[found.flag("stable")],
        statics=HOLDS[found.flag("statics_stable")] if found.has("statics_stable") else None,
        friction=found.number("friction") if found.has("friction") else None,
        reason=found.words("reason"),
        moved=found.texts("moved"),
        statics_moved=found.texts("statics_moved"),
        max_displacement=found.number("max_displacement_m", 0.0),
        max_share=found.number("max_displacement_share", 0.0),
        final_speed=found.number("final_speed_m_s", 0.0),
        duration=found.number("simulated_s", 0.0),
        times=motion.numbers("times_s"),
        poses=tuple(tuple(_numbers(pose, motion.at("poses")) for pose in frame) for frame in frames),
        parts=motion.texts("parts"),
        cause=found.words("cause"),
        engine=found.words("engine"),
    )


def _read_tilt(found: _Reader) -> TiltVerdict:
    failed = np.deg2rad(found.numbers("runs_without_verdict_deg"))
    return TiltVerdict(
        azimuth_rad=found.angle("azimuth_deg"),
        critical_rad=found.angle("critical_deg"),
        statics_rad=found.angle("statics_deg"),
        friction=found.number("friction"),
        moved=found.texts("moved"),
        failed=tuple(float(a) for a in failed),
        within_rad=found.angle("within_deg", 0.0),
        cause=found.words("cause"),
        engine=found.words("engine"),
    )


def _read_load(found: _Reader) -> LoadVerdict:
    def factor(key: str) -> float:
        return float(np.inf) if found.flag(f"{key}_unlimited") else found.number(key)

    return LoadVerdict(
        name=found.words("load"),
        factor=factor("factor"),
        statics=factor("statics_factor"),
        friction=found.number("friction"),
        placed="" if found.data.get("placed") is None else found.words("placed"),
        moved=found.texts("moved"),
        failed=found.numbers("runs_without_verdict"),
        within=found.number("within", 0.0),
        tried=found.number("tried", 0.0),
        scale=found.number("scale", 1.0),
        cause=found.words("cause"),
        engine=found.words("engine"),
    )


def _read_insertion(found: _Reader) -> PartInsertion:
    part = fields.part_name(found.data.get("part"), found.at("part"))
    return PartInsertion(
        part=part,
        axis=found.numbers("axis"),
        realised_rad=found.angle("realised_cone_deg"),
        tried_rad=found.angle("cone_deg"),
        friction=found.number("friction") if found.has("friction") else None,
        trials=tuple(replace(t, part=part) for t in found.each("trials", _read_trial)),
    )


def _read_trial(found: _Reader) -> InsertionTrial:
    return InsertionTrial(
        part="",
        kind=found.words("kind"),
        direction=found.numbers("direction"),
        clearance=found.number("clearance_m", 0.0),
        error=found.number("error_m", 0.0),
        below=found.words("below", "held"),
        succeeded=fields.boolean(found.data.get("succeeded"), found.at("succeeded")),
        reason=found.words("reason"),
        peak_force=found.number("peak_force_n", 0.0),
        allowed_force=found.number("allowed_force_n", 0.0),
        peak_penetration=found.number("penetration_m", 0.0),
        tracking_error=found.number("tracking_error_m", 0.0),
        moved_below=found.texts("moved_below"),
        steps=found.count("steps", 0),
    )


def _read_robust(found: _Reader) -> Robustness:
    return Robustness(
        trials=found.count("trials"),
        succeeded=found.count("succeeded"),
        low=found.number("low", 0.0),
        high=found.number("high", 1.0),
        confidence=found.number("confidence", 0.0),
        failures={k: fields.integer(v, found.at("failures"), 0, 10**12) for k, v in found.table("failures")},
        distributions={k: _drawn(v, found.at("distributions")) for k, v in found.table("distributions")},
    )


def _drawn(value: object, where: str) -> float | bool | tuple[float, ...]:
    if isinstance(value, list):
        return _numbers(value, where)
    return value if isinstance(value, bool) else fields.number(value, where)
