"""What to ask physics about an assembly."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mocca_robot.errors import InputError, nearest
from sim.insertion.hand import HandOptions, PlacingError
from sim.robust import RobustOptions

STAGES = ("states", "tilt", "loads", "insertion", "robust")
TILT_FRICTIONS = (0.0, 0.3)


@dataclass(frozen=True, kw_only=True)
class Questions:
    """What to ask physics.

    Attributes:
        stages: any of 'states', 'tilt', 'loads', 'insertion', 'robust'.
        friction: Coulomb coefficient in states, loads, insertions and robustness trials.
        tilt_frictions: one tilt table each; `friction` is added when missing. None: `TILT_FRICTIONS`, of which those
            with friction are left out, with a note, where a structure is so large that they would take hours.
        azimuths: of the tilt table in 3D (2D: right and left).
        directions: ways in that cover each part's cone.
        clearances: metres; every one is tried along the axis and the rim.
        errors: of the placing hand; each is tried along the axis without clearance, the hardest case.
        hand: its stiffness and what counts as a jam.
        robust: distributions of the robustness trials.
        seed: of everything drawn at random.
        threads: None = one per core.
    """

    stages: tuple[str, ...] = ("states", "tilt", "loads", "insertion")
    friction: float = 0.0
    tilt_frictions: tuple[float, ...] | None = None
    azimuths: int = 8
    directions: int = 12
    clearances: tuple[float, ...] = (0.0, 3e-4)
    errors: tuple[PlacingError, ...] = (
        PlacingError((5e-4,)),
        PlacingError((-5e-4,)),
        PlacingError((), float(np.deg2rad(1.0))),
        PlacingError((), -float(np.deg2rad(1.0))),
    )
    hand: HandOptions = field(default_factory=HandOptions)
    robust: RobustOptions = field(default_factory=RobustOptions)
    seed: int = 0
    threads: int | None = None

    def __post_init__(self) -> None:
        for stage in self.stages:
            if stage not in STAGES:
                raise InputError(f"No stage is called '{stage}'; {nearest(stage, STAGES)}")
        if self.azimuths < 1 or self.directions < 1:
            raise InputError(f"azimuths = {self.azimuths} and directions = {self.directions} must both be at least 1.")
        for value in (self.friction, *(self.tilt_frictions or ()), *self.clearances):
            if not (np.isfinite(value) and value >= 0.0):
                raise InputError(f"Friction and clearance must be finite and not negative; {value} is not.")
