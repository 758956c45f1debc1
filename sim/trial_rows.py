"""One trial of each kind, as the row that is kept of it; functions of values that can be sent to other processes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, TypeVar

from mocca_robot.actions import Combination
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.load_factor import LoadFactor
from mocca_robot.statics.loads import LoadCase
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.physics import InsertionTrial, LoadVerdict, StateVerdict, TiltVerdict, Verdict
from sim import loads, states
from sim.coulomb import loading, verdicts
from sim.coulomb.judge import Rubbing
from sim.insertion.directions import Direction, InsertionCone
from sim.insertion.hand import PlacingError
from sim.insertion.trial import insert
from sim.insertion.trial_scene import insertion_scene
from sim.questions import Questions
from sim.scene import Compiled
from sim.shapes.contact_model import ContactModel, PairRays, holding_model
from sim.tilt import detailed_tilt, physical_tilt
from sim.trial_store import Row

Result = TypeVar("Result", StateVerdict, TiltVerdict, LoadVerdict, InsertionTrial)


def state_row(graph: PartsGraph, touching: ContactModel | Sequence[PairRays], case: LoadCase) -> Row:
    """Return whether the state of `case` stands without friction; `touching` as `simulate` prepares it."""
    model = touching if isinstance(touching, ContactModel) else holding_model(graph, touching, case)
    return asdict(states.state_verdict(graph, model, case))


def rubbing_state_row(rubs: Rubbing, case: LoadCase) -> Row:
    """Return whether the state of `case` stands with friction."""
    return asdict(verdicts.state_verdict(rubs, case))


def tilt_row(compiled: Compiled, graph: PartsGraph, azimuth: float) -> Row:
    """Return the critical tilt of a compiled assembly without friction towards one azimuth (rad)."""
    return asdict(physical_tilt(compiled, graph, azimuth))


def detailed_tilt_row(graph: PartsGraph, rays: Sequence[PairRays], azimuth: float) -> Row:
    """Return the same with contact points that are chosen for this azimuth."""
    return asdict(detailed_tilt(graph, rays, azimuth))


def rubbing_tilt_row(rubs: Rubbing, azimuth: float) -> Row:
    """Return the critical tilt with friction towards one azimuth (rad)."""
    return asdict(verdicts.tilt_verdict(rubs, azimuth))


def load_row(
    graph: PartsGraph,
    touching: ContactModel | Sequence[PairRays],
    combination: Combination,
    expected: LoadFactor,
) -> Row:
    """Return how much of a load stands without friction; `touching` as `simulate` prepares it."""
    return asdict(loads.load_verdict(graph, touching, combination, expected))


def rubbing_load_row(rubs: Rubbing, combination: Combination, expected: LoadFactor) -> Row:
    """Return how much of a load stands with friction."""
    return asdict(loading.load_verdict(rubs, combination, expected))


@dataclass(frozen=True, eq=False)
class Carried:
    """Contact points of a large structure, to be chosen so that they hold its `state` before a part is placed."""

    rays: Sequence[PairRays]
    state: LoadCase


def insertion_rows(
    graph: PartsGraph,
    ask: Questions,
    resting: ContactModel | Carried | None,
    cone: InsertionCone,
    clearance: float,
    below: str,
    tried: Sequence[Direction],
    errors: Sequence[PlacingError],
) -> Row:
    """Return the insertions of one part in one scene: along the ways `tried`, and off their place by `errors`."""
    if isinstance(resting, Carried):
        resting = holding_model(graph, resting.rays, resting.state, ask.friction)
    ready = insertion_scene(
        graph,
        cone,
        resting=resting,
        clearance=clearance,
        below=below,
        friction=ask.friction,
        hand=ask.hand,
    )
    results = [insert(ready, way, hand=ask.hand) for way in tried]
    axis = next((w for w in tried if w.kind == "axis"), None)
    if axis is not None:
        results += [insert(ready, axis, error=e, hand=ask.hand) for e in errors]
    return {"trials": [asdict(r) for r in results]}


def state_of(row: Row, friction: float) -> StateVerdict:
    """Return the verdict that a row was kept of; rows of earlier versions do not tell their friction."""
    known = {"verdict": Verdict(row["verdict"]), "statics": Status(row["statics"]), "friction": friction}
    return _restored(StateVerdict, {**row, **known})


def tilt_of(row: Row) -> TiltVerdict:
    """Return the verdict that a row was kept of."""
    return _restored(TiltVerdict, row)


def load_of(row: Row) -> LoadVerdict:
    """Return the verdict that a row was kept of."""
    return _restored(LoadVerdict, row)


def trials_of(row: Row) -> tuple[InsertionTrial, ...]:
    """Return the insertions that a row was kept of."""
    return tuple(_restored(InsertionTrial, trial) for trial in row["trials"])


def _restored(kind: type[Result], row: Row) -> Result:
    """Return the dataclass a row came from: lists become tuples again, and what other versions kept is left out."""
    return kind(**{f.name: _tuples(row[f.name]) for f in fields(kind) if f.name in row})


def _tuples(value: Any) -> Any:
    return tuple(_tuples(v) for v in value) if isinstance(value, (list, tuple)) else value
