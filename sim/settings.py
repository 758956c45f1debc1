"""MuJoCo's settings, and what a run must show to be believed, in one place with their reasons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.assembly import Assembly

LARGE = 60
"""Free parts from which the step is doubled: verdicts stay the same and a dome takes half the time."""
ENERGY_GROWTH = 1e-3
"""Energy a run may gain, as a share of what the free parts would lose by falling their own size. A sound run of
contacts at rest gains about 1e-7; divergence gains orders of magnitude."""
OVERLAP = 1e-3
"""Penetration at the start, relative to the smaller part, that is no touch any more."""
RESTS = 1e-6
"""Sizes per second below which what sank rests."""
KEEPS = 1e-3
"""Displacement (sizes) up to which a free part that rests counts as keeping its place. At its limit it creeps with the
settings' step, because contacts give in proportion to the step's square; then finer ones are tried."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How MuJoCo integrates and resolves contact.

    Attributes:
        timestep: seconds.
        contact_steps: time constant of contacts, in steps: two are the stiffest that stay stable.
        iterations, tolerance: of Newton's method; a run that needs all iterations is rejected, because divergence
            otherwise shows no warning.
        solimp: impedance 0.99 … 0.9999 over 0.1 mm: with MuJoCo's own values critical tilts are 1° off, and with
            a constant 0.9999 large models explode.
        condim: 1 without friction (3 with μ = 0 diverges on pyramidal cones), 3 with.
        impratio: friction ten times stiffer than normal contact, with elliptic cones: pyramidal ones creep
            1 mm/s on a 15° slope that holds.
        sparse: sparse Jacobians; an order of magnitude faster on large models.
    """

    timestep: float
    friction: float = 0.0
    contact_steps: float = 2.0
    iterations: int = 100
    tolerance: float = 1e-10
    solimp: tuple[float, float, float, float, float] = (0.99, 0.9999, 1e-4, 0.5, 2.0)
    impratio: float = 10.0
    sparse: bool = False

    @property
    def condim(self) -> int:
        """Return 1 for normal forces only, 3 for normal and two tangential ones."""
        return 3 if self.friction > 0.0 else 1

    @property
    def solref(self) -> tuple[float, float]:
        """Return time constant (s) and damping ratio of contacts."""
        return (self.contact_steps * self.timestep, 1.0)

    @property
    def give(self) -> float:
        """Return what a contact gives (m) under a part: (1 − d) g τ² with time constant τ and impedance d = 0.99."""
        return 0.1 * self.solref[0] ** 2

    @property
    def margin(self) -> float:
        """Return how far apart (m) what should touch already does.

        MuJoCo leaves out contacts that do not overlap, and a touch that rounding opens carries nothing.
        """
        return 0.1 * self.give


def settings_for(assembly: Assembly, friction: float = 0.0, free_parts: int | None = None) -> Settings:
    """Return the settings for an assembly of which `free_parts` (default: all that are not fixed) move.

    The step is 1 ms for parts of 50 mm and more and follows √size below that, as falling does. Friction halves
    it: parts that wedge slip by as much as the contacts give before they hold, and softer contacts let go 1.3°
    too early on a leaning tower (0.2° with half the step).
    """
    free = int((~assembly.fixed).sum()) if free_parts is None else free_parts
    extents = [float(np.ptp(p.shape.bounds, axis=0).max()) for p in assembly.parts]
    scale = float(np.clip(np.sqrt(np.median(extents) / 0.05), 0.3, 1.0))
    step = 1e-3 * scale * (2.0 if free >= LARGE else 1.0) * (0.5 if friction > 0.0 else 1.0)
    return Settings(timestep=step, friction=friction, sparse=free >= 10)
