"""Up to which tilt does an assembly stand with friction? The ground tilts on, step by step, until it falls."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.statics.cases import case_at
from mocca_robot.statics.loads import case_wrenches
from sim.coulomb.judge import CoulombVerdict, Rubbing, told
from sim.coulomb.settle import COURSE, Course, SettlingOutcome, settle

RESOLUTION_RAD = float(np.deg2rad(0.1))
"""Width at which the search for a critical tilt ends."""
STEP_RAD, LONGEST_STEP_RAD = float(np.deg2rad(0.5)), float(np.deg2rad(4.0))
"""A fall counts after a step of no more than the first; the search takes none longer than the second from a stand."""
RAMP_PER_RAD, SHORTEST_RAMP = float(np.rad2deg(400.0)), 400
"""Steps of the engine in which a step of the ground is made. With ten times as many, ten random assemblies fall within
0.1° of where they did."""
PAST = 5
"""Tilts to try, ever farther on, beyond one without a verdict."""


@dataclass(frozen=True, eq=False)
class Tilted:
    """What the assembly does at one tilt (radians)."""

    angle_rad: float
    standing: CoulombVerdict


@dataclass(frozen=True, eq=False)
class TiltBracket:
    """Where a critical tilt lies.

    Attributes:
        stood: the largest tilt that stood; None when it does not stand upright.
        fell: the smallest beyond that fell, or gave no verdict where none fell; None when it stands at every tilt.
        runs: tilts that were tried.
    """

    stood: Tilted | None
    fell: Tilted | None
    runs: int

    @property
    def critical_rad(self) -> float:
        """Return the middle: 0 when it does not stand upright, π/2 when nothing up to there moves it."""
        if self.stood is None:
            return 0.0
        return np.pi / 2 if self.fell is None else 0.5 * (self.stood.angle_rad + self.fell.angle_rad)

    @property
    def within_rad(self) -> float:
        """Return by how much either way the critical tilt is uncertain."""
        return 0.0 if self.stood is None else self.critical_rad - self.stood.angle_rad


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
    ground = _Ground(rubbing, azimuth_rad, course)
    stood = ground.tilt(0.0, None)
    if not stood.standing.stands:
        return TiltBracket(None, stood, ground.runs)
    stood, fell = _approached(ground, stood, guess_rad)
    while fell is not None and fell.angle_rad - stood.angle_rad > resolution_rad:
        middle = ground.tilt(0.5 * (stood.angle_rad + fell.angle_rad), stood)
        stood, fell = (middle, fell) if middle.standing.stands else (stood, middle)
    if fell is not None:
        fell = _past(ground, stood, fell, resolution_rad)
    return TiltBracket(stood, fell, ground.runs)


class _Ground:
    """A ground that tilts, and how often it did."""

    def __init__(self, rubbing: Rubbing, azimuth_rad: float, course: Course) -> None:
        self.rubbing, self.azimuth_rad, self.course, self.runs = rubbing, azimuth_rad, course, 0

    def tilt(self, angle_rad: float, rest: Tilted | None) -> Tilted:
        """Return what the assembly does when it is tilted on from a rest, or loaded at once where there is none."""
        assembly, course, after = self.rubbing.graph.assembly, self.course, None
        if rest is not None:
            ramp = int(max(SHORTEST_RAMP, RAMP_PER_RAD * (angle_rad - rest.angle_rad)))
            course, after = replace(course, ramp=ramp), rest.standing.settled
        case = case_at(assembly, angle_rad, self.azimuth_rad)
        wrenches = case_wrenches(case, self.rubbing.graph)
        self.runs += 1
        return Tilted(angle_rad, told(assembly, settle(self.rubbing.whole, wrenches, course, after)))


def _approached(ground: _Ground, stood: Tilted, guess_rad: float) -> tuple[Tilted, Tilted | None]:
    """Return the last tilt that stood and the first that did not after a step of `STEP_RAD` or less; None at π/2."""
    near = guess_rad + 3.0 * STEP_RAD
    step = max(guess_rad - 1.5 * STEP_RAD, STEP_RAD)
    while stood.angle_rad < np.pi / 2:
        further = ground.tilt(min(stood.angle_rad + step, np.pi / 2), stood)
        if further.standing.stands:
            stood = further
            step = STEP_RAD if stood.angle_rad < near else min(2.0 * step, LONGEST_STEP_RAD)
        elif step <= STEP_RAD:
            return stood, further
        else:
            step = max(0.5 * step, STEP_RAD)
    return stood, None


def _past(ground: _Ground, stood: Tilted, over: Tilted, width_rad: float) -> Tilted:
    """Return a tilt that falls, ever farther past one without a verdict; the latter where `PAST` of them have none."""
    for k in range(PAST):
        if over.standing.settled.outcome is SettlingOutcome.FALLS:
            return over
        further = ground.tilt(min(over.angle_rad + 2.0**k * width_rad, np.pi / 2), stood)
        if further.standing.settled.outcome is SettlingOutcome.FALLS:
            return further
    return over
