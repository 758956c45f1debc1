"""A cell in MuJoCo behind the same interface as a robot: the executor builds a plan in it as it would on a UR arm.

The arm follows by servo, feels through the wrist, pushes compliantly and grips with force; parts are carried by
friction between pads and faces alone. What the real driver checks is checked here by the same guards.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from types import TracebackType

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.plan.gripper import Grip
from mocca_robot.plan.guards import SEATING_PACE, PushGuard, arrived, check_forces, check_path, check_start
from mocca_robot.plan.limits import Limits
from mocca_robot.plan.plan import Plan, Waypoint
from mocca_robot.plan.pose import Three, pose_of, six
from mocca_robot.plan.status import ArmState, ExecutionEvent, ExecutionStatus, Outcome
from mocca_robot.plan.supervision import Stopped
from planners.robot.tool import SuctionGripper
from sim.cell.build import Build, phases, settle, speeds
from sim.cell.cell_model import Pose, Workplace, seat
from sim.cell.cup import overload
from sim.cell.fingers import Hand, Track
from sim.cell.world import FRAME_S, CellWorld, Frame
from sim.cell.wrist_force import touched

COMPLIANCE = 1.0
"""Share of the insertion speed with which the hand gives way sideways at a force as large as the push."""


class SimulatedCell:
    """A simulated arm in a simulated cell (see `interface.Arm`), from `__enter__` to `__exit__`.

    Give `heed` to the executor as its listener: it says which part is next, and that moves the cell from one moment of
    the build to the next. `waiting` are the poses of parts in the tray; `speed` plays free motions that much faster.
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
        self.limits: Limits = plan.cell.limits
        self._speed = speed
        self._cancelled = cancelled
        self._build = Build(place, plan)
        fixed = {k: seat(place.assembly.parts[k]) for k in self._build.held}
        self._world = CellWorld(place, {**waiting, **fixed}, FRAME_S / speed)
        self._hand = Hand(self._world, place.cell.gripper, self._watch)
        self._current = ""
        self._bias = np.zeros(6)
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
            self._world.enter(self._build.released(moving, self._world.poses[moving]))
        else:
            self._world.enter(self._build.at(phase, moving))
        self._hand.keep()

    def settle(self, part: int | None, longest_s: float, resting: Callable[[Array], bool]) -> float:
        """Leave the structure alone until `resting` says so of its parts' speeds (F,), m/s; return the seconds it took.

        `part` counts as built from now on: held by its support if it has one. With None the supports are taken away.
        """
        self._world.enter(self._build.without_supports() if part is None else self._build.placed(part))
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

    def _watch(self) -> ArmState:
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

    # The interface of an arm

    def preflight(self, plan: Plan, first_step: int) -> Outcome:
        """Return SUCCEEDED if `plan` is the one this cell was made for."""
        if plan is not self.plan or first_step != 0:
            return Outcome(ExecutionStatus.REFUSED, "a rehearsal begins with the first step of its own plan")
        return Outcome(ExecutionStatus.SUCCEEDED, "", self._state())

    def set_payload(self, mass_kg: float, cog_m: Three) -> Outcome:
        """Tell the controller what it carries: it holds that weight from now on."""
        self._world.payload = (mass_kg, cog_m)
        return Outcome(ExecutionStatus.SUCCEEDED, "", self._state())

    def zero_force(self) -> Outcome:
        """Pause, then take the present force as zero."""
        try:
            self._world.hold(0.2)
            state = self._watch()
        except Stopped as stop:
            return self._end(stop)
        self._bias = np.array(state.force)
        size = float(np.linalg.norm(self._bias[:3]))
        if size > self.limits.contact_force_n:
            detail = f"the hand feels {size:.1f} N where it should hang free, limit {self.limits.contact_force_n:g} N"
            return Outcome(ExecutionStatus.REFUSED, detail, state)
        return Outcome(ExecutionStatus.SUCCEEDED, "", state)

    def follow(self, path: Sequence[Waypoint], *, force_limit_n: float, contact_force_n: float | None) -> Outcome:
        """Follow a timed path by servo; see `interface.Arm`."""
        waypoint = 0
        try:
            state = self._watch()
            check_start(state, path[0], self.limits)
            times = np.array([w.t - path[0].t for w in path]) / self._speed
            joints, places = np.array([w.q for w in path]), np.array([w.tcp[:3] for w in path])
            offset = np.subtract(state.q, path[0].q)
            last, clock = float(times[-1]), 0.0
            blend = max(0.2, min(0.5, last))
            end = self._world.time_s + 1.1 * last + 2.0
            trail: deque[Array] = deque(maxlen=50)
            goal = np.array(state.q)
            while True:
                clock = min(clock + self._world.cycle_s, max(last, blend))
                waypoint = int(np.searchsorted(times, clock, side="right")) - 1
                fade = max(0.0, 1.0 - clock / blend)
                before = goal
                goal = _at(times, joints, clock) + offset * (fade * fade * (3.0 - 2.0 * fade))
                trail.append(_at(times, places, clock))
                self._world.advance(goal, (goal - before) / self._world.cycle_s)
                state = self._watch()
                check_forces(state, self._bias, self.limits, force_limit_n, contact_force_n)
                check_path(state, trail, self.limits)
                if clock >= max(last, blend) and arrived(state, path[-1], self.limits):
                    break
                if self._world.time_s > end:
                    raise Stopped(ExecutionStatus.TIMED_OUT, f"not there after 1.1 × {last:.1f} s + 2 s", state)
        except Stopped as stop:
            return self._end(stop, waypoint)
        return Outcome(ExecutionStatus.SUCCEEDED, "", state, len(path) - 1)

    def push(self, axis: Array, depth_m: float, *, force_limit_n: float) -> Outcome:
        """Push along `axis` until the depth is measured, giving way sideways; see `interface.Arm`."""
        limits, guard = self.limits, None
        try:
            start = self._watch()
            guard = PushGuard(start, axis, depth_m, self._bias, limits)
            end = self._world.time_s + 1.1 * depth_m / limits.insert_speed_m_s + 2.0
            goal, state = np.array(self._world.data.qpos[:6]), start
            while True:
                felt = np.subtract(state.force, self._bias)[:3]
                along = float(felt @ axis)
                sideways = felt - along * axis
                ahead = min(1.0, max(-1.0, (limits.push_force_n + along) / limits.push_force_n))
                aside = COMPLIANCE * sideways / limits.push_force_n
                aside /= max(1.0, float(np.linalg.norm(aside)))
                pace = SEATING_PACE if guard.seating else 1.0
                velocity = pace * limits.insert_speed_m_s * (ahead * axis + aside)
                before, goal = goal, self._moved(goal, velocity * self._world.cycle_s, start)
                self._world.advance(goal, (goal - before) / self._world.cycle_s)
                state = self._watch()
                size = float(np.linalg.norm(np.subtract(state.force, self._bias)[:3]))
                self.track.peak_insert_n = max(self.track.peak_insert_n, size)
                if guard.check(state, force_limit_n):
                    break
                if self._world.time_s > end:
                    raise Stopped(ExecutionStatus.TIMED_OUT, "the depth was not reached in 1.1 × its time + 2 s", state)
            self._world.hold(0.1)
            state = self._watch()
            if guard.measure(state) < depth_m - limits.depth_tolerance_m:
                raise Stopped(ExecutionStatus.JAMMED, "the part sprang back after the push", state)
        except Stopped as stop:
            outcome = self._end(stop)
            depth = guard.depth_m if guard is not None else 0.0
            detail = f"{outcome.detail} (depth {1e3 * depth:.1f} of {1e3 * depth_m:.1f} mm)"
            return Outcome(outcome.status, detail, outcome.state, None, depth, outcome.stop_observed)
        return Outcome(ExecutionStatus.SUCCEEDED, f"depth {1e3 * guard.depth_m:.2f} mm", state, None, guard.depth_m)

    def _moved(self, joints: Array, shift: Array, start: ArmState) -> Array:
        """Return joint angles that move the commanded tool by `shift` (3,) and turn it back to where it started."""
        model, offset = self.place.cell.model, self.plan.cell.tcp_offset
        target = list(model.tcp_pose(joints, offset))
        target[:3] = (np.array(target[:3]) + shift).tolist()
        target[3:] = start.tcp[3:]
        try:
            return model.solve_pose(target, joints, offset)
        except InputError:
            return joints

    def grip(self, width_m: float, force_n: float) -> tuple[Outcome, Grip]:
        """Move the fingers to an opening, with at most `force_n`, or switch the vacuum; see `interface.Arm`."""
        try:
            grip = self._hand.grip(width_m, force_n)
            return Outcome(ExecutionStatus.SUCCEEDED, "", self._state()), grip
        except Stopped as stop:
            return self._end(stop), Grip(None, None)

    def stop(self) -> bool:
        """Hold the present joint angles; return whether the arm then stands still."""
        self._world.hold(0.3)
        return bool(np.abs(self._world.data.qvel[:6]).max() < 0.01)

    def _end(self, stop: Stopped, waypoint: int | None = None) -> Outcome:
        """Return the outcome of a motion that must end, after ending it."""
        still = self.stop()
        return Outcome(stop.status, stop.detail, stop.state, waypoint, None, still)


def _at(times: Array, values: Array, t: float) -> Array:
    k = int(np.clip(np.searchsorted(times, t, side="right") - 1, 0, max(len(times) - 2, 0)))
    if len(times) < 2:
        return np.asarray(values[0])
    u = min(1.0, max(0.0, (t - times[k]) / (times[k + 1] - times[k])))
    return np.asarray(values[k] + u * (values[k + 1] - values[k]))
