"""Do physics and statics agree, by how much do they not, and how is it said? Report and command line ask here."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np

from mocca_robot.assembly import Assembly, Interlocking, SupportFree
from mocca_robot.errors import quoted
from mocca_robot.motion.insertion import InsertionVerdict
from mocca_robot.statics.cases import CaseVerdict
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.physics import LoadVerdict, PartInsertion, Simulation, StateVerdict, TiltVerdict, Verdict

TILT_AGREEMENT_DEG = {2: 0.5, 3: 1.5}
"""By dimension: critical tilts by statics and physics further apart than this disagree. Rigid facets against slightly
soft ones explain less."""
LOAD_AGREEMENT = 0.02
"""Load factors by statics and physics further apart than this share disagree."""
FITS: Mapping[Status, frozenset[Verdict]] = {
    Status.EQUILIBRIUM: frozenset({Verdict.STANDS}),
    Status.NOT_IN_EQUILIBRIUM: frozenset({Verdict.FELL}),
}
"""Which verdicts of physics fit one of statics; a verdict that is not here decides nothing."""
SAID: Mapping[Verdict | Status, str] = {
    Verdict.STANDS: "stands",
    Verdict.FELL: "falls",
    Status.EQUILIBRIUM: "stands",
    Status.NOT_IN_EQUILIBRIUM: "falls",
}


class Kind(StrEnum):
    """What a remark is about."""

    DISAGREEMENT = "disagreement"
    """Physics contradicts statics, or geometry."""
    FALLS = "falls"
    """A state that is asked to stand does not in physics."""
    INACCURATE = "inaccurate"
    """Physics gave no verdict on a state."""
    JAMS = "jams"
    """A part does not go in along a way inside its cone."""
    UNDECIDED = "undecided"
    """Statics gave no verdict on a state."""


HELD = frozenset({Kind.DISAGREEMENT, Kind.FALLS, Kind.INACCURATE, Kind.JAMS})
"""Kinds that are held against an assembly; the others are only worth knowing."""


@dataclass(frozen=True, kw_only=True)
class Remark:
    """Something that a person should know of a simulation.

    Attributes:
        kind: what it is.
        about: the verdict that it comes from.
        text: one sentence with its figures.
        contradicts: it says something else than statics or geometry.
        parts: names of the parts concerned.
        case: name of the state, for what is held against one.
    """

    kind: Kind
    about: StateVerdict | TiltVerdict | LoadVerdict | PartInsertion
    text: str
    contradicts: bool
    parts: tuple[str, ...] = ()
    case: str | None = None

    @property
    def held(self) -> bool:
        """Return whether it is held against the assembly."""
        return self.kind in HELD


def remarks(
    assembly: Assembly,
    simulation: Simulation,
    *,
    insertions: Sequence[InsertionVerdict] = (),
    states: Sequence[CaseVerdict] = (),
) -> tuple[Remark, ...]:
    """Return what physics holds against an assembly, and where it agrees neither with statics nor with geometry.

    Args:
        assembly: what was simulated.
        simulation: what physics says; statics is what it was compared with there, with the same friction.
        insertions: geometry's verdicts: a part that jams contradicts them where they say that it goes in.
        states: statics' verdicts on states, for those of which the simulation tells none.
    """
    statics = _statics(simulation, states)
    goes_in = {i.part for i in insertions if i.assemblable}
    return (
        *_states_apart(simulation, statics),
        *_tilts_apart(assembly, simulation),
        *_loads_apart(simulation),
        *_falls(assembly, simulation),
        *_silent(simulation),
        *_insertions(assembly, simulation, statics, goes_in),
    )


def contradictions(assembly: Assembly, simulation: Simulation) -> tuple[str, ...]:
    """Return where physics and statics differ on states and tilts, in words."""
    found = remarks(assembly, simulation)
    return tuple(r.text for r in found if r.contradicts and not isinstance(r.about, PartInsertion))


def agree(physics: Verdict, statics: Status | None) -> bool | None:
    """Return whether physics and statics say the same of a state; None where one of them says nothing."""
    if statics is None or statics not in FITS or physics is Verdict.FAILED:
        return None
    return physics in FITS[statics]


def tilts_apart(tilt: TiltVerdict, dimension: int) -> bool:
    """Return whether physics and statics differ on a critical tilt by more than they may.

    No more is known of that of physics than a bracket: only what lies outside the limit as a whole is apart.
    """
    critical, statics, within = (float(np.rad2deg(a)) for a in (tilt.critical_rad, tilt.statics_rad, tilt.within_rad))
    return abs(critical - statics) - within > TILT_AGREEMENT_DEG[dimension]


def gaps_rad(tilts: Iterable[TiltVerdict]) -> tuple[float, ...]:
    """Return how far apart physics and statics are at most, radians, on every tilt."""
    return tuple(t.apart_rad for t in tilts)


def towards(azimuth_rad: float, dimension: int) -> str:
    """Return a direction of tilt: 'right' or 'left' in 2D, else '45°'."""
    if dimension == 2:
        return "right" if np.cos(azimuth_rad) >= 0 else "left"
    return f"{np.rad2deg(azimuth_rad):.0f}°"


def called(engine: str) -> str:
    """Return an engine's name without its version, as people write it."""
    name = engine.split(" ")[0]
    return {"": "MuJoCo", "mujoco": "MuJoCo", "coulomb": "the friction engine"}.get(name, name)


