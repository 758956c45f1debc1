"""What physics says about an assembly, beside what statics says of the same: results as types, no words to be parsed.

`mocca_robot.verdicts.agreement` decides what agrees and says it; `mocca_robot.verdicts.simulation_json` is the codec.
Names end in no unit where they are metres, newtons, seconds; angles are radians.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from mocca_robot.statics.solution import Status


class Verdict(StrEnum):
    """What a run says."""

    STANDS = "stands"
    FELL = "fell"
    FAILED = "failed"
    """The run cannot be believed, or did not come to rest in time: no verdict."""


@dataclass(frozen=True, kw_only=True)
class StateVerdict:
    """The assembly just after a part was placed.

    Attributes:
        placed: name of the part placed last.
        verdict: of physics.
        statics: verdict of statics with the same friction; None where a file does not tell it.
        friction: Coulomb coefficient; None where a file does not tell it.
        reason: physics' evidence, for people.
        moved: parts that moved; statics_moved those that statics' collapse motion moves.
        max_displacement, max_share: metres, and relative to the part's size.
        final_speed: m/s.
        duration: simulated seconds.
        times, poses: the motion, sampled; poses[t][f] are the coordinates of part `parts[f]` (x, y, turn from its
            place in 2D; position and quaternion in 3D). Empty for a state that stands.
        parts: names of the parts in `poses`.
        cause: what experiments say where it falls in physics though statics holds it; else ''.
        engine: what found it, where that is another than the simulation's; else ''.
    """

    placed: str
    verdict: Verdict
    statics: Status | None = None
    friction: float | None = None
    reason: str = ""
    moved: tuple[str, ...] = ()
    statics_moved: tuple[str, ...] = ()
    max_displacement: float = 0.0
    max_share: float = 0.0
    final_speed: float = 0.0
    duration: float = 0.0
    times: tuple[float, ...] = ()
    poses: tuple[tuple[tuple[float, ...], ...], ...] = ()
    parts: tuple[str, ...] = ()
    cause: str = ""
    engine: str = ""

    @property
    def stands(self) -> bool:
        """Return whether it stands in physics."""
        return self.verdict is Verdict.STANDS


@dataclass(frozen=True, kw_only=True)
class TiltVerdict:
    """The critical tilt towards one azimuth.

    Attributes:
        azimuth_rad: direction towards which the ground drops, from +x.
        critical_rad: halfway between the largest tilt that stood and the smallest that fell; 0 when it falls
            upright, π/2 when nothing up to there moves it.
        statics_rad: the same from static equilibrium.
        friction: Coulomb coefficient.
        moved: parts that moved in the smallest tilt that fell.
        failed: tilts (radians) whose runs gave no verdict; they count as not standing.
        within_rad: half the distance of those two tilts: no more is known of the critical one. The search begins
            around statics' guess, so that a difference from statics means nothing without it.
        cause: what experiments say where physics falls earlier than statics by more than the two may differ; else ''.
        engine: what found it, where that is another than the simulation's; else ''.
    """

    azimuth_rad: float
    critical_rad: float
    statics_rad: float
    friction: float
    moved: tuple[str, ...] = ()
    failed: tuple[float, ...] = ()
    within_rad: float = 0.0
    cause: str = ""
    engine: str = ""

    @property
    def apart_rad(self) -> float:
        """Return how far apart physics and statics are at most, radians."""
        return abs(self.critical_rad - self.statics_rad) + self.within_rad


@dataclass(frozen=True, kw_only=True)
class LoadVerdict:
    """How much of one load the structure takes.

    Attributes:
        name: the load, or the combination.
        factor: halfway between the largest multiple of the load that stood and the smallest that fell; 0 when it falls
            without it. Infinite where none up to `tried` moves it.
        statics: the same from static equilibrium, infinite where any amount stands.
        friction: Coulomb coefficient.
        placed: the part just placed in the state that this is about, which takes least by statics; '' = the finished
            structure.
        moved: parts that moved under the smallest multiple that fell.
        failed: multiples whose runs gave no verdict; they count as not standing.
        within: half the distance of those two multiples.
        tried: the multiple beyond which nothing was tried, where all up to there stand.
        scale: the multiple to measure differences by: that of statics, or of the load as heavy as the structure.
        cause: what experiments say where physics falls earlier than statics by more than the two may differ; else ''.
        engine: what found it, where that is another than the simulation's; else ''.
    """

    name: str
    factor: float
    statics: float
    friction: float
    placed: str = ""
    moved: tuple[str, ...] = ()
    failed: tuple[float, ...] = ()
    within: float = 0.0
    tried: float = 0.0
    scale: float = 1.0
    cause: str = ""
    engine: str = ""

    @property
    def apart(self) -> float:
        """Return how far apart physics and statics surely are, as a share of `scale`; 0 where statics is between.

        One that knows no limit says at least as much as the other: `tried` is a limit that physics does not know.
        """
        low, high = self.factor - self.within, self.factor + self.within
        if np.isinf(self.factor):
            low, high = self.tried, np.inf
        if low <= self.statics <= high:
            return 0.0
        if np.isinf(self.statics):
            return 1.0
        return float(min(abs(low - self.statics), abs(high - self.statics)) / self.scale)


@dataclass(frozen=True, kw_only=True)
class InsertionTrial:
    """One insertion, judged.

    Attributes:
        part, kind: name; 'axis', 'interior', 'rim' or 'outside'.
        direction: way in, (d,).
        clearance: metres that the part was made smaller all around.
        error: effective length e of the hand's error, metres.
        below: 'held' when the earlier parts could not move, 'free' when they could and were judged too.
        succeeded: nothing was in the way.
        reason: for people.
        peak_force: largest net contact force and torque/reach on the part, N; allowed_force what it may be.
        peak_penetration: metres.
        tracking_error: largest deviation from the commanded path, metres.
        moved_below: names of earlier parts that moved too far.
        steps: of the simulation; 0 where a file does not tell.
    """

    part: str
    kind: str
    direction: tuple[float, ...]
    clearance: float = 0.0
    error: float = 0.0
    below: str = "held"
    succeeded: bool
    reason: str = ""
    peak_force: float = 0.0
    allowed_force: float = 0.0
    peak_penetration: float = 0.0
    tracking_error: float = 0.0
    moved_below: tuple[str, ...] = ()
    steps: int = 0

    @property
    def inside(self) -> bool:
        """Return whether the way lies inside the part's cone; those outside are negative controls."""
        return self.kind != "outside"

    @property
    def force_share(self) -> float:
        """Return the peak force over what is allowed; 0 where nothing pushed."""
        return self.peak_force / self.allowed_force if self.peak_force else 0.0


