"""An assembly → everything physics has to say about it: states, tilt table, insertions, robustness."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.contacts.find import find_contacts, require_exact, require_sound
from mocca_robot.contacts.friction import sprung, tangential_ratio
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.runtime.content_hash import assembly_hash
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.load_factor import asked_combinations, load_factors
from mocca_robot.statics.loads import LoadCase, state_cases
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.physics import PartInsertion, Simulation
from sim.coulomb.judge import MOST_POINTS, corners, rubbing
from sim.coulomb.verdicts import ENGINE
from sim.insertion.directions import Direction, InsertionCone, directions, insertion_cone
from sim.insertion.hand import PlacingError
from sim.insertion.trial_scene import resting_model
from sim.questions import TILT_FRICTIONS, Questions
from sim.robust import robust_trials, robustness
from sim.shapes.contact_model import ContactModel, PairRays, contact_model, telling_rays
from sim.stability import LIMITS
from sim.tilt import azimuths, tilt_scene
from sim.trial_rows import (
    Carried,
    detailed_tilt_row,
    insertion_rows,
    load_of,
    load_row,
    rubbing_load_row,
    rubbing_state_row,
    rubbing_tilt_row,
    state_of,
    state_row,
    tilt_of,
    tilt_row,
    trials_of,
)
from sim.trial_store import Row, Trial, TrialStore, run_trials

METHOD = {"state": 12, "tilt": 12, "load": 1, "insert": 14, "robust": 15}
"""Raise what a trial's verdict is reached by in another way: trials kept from before then run again."""
MANY_RUNS = 60
"""About how many insertions make up for starting processes: each step of theirs runs Python, which threads share."""
FEW_RIM = 3
"""Ways on the rim along which a part goes in on top of a large structure that is free to move: each takes seconds."""


def simulate(
    assembly: Assembly,
    insertion: Mapping[str, Array] | None = None,
    questions: Questions | None = None,
    progress: Callable[[str, int, int], None] | None = None,
    store: TrialStore | None = None,
    executor: Executor | None = None,
    processes: Executor | None = None,
) -> Simulation:
    """Return physics' verdicts on an assembly's geometry.

    Args:
        assembly: parts where they belong, joints cut in.
        insertion: way in by part name; default: the axis of each part's widest cone.
        questions: what to find out; default `Questions()`.
        progress: called with (what was done, trials done, trials in all of this stage).
        store: keeps finished trials, so that an interrupted simulation resumes; default: in memory.
        executor: runs the trials; default: `questions.threads` threads.
        processes: runs insertions, and tilts with them, in its stead where they are many.

    Ctrl-C ends it early with `interrupted` set and everything that was finished. Raises InputError for parts that
    overlap, float free or have no mass, and for models that would not fit into memory.
    """
    import mujoco

    questions = Questions() if questions is None else questions
    store = TrialStore() if store is None else store
    report = find_contacts(assembly)
    require_sound(assembly, report)
    require_exact(assembly, report)
    work = _Work(
        PartsGraph.of(assembly, report.contacts, insertion),
        questions=questions,
        progress=progress,
        store=store,
        executor=executor,
        processes=processes,
    )
    result = Simulation(
        name=assembly.name,
        engine=f"mujoco {mujoco.__version__}",
        notes=_near_misses(report),
    )
    seconds: dict[str, float] = {}
    for group in ((work.states,), (work.tilt, work.loads, work.insertion), (work.robust,)):
        asked = [stage for stage in group if stage.__name__ in questions.stages]
        if asked and not result.interrupted:
            started = time.perf_counter()
            result = work.carry_out([stage(result) for stage in asked], result)
            seconds[" and ".join(stage.__name__ for stage in asked)] = time.perf_counter() - started
    return replace(result, seconds={**seconds, "total": sum(seconds.values())})


@dataclass(frozen=True)
class _Stage:
    """What a stage wants to find out.

    Attributes:
        trials: in the order of their rows.
        told: returns the simulation with the rows that were finished.
        runs: about how many runs of MuJoCo they are.
    """

    trials: Sequence[Trial]
    told: Callable[[Simulation, Sequence[Row]], Simulation]
    runs: int = 0