def _statics(simulation: Simulation, states: Sequence[CaseVerdict]) -> dict[str, Status]:
    """Return statics' verdict by the name of the part placed last: the simulation's, or else that of `states`."""
    others = {s.case.name.removeprefix("state_"): s.result.status for s in states}
    return others | {s.placed: s.statics for s in simulation.states if s.statics is not None}


def _states_apart(simulation: Simulation, statics: Mapping[str, Status]) -> Iterator[Remark]:
    for state in simulation.states:
        engine, expected = called(simulation.engine_of(state)), statics.get(state.placed)
        if agree(state.verdict, expected) is False and expected is not None:
            text = (
                f"After placing '{state.placed}' it {SAID[state.verdict]} in {engine} and {SAID[expected]} by statics"
                f"{_because(state)}."
            )
            yield Remark(kind=Kind.DISAGREEMENT, about=state, text=text, contradicts=True)
        elif expected is not None and expected not in FITS and state.verdict is not Verdict.FAILED:
            text = f"After placing '{state.placed}' it {SAID[state.verdict]} in {engine}; statics gave no verdict."
            yield Remark(kind=Kind.UNDECIDED, about=state, text=text, contradicts=True)


def _tilts_apart(assembly: Assembly, simulation: Simulation) -> Iterator[Remark]:
    for tilt in simulation.tilt:
        engine, words = called(simulation.engine_of(tilt)), _tilt_words(assembly, simulation, tilt)
        if tilt.failed:
            text = f"{len(tilt.failed)} of {engine}'s runs gave no verdict at a {words}."
            yield Remark(kind=Kind.DISAGREEMENT, about=tilt, text=text, contradicts=True)
        elif tilts_apart(tilt, assembly.dimension):
            text = f"{_begun(engine)} and statics disagree on the {words}{_because(tilt)}."
            yield Remark(kind=Kind.DISAGREEMENT, about=tilt, text=text, contradicts=True)


def _loads_apart(simulation: Simulation) -> Iterator[Remark]:
    for load in simulation.loads:
        engine, words = called(simulation.engine_of(load)), load_words(simulation, load)
        if load.failed:
            text = f"{len(load.failed)} of {engine}'s runs gave no verdict on how much of the {words}."
            yield Remark(kind=Kind.DISAGREEMENT, about=load, text=text, contradicts=True)
        elif load.apart > LOAD_AGREEMENT:
            text = f"{_begun(engine)} and statics disagree on how much stands of the {words}{_because(load)}."
            yield Remark(kind=Kind.DISAGREEMENT, about=load, text=text, contradicts=True)


