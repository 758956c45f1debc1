"""How much of a load an assembly takes in MuJoCo, without friction: the same forces as in statics, let go ever anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mocca_robot.actions import Combination
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.applied import combined_pushes
from mocca_robot.statics.load_factor import LoadFactor, growing_cases
from mocca_robot.statics.loads import LoadCase, case_wrenches
from mocca_robot.verdicts.agreement import LOAD_AGREEMENT
from mocca_robot.verdicts.physics import LoadVerdict
from sim.critical import Search, critical
from sim.forces import heaviest
from sim.scene import Compiled, compile_scene, with_gravity, with_timestep
from sim.shapes.contact_model import ContactModel, PairRays, facet_pairs, holding_model
from sim.stability import LIMITS, StabilityLimits, contact_points, free_scene

RESOLUTION, COARSE_RESOLUTION = 0.004, 0.01
"""Width at which the search ends, as a share of statics' factor; with more contact points than `finest_points` a run
takes minutes."""
HELD_BELOW = 0.01
"""Contact points that are chosen for a load hold up to this share below statics' factor."""
FARTHEST = {True: 2.0, False: 10.0}
"""No more of a load is tried than this multiple of statics' factor (true), or, where statics knows no limit or nothing
of it stands, of the load that is as heavy as the structure (false)."""
SHORTEST_STEP = 0.1
"""A part that is pressed by many times its weight takes shorter steps, down to this share: contacts give less then."""


def load_verdict(
    graph: PartsGraph,
    touching: ContactModel | Sequence[PairRays],
    combination: Combination,
    expected: LoadFactor,
    limits: StabilityLimits = LIMITS,
) -> LoadVerdict:
    """Return how much of a combination's loads stands in physics, in the state of which statics says `expected`.

    Places, weights and pressures are those of statics. A place where nothing stands by statics is searched around no
    load at all. `touching` as for states.
    """
    state = state_of(graph, expected)
    unit = unit_of(state, combination, expected)
    compiled = compile_scene(
        free_scene(graph.assembly, _model(state, touching, combination, unit, expected), present=state.present)
    )
    own = combination.gravity * graph.assembly.gravity
    gravity, found = combined_pushes(state, combination)

    def scene_at(share: float) -> Compiled:
        factor = share * unit
        pushes = tuple(replace(p, force=factor * p.force) for p in found)
        loaded = with_gravity(compiled, own + factor * (gravity - own), pushes)
        return _stiff_enough(loaded)

    fine = contact_points(compiled) <= limits.finest_points
    known = bool(expected.factor) and bool(np.isfinite(expected.factor or 0.0))
    resolution = RESOLUTION if fine else COARSE_RESOLUTION
    search = Search(
        guess=1.0 if known else 0.0 if not expected.factor else FARTHEST[False],
        agreement=LOAD_AGREEMENT,
        resolution=resolution,
        doubtful=max(resolution, 0.5 * LOAD_AGREEMENT),
        end=FARTHEST[known],
    )
    told = critical(scene_at, search, limits)
    never = told.high >= search.end
    return LoadVerdict(
        name=combination.name,
        factor=float(np.inf if never else 0.5 * (told.low + told.high) * unit),
        statics=float(np.nan if expected.factor is None else expected.factor),
        friction=0.0,
        placed=expected.placed,
        moved=told.moved,
        failed=tuple(share * unit for share in told.failed),
        within=0.0 if never else 0.5 * (told.high - told.low) * unit,
        tried=(search.end if never else told.high) * unit,
        scale=unit,
        cause=told.cause,
    )


def state_of(graph: PartsGraph, expected: LoadFactor) -> PartsGraph:
    """Return the state of the sequence that a load factor is about."""
    return graph.states[graph.assembly.index(expected.placed)] if expected.placed else graph


def unit_of(state: PartsGraph, combination: Combination, expected: LoadFactor) -> float:
    """Return the factor to count in: that of statics, or that of the load as heavy as all that can move."""
    if expected.factor and np.isfinite(expected.factor):
        return expected.factor
    steady, growing = (case_wrenches(case, state) for case in growing_cases(state, combination))
    d = state.assembly.dimension
    free = state.present & ~state.assembly.fixed
    weight, load = (float(np.linalg.norm(w[free, :d], axis=1).sum()) for w in (steady, growing))
    return weight / load


def _model(
    state: PartsGraph,
    touching: ContactModel | Sequence[PairRays],
    combination: Combination,
    unit: float,
    expected: LoadFactor,
) -> ContactModel:
    """Return the contact model, with points that hold what statics holds just before the fall."""
    if isinstance(touching, ContactModel):
        return touching
    if not expected.factor:
        return facet_pairs(r.reduced for r in touching)
    share = 1.0 - HELD_BELOW if np.isfinite(expected.factor) else FARTHEST[False]
    return holding_model(state, touching, loaded_case(state, combination, share * unit))


def loaded_case(state: PartsGraph, combination: Combination, factor: float) -> LoadCase:
    """Return a state under the steady part of a combination and `factor` times what grows of it."""
    steady, growing = growing_cases(state, combination)
    assert steady.gravity is not None and growing.gravity is not None and growing.applied is not None
    return replace(steady, gravity=steady.gravity + factor * growing.gravity, applied=factor * growing.applied)


def _stiff_enough(loaded: Compiled) -> Compiled:
    """Return the scene with steps as short as its loads are heavy: contacts give with the force and step's square."""
    share = max(SHORTEST_STEP, 1.0 / np.sqrt(max(1.0, heaviest(loaded))))
    settings = loaded.scene.settings
    return loaded if share == 1.0 else with_timestep(loaded, share * settings.timestep)
