"""Where an interrupted design stood, in a file, so that the same command goes on there (JSON, every bit kept)."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, read_only
from mocca_robot.assembly import Assembly
from mocca_robot.errors import InputError
from mocca_robot.files.output import write_json
from mocca_robot.files.versions import PROGRESS
from mocca_robot.joints.options import JointOptions
from mocca_robot.runtime.content_hash import assembly_hash, content_hash
from planners.cone_joints.descent import Descent
from planners.cone_joints.realization import Polished, Polishing
from planners.cone_joints.search import SearchState, Stage
from planners.cone_joints.unknowns import JointParameters

METHOD = 3
"""Raise it when designing takes another course: states kept from before are not gone on with then."""
SAVE_EVERY = 5.0
"""Seconds between two saves; a design that takes less leaves no file."""


def design_identity(assembly: Assembly, options: JointOptions, insertion: Mapping[str, Array] | None) -> str:
    """Return a hash of everything that decides what a design run finds."""
    ways = {name: np.asarray(way) for name, way in sorted((insertion or {}).items())}
    return content_hash((METHOD, assembly_hash(assembly), assembly.goals, assembly.alpha_rad, options, ways))


@dataclass(frozen=True)
class Found:
    """What a checkpoint file holds: a state to go on from, or why there is none ('' = there is no file)."""

    state: SearchState | None
    why_not: str = ""


def read_checkpoint(path: Path, identity: str) -> Found:
    """Return the state in `path` if it belongs to the design with this identity."""
    if not path.exists():
        return Found(None)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        data, _ = PROGRESS.current(data, f"'{path.name}'")
        if data["identity"] != identity:
            return Found(None, "it was made from another input or with other options")
        return Found(_state(data["state"]))
    except InputError as error:
        return Found(None, str(error).rstrip("."))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        return Found(None, f"it cannot be read ({type(error).__name__}: {error})")


class Checkpoint:
    """Keeps the latest state of a design in a file: now and then, and at once when asked to."""

    def __init__(self, path: Path, identity: str) -> None:
        self.path = path
        self._identity = identity
        self._saved = time.monotonic()
        self._state: SearchState | None = None

    def keep(self, state: SearchState) -> None:
        """Remember `state`; write it if the last one was written `SAVE_EVERY` seconds ago, or work is done."""
        self._state = state
        due = time.monotonic() - self._saved >= SAVE_EVERY
        if due or (state.stage is Stage.FINISHED and self.path.exists()):
            self.save()

    def save(self) -> Path | None:
        """Return the file after writing the latest state; None when nothing is worth keeping yet."""
        if self._state is None:
            return None
        self._saved = time.monotonic()
        data = {
            "format": PROGRESS.name,
            "version": PROGRESS.version,
            "identity": self._identity,
            "state": _data(self._state),
        }
        return write_json(self.path, data)


def _data(state: SearchState) -> dict[str, Any]:
    return {
        "stage": str(state.stage),
        "attempt": state.attempt,
        "polishing": None if state.polishing is None else _polishing_data(state.polishing),
        "best_attempt": state.best_attempt,
        "best": None if state.best is None else _polished_data(state.best),
        "plain_attempt": state.plain_attempt,
        "plain": None if state.plain is None else _polished_data(state.plain),
    }


def _polishing_data(polishing: Polishing) -> dict[str, Any]:
    descent = polishing.descent
    return {
        "parameters": _parameters_data(polishing.parameters),
        "working": polishing.working.tolist(),
        "count": polishing.count,
        "descent": None
        if descent is None
        else {
            "parameters": _parameters_data(descent.parameters),
            "damping": descent.damping,
            "values": list(descent.values),
        },
    }


def _polished_data(polished: Polished) -> dict[str, Any]:
    return {
        "parameters": _parameters_data(polished.parameters),
        "infeasibility": polished.infeasibility.tolist(),
        "violation": polished.violation,
        "evaluations": polished.evaluations,
    }


def _parameters_data(parameters: JointParameters) -> dict[str, Any]:
    return {f.name: getattr(parameters, f.name).tolist() for f in fields(JointParameters)}


def _state(data: dict[str, Any]) -> SearchState:
    polishing, best, plain = data["polishing"], data["best"], data["plain"]
    return SearchState(
        stage=Stage(data["stage"]),
        attempt=int(data["attempt"]),
        polishing=None if polishing is None else _polishing(polishing),
        best_attempt=int(data["best_attempt"]),
        best=None if best is None else _polished(best),
        plain_attempt=int(data["plain_attempt"]),
        plain=None if plain is None else _polished(plain),
    )


def _polishing(data: dict[str, Any]) -> Polishing:
    descent = data["descent"]
    under_way = (
        None
        if descent is None
        else Descent(_parameters(descent["parameters"]), float(descent["damping"]), tuple(descent["values"]))
    )
    working = np.array(data["working"], dtype=np.bool_)
    return Polishing(_parameters(data["parameters"]), working, int(data["count"]), under_way)


def _polished(data: dict[str, Any]) -> Polished:
    infeasibility = read_only(data["infeasibility"])
    return Polished(_parameters(data["parameters"]), infeasibility, float(data["violation"]), int(data["evaluations"]))


def _parameters(data: dict[str, Any]) -> JointParameters:
    numbers = {name: np.array(data[name], dtype=float) for name in ("shape", "lean", "axis")}
    return JointParameters(curved=np.array(data["curved"], dtype=np.bool_), **numbers)