class _Work:
    """The stages over one assembly; each takes the simulation so far, for what it has to know of it."""

    def __init__(
        self,
        graph: PartsGraph,
        *,
        questions: Questions,
        progress: Callable[[str, int, int], None] | None,
        store: TrialStore,
        executor: Executor | None,
        processes: Executor | None,
    ) -> None:
        self.graph, self.ask = graph, questions
        self.assembly, self.contacts = graph.assembly, graph.contacts
        self.progress, self.store = progress, store
        self.executor, self.processes = executor, processes
        self.hash = assembly_hash(self.assembly)
        self._touching_at: dict[float, ContactModel | Sequence[PairRays]] = {}

    def carry_out(self, stages: Sequence[_Stage], so_far: Simulation) -> Simulation:
        """Return the simulation with what stages that run side by side find out."""
        trials = [trial for stage in stages for trial in stage.trials]
        many = self.processes is not None and sum(stage.runs for stage in stages) >= MANY_RUNS
        executor = self.processes if many else self.executor
        rows = iter(run_trials(trials, self.store, self.ask.threads, self.progress, executor))
        for stage in stages:
            mine = list(islice(rows, len(stage.trials)))
            found = [row for row in mine if row is not None]
            so_far = stage.told(so_far, found)
            if len(found) < len(mine):
                so_far = replace(so_far, interrupted=True)
        return so_far

    def states(self, so_far: Simulation) -> _Stage:
        friction = self.ask.friction
        find_out = self._states(friction)
        trials = [
            Trial(
                f"state {case.name.removeprefix('state_')}",
                (*self._identity("state", friction), case.name, friction),
                find_out(case),
            )
            for case in state_cases(self.graph)
        ]

        def told(s: Simulation, rows: Sequence[Row]) -> Simulation:
            return replace(s, states=tuple(state_of(r, friction) for r in rows))

        return _Stage(trials, told)

    def tilt(self, so_far: Simulation) -> _Stage:
        ratio = tangential_ratio(self.ask.friction)
        frictions = sorted(
            {*(sprung(mu, ratio) for mu in self.ask.tilt_frictions or TILT_FRICTIONS), self.ask.friction}
        )
        notes: list[str] = []
        trials: list[Trial] = []
        for mu in frictions:
            unasked = self.ask.tilt_frictions is None and mu not in (0.0, self.ask.friction)
            if unasked and corners(self.graph) > MOST_POINTS:
                notes.append(_left_out(mu))
                continue
            find_out = self._tilts(mu)
            trials += [
                Trial(
                    f"tilt {np.rad2deg(a):.0f}°, friction {mu:g}",
                    (*self._identity("tilt", mu), float(a), mu),
                    find_out(float(a)),
                    takes_long=mu > 0.0,
                )
                for a in azimuths(self.assembly, self.ask.azimuths)
            ]

        def told(s: Simulation, rows: Sequence[Row]) -> Simulation:
            return replace(s, tilt=tuple(tilt_of(r) for r in rows), notes=(*s.notes, *notes))

        return _Stage(trials, told)

    def loads(self, so_far: Simulation) -> _Stage:
        friction = self.ask.friction
        touching = None if friction > 0.0 else self._choose_touching(0.0)
        trials: list[Trial] = []
        for combination, found in zip(
            asked_combinations(self.assembly), load_factors(self.graph, friction), strict=True
        ):
            if found.steps == 0 or found.factor is None:  # statics says why nothing is said of it
                continue
            if touching is None:
                find_out = partial(rubbing_load_row, rubbing(self.graph, friction), combination, found)
            else:
                find_out = partial(load_row, self.graph, touching, combination, found)
            acting = (dict(combination.factors), combination.gravity, combination.states, *self.assembly.actions)
            content = (*self._identity("load", friction), combination.name, acting, friction)
            trials.append(Trial(f"load {combination.name}", content, find_out, takes_long=friction > 0.0))
        return _Stage(trials, lambda s, rows: replace(s, loads=tuple(load_of(r) for r in rows)))

    def _states(self, friction: float) -> Callable[[LoadCase], Callable[[], Row]]:
        """Return what makes, of a state, a function that finds out whether it stands."""
        if friction > 0.0:
            return partial(partial, rubbing_state_row, rubbing(self.graph, friction))
        return partial(partial, state_row, self.graph, self._choose_touching(0.0))

    def _tilts(self, friction: float) -> Callable[[float], Callable[[], Row]]:
        """Return what makes, of an azimuth, a function that finds out the critical tilt."""
        if friction > 0.0:
            return partial(partial, rubbing_tilt_row, rubbing(self.graph, friction))
        touching = self._choose_touching(0.0)
        if isinstance(touching, ContactModel):
            return partial(partial, tilt_row, tilt_scene(self.assembly, touching), self.graph)
        return partial(partial, detailed_tilt_row, self.graph, touching)

    def insertion(self, so_far: Simulation) -> _Stage:
        resting = resting_model(self.assembly, self.contacts)
        trials: list[Trial] = []
        parts: list[PartInsertion] = []
        notes: list[str] = []
        standing = self._standing(so_far)
        for index, part in enumerate(self.assembly.parts):
            if part.fixed:
                continue
            cone = insertion_cone(self.graph, index)
            axis = tuple(float(x) for x in cone.axis)
            parts.append(
                PartInsertion(
                    part=part.name,
                    axis=axis,
                    realised_rad=cone.realised_rad,
                    tried_rad=cone.tried_rad,
                    friction=self.ask.friction,
                )
            )
            if cone.realised_rad < 0.0:
                notes.append(
                    f"'{part.name}' cannot be inserted along its direction: its neighbours block it by "
                    f"{np.rad2deg(-cone.realised_rad):.2f}°"
                )
            if not standing[index]:
                notes.append(f"'{part.name}' is inserted with the earlier parts held: without support they fall")
            trials += [
                Trial(f"insert {part.name}", (*self._identity("insert"), *what), find_out)
                for what, find_out in self._insertion_groups(resting, cone, standing[index])
            ]

        def told(s: Simulation, rows: Sequence[Row]) -> Simulation:
            found = [t for row in rows for t in trials_of(row)]
            entries = (replace(p, trials=tuple(t for t in found if t.part == p.part)) for p in parts)
            return replace(s, insertion=tuple(entries), notes=(*s.notes, *notes))

        return _Stage(trials, told, runs=len(trials) * self.ask.directions)

    def robust(self, so_far: Simulation) -> _Stage:
        identity = self._identity("robust")
        trials = robust_trials(self.graph, self.ask.robust, self.ask.seed, identity)
        return _Stage(trials, lambda s, rows: replace(s, robust=robustness(rows, self.ask.robust)))

    def _insertion_groups(
        self, resting: ContactModel, cone: InsertionCone, below_stands: bool
    ) -> list[tuple[tuple[Any, ...], Callable[[], Row]]]:
        """Return (content, function) per compiled scene: one scene serves many directions and errors."""
        groups: list[tuple[tuple[Any, ...], Callable[[], Row]]] = []
        ways = directions(cone, self.ask.directions)
        before = self._state_before(cone.part)
        rays = self._choose_touching(self.ask.friction)
        carried = None
        if below_stands and before is not None and not isinstance(rays, ContactModel):
            carried = Carried(rays, before)
        # What is between all the others takes long to send for a large structure.
        near = self.graph.state(cone.part).around(cone.part)
        telling = tuple(w for w in ways if w.kind in ("axis", "rim"))
        # Negative controls only without clearance: with play, 3° outside may truly go in.
        runs: list[tuple[float, str, tuple[Direction, ...], tuple[PlacingError, ...]]]
        runs = [(c, "held", telling, ()) for c in self.ask.clearances if c > 0.0]
        runs.insert(0, (0.0, "held", ways, self.ask.errors))
        if below_stands:
            large = len(resting.pairs or ()) > LIMITS.finest_points
            few = (*telling[:1], *telling[1 :: max(1, (len(telling) - 1) // FEW_RIM)][:FEW_RIM])
            runs.append((0.0, "free", few if large else telling, ()))
        for clearance, below, tried, errors in runs:
            content = (cone.part, [w.vector for w in tried], clearance, below, errors, self.ask.hand, self.ask.friction)
            needed: ContactModel | Carried | None = None
            if below == "free" or self.assembly.dimension == 2:
                needed = carried or resting
            find_out = partial(insertion_rows, near, self.ask, needed, cone, clearance, below, tried, errors)
            groups.append((content, find_out))
        return groups

    def _standing(self, so_far: Simulation) -> list[bool]:
        """Return for every part whether what was placed before it stands: in physics, or else in statics."""
        stands = {s.placed: s.stands for s in so_far.states}
        out = []
        before = True
        cases = {case.name.removeprefix("state_"): case for case in state_cases(self.graph)}
        for part in self.assembly.parts:
            out.append(before)
            if part.name in stands:
                before = stands[part.name]
            elif part.name in cases:
                before = self._statics_stands(cases[part.name])
        return out

    def _statics_stands(self, case: Any) -> bool:
        result = solve_case(self.graph, case, self.ask.friction).result
        return result.status is Status.EQUILIBRIUM

    def _state_before(self, part: int) -> LoadCase | None:
        """Return the load case of the state in which `part` is placed; None when only fixed parts are there."""
        cases = [c for c in state_cases(self.graph) if not c.present[part:].any()]
        return cases[-1] if cases else None

    def _choose_touching(self, friction: float) -> ContactModel | Sequence[PairRays]:
        """Return the contact model of every load, or the contact points to choose it from load by load."""
        if friction not in self._touching_at:
            rays = telling_rays(self.assembly, self.contacts, friction)
            self._touching_at[friction] = (
                contact_model(self.assembly, self.contacts, friction) if rays is None else rays
            )
        return self._touching_at[friction]

    def _identity(self, kind: str, friction: float = 0.0) -> tuple[str, str, str]:
        """Return what a trial's row depends on: with friction, states and tilts have an engine of their own."""
        import mujoco

        engine = ENGINE if friction > 0.0 else f"mujoco {mujoco.__version__}, method {METHOD[kind]}"
        return kind, self.hash, engine


def _left_out(friction: float) -> str:
    return (
        f"the tilt table with friction {friction:g} is left out: with so many contact points it takes many minutes; "
        f"--friction {friction:g} asks for it"
    )


def _near_misses(report: ContactReport) -> tuple[str, ...]:
    return tuple(
        f"'{m.parts[0]}' and '{m.parts[1]}' do not touch: a gap of {m.gap_m * 1e3:.3g} mm separates parallel faces"
        for m in report.near_misses
    )
