"""Does it stand? The load grows from nothing on springs with Coulomb friction until all rests, or something goes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from mocca_robot.arrays import Array, read_only
from sim.coulomb.kernel import ADVANCE, Resting
from sim.coulomb.springs import VISCOSITY, Springs


@dataclass(frozen=True, kw_only=True)
class Course:
    """How the load is brought on, and when a run is over.

    Attributes:
        ramp: steps in which the load grows to all of it. With four times as many, a wall of 150 and a dome of 140
            bricks do the same at every tilt that was tried.
        damping: see `sim.coulomb.kernel.advance`.
        wears: steps after the ramp in which damping wears off by half; after eight times as many it begins anew.
            Damping settles what stands. Through what rattles in its contacts it also slows down what falls.
        gone: a contact that opens or slides by so many times what the springs give has gone, and it falls. What
            contacts really give is about a micrometre.
        balanced: what rests: force that nothing balances, relative to the load, and speed per step, relative to what
            the springs give.
        most: steps after which there is no verdict.
        look: steps between two looks.
    """

    ramp: int = 4000
    damping: float = 0.5
    wears: int = 5000
    gone: float = 3e3
    balanced: float = 1e-6
    most: int = 200_000
    look: int = 100


COURSE = Course()


class SettlingOutcome(StrEnum):
    """What a run says."""

    STANDS = "stands"
    FALLS = "falls"
    UNDECIDED = "undecided"


@dataclass(frozen=True, eq=False, kw_only=True)
class Settled:
    """A verdict with its evidence.

    Attributes:
        outcome: stands, falls, or undecided when the steps ran out.
        unbalanced: largest force on a part that contact forces do not balance, relative to the largest load. It is
            computed anew from `forces`.
        fastest: largest speed of a part, per step, relative to what the springs give.
        farthest: farthest that a contact has opened or slid, relative to what the springs give.
        power: of the load on the last motion, per step, in units of the load and of what the springs give; a fall
            gains, and what rests has none.
        motions: (N, dof) [shift; turn] of every part since the start, relative to what the springs give. A shape of
            motion, of no size: how much springs give is not known.
        forces: (K, d) newtons on the later part of every contact point given.
        steps: of the run.
        held: the state and the load (F, dof) in which it ended, to go on from.
    """

    outcome: SettlingOutcome
    unbalanced: float
    fastest: float
    farthest: float
    power: float
    motions: Array
    forces: Array
    steps: int
    held: tuple[Resting, Array]


def settle(springs: Springs, wrenches: Array, course: Course = COURSE, after: Settled | None = None) -> Settled:
    """Return whether the parts stand under world wrenches (N, dof) about the origin.

    The load grows from zero, or changes from the one of a run that ended `after` which this one comes. They stand when
    everything rests, and fall when a contact has opened or slid by `course.gone` and the load gains by what still
    moves. Points and normals stay where they are: the verdict is on the geometry as it is given.
    """
    load, unit = springs.load(wrenches)
    advance = ADVANCE[springs.about.shape[1]]
    state, before = _at_rest(springs) if after is None else _copied(after.held)
    contacts = springs.contacts
    if after is None:
        contacts = contacts._replace(squeeze=springs.clamping / unit / contacts.normal)
    steps, outcome = 0, SettlingOutcome.UNDECIDED
    seen = _Seen.of(springs, load, state, 0.0)
    while outcome is SettlingOutcome.UNDECIDED and steps < course.most:
        damping = course.damping * 0.5 ** (max(0, steps - course.ramp) / course.wears % 8)
        advance(contacts, before, load, state, steps, course.look, course.ramp, damping, VISCOSITY)
        steps += course.look
        seen = _Seen.of(springs, load, state, 1.0 if after is not None else min(1.0, steps / course.ramp))
        outcome = _outcome(seen, steps, course)
    pushes = np.column_stack([np.maximum(0.0, -springs.contacts.normal * state.gap), state.shear])
    forces = np.zeros((len(springs.used), springs.axes.shape[1]))
    forces[springs.used] = unit * np.einsum("ck,ckx->cx", pushes, springs.axes)
    left = np.linalg.norm(load + springs.resultant(pushes), axis=1)
    return Settled(
        outcome=outcome,
        unbalanced=float(left.max(initial=0.0)) / _largest(load),
        fastest=seen.fastest,
        farthest=seen.farthest,
        power=seen.power,
        motions=read_only(springs.motions(state.motion[:-1] / seen.give)),
        forces=read_only(forces),
        steps=steps,
        held=(state, load),
    )


def _at_rest(springs: Springs) -> tuple[Resting, Array]:
    contacts, d = springs.axes.shape[:2]
    motion, speed, force = (np.zeros((len(springs.free) + 1, springs.dof)) for _ in range(3))
    state = Resting(motion, speed, force, np.zeros(contacts), np.zeros((contacts, d - 1)))
    return state, np.zeros((len(springs.free), springs.dof))


def _copied(held: tuple[Resting, Array]) -> tuple[Resting, Array]:
    return Resting(*(a.copy() for a in held[0])), held[1]


def _largest(load: Array) -> float:
    """Return the largest force on a part; 1 where there is none."""
    return float(np.linalg.norm(load, axis=1).max(initial=0.0)) or 1.0


@dataclass(frozen=True, kw_only=True)
class _Seen:
    """One look at a run; `give` is what the springs give, the rest as in `Settled`."""

    give: float
    unbalanced: float
    fastest: float
    farthest: float
    power: float

    @classmethod
    def of(cls, springs: Springs, load: Array, state: Resting, share: float) -> _Seen:
        contacts, motion, speed = springs.contacts, state.motion[:-1], state.speed[:-1]
        bent = np.linalg.norm(state.shear, axis=1) / contacts.tangential
        give = max(share, float(-state.gap.min(initial=0.0)), float(bent.max(initial=0.0))) or 1.0
        way = springs.relative(motion)
        gone = np.maximum(way[:, 0], np.linalg.norm(way[:, 1:], axis=1))
        adrift = np.linalg.norm(motion[springs.adrift], axis=1)
        return cls(
            give=give,
            unbalanced=float(np.linalg.norm(state.force[:-1], axis=1).max(initial=0.0)) / _largest(load),
            fastest=float(np.linalg.norm(speed, axis=1).max(initial=0.0)) / give,
            farthest=max(float(gone.max(initial=0.0)), float(adrift.max(initial=0.0))) / give,
            power=float((load * speed).sum()) / give,
        )


def _outcome(seen: _Seen, steps: int, course: Course) -> SettlingOutcome:
    if seen.farthest > course.gone and seen.power > 0.0:
        return SettlingOutcome.FALLS
    if steps >= course.ramp and max(seen.unbalanced, seen.fastest) < course.balanced:
        return SettlingOutcome.STANDS
    return SettlingOutcome.UNDECIDED