@dataclass(frozen=True, kw_only=True)
class Tries:
    """Trials of one kind, counted: how many, how many succeeded, and the largest force, N, and share of the allowed."""

    trials: int
    succeeded: int
    peak_force: float
    force_share: float

    @staticmethod
    def of(trials: Sequence[InsertionTrial]) -> Tries:
        """Return the counts of `trials`."""
        return Tries(
            trials=len(trials),
            succeeded=sum(t.succeeded for t in trials),
            peak_force=max((t.peak_force for t in trials), default=0.0),
            force_share=max((t.force_share for t in trials), default=0.0),
        )


@dataclass(frozen=True, kw_only=True)
class PartInsertion:
    """The insertions of one part.

    Attributes:
        part: name.
        axis: (d,) way in, the axis of its cone.
        realised_rad: half-angle of the widest cone that its contacts leave about the axis; negative when blocked.
        tried_rad: half-angle of the cone that the trials cover.
        friction: Coulomb coefficient; None where a file does not tell it.
        trials: every one.
    """

    part: str
    axis: tuple[float, ...]
    realised_rad: float
    tried_rad: float
    friction: float | None = None
    trials: tuple[InsertionTrial, ...] = ()

    @property
    def inside(self) -> Tries:
        """Return the counts inside the cone, where all should succeed."""
        return Tries.of([t for t in self.trials if t.inside])

    @property
    def outside(self) -> Tries:
        """Return the counts just outside the cone, where none should."""
        return Tries.of([t for t in self.trials if not t.inside])


@dataclass(frozen=True, kw_only=True)
class Robustness:
    """Success over all disturbed trials.

    Attributes:
        trials, succeeded: counts; low, high: Wilson interval on the success rate at `confidence`.
        failures: how many trials failed for which reason; a trial counts once, for its first failure.
        distributions: what was drawn from, as plain values by name; see `sim.robust.RobustOptions`.
    """

    trials: int
    succeeded: int
    low: float
    high: float
    confidence: float
    failures: Mapping[str, int]
    distributions: Mapping[str, float | bool | tuple[float, ...]]

    @property
    def rate(self) -> float:
        """Return the share of trials that succeeded."""
        return self.succeeded / self.trials if self.trials else 0.0


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """What physics says, beside what statics says.

    Attributes:
        name: of the assembly.
        engine: 'mujoco 3.17.0'; single verdicts may name another.
        states: one per free part, in assembly order.
        tilt: by friction, then azimuth.
        loads: one per load, and per combination of several.
        insertion: per free part, in assembly order.
        robust: success rates with confidence intervals; None when not asked for.
        seconds: wall time by stage, and in 'total'.
        notes: near misses, parts inserted with their neighbours held, parts without a free direction.
        interrupted: Ctrl-C came before all trials were done.
    """

    name: str
    engine: str
    states: tuple[StateVerdict, ...] = ()
    tilt: tuple[TiltVerdict, ...] = ()
    loads: tuple[LoadVerdict, ...] = ()
    insertion: tuple[PartInsertion, ...] = ()
    robust: Robustness | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    interrupted: bool = False

    def __repr__(self) -> str:
        said = [f"{sum(s.stands for s in self.states)} of {len(self.states)} states stand"] if self.states else []
        if inside := [t for t in self.trials if t.inside]:
            said.append(f"{sum(t.succeeded for t in inside)} of {len(inside)} insertions inside the cones succeed")
        said += ["interrupted"] if self.interrupted else []
        return f"<Simulation of {self.name!r} by {self.engine}: {', '.join(said) or 'nothing asked'}>"

    @property
    def needs_support(self) -> tuple[str, ...]:
        """Return the parts after whose placing the assembly does not stand by itself."""
        return tuple(s.placed for s in self.states if not s.stands)

    @property
    def trials(self) -> tuple[InsertionTrial, ...]:
        """Return every insertion trial, part by part."""
        return tuple(t for part in self.insertion for t in part.trials)

    def engine_of(self, verdict: StateVerdict | TiltVerdict | LoadVerdict) -> str:
        """Return what found a verdict, such as 'mujoco 3.17.0'."""
        return verdict.engine or self.engine
