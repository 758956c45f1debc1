"""A cell in MuJoCo behind the same interface as a robot: the executor builds a plan in it as it would on a UR arm.

The arm follows by servo, feels through the wrist, pushes compliantly and grips with force; parts are carried by
friction between pads and faces alone. The loop that supervises a real arm supervises this one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.plan.gripper import Grip
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Plan
from mocca_robot.plan.pose import Six, Three, pose_of, rotation_matrix, six
from mocca_robot.plan.status import ArmState, ExecutionEvent, ExecutionStatus, MotionOutcome
from mocca_robot.plan.supervision import Stopped
from planners.robot.tool import SuctionGripper
from sim.cell.build import Build, phases, settle, speeds
from sim.cell.cell_model import Pose, Workplace, seat
from sim.cell.cup import overload
from sim.cell.fingers import CellHand, Track
from sim.cell.world import FRAME_S, CellWorld, Frame
from sim.cell.wrist_force import touched

COMPLIANCE = 1.0
"""Share of the insertion speed with which the hand gives way sideways at a force as large as the push."""


@dataclass(frozen=True)
class _Push:
    """A push along `axis` (3,) by a hand that keeps the rotation vector `turn`."""

    axis: Array
    force_n: float
    speed_m_s: float
    turn: tuple[float, ...]


class SimulatedCell:
    """A simulated arm in a simulated cell (see `plan.arm.Arm`), from `__enter__` to `__exit__`.

    Give `heed` to the executor as its listener: it says which part is next, and that moves the cell from one moment of
    the build to the next. `waiting` are the poses of parts in the tray. Where free motions run at `speed` times their
    own, the film takes as many more frames.
    """

    def __init__(
        self,
        place: Workplace,
        plan: Plan,
        waiting: dict[int, Pose],
        *,
        speed: float = 1.0,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> None:
        self.place = place
        self.plan = plan
        self.limits: MotionLimits = plan.cell.limits
        self._cancelled = cancelled
        self._build = Build(place, plan)
        fixed = {k: seat(place.assembly.parts[k]) for k in self._build.held}
        self._world = CellWorld(place, {**waiting, **fixed}, FRAME_S / speed)
        self._hand = CellHand(self._world, place.cell.gripper, self.watch)
        self._current = ""
        self._bias = np.zeros(6)
        self._push: _Push | None = None
        self._wanted: Array | None = None
        self._goal: Array | None = None
        self._refusal = ""

    # Opening and closing

    def __enter__(self) -> SimulatedCell:
        opening = self.plan.steps[0].moves[0].gripper_m
        self._world.begin(self._build.at("fetch", None), np.array(self.plan.first_waypoint.q), opening)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._world.model = self._world.data = None

    @property
    def name(self) -> str:
        """Return what this arm is called in a journal."""
        return f"simulated {self.plan.robot}"

    @property
    def time_s(self) -> float:
        """Return the simulated time."""
        return self._world.time_s

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Return what was to be seen so far."""
        return tuple(self._world.frames)

    # The build

    def heed(self, event: ExecutionEvent) -> None:
        """Bring the cell to the moment that an event of the executor begins."""
        if event.step is None or event.event not in ("step_started", "move_started"):
            return
        step = self.plan.steps[event.step]
        moving = self.place.assembly.index(step.part)
        if event.event == "step_started":
            self._hand.track, self._current = Track(), f"part {step.part}"
            self._world.enter(self._build.at("fetch", moving))
            return
        assert event.move is not None
        phase = phases(step)[event.move]
        if self._world.moment.phase == phase:
            return
        if phase == "rest":
            self._hand.measure_slip(self._current)
            self._world.remember()
            self._world.enter(self._build.release(moving, self._world.poses[moving]))
        else:
            self._world.enter(self._build.at(phase, moving))
        self._hand.keep()

    def settle(self, part: int | None, longest_s: float, resting: Callable[[Array], bool]) -> float:
        """Leave the structure alone until `resting` says so of its parts' speeds (F,), m/s; return the seconds it took.

        `part` counts as built from now on: held by its support if it has one. With None the supports are taken away.
        """
        self._rest()
        self._world.enter(self._build.remove_supports() if part is None else self._build.set_down(part))
        return settle(self._world, longest_s, lambda: resting(self.speeds()))

    def put(self, part: int, pose: Pose) -> None:
        """Have a part that is not in hand lie elsewhere, as a person might leave it."""
        self._world.poses[part] = pose

    def refuse(self, reason: str) -> None:
        """Have every further motion refused: the structure fell, and a person would stop the arm."""
        self._refusal = reason

    def hold_key(self, parts: Sequence[int]) -> None:
        """Hold those of `parts` that are built: the design of the finished structure asks for it."""
        self._build.hold_key(parts)

    @property
    def track(self) -> Track:
        """Return what happened to the part of the present step so far."""
        return self._hand.track

    @property
    def free(self) -> tuple[int, ...]:
        """Return the parts that are built and held by nothing but the structure."""
        return self._build.free

    def speeds(self) -> Array:
        """Return (F,) how fast the free parts move, m/s: of their centres, and of their outermost points by turning."""
        return speeds(self._world, self.free)

    def pose(self, part: int) -> Pose:
        """Return where a part was when it was last looked at."""
        return self._world.poses[part]

    # Supervision

    def _state(self) -> ArmState:
        """Return the arm as its controller would report it."""
        world = self._world
        return ArmState(
            time_s=world.time_s,
            q=six(world.data.qpos[:6]),
            qd=six(world.data.qvel[:6]),
            tcp=pose_of(world.tcp()),
            force=six(world.felt),
            speed_scaling=1.0,
            robot_mode=7,
            safety_mode=1,
            runtime_state=2,
            status_bits=3,
            safety_bits=1,
            payload_kg=world.payload[0],
        )

    def watch(self) -> ArmState:
        """Return the present state; Stopped for what a real cell would be stopped for."""
        state, world, gripper = self._state(), self._world, self.place.cell.gripper
        if self._refusal:
            raise Stopped(ExecutionStatus.REFUSED, self._refusal, state)
        if self._cancelled():
            raise Stopped(ExecutionStatus.CANCELLED, "interrupted", state)
        if isinstance(gripper, SuctionGripper) and (words := overload(world, gripper)):
            self._hand.let_go()
            raise Stopped(ExecutionStatus.DEVIATED, words, state)
        for words, newtons in touched(world.model, world.data, world.hand).items():
            if not self._expected(words):
                self.track.touches[words] = max(self.track.touches.get(words, 0.0), newtons)
        if bumped := touched(world.model, world.data, world.arm):
            words, newtons = max(bumped.items(), key=lambda item: item[1])
            self.track.touches[words] = newtons
            raise Stopped(ExecutionStatus.PROTECTIVE_STOP, f"collision: {words}, {newtons:.1f} N", state)
        return state

    def _expected(self, words: str) -> bool:
        """Return whether a touch belongs to the build: the hand on its part, the part in its joints."""
        held = words.startswith(("finger", "flange")) and words.endswith(f"against {self._current}")
        return held or (words.startswith(f"{self._current} against part") and self._world.moment.phase != "fetch")

    # What an arm does (see `plan.arm.Arm`)

    def now(self) -> float:
        """Return the simulated time."""
        return self._world.time_s

    def preflight(self, plan: Plan, first_step: int) -> MotionOutcome:
        """Return SUCCEEDED if `plan` is the one this cell was made for."""
        if plan is not self.plan or first_step != 0:
            return MotionOutcome(ExecutionStatus.REFUSED, "a rehearsal begins with the first step of its own plan")
        return MotionOutcome(ExecutionStatus.SUCCEEDED, "", self._state())

    def attend(self) -> ArmState:
        """Let the world go on for a cycle under the present command, and `watch`."""
        world = self._world
        before = np.array(world.data.qpos[:6]) if self._goal is None else self._goal
        if self._push is not None:
            self._wanted = self._yielding(before, self._push)
        goal = before if self._wanted is None else self._wanted
        world.advance(goal, (goal - before) / world.cycle_s)
        self._goal = goal
        return self.watch()

    def servo(self, q: Array) -> None:
        """Have the joints follow to `q`."""
        self._wanted = q

    def end_servo(self) -> None:
        """Hold the place."""
        self._rest()

    def push_along(self, frame: Six, force_n: float, speed_m_s: float) -> None:
        """Push along z of `frame`, giving way sideways."""
        turn = self._state().tcp[3:] if self._push is None else self._push.turn
        self._push = _Push(rotation_matrix(frame[3:6])[:, 2], force_n, speed_m_s, turn)

    def end_push(self) -> None:
        """Hold the place."""
        self._rest()

    def zero_force(self) -> None:
        """Take what is felt now as nothing when giving way; the state goes on showing all of it."""
        self._bias = np.array(self._world.felt)

    def set_payload(self, mass_kg: float, cog_m: Three) -> None:
        """Tell the controller what it carries: it holds that weight from now on."""
        self._world.payload = (mass_kg, cog_m)

    def grip(self, width_m: float, force_n: float) -> Grip:
        """Move the fingers to an opening, with at most `force_n`, or switch the vacuum."""
        self._rest()
        return self._hand.grip(width_m, force_n)

    def show(self, text: str) -> None:
        """Nobody stands there."""

    def halt(self, stop: Stopped) -> MotionOutcome:
        """Stop for the reason in `stop`; return that and whether the arm then stands still."""
        return MotionOutcome(stop.status, stop.detail, stop.state, stop_observed=self.stop())

    def stop(self) -> bool:
        """Hold the present joint angles; return whether the arm then stands still."""
        self._rest()
        self._world.hold(0.3)
        return bool(np.abs(self._world.data.qvel[:6]).max() < 0.01)

    # How it moves

    def _rest(self) -> None:
        self._wanted = self._goal = self._push = None

    def _yielding(self, joints: Array, push: _Push) -> Array:
        """Return the joint angles (6,) of a push's next cycle: on along its axis, aside from what presses there."""
        felt = self._world.felt[:3] - self._bias[:3]
        size = float(np.linalg.norm(felt))
        self.track.peak_insert_n = max(self.track.peak_insert_n, size)
        along = float(felt @ push.axis)
        ahead = min(1.0, max(-1.0, (push.force_n + along) / push.force_n))
        aside = COMPLIANCE * (felt - along * push.axis) / push.force_n
        aside /= max(1.0, float(np.linalg.norm(aside)))
        shift = push.speed_m_s * (ahead * push.axis + aside) * self._world.cycle_s
        model, offset = self.place.cell.model, self.plan.cell.tcp_offset
        target = [*(np.array(model.tcp_pose(joints, offset)[:3]) + shift).tolist(), *push.turn]
        try:
            return model.solve_pose(target, joints, offset)
        except InputError:
            return joints
