"""How much of a load does an assembly take with friction? The load grows, step by step, until it falls."""

from __future__ import annotations

import numpy as np

from mocca_robot.actions import Combination
from mocca_robot.arrays import Array
from mocca_robot.statics.load_factor import LoadFactor, growing_cases
from mocca_robot.statics.loads import case_wrenches
from mocca_robot.verdicts.physics import LoadVerdict
from sim.coulomb.judge import Rubbing
from sim.coulomb.onward import Line, last_stand
from sim.coulomb.settle import SettlingOutcome
from sim.coulomb.verdicts import ENGINE
from sim.loads import FARTHEST, RESOLUTION, state_of, unit_of

STEP, LONGEST_STEP = 0.02, 0.2
"""A fall counts after a step of no more than this share of statics' factor; from a stand the search takes no longer
one than the second."""
RAMP = 20_000.0
"""Steps of the engine in which all of statics' factor would come on."""


def load_verdict(rubbing: Rubbing, combination: Combination, expected: LoadFactor) -> LoadVerdict:
    """Return how much of a combination's loads stands besides gravity, in the state of which statics says `expected`.

    The weight comes at once, from no forces; then the load grows on.
    """
    graph = rubbing.graph
    state, assembly = state_of(graph, expected), graph.assembly
    unit = unit_of(state, combination, expected)
    steady, growing = (case_wrenches(case, state) for case in growing_cases(state, combination))
    known = bool(expected.factor) and bool(np.isfinite(expected.factor or 0.0))

    def wrenches(share: float) -> Array:
        return np.asarray(steady + share * unit * growing)

    found = last_stand(
        Line(
            assembly=assembly,
            springs=rubbing.springs(state.present, assembly.fixed),
            wrenches=wrenches,
            guess=1.0 if known else 0.0 if not expected.factor else FARTHEST[False],
            resolution=RESOLUTION,
            step=STEP,
            longest=LONGEST_STEP if known else 1.0,
            ramp=RAMP,
            end=FARTHEST[known],
        )
    )
    fell = found.fell
    silent = fell is not None and fell.standing.settled.outcome is SettlingOutcome.UNDECIDED
    low = 0.0 if found.stood is None else found.stood.place
    high = low if fell is None or found.stood is None else fell.place
    return LoadVerdict(
        name=combination.name,
        factor=float(np.inf if fell is None else 0.5 * (low + high) * unit),
        statics=float(np.nan if expected.factor is None else expected.factor),
        friction=rubbing.friction,
        placed=expected.placed,
        moved=() if fell is None else fell.standing.moved,
        failed=(fell.place * unit,) if fell is not None and silent else (),
        within=0.5 * (high - low) * unit,
        scale=unit,
        tried=high * unit,
        engine=ENGINE,
    )
