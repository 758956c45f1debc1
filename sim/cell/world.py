"""The physics of a simulated cell: a MuJoCo model per moment of a build, and the state that goes on through them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.plan.pose import Three, transform
from mocca_robot.tolerances import ROUNDING
from sim.cell.cell_model import Moment, Pose, Workplace, compile_moment
from sim.cell.wrist_force import hand_wrench
from sim.motion import step_failure

CYCLE_S = 0.008
"""How often the arm is commanded and looked at: 125 times a second."""
FRAME_S = 0.1
"""Between the frames of the film."""
SENSOR_S = 0.01
"""Time constant of the force sensor's filter: a shorter knock is felt as less."""
NEWTON_PATIENCE = 5
"""Cycles in a row in which the solver may end with its last iteration before the run is not believed."""


class CannotBelieve(Exception):
    """Physics broke down: not a verdict on the plan."""


@dataclass(frozen=True)
class Frame:
    """The cell at one time: joint angles (6,), two finger coordinates if there are fingers, and the poses of parts."""

    time_s: float
    joints: tuple[float, ...]
    parts: tuple[tuple[int, Pose], ...]


class CellWorld:
    """Bodies, time and forces of a cell. `enter` goes to another moment, `advance` takes one cycle.

    Attributes:
        poses: of every part that is there, by index; those that can move as of the last `remember`.
        payload: mass and centre of gravity (flange frame) that the controller carries.
        gripped: whether the part that moves is in the hand.
        gently: remove the parts' velocities after every step (see `sim.motion.run`).
        felt: the filtered wrench (6,) on the hand, base frame, about the tool's centre point.
    """

    def __init__(self, place: Workplace, poses: dict[int, Pose], frame_s: float = FRAME_S) -> None:
        cell = place.cell
        self.place = place
        self.poses = poses
        self.frames: list[Frame] = []
        self.time_s = 0.0
        self.payload: tuple[float, Three] = (cell.gripper.mass_kg, cell.gripper.cog_m)
        self.gripped = False
        self.gently = False
        self.felt = np.zeros(6)
        self.moment = Moment("fetch", None, (), ())
        self.model: Any = None
        self.data: Any = None
        self._frame_s = frame_s
        self._tool = transform(cell.gripper.tcp_offset)
        self._struggling = 0

    # From moment to moment

    def begin(self, moment: Moment, joints: Array, opening_m: float) -> None:
        """Enter the first moment with the arm and the fingers where they start."""
        self.enter(moment)
        self.data.qpos[:6] = joints
        self.data.qpos[6 : self.driven] = 0.5 * opening_m
        self.data.ctrl[:] = self.data.qpos[: self.driven]
        self.forward()

    def enter(self, moment: Moment) -> None:
        """Compile the model of a moment and take the present state over into it."""
        import mujoco

        before, old = self.model, self.data
        if before is not None:
            self.remember()
        self.model = compile_moment(self.place, moment, self.poses)
        self.data = mujoco.MjData(self.model)
        self.moment = moment
        self.driven = int(self.model.nu)
        if before is not None:
            n = self.driven
            self.data.qpos[:n], self.data.qvel[:n], self.data.ctrl[:] = old.qpos[:n], old.qvel[:n], old.ctrl
            for k in moment.loose:
                mine, theirs = (self._joint(m, k) for m in (self.model, before))
                if mine is not None and theirs is not None:
                    self.data.qvel[mine[1] : mine[1] + 6] = old.qvel[theirs[1] : theirs[1] + 6]
        self._steps = max(1, round(CYCLE_S / float(self.model.opt.timestep)))
        self.cycle_s = self._steps * float(self.model.opt.timestep)
        self._lag = -self.model.actuator_biasprm[:6, 2] / self.model.actuator_gainprm[:6, 0]
        self.flange = int(self.model.body("flange").id)
        self.nest, self.cup = self._equality("nest"), self._equality("cup")
        self.carry(by_nest=not self.gripped)
        self.arm = self.bodies([f"link {k}" for k in range(6)])
        self.forward()

    def carry(self, by_nest: bool) -> None:
        """Have the nest, if there is one, hold the part that moves where it is now, or let go of it."""
        name = self.moving_name
        if self.nest is not None and name:
            self.model.body_gravcomp[int(self.model.body(name).id)] = float(by_nest)
            self.data.eq_active[self.nest] = int(by_nest)
            if by_nest and self.moment.moving is not None:
                pose = self.poses[self.moment.moving]
                self.model.eq_data[self.nest][3:10] = [*pose.position, *pose.quat_wxyz]
        names = ["flange", *self.fingers]
        self.hand = self.bodies([*names, name] if self.gripped and name else names)

    def remember(self) -> None:
        """Read the poses of everything that can move out of the model."""
        for k in self.moment.loose:
            if (at := self._joint(self.model, k)) is not None:
                q = self.data.qpos[at[0] : at[0] + 7].tolist()
                self.poses[k] = Pose((q[0], q[1], q[2]), (q[3], q[4], q[5], q[6]))

    # Stepping

    def forward(self) -> None:
        """Bring everything that follows from the state up to date."""
        import mujoco

        mujoco.mj_forward(self.model, self.data)

    def advance(self, joints: Array, rates: Array) -> None:
        """Step one cycle towards joint angles (6,) that change at `rates` (6,).

        Raises CannotBelieve when physics breaks down.
        """
        import mujoco

        data = self.data
        data.ctrl[:6] = joints + self._lag * rates
        data.xfrc_applied[self.flange] = self._lift()
        if self.gently:
            for _ in range(self._steps):
                mujoco.mj_step(self.model, data)
                data.qvel[self.driven :] = 0.0
        else:
            mujoco.mj_step(self.model, data, self._steps)
        self.time_s += self.cycle_s
        self.felt = self.felt + (self._wrench() - self.felt) * (1.0 - np.exp(-self.cycle_s / SENSOR_S))
        failure = step_failure(self.model, data)
        self._struggling = self._struggling + 1 if failure is not None else 0
        if failure is not None and (self._struggling >= NEWTON_PATIENCE or not np.isfinite(data.qpos).all()):
            raise CannotBelieve(failure)
        if not self.frames or self.time_s - self.frames[-1].time_s >= self._frame_s:
            self.remember()
            self.frames.append(Frame(self.time_s, tuple(data.qpos[: self.driven].tolist()), tuple(self.poses.items())))

    def hold(self, seconds: float) -> None:
        """Keep the arm where it is for a while."""
        goal, end = np.array(self.data.qpos[:6]), self.time_s + seconds
        while self.time_s < end:
            self.advance(goal, np.zeros(6))

    def _lift(self) -> Array:
        """Return force and torque (6,) on the flange: the controller carries what is heavier than its tool."""
        gripper = self.place.cell.gripper
        mass, cog = self.payload
        carried = mass - gripper.mass_kg
        if carried <= ROUNDING:
            return np.zeros(6)
        local = (mass * np.asarray(cog) - gripper.mass_kg * np.asarray(gripper.cog_m)) / carried
        data, k = self.data, self.flange
        lever = data.xmat[k].reshape(3, 3) @ local + data.xpos[k] - data.xipos[k]
        up = -carried * self.model.opt.gravity
        return np.concatenate([up, np.cross(lever, up)])

    # What there is to see

    @property
    def moving_name(self) -> str:
        """Return the body of the part that moves, '' when none does."""
        return "" if self.moment.moving is None else f"part {self.place.assembly.parts[self.moment.moving].name}"

    @property
    def fingers(self) -> list[str]:
        """Return the bodies of the fingers; a cup has none."""
        return ["finger left", "finger right"] if self.driven == 8 else []

    def bodies(self, names: Sequence[str]) -> BoolArray:
        """Return (B,) which bodies of the model have these names."""
        mask = np.zeros(self.model.nbody, dtype=np.bool_)
        mask[[int(self.model.body(n).id) for n in names]] = True
        return mask

    def tcp(self) -> Array:
        """Return the tool's pose (4, 4), base frame."""
        flange = np.eye(4)
        flange[:3, :3] = self.place.turn @ self.data.xmat[self.flange].reshape(3, 3)
        flange[:3, 3] = self.place.turn @ self.data.xpos[self.flange] + self.place.shift
        return np.asarray(flange @ self._tool)

    def in_hand(self) -> tuple[Array, Array] | None:
        """Return where the part that moves is in the flange's frame, (3,) and (3, 3); None when none does."""
        if not self.moving_name:
            return None
        body, data = int(self.model.body(self.moving_name).id), self.data
        turn = data.xmat[self.flange].reshape(3, 3).T
        return turn @ (data.xpos[body] - data.xpos[self.flange]), turn @ data.xmat[body].reshape(3, 3)

    def speed(self, part: int) -> float:
        """Return how fast a part moves, m/s: its centre, and its outermost point by turning; 0 when it cannot."""
        at = self._joint(self.model, part)
        if at is None:
            return 0.0
        v = self.data.qvel[at[1] : at[1] + 6]
        reach = float(np.linalg.norm(np.ptp(self.place.assembly.parts[part].shape.bounds, axis=0)))
        return float(np.linalg.norm(v[:3])) + 0.5 * reach * float(np.linalg.norm(v[3:]))

    def _wrench(self) -> Array:
        """Return what acts on the hand now, (6,), base frame, about the tool's centre point."""
        turn = self.place.turn
        point = turn.T @ (self.tcp()[:3, 3] - self.place.shift)
        wrench = hand_wrench(self.model, self.data, self.hand, point)
        return np.concatenate([turn @ wrench[:3], turn @ wrench[3:]])

    def _joint(self, model: Any, part: int) -> tuple[int, int] | None:
        """Return the addresses of a part's position and velocity; None where it cannot move."""
        body = model.body(f"part {self.place.assembly.parts[part].name}")
        if int(body.jntnum[0]) == 0:
            return None
        joint = int(body.jntadr[0])
        return int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])

    def _equality(self, name: str) -> int | None:
        return next((k for k in range(self.model.neq) if self.model.equality(k).name == name), None)
