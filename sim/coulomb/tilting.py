"""Up to which tilt does an assembly stand with friction? The ground tilts on, step by step, until it falls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.statics.cases import case_at
from mocca_robot.statics.loads import case_wrenches
from sim.coulomb.judge import Rubbing
from sim.coulomb.onward import Bracket, Line, last_stand
from sim.coulomb.settle import COURSE, Course

RESOLUTION_RAD = float(np.deg2rad(0.1))
"""Width at which the search for a critical tilt ends."""
STEP_RAD, LONGEST_STEP_RAD = float(np.deg2rad(0.5)), float(np.deg2rad(4.0))
"""A fall counts after a step of no more than the first; the search takes none longer than the second from a stand."""
RAMP_PER_RAD = float(np.rad2deg(400.0))
"""Steps of the engine in which a step of the ground is made. With ten times as many, ten random assemblies fall within
0.1° of where they did."""


@dataclass(frozen=True, eq=False)
class TiltBracket(Bracket):
    """Where a critical tilt lies: the places of the bracket are tilts, radians."""

    @property
    def critical_rad(self) -> float:
        """Return the middle: 0 when it does not stand upright, π/2 when nothing up to there moves it."""
        if self.stood is None:
            return 0.0
        return np.pi / 2 if self.fell is None else 0.5 * (self.stood.place + self.fell.place)

    @property
    def within_rad(self) -> float:
        """Return by how much either way the critical tilt is uncertain."""
        return 0.0 if self.stood is None else self.critical_rad - self.stood.place


def tilt_bracket(
    rubbing: Rubbing,
    azimuth_rad: float,
    guess_rad: float,
    resolution_rad: float = RESOLUTION_RAD,
    course: Course = COURSE,
) -> TiltBracket:
    """Return between which tilts towards an azimuth the finished assembly stops standing.

    The weight acts upright at once; then the ground tilts on, and every step goes on from the rest of the last. A
    guess saves runs. Where no fall is told near by, the runs closest to the critical tilt ended without a verdict, and
    the bracket reaches past them.
    """
    assembly = rubbing.graph.assembly

    def wrenches(angle_rad: float) -> Array:
        return case_wrenches(case_at(assembly, angle_rad, azimuth_rad), rubbing.graph)

    found = last_stand(
        Line(
            assembly=assembly,
            springs=rubbing.whole,
            wrenches=wrenches,
            guess=guess_rad,
            resolution=resolution_rad,
            step=STEP_RAD,
            longest=LONGEST_STEP_RAD,
            ramp=RAMP_PER_RAD,
            end=np.pi / 2,
            course=course,
        )
    )
    return TiltBracket(found.stood, found.fell, found.runs)
