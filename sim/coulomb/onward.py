"""How far does an assembly stand with friction as its load changes, step by step, each from the rest of the last?"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from sim.coulomb.judge import CoulombVerdict, told
from sim.coulomb.settle import COURSE, Course, SettlingOutcome, settle
from sim.coulomb.springs import Springs

SHORTEST_RAMP = 400
"""Steps of the engine in which the least change of the load is made."""
PAST = 5
"""Places to try, ever farther on, beyond one without a verdict."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Line:
    """A line of loads, in its own unit: radians of tilt, or shares of a load.

    Attributes:
        assembly: whose parts they act on.
        springs: between the parts that are there.
        wrenches: place on the line → (N, dof) about the world origin.
        guess: where it is thought to fall; saves runs.
        resolution: width at which the search ends.
        step: a fall counts after one of no more than this.
        longest: the search takes none longer from a stand.
        ramp: steps of the engine in which a unit of the line is gone.
        end: the line's end.
    """

    assembly: Assembly
    springs: Springs
    wrenches: Callable[[float], Array]
    guess: float
    resolution: float
    step: float
    longest: float
    ramp: float
    end: float
    course: Course = COURSE

    def reached(self, place: float, rest: LinePlace | None) -> LinePlace:
        """Return what the assembly does when the load goes on from a rest, or comes at once where there is none."""
        course, after = self.course, None
        if rest is not None:
            course = replace(course, ramp=int(max(SHORTEST_RAMP, self.ramp * (place - rest.place))))
            after = rest.standing.settled
        return LinePlace(place, told(self.assembly, settle(self.springs, self.wrenches(place), course, after)))


@dataclass(frozen=True, eq=False)
class LinePlace:
    """What the assembly does at one place of a line."""

    place: float
    standing: CoulombVerdict


@dataclass(frozen=True, eq=False)
class Bracket:
    """Where on a line it stops standing.

    Attributes:
        stood: the farthest place that stood; None when it does not stand at 0.
        fell: the first beyond that fell, or gave no verdict where none fell; None when it stands up to the end.
        runs: places that were tried.
    """

    stood: LinePlace | None
    fell: LinePlace | None
    runs: int


def last_stand(line: Line) -> Bracket:
    """Return between which places of a line the assembly stops standing.

    What acts at 0 acts at once; from there it changes step by step. Where no fall is told near by, the runs closest to
    it ended without a verdict, and the bracket reaches past them.
    """
    runs = 1

    def at(place: float, rest: LinePlace) -> LinePlace:
        nonlocal runs
        runs += 1
        return line.reached(place, rest)

    stood = line.reached(0.0, None)
    if not stood.standing.stands:
        return Bracket(None, stood, runs)
    stood, fell = _approached(line, at, stood)
    while fell is not None and fell.place - stood.place > line.resolution:
        middle = at(0.5 * (stood.place + fell.place), stood)
        stood, fell = (middle, fell) if middle.standing.stands else (stood, middle)
    if fell is not None:
        fell = _past(line, at, stood, fell)
    return Bracket(stood, fell, runs)


def _approached(
    line: Line, at: Callable[[float, LinePlace], LinePlace], stood: LinePlace
) -> tuple[LinePlace, LinePlace | None]:
    """Return the last place that stood and the first that did not after a step of `line.step` or less."""
    near = line.guess + 3.0 * line.step
    step = max(line.guess - 1.5 * line.step, line.step)
    while stood.place < line.end:
        further = at(min(stood.place + step, line.end), stood)
        if further.standing.stands:
            stood = further
            step = line.step if stood.place < near else min(2.0 * step, line.longest)
        elif step <= line.step:
            return stood, further
        else:
            step = max(0.5 * step, line.step)
    return stood, None


def _past(line: Line, at: Callable[[float, LinePlace], LinePlace], stood: LinePlace, over: LinePlace) -> LinePlace:
    """Return a place that falls, ever farther past one without a verdict; the latter where `PAST` of them have none."""
    for k in range(PAST):
        if over.standing.settled.outcome is SettlingOutcome.FALLS:
            return over
        further = at(min(over.place + 2.0**k * line.resolution, line.end), stood)
        if further.standing.settled.outcome is SettlingOutcome.FALLS:
            return further
    return over
