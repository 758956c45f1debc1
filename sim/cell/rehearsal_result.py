"""What a rehearsal was asked for and what was seen in it: per part, after each release, and of the whole."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from mocca_robot.errors import InputError
from mocca_robot.plan.plan import Plan
from mocca_robot.plan.status import ExecutionStatus
from mocca_robot.report.rehearsal import Chapter
from sim.cell.cell_model import Workplace
from sim.cell.world import Frame


@dataclass(frozen=True)
class Options:
    """How to rehearse.

    Attributes:
        friction: Coulomb coefficient within joints; 0 leaves everything to their shape.
        pad_friction: between pads (or cup) and parts; None takes the gripper's own.
        noise_m, noise_rad: standard deviation of where parts wait in the tray, per horizontal axis and about z.
        seed: of that noise.
        speed: free motions are played this much faster than planned; pushes and grips are not.
        parts: only so many of the plan's first parts; None for all.
    """

    friction: float = 0.0
    pad_friction: float | None = None
    noise_m: float = 0.0
    noise_rad: float = 0.0
    seed: int = 0
    speed: float = 1.0
    parts: int | None = None

    def __post_init__(self) -> None:
        for name, low, high in (
            ("friction", 0.0, 2.0),
            ("pad_friction", 0.01, 2.0),
            ("noise_m", 0.0, 0.01),
            ("noise_rad", 0.0, math.radians(10)),
            ("speed", 0.1, 10.0),
        ):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise InputError(f"{name} is {value:g}; give {low:g} to {high:.4g}.")


@dataclass(frozen=True, kw_only=True)
class StandingCheck:
    """Whether the structure stands as it should, by how far its parts are from their places once it rests.

    Attributes:
        stands: None when it neither rested in time nor moved far: no verdict.
        farthest: the part that is farthest from its place, '' where all is held; besides the free parts the one that
            was placed last counts, held by its support or not.
        displacement_m, allowed_m: its distance (turning counted at its outermost point), and the limit.
        moved: the parts beyond their limits, in assembly order.
        seconds: simulated, until it rested or was given up.
        on_support: the farthest is held by its support: it is out of place, but nothing falls.
    """

    stands: bool | None
    farthest: str
    displacement_m: float
    allowed_m: float
    moved: tuple[str, ...]
    seconds: float
    reason: str
    on_support: bool = False


@dataclass(frozen=True)
class PartRehearsal:
    """What was seen of one part.

    Attributes:
        status, detail: how its last motion ended.
        width_m: opening at which the fingers closed on it; None when they never did.
        held: it was still between the fingers where it was meant to be let go.
        slip_m, slip_rad: how far it moved between the fingers from pick to release.
        inserted: None when its insertion was not reached.
        depth_m, wanted_m: measured and planned depth of the insertion.
        attempts: pushes it took.
        peak_force_n: largest force felt while pushing.
        touches: what touched that should not, with the largest force in newtons.
        standing: the structure after its release; None when that was not reached.
    """

    part: str
    status: ExecutionStatus
    detail: str
    width_m: float | None = None
    held: bool | None = None
    slip_m: float | None = None
    slip_rad: float | None = None
    inserted: bool | None = None
    depth_m: float | None = None
    wanted_m: float | None = None
    attempts: int = 0
    peak_force_n: float | None = None
    touches: tuple[tuple[str, float], ...] = ()
    standing: StandingCheck | None = None

    @property
    def succeeded(self) -> bool:
        """Return whether the part was placed and the structure stood afterwards."""
        return self.status is ExecutionStatus.SUCCEEDED and self.standing is not None and self.standing.stands is True


@dataclass(frozen=True, eq=False, kw_only=True)
class Rehearsal:
    """A rehearsal, finished or not.

    Attributes:
        parts: one per step that was begun.
        whole: the finished structure without its supports, or, where only some parts were asked for, what they are with
            theirs; None when it was not reached.
        planned: number of parts that were to be placed.
        interrupted: Ctrl-C came before the end.
        simulated_s, seconds: simulated time, and wall time.
        frames, chapters, place: what happened, for the player and the film.
    """

    plan: Plan
    name: str
    options: Options
    engine: str
    parts: tuple[PartRehearsal, ...]
    whole: StandingCheck | None
    planned: int
    interrupted: bool
    simulated_s: float
    seconds: float
    place: Workplace = field(repr=False)
    frames: tuple[Frame, ...] = field(repr=False)
    chapters: tuple[Chapter, ...] = field(repr=False)

    @property
    def partial(self) -> bool:
        """Return whether only some of the plan's parts were asked for."""
        return self.planned < len(self.plan.steps)

    @property
    def succeeded(self) -> bool:
        """Return whether everything was placed and the whole stands."""
        return (
            len(self.parts) == self.planned
            and all(p.succeeded for p in self.parts)
            and self.whole is not None
            and self.whole.stands is True
        )
