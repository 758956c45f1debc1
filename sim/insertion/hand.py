"""The compliant hand: its springs, how far off it grips, and the path that its far end takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, read_only
from mocca_robot.assembly import Assembly
from mocca_robot.geometry.frames import tangents
from sim.scene import Compiled
from sim.shapes.inertia import inertia


@dataclass(frozen=True, kw_only=True)
class HandOptions:
    """How a part is held and what counts as jammed. Lengths are shares of the part's size (twice its reach).

    Attributes:
        stiffness: N/m of the hand in units of the part's weight per size; 1250 for a 50 mm part of 50 g is
            12 N/mm, about that of an arm holding its position. Rotations get stiffness × reach².
        weight_share: contact force allowed without any error, as a share of the part's weight.
        penetration: deepest penetration allowed without any error: 10 µm for a part of 50 mm.
        pressed: further penetration allowed, as a share of the hand's error: contacts give where the hand presses.
        tracking: deviation from the commanded path allowed beyond the hand's own error.
        lead: free travel before the part comes between its neighbours.
        steps: of one insertion, at least; the tip moves smoothly from rest to rest.
        touching_speed: m/s at most when the grip is off, because the part then meets its neighbours on the way and
            a faster one hits harder than the springs push.
        impact: force allowed beyond the springs', as a share of it: what meeting a neighbour at that speed adds.
        sag_share: displacement of the parts below, when they are left free, that is still harmless.
    """

    stiffness: float = 1250.0
    weight_share: float = 0.05
    penetration: float = 2e-4
    pressed: float = 0.25
    tracking: float = 2e-4
    lead: float = 0.02
    steps: int = 400
    touching_speed: float = 0.05
    impact: float = 0.25
    sag_share: float = 0.01


HAND = HandOptions()


@dataclass(frozen=True)
class PlacingError:
    """How far the hand's grip is off: a shift (m) sideways in one or two directions, and a turn (rad)."""

    shift: tuple[float, ...] = ()
    turn: float = 0.0


STEADY = PlacingError()
"""A grip without error."""


class HandPath:
    """The hand's motion: straight to the seat, in legs (metres before the seat, steps) at rest at both ends.

    Attributes:
        targets: (steps + 1, n) where the grip should be after each step, in joint coordinates.
        commands: (steps + 1, n) the servos' settings during each step.
    """

    def __init__(
        self,
        model: Any,
        compiled: Compiled,
        part: int,
        way: Array,
        *,
        legs: Sequence[tuple[float, int]],
        offset: Array,
    ) -> None:
        row = int(np.flatnonzero(compiled.parts == part)[0])
        d = len(way)
        wide = compiled.dof.shape[1]
        self.qpos, self.dof = compiled.qpos[row, :wide], compiled.dof[row]
        self.body = int(model.body(compiled.scene.assembly.parts[part].name).id)
        self.way = np.concatenate([way, np.zeros(wide - d)])
        self.steps = sum(steps for _, steps in legs)
        self.targets = self._targets(legs, offset)
        # What the servo needs ahead to follow exactly: damping × velocity and inertia × acceleration.
        gains, damping = model.actuator_gainprm[:, 0], -model.actuator_biasprm[:, 2]
        turning = float(np.trace(inertia(compiled.scene.assembly.parts[part]))) / 3.0
        mass = compiled.scene.assembly.parts[part].mass
        step_s = float(model.opt.timestep)
        heave = np.concatenate([np.full(d, mass), np.full(wide - d, turning)]) / gains / step_s**2
        self.commands = self._commands(damping / gains / step_s, heave)

    def _targets(self, legs: Sequence[tuple[float, int]], offset: Array) -> Array:
        """Return (steps + 1, n) where the grip should be: minimum jerk along the line, plus its error.

        The error grows over the first fifth of the first leg, so that no path starts in a neighbour.
        """
        ahead = [np.array([legs[0][0]])]
        for (start, steps), (end, _) in zip(legs, [*legs[1:], (0.0, 0)], strict=True):
            t = np.arange(1, steps + 1) / steps
            ahead.append(start + (end - start) * t**3 * (10.0 - 15.0 * t + 6.0 * t * t))
        e = np.minimum(1.0, 5.0 * np.arange(self.steps + 1) / legs[0][1])
        return read_only(-np.outer(np.concatenate(ahead), self.way) + np.outer(e * e * (3.0 - 2.0 * e), offset))

    def _commands(self, lag: Array, heave: Array) -> Array:
        """Return (steps + 1, n) the servos' settings for which a part that meets nothing is at its target after a step.

        MuJoCo takes the spring's force at the start of a step, the damper's at its end, and moves the part with
        the velocity it has then: with velocities as differences of targets, the following is exact.
        """
        before, now, after = (self.targets[np.maximum(np.arange(self.steps + 1) - k, 0)] for k in (2, 1, 0))
        return read_only(now + lag * (after - now) + heave * (after - 2.0 * now + before))

    def place(self, data: Any) -> None:
        """Put the part at the start of its path."""
        data.qpos[self.qpos] = self.targets[0]

    def deviation(self, visited: Array, far: float) -> float:
        """Return how far the part was from where the grip should be, at most, in the steps after which it was at
        `visited` (steps, n); rotations count as lengths at its reach `far`."""
        gap = visited - self.targets[1 : len(visited) + 1]
        d = 2 if gap.shape[1] == 3 else 3
        off = np.linalg.norm(gap[:, :d], axis=1) + far * np.linalg.norm(gap[:, d:], axis=1)
        return float(np.fmax.reduce(off, initial=0.0))

    def force_weights(self, far: float) -> Array:
        """Return what turns generalized forces into newtons: torques count at the reach `far`."""
        d = 2 if len(self.dof) == 3 else 3
        return np.concatenate([np.ones(d), np.full(len(self.dof) - d, 1.0 / far)])


def grip_offset(assembly: Assembly, way: Array, error: PlacingError, far: float) -> tuple[Array, float]:
    """Return the hand's error in joint coordinates and its effective length."""
    shift = sum((s * axis for s, axis in zip(error.shift, tangents(way))), np.zeros(len(way)))
    turn = np.zeros(1 if assembly.dimension == 2 else 3)
    turn[-1] = error.turn
    return np.concatenate([shift, turn]), float(np.hypot(np.linalg.norm(shift), far * error.turn))