def load_words(simulation: Simulation, load: LoadVerdict) -> str:
    """Return a load with how many times it stands, by physics and by statics."""
    when = f" just after placing '{load.placed}'" if load.placed else ""
    return (
        f"load '{load.name}'{when} (friction {load.friction:g}): {times(load)} in "
        f"{called(simulation.engine_of(load))}, {_factor(load.statics)} by statics"
    )


def times(load: LoadVerdict) -> str:
    """Return how many times a load stands in physics: 3.21 times, or at least as many as were tried."""
    return f"at least {load.tried:.4g} times" if np.isinf(load.factor) else _factor(load.factor)


def _factor(factor: float) -> str:
    return "any amount" if np.isinf(factor) else f"{factor:.4g} times"


def _tilt_words(assembly: Assembly, simulation: Simulation, tilt: TiltVerdict) -> str:
    where = towards(tilt.azimuth_rad, assembly.dimension)
    if assembly.dimension == 2:
        where = f"the {where}"
    return (
        f"tilt towards {where} (friction {tilt.friction:g}): {np.rad2deg(tilt.critical_rad):.2f}° in "
        f"{called(simulation.engine_of(tilt))}, {np.rad2deg(tilt.statics_rad):.2f}° by statics"
    )


def _begun(words: str) -> str:
    """Return words as a sentence begins with them."""
    return words[:1].upper() + words[1:]


def _because(verdict: StateVerdict | TiltVerdict | LoadVerdict) -> str:
    return f"; cause: {verdict.cause}" if verdict.cause else ""


def _falls(assembly: Assembly, simulation: Simulation) -> Iterator[Remark]:
    required = simulation.states
    if all(isinstance(g, Interlocking) for g in assembly.goals):
        required = ()
    elif not any(isinstance(g, SupportFree) for g in assembly.goals):
        required = required[-1:]
    for state in required:
        if state.verdict is Verdict.FELL:
            engine = called(simulation.engine_of(state))
            text = f"Does not stand in {engine} after placing '{state.placed}': {quoted(state.moved)} moved."
            case = f"state_{state.placed}"
            yield Remark(kind=Kind.FALLS, about=state, text=text, contradicts=False, parts=state.moved, case=case)


def _silent(simulation: Simulation) -> Iterator[Remark]:
    for state in simulation.states:
        if state.verdict is Verdict.FAILED:
            engine, why = called(simulation.engine_of(state)), state.reason or "the run failed"
            text = f"{_begun(engine)} gave no verdict after placing '{state.placed}': {why}."
            case = f"state_{state.placed}"
            yield Remark(kind=Kind.INACCURATE, about=state, text=text, contradicts=True, case=case)


def _insertions(
    assembly: Assembly, simulation: Simulation, statics: Mapping[str, Status], goes_in: set[str]
) -> Iterator[Remark]:
    """Yield where parts jam inside their cone, or go in outside it.

    A trial onto parts that were free to move, in a state that falls by statics as well, says nothing of the joint.
    """
    unsteady = _placed_onto_what_falls(assembly, statics)
    for entry in simulation.insertion:
        inside, outside, part = entry.inside, entry.outside, entry.part
        jams = [t for t in entry.trials if t.inside and not t.succeeded]
        jams = [t for t in jams if t.below != "free" or part not in unsteady]
        if jams:
            why = f" ({jams[0].reason})" if jams[0].reason else ""
            text = f"'{part}' jams in {len(jams)} of {inside.trials} insertions inside its cone{why}."
            yield Remark(kind=Kind.JAMS, about=entry, text=text, contradicts=part in goes_in, parts=(part,))
        if outside.succeeded:
            text = (
                f"'{part}' goes in along {outside.succeeded} of {outside.trials} directions outside its cone, which "
                "geometry says are blocked."
            )
            yield Remark(kind=Kind.DISAGREEMENT, about=entry, text=text, contradicts=True, parts=(part,))


def _placed_onto_what_falls(assembly: Assembly, statics: Mapping[str, Status]) -> set[str]:
    """Return the free parts that are placed onto a state that falls by statics."""
    free = [p.name for p in assembly.parts if not p.fixed]
    return {late for early, late in pairwise(free) if statics.get(early) is Status.NOT_IN_EQUILIBRIUM}
