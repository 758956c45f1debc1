"""The hand of a simulated cell: fingers that close, or a cup that sucks; what it holds, and how that slips in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mocca_robot.plan.gripper import Grip
from mocca_robot.tolerances import ROUNDING
from planners.robot.tool import Gripper, SuctionGripper
from sim.cell.cup import Grasp, sealed, suck
from sim.cell.world import CellWorld
from sim.cell.wrist_force import touched

FINGER_SPEED_M_S = 0.05
GRIP_TIMEOUT_S = 3.0
STILL_M_S = 2e-4
BLOCKED_M = 2e-4
"""Fingers that stop farther than this from where they were sent have been stopped by something."""
VALVE_S = 0.3
"""Vacuum comes and goes in this time."""


@dataclass
class Track:
    """What happened to the part in hand, filled in as it happens. Lengths in metres, angles in radians.

    Attributes:
        width_m: opening at which the fingers closed on it.
        held: it was still in the hand when it was to be let go.
        slip_m, slip_rad: how far it moved in the hand from pick to release.
        peak_insert_n: largest force felt while it was pushed in.
        touches: what touched that should not, with the largest force, newtons.
    """

    width_m: float | None = None
    held: bool | None = None
    slip_m: float | None = None
    slip_rad: float | None = None
    peak_insert_n: float = 0.0
    touches: dict[str, float] = field(default_factory=dict)


class CellHand:
    """The hand in a world. `watch` is asked in every cycle and raises Stopped.

    Parts are let go gently: until the fingers are open, velocities are removed after every step, so that the forces
    between parts build up as they would under a calm hand (see `sim.motion.run`). That holds up nothing that falls.
    """

    def __init__(self, world: CellWorld, gripper: Gripper, watch: Callable[[], object]) -> None:
        self.track = Track()
        self._world = world
        self._gripper = gripper
        self._watch = watch
        self._grasp: Grasp | None = None

    def grip(self, width_m: float, force_n: float) -> Grip:
        """Move the fingers to an opening with at most `force_n`, or switch the vacuum; return where they stopped."""
        self._watch()
        try:
            if isinstance(self._gripper, SuctionGripper):
                grip = self._switch(self._gripper, width_m)
            else:
                grip = self._close_or_open(width_m, force_n)
            self._watch()
        finally:
            self._world.gently = False
        return grip

    def let_go(self) -> None:
        """The part is in the hand no longer: where it lies in its nest, that holds it again."""
        world = self._world
        world.gripped = False
        if world.cup is not None:
            world.data.eq_active[world.cup] = 0
        world.remember()
        world.carry(by_nest=True)

    def keep(self) -> None:
        """Hold on to the part in a world that has just entered another moment."""
        if self._world.gripped and self._world.cup is not None:
            self._suck()

    def measure_slip(self, part: str) -> None:
        """Note whether the body `part` is still in the hand, and how far it moved there."""
        world, now = self._world, self._world.in_hand()
        if now is None or self._grasp is None:
            return
        if world.cup is None:
            pads = touched(world.model, world.data, world.bodies(world.fingers))
            self.track.held = any(words.endswith(part) for words in pads)
        else:
            self.track.held = bool(world.data.eq_active[world.cup])
        self.track.slip_m = float(np.linalg.norm(now[0] - self._grasp[0]))
        cosine = 0.5 * (float(np.trace(now[1].T @ self._grasp[1])) - 1.0)
        self.track.slip_rad = float(np.arccos(min(1.0, max(-1.0, cosine))))

    def _close_or_open(self, width_m: float, force_n: float) -> Grip:
        world = self._world
        world.model.actuator_forcerange[6:8] = [-force_n, force_n]
        joints, opening = np.array(world.data.ctrl[:6]), float(world.data.qpos[6:8].sum())
        closing = width_m < opening
        if not closing:
            self.let_go()
            world.gently = world.moment.phase == "rest"
        target, still, end = opening, 0, world.time_s + GRIP_TIMEOUT_S
        while still < 10 and world.time_s <= end:
            reach, gap = FINGER_SPEED_M_S * world.cycle_s, width_m - target
            target += float(np.clip(gap, -reach, reach))
            world.data.ctrl[6:8] = 0.5 * target
            world.advance(joints, np.zeros(6))
            self._watch()
            quiet = abs(gap) < ROUNDING and float(np.abs(world.data.qvel[6:8]).max()) < STILL_M_S
            still = still + 1 if quiet else 0
        reached = float(world.data.qpos[6:8].sum())
        blocked = abs(reached - width_m) > BLOCKED_M
        if closing and blocked:
            self._take(reached)
        return Grip(reached, blocked)

    def _switch(self, gripper: SuctionGripper, width_m: float) -> Grip:
        """Switch the vacuum on at opening 0, off at any other; the cup holds what lies at its lip."""
        world = self._world
        if width_m > 0.5 * gripper.RELEASED_M:
            self.let_go()
            world.gently = world.moment.phase == "rest"
            world.hold(VALVE_S)
            return Grip(None, None, False)
        world.hold(VALVE_S)
        holds = sealed(world, gripper)
        if holds:
            self._take(0.0)
            self._suck()
        return Grip(None, None, holds)

    def _take(self, width_m: float) -> None:
        """The part is in the hand: its nest holds it no longer."""
        self.track.width_m = width_m
        self._world.gripped = True
        self._world.carry(by_nest=False)
        self._grasp = self._world.in_hand()

    def _suck(self) -> None:
        assert isinstance(self._gripper, SuctionGripper) and self._grasp is not None
        suck(self._world, self._gripper, self._grasp)
