"""How often it works when friction, density, play and the hand are not what was assumed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import norm

from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import case_at
from mocca_robot.verdicts.physics import Robustness, Verdict
from sim.coulomb.judge import rubbing, standing
from sim.coulomb.verdicts import VERDICTS, reason
from sim.insertion.directions import Direction, insertion_cone
from sim.insertion.hand import HandOptions, PlacingError
from sim.insertion.trial import insert
from sim.insertion.trial_scene import insertion_scene
from sim.shapes.contact_model import contact_model, pieces
from sim.stability import free_scene, stability
from sim.trial_store import Row, Trial


@dataclass(frozen=True, kw_only=True)
class RobustOptions:
    """Distributions that a trial draws from; every draw is independent.

    Attributes:
        trials: how many.
        friction: uniform between the two.
        density_share: standard deviation of each part's density, relative (normal, cut off at 3 σ).
        clearance: uniform between the two, metres, one for all parts.
        shift: standard deviation of the hand's sideways error, metres; turn: of its angle, radians (normal).
        insert: also insert every part; otherwise only the finished structure is let go.
        confidence: of the interval on the success rate.
    """

    trials: int = 50
    friction: tuple[float, float] = (0.0, 0.4)
    density_share: float = 0.05
    clearance: tuple[float, float] = (0.0, 2e-4)
    shift: float = 2e-4
    turn: float = float(np.deg2rad(0.3))
    insert: bool = True
    confidence: float = 0.95

    def __post_init__(self) -> None:
        if self.trials < 1:
            raise InputError(f"{self.trials} robustness trials were asked for; at least 1 is needed.")
        if not 0.0 < self.confidence < 1.0:
            raise InputError(f"A confidence of {self.confidence} is not between 0 and 1.")


def wilson(succeeded: int, trials: int, confidence: float) -> tuple[float, float]:
    """Return Wilson's interval on a success rate: honest also where every trial succeeded."""
    if trials == 0:
        return 0.0, 1.0
    z = float(norm.ppf(0.5 + 0.5 * confidence))
    rate = succeeded / trials
    centre = (rate + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * float(np.sqrt(rate * (1 - rate) / trials + z * z / (4 * trials**2)))
    return max(0.0, centre - half), min(1.0, centre + half)


def robust_trials(
    graph: PartsGraph,
    options: RobustOptions,
    seed: int,
    identity: tuple[str, str, str],
) -> list[Trial]:
    """Return the trials; trial k draws from `seed` and k alone, so that more trials extend fewer ones."""
    return [
        Trial(
            f"robustness {k + 1}",
            (
                *identity,
                sorted((n, list(map(float, v))) for n, v in graph.chosen.items()),
                replace(options, trials=1),
                seed,
                k,
            ),
            partial(robust_trial, graph, options, (seed, k)),
        )
        for k in range(options.trials)
    ]


def robust_trial(
    graph: PartsGraph,
    options: RobustOptions,
    seed: tuple[int, int],
) -> Row:
    """Return {'failure': reason or ''} with what was drawn."""
    rng = np.random.default_rng(seed)
    friction = float(rng.uniform(*options.friction))
    assembly, contacts = graph.assembly, graph.contacts
    factors = 1.0 + options.density_share * np.clip(rng.standard_normal(len(assembly.parts)), -3.0, 3.0)
    clearance = float(rng.uniform(*options.clearance))
    parts = tuple(replace(p, density=p.density * f) for p, f in zip(assembly.parts, factors))
    drawn = replace(assembly, parts=parts)
    row: Row = {"friction": friction, "clearance": clearance, "failure": ""}
    placed = PartsGraph.of(drawn, contacts, graph.chosen)
    verdict, why = _let_go(placed, friction)
    if verdict is not Verdict.STANDS:
        return {**row, "failure": f"structure {verdict}: {why}", "kind": f"structure {verdict}"}
    if options.insert:
        resting = pieces(drawn, contacts) if drawn.dimension == 2 else None
        for index, part in enumerate(drawn.parts):
            if part.fixed:
                continue
            cone = insertion_cone(placed, index)
            error = PlacingError(
                tuple(options.shift * rng.standard_normal(drawn.dimension - 1)),
                float(options.turn * rng.standard_normal()),
            )
            ready = insertion_scene(placed, cone, resting=resting, clearance=clearance, friction=friction)
            trial = insert(ready, Direction("axis", cone.axis), error=error, hand=HandOptions())
            if not trial.succeeded:
                return {**row, "failure": f"{part.name}: {trial.reason}", "kind": f"insertion of {part.name}"}
    return row


def _let_go(graph: PartsGraph, friction: float) -> tuple[Verdict, str]:
    """Return whether the finished assembly stands, and why."""
    assembly = graph.assembly
    if friction == 0.0:
        found = stability(free_scene(assembly, contact_model(assembly, graph.contacts)))
        return found.verdict, found.reason
    upright = standing(rubbing(graph, friction), case_at(assembly, 0.0, 0.0))
    return VERDICTS[upright.settled.outcome], reason(upright)


def robustness(rows: Sequence[Mapping[str, Any]], options: RobustOptions) -> Robustness:
    """Return the success rate over finished trials."""
    succeeded = sum(not row["failure"] for row in rows)
    low, high = wilson(succeeded, len(rows), options.confidence)
    return Robustness(
        trials=len(rows),
        succeeded=succeeded,
        low=low,
        high=high,
        confidence=options.confidence,
        failures=dict(Counter(row["kind"] for row in rows if row["failure"])),
        distributions=asdict(options),
    )
