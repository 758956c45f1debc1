"""A cell in MuJoCo behind the same interface as a robot: the executor builds a plan in it as it would on a UR arm.

The arm follows by servo, feels through the wrist, pushes compliantly and grips with force; parts are carried by
friction between pads and faces alone. What the real driver checks is checked here by the same guards.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any

import numpy as np

from mocca_robot.assembly import Array, BoolArray
from mocca_robot.errors import InputError
from mocca_robot.ur.gripper import Grip
from mocca_robot.ur.guards import SEATING_PACE, PushGuard, arrived, check_forces, check_path, check_start
from mocca_robot.ur.limits import Limits
from mocca_robot.ur.plan import MoveKind, Plan, Step, Waypoint
from mocca_robot.ur.pose import Three, pose_of, six, transform
from mocca_robot.ur.status import ArmState, ExecutionEvent, ExecutionStatus, Outcome
from mocca_robot.ur.supervision import Stopped
from planners.tool import SuctionGripper
from sim.cell_force import hand_wrench, touched
from sim.cell_model import Moment, Phase, Pose, Workplace, compile_moment, seat
from sim.motion import step_failure

CYCLE_S = 0.008
"""How often the arm is commanded and looked at: 125 times a second."""
FINGER_SPEED_M_S = 0.05
GRIP_TIMEOUT_S = 3.0
STILL_M_S = 2e-4
FRAME_S = 0.1
"""Between the frames of the film."""
COMPLIANCE = 1.0
"""Share of the insertion speed with which the hand gives way sideways at a force as large as the push."""
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


@dataclass
class Track:
    """What happened to the part in hand, filled in as it happens. Lengths in metres, angles in radians.

    Attributes:
        width_m: opening at which the fingers closed on it.
        held: it was still between the fingers when it was to be let go.
        slip_m, slip_rad: how far it moved between the fingers from pick to release.
        peak_insert_n: largest force felt while it was pushed in.
        touches: what else touched it, the hand or the arm, with the largest force, newtons.
    """

    width_m: float | None = None
    held: bool | None = None
    slip_m: float | None = None
    slip_rad: float | None = None
    peak_insert_n: float = 0.0
    touches: dict[str, float] = field(default_factory=dict)


class SimulatedCell:
    """A simulated arm in a simulated cell (see `interface.Arm`), from `__enter__` to `__exit__`.

    Parts are let go gently: until the fingers are open, velocities are removed after every step, so that the forces
    between parts build up as they would under a calm hand (see `sim.motion.run`). That holds up nothing that falls.

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
        self._tool = transform(plan.cell.tcp_offset)
        self.poses: dict[int, Pose] = dict(waiting)
        self.frames: list[Frame] = []
        self.track = Track()
        self.time_s = 0.0
        self._speed = speed
        self._cancelled = cancelled
        self._parts = place.assembly.parts
        self._held = {k for k, p in enumerate(self._parts) if p.fixed}
        self._free: set[int] = set()
        self._supported = {place.assembly.index(name) for name in plan.supports}
        self.poses.update({k: seat(self._parts[k]) for k in self._held})
        self._moment: Moment | None = None
        self._current: int | None = None
        self._model: Any = None
        self._data: Any = None
        self._gripped = False
        self._grasp: tuple[Array, Array] | None = None
        self._payload: tuple[float, Three] = (plan.cell.tool_mass_kg, plan.cell.tool_cog_m)
        self._bias = np.zeros(6)
        self._felt = np.zeros(6)
        self._struggling = 0
        self._refusal = ""
        self._gently = False

    # Opening and closing

    def __enter__(self) -> SimulatedCell:
        first = self.plan.first_waypoint
        self._enter(Moment("fetch", None, (), tuple(sorted(self._held))))
        self._data.qpos[:6] = first.q
        self._data.qpos[6 : self._driven] = 0.5 * self.plan.steps[0].moves[0].gripper_m
        self._data.ctrl[:] = self._data.qpos[: self._driven]
        self._forward()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._model = self._data = None

    @property
    def name(self) -> str:
        """Return what this arm is called in a journal."""
        return f"simulated {self.plan.robot}"

    # Moments of the build

    def heed(self, event: ExecutionEvent) -> None:
        """Bring the cell to the moment that an event of the executor begins."""
        if event.step is None or event.event not in ("step_started", "move_started"):
            return
        step = self.plan.steps[event.step]
        moving = self.place.assembly.index(step.part)
        if event.event == "step_started":
            self.track, self._current = Track(), moving
            self._enter(self._at("fetch", moving))
            return
        assert event.move is not None
        phase = phases(step)[event.move]
        if self._moment is None or self._moment.phase != phase:
            if phase == "rest":
                self._measure_slip(moving)
                if moving in self._supported:
                    self._held.add(moving)
            self._enter(self._at(phase, moving))

    def _at(self, phase: Phase, moving: int) -> Moment:
        supported = phase == "rest" and moving in self._held
        return Moment(phase, None if supported else moving, tuple(sorted(self._free)), tuple(sorted(self._held)))

    def settle(self, part: int | None, longest_s: float, resting: Callable[[Array], bool]) -> float:
        """Leave the structure alone until `resting` says so of its parts' speeds (F,), m/s; return the seconds it took.

        `part` counts as built from now on: held by its support if it has one. With None the supports are taken away.
        """
        if part is not None:
            (self._held if part in self._supported else self._free).add(part)
        else:
            self._free |= self._held & self._supported
            self._held -= self._supported
        self._enter(Moment("rest", None, tuple(sorted(self._free)), tuple(sorted(self._held))))
        started = self.time_s
        goal = np.array(self._data.qpos[:6])
        while self.time_s - started < longest_s:
            self._advance(goal, np.zeros(6))
            self._remember()
            if self.time_s - started >= 0.2 and resting(self.speeds()):
                break
        return self.time_s - started

    def refuse(self, reason: str) -> None:
        """Have every further motion refused: the structure fell, and a person would stop the arm."""
        self._refusal = reason

    def speeds(self) -> Array:
        """Return (F,) how fast the free parts move, m/s: of their centres, and of their outermost points by turning."""
        out = []
        for k in sorted(self._free):
            address = int(self._model.joint(f"part {self._parts[k].name}").dofadr[0])
            v = self._data.qvel[address : address + 6]
            reach = float(np.linalg.norm(np.ptp(self._parts[k].shape.bounds, axis=0)))
            out.append(float(np.linalg.norm(v[:3])) + 0.5 * reach * float(np.linalg.norm(v[3:])))
        return np.array(out)

    @property
    def free(self) -> tuple[int, ...]:
        """Return the parts that are built and held by nothing but the structure."""
        return tuple(sorted(self._free))

    def pose(self, part: int) -> Pose:
        """Return where a part was when it was last looked at."""
        return self.poses[part]

    def hold_key(self, parts: Sequence[int]) -> None:
        """Hold those of `parts` that are built: the design of the finished structure asks for it."""
        there = set(parts) & (self._held | self._free)
        self._held |= there
        self._free -= there
        self._supported -= there

    def _enter(self, moment: Moment) -> None:
        """Compile the model of a moment and take the present state over into it."""
        import mujoco

        before, old = self._model, self._data
        if before is not None:
            self._remember()
        self._model = compile_moment(self.place, moment, self.poses)
        self._data = mujoco.MjData(self._model)
        self._driven = int(self._model.nu)
        if before is not None:
            n = self._driven
            self._data.qpos[:n], self._data.qvel[:n], self._data.ctrl[:] = old.qpos[:n], old.qvel[:n], old.ctrl
            for k in self._loose(moment):
                mine, theirs = (self._joint(m, k) for m in (self._model, before))
                if mine is not None and theirs is not None:
                    self._data.qvel[mine[1] : mine[1] + 6] = old.qvel[theirs[1] : theirs[1] + 6]
        self._moment = moment
        self._steps = max(1, round(CYCLE_S / float(self._model.opt.timestep)))
        self._cycle_s = self._steps * float(self._model.opt.timestep)
        self._lag = -self._model.actuator_biasprm[:6, 2] / self._model.actuator_gainprm[:6, 0]
        self._nest, self._cup = self._equality("nest"), self._equality("cup")
        if self._cup is not None and self._gripped:
            self._suck()
        self._carry(by_nest=self._nest is not None and not self._gripped)
        self._hand = self._hand_bodies()
        self._arm = self._bodies([f"link {k}" for k in range(6)])
        self._flange = int(self._model.body("flange").id)
        self._forward()

    def _loose(self, moment: Moment) -> tuple[int, ...]:
        return tuple(k for k in (*moment.free, moment.moving) if k is not None)

    def _joint(self, model: Any, part: int) -> tuple[int, int] | None:
        """Return the addresses of a part's position and velocity; None where it cannot move."""
        body = model.body(f"part {self._parts[part].name}")
        if int(body.jntnum[0]) == 0:
            return None
        joint = int(body.jntadr[0])
        return int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])

    def _equality(self, name: str) -> int | None:
        return next((k for k in range(self._model.neq) if self._model.equality(k).name == name), None)

    def _bodies(self, names: Sequence[str]) -> BoolArray:
        mask = np.zeros(self._model.nbody, dtype=np.bool_)
        mask[[int(self._model.body(n).id) for n in names]] = True
        return mask

    def _fingers(self) -> list[str]:
        return ["finger left", "finger right"] if self._driven == 8 else []

    def _hand_bodies(self) -> BoolArray:
        names = ["flange", *self._fingers()]
        moment = self._moment
        if self._gripped and moment is not None and moment.moving is not None:
            names.append(f"part {self._parts[moment.moving].name}")
        return self._bodies(names)

    def _remember(self) -> None:
        """Read the poses of everything that can move out of the model."""
        assert self._moment is not None
        for k in self._loose(self._moment):
            if (at := self._joint(self._model, k)) is not None:
                q = self._data.qpos[at[0] : at[0] + 7].tolist()
                self.poses[k] = Pose((q[0], q[1], q[2]), (q[3], q[4], q[5], q[6]))

    # Stepping

    def _forward(self) -> None:
        import mujoco

        mujoco.mj_forward(self._model, self._data)

    def _advance(self, joints: Array, rates: Array) -> None:
        """Step one cycle towards joint angles (6,) that change at `rates` (6,)."""
        import mujoco

        data = self._data
        data.ctrl[:6] = joints + self._lag * rates
        mass, cog = self._payload
        carried = mass - self.plan.cell.tool_mass_kg
        data.xfrc_applied[self._flange] = 0.0
        if carried > 1e-9:
            tool, both = self.plan.cell.tool_mass_kg, np.asarray(cog)
            # The hand's own weight is taken care of in the model; of the payload, what is more than the hand.
            local = (mass * both - tool * np.asarray(self.plan.cell.tool_cog_m)) / carried
            lever = data.xmat[self._flange].reshape(3, 3) @ local + data.xpos[self._flange] - data.xipos[self._flange]
            up = -carried * self._model.opt.gravity
            data.xfrc_applied[self._flange] = np.concatenate([up, np.cross(lever, up)])
        if self._gently:
            for _ in range(self._steps):
                mujoco.mj_step(self._model, data)
                data.qvel[self._driven :] = 0.0
        else:
            mujoco.mj_step(self._model, data, self._steps)
        self.time_s += self._cycle_s
        self._felt += (self._wrench() - self._felt) * (1.0 - np.exp(-self._cycle_s / SENSOR_S))
        failure = step_failure(self._model, data)
        self._struggling = self._struggling + 1 if failure is not None else 0
        if failure is not None and (self._struggling >= NEWTON_PATIENCE or not np.isfinite(data.qpos).all()):
            raise CannotBelieve(failure)
        if not self.frames or self.time_s - self.frames[-1].time_s >= FRAME_S / self._speed:
            self._remember()
            self.frames.append(Frame(self.time_s, tuple(data.qpos[: self._driven].tolist()), tuple(self.poses.items())))

    def _tcp(self) -> Array:
        """Return the tool's pose (4, 4), base frame."""
        flange = np.eye(4)
        flange[:3, :3] = self.place.turn @ self._data.xmat[self._flange].reshape(3, 3)
        flange[:3, 3] = self.place.turn @ self._data.xpos[self._flange] + self.place.shift
        return np.asarray(flange @ self._tool)

    def _wrench(self) -> Array:
        """Return what acts on the hand now, (6,), base frame, about the tool's centre point."""
        turn = self.place.turn
        point = turn.T @ (self._tcp()[:3, 3] - self.place.shift)
        wrench = hand_wrench(self._model, self._data, self._hand, point)
        return np.concatenate([turn @ wrench[:3], turn @ wrench[3:]])

    def _state(self) -> ArmState:
        """Return the arm as its controller would report it."""
        data = self._data
        tcp = self._tcp()
        return ArmState(
            time_s=self.time_s,
            q=six(data.qpos[:6]),
            qd=six(data.qvel[:6]),
            tcp=pose_of(tcp),
            force=six(self._felt),
            speed_scaling=1.0,
            robot_mode=7,
            safety_mode=1,
            runtime_state=2,
            status_bits=3,
            safety_bits=1,
            payload_kg=self._payload[0],
        )

    def _watch(self) -> ArmState:
        """Return the present state; Stopped for what a real cell would be stopped for."""
        state = self._state()
        if self._refusal:
            raise Stopped(ExecutionStatus.REFUSED, self._refusal, state)
        if self._cancelled():
            raise Stopped(ExecutionStatus.CANCELLED, "interrupted", state)
        self._check_cup()
        for words, newtons in touched(self._model, self._data, self._hand).items():
            if not self._expected(words):
                self.track.touches[words] = max(self.track.touches.get(words, 0.0), newtons)
        if bumped := touched(self._model, self._data, self._arm):
            words, newtons = max(bumped.items(), key=lambda item: item[1])
            self.track.touches[words] = newtons
            raise Stopped(ExecutionStatus.PROTECTIVE_STOP, f"collision: {words}, {newtons:.1f} N", state)
        return state

    def _expected(self, words: str) -> bool:
        """Return whether a touch belongs to the build: fingers on their part, the part in its joints."""
        moment = self._moment
        if moment is None or self._current is None:
            return False
        mine = f"part {self._parts[self._current].name}"
        return (words.startswith(("finger", "flange")) and words.endswith(f"against {mine}")) or (
            words.startswith(f"{mine} against part") and moment.phase != "fetch"
        )

    # The interface of an arm

    def preflight(self, plan: Plan, first_step: int) -> Outcome:
        """Return SUCCEEDED if `plan` is the one this cell was made for."""
        if plan is not self.plan or first_step != 0:
            return Outcome(ExecutionStatus.REFUSED, "a rehearsal begins with the first step of its own plan")
        return Outcome(ExecutionStatus.SUCCEEDED, "", self._state())

    def set_payload(self, mass_kg: float, cog_m: Three) -> Outcome:
        """Tell the controller what it carries: it holds that weight from now on."""
        self._payload = (mass_kg, cog_m)
        return Outcome(ExecutionStatus.SUCCEEDED, "", self._state())

    def zero_force(self) -> Outcome:
        """Pause, then take the present force as zero."""
        try:
            self._hold(0.2)
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
            end = self.time_s + 1.1 * last + 2.0
            trail: deque[Array] = deque(maxlen=50)
            goal = np.array(state.q)
            while True:
                clock = min(clock + self._cycle_s, max(last, blend))
                waypoint = int(np.searchsorted(times, clock, side="right")) - 1
                fade = max(0.0, 1.0 - clock / blend)
                before = goal
                goal = _at(times, joints, clock) + offset * (fade * fade * (3.0 - 2.0 * fade))
                trail.append(_at(times, places, clock))
                self._advance(goal, (goal - before) / self._cycle_s)
                state = self._watch()
                check_forces(state, self._bias, self.limits, force_limit_n, contact_force_n)
                check_path(state, trail, self.limits)
                if clock >= max(last, blend) and arrived(state, path[-1], self.limits):
                    break
                if self.time_s > end:
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
            end = self.time_s + 1.1 * depth_m / limits.insert_speed_m_s + 2.0
            goal, state = np.array(self._data.qpos[:6]), start
            while True:
                felt = np.subtract(state.force, self._bias)[:3]
                along = float(felt @ axis)
                sideways = felt - along * axis
                ahead = min(1.0, max(-1.0, (limits.push_force_n + along) / limits.push_force_n))
                aside = COMPLIANCE * sideways / limits.push_force_n
                aside /= max(1.0, float(np.linalg.norm(aside)))
                pace = SEATING_PACE if guard.seating else 1.0
                velocity = pace * limits.insert_speed_m_s * (ahead * axis + aside)
                before, goal = goal, self._moved(goal, velocity * self._cycle_s, start)
                self._advance(goal, (goal - before) / self._cycle_s)
                state = self._watch()
                size = float(np.linalg.norm(np.subtract(state.force, self._bias)[:3]))
                self.track.peak_insert_n = max(self.track.peak_insert_n, size)
                if guard.check(state, force_limit_n):
                    break
                if self.time_s > end:
                    raise Stopped(ExecutionStatus.TIMED_OUT, "the depth was not reached in 1.1 × its time + 2 s", state)
            self._hold(0.1)
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
        """Move the fingers to an opening, with at most `force_n`, and say where they stopped."""
        if self._driven < 8:
            return self._suction(width_m)
        try:
            self._watch()
            self._model.actuator_forcerange[6:8] = [-force_n, force_n]
            joints = np.array(self._data.ctrl[:6])
            opening = float(self._data.qpos[6:8].sum())
            closing = width_m < opening
            target, end, still = opening, self.time_s + GRIP_TIMEOUT_S, 0
            if not closing:
                self._let_go()
                self._gently = self._moment is not None and self._moment.phase == "rest"
            while still < 10:
                gap = width_m - target
                target += float(np.clip(gap, -FINGER_SPEED_M_S * self._cycle_s, FINGER_SPEED_M_S * self._cycle_s))
                self._data.ctrl[6:8] = 0.5 * target
                self._advance(joints, np.zeros(6))
                self._watch()
                quiet = abs(gap) < 1e-9 and float(np.abs(self._data.qvel[6:8]).max()) < STILL_M_S
                still = still + 1 if quiet else 0
                if self.time_s > end:
                    break
            self._gently = False
            reached = float(self._data.qpos[6:8].sum())
            blocked = abs(reached - width_m) > 2e-4
            if closing and blocked:
                self._take(reached)
            return Outcome(ExecutionStatus.SUCCEEDED, "", self._watch()), Grip(reached, blocked)
        except Stopped as stop:
            self._gently = False
            return self._end(stop), Grip(None, None)

    def _suction(self, width_m: float) -> tuple[Outcome, Grip]:
        """Switch the vacuum on at opening 0, off at any other; the cup holds what lies at its lip."""
        gripper = self.place.cell.gripper
        assert isinstance(gripper, SuctionGripper)
        try:
            self._watch()
            if width_m > 0.5 * gripper.RELEASED_M:
                if self._cup is not None:
                    self._data.eq_active[self._cup] = 0
                self._let_go()
                self._gently = self._moment is not None and self._moment.phase == "rest"
                self._hold(0.3)
                self._gently = False
                return Outcome(ExecutionStatus.SUCCEEDED, "", self._watch()), Grip(gripper.RELEASED_M, False)
            self._hold(0.3)
            sealed = self._cup is not None and self._lip_gap() <= gripper.bellows_m
            if sealed:
                self._take(0.0)
                self._suck()
            return Outcome(ExecutionStatus.SUCCEEDED, "", self._watch()), Grip(0.0, sealed)
        except Stopped as stop:
            return self._end(stop), Grip(None, None)

    def _lip_gap(self) -> float:
        """Return how far the part in hand is from the middle of the cup's lip, metres, along the cup's axis."""
        import mujoco

        assert self._moment is not None and self._moment.moving is not None
        data, flange = self._data, self._flange
        axes = data.xmat[flange].reshape(3, 3)
        lip = data.xpos[flange] + axes @ np.asarray(self.plan.cell.tcp_offset[:3])
        back, found = 0.02, np.zeros(1, dtype=np.int32)
        # The stem itself is in the way of a ray from above: it is left out with everything else of the flange.
        reached = mujoco.mj_ray(self._model, data, lip - back * axes[:, 2], axes[:, 2], None, 1, flange, found)
        mine = int(self._model.body(f"part {self._parts[self._moment.moving].name}").id)
        if reached < 0 or found[0] < 0 or int(self._model.geom_bodyid[found[0]]) != mine:
            return float("inf")
        return abs(float(reached) - back)

    def _suck(self) -> None:
        """Hold the part where it is now, at the cup's lip."""
        import mujoco

        assert self._moment is not None and self._moment.moving is not None and self._cup is not None
        self._forward()
        grasp = self._in_hand()
        assert grasp is not None
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(grasp[1]).ravel())
        data = self._model.eq_data[self._cup]
        data[:3], data[3:6], data[6:10], data[10] = 0.0, grasp[0], quat, 0.05
        self._data.eq_active[self._cup] = 1

    def _check_cup(self) -> None:
        """Let the part drop once it is pulled harder than the vacuum holds, or sideways than its friction does."""
        gripper = self.place.cell.gripper
        if self._cup is None or not self._data.eq_active[self._cup] or not isinstance(gripper, SuctionGripper):
            return
        rows = np.flatnonzero((self._data.efc_id == self._cup) & (self._data.efc_type == 0))[:3]
        if len(rows) < 3:
            return  # not stepped since it took hold
        force = -self._data.efc_force[rows]  # MuJoCo's acts on the flange
        axis = self._data.xmat[self._flange].reshape(3, 3)[:, 2]
        along = float(force @ axis)
        across = float(np.linalg.norm(force - along * axis))
        # On the part, negative is towards the cup: what the vacuum has to pull with.
        if -along > gripper.force_n or across > self.place.pad_friction * max(0.0, gripper.force_n + along):
            self._data.eq_active[self._cup] = 0
            self._let_go()
            words = f"the cup let go: {-along:.1f} N along its axis, {across:.1f} N across"
            raise Stopped(ExecutionStatus.DEVIATED, words, self._state())

    def stop(self) -> bool:
        """Hold the present joint angles; return whether the arm then stands still."""
        self._hold(0.3)
        return bool(np.abs(self._data.qvel[:6]).max() < 0.01)

    # Taking and letting go

    def _take(self, width_m: float) -> None:
        """The part is between the fingers: its nest holds it no longer."""
        self._gripped = True
        self.track.width_m = width_m
        self._carry(by_nest=False)
        self._hand = self._hand_bodies()
        self._grasp = self._in_hand()

    def _carry(self, by_nest: bool) -> None:
        """Have the nest hold the part in hand where it is now, or let go of it."""
        moment = self._moment
        if moment is None or moment.moving is None or self._nest is None:
            return
        self._model.body_gravcomp[int(self._model.body(f"part {self._parts[moment.moving].name}").id)] = float(by_nest)
        self._data.eq_active[self._nest] = int(by_nest)
        if by_nest:
            pose = self.poses[moment.moving]
            self._model.eq_data[self._nest][3:10] = [*pose.position, *pose.quat_wxyz]

    def _let_go(self) -> None:
        self._gripped = False
        self._remember()
        self._carry(by_nest=True)
        self._hand = self._hand_bodies()

    def _in_hand(self) -> tuple[Array, Array] | None:
        """Return where the part is in the flange's frame, (3,) and (3, 3)."""
        if self._moment is None or self._moment.moving is None:
            return None
        body = int(self._model.body(f"part {self._parts[self._moment.moving].name}").id)
        flange, data = self._flange, self._data
        turn = data.xmat[flange].reshape(3, 3).T
        return turn @ (data.xpos[body] - data.xpos[flange]), turn @ data.xmat[body].reshape(3, 3)

    def _measure_slip(self, part: int) -> None:
        now = self._in_hand()
        if now is None or self._grasp is None:
            return
        if self._cup is None:
            pads, mine = self._bodies(self._fingers()), f"part {self._parts[part].name}"
            self.track.held = any(words.endswith(mine) for words in touched(self._model, self._data, pads))
        else:
            self.track.held = bool(self._data.eq_active[self._cup])
        self.track.slip_m = float(np.linalg.norm(now[0] - self._grasp[0]))
        cosine = 0.5 * (float(np.trace(now[1].T @ self._grasp[1])) - 1.0)
        self.track.slip_rad = float(np.arccos(min(1.0, max(-1.0, cosine))))

    def _hold(self, seconds: float) -> None:
        goal = np.array(self._data.qpos[:6])
        end = self.time_s + seconds
        while self.time_s < end:
            self._advance(goal, np.zeros(6))

    def _end(self, stop: Stopped, waypoint: int | None = None) -> Outcome:
        """Return the outcome of a motion that must end, after ending it."""
        still = self.stop()
        return Outcome(stop.status, stop.detail, stop.state, waypoint, None, still)


def phases(step: Step) -> tuple[Phase, ...]:
    """Return the phase of the build in which each move of `step` happens.

    A part meets its neighbours from the guarded approach before its insertion on, and rests once it is released.
    """
    kinds = [m.kind for m in step.moves]
    insert = kinds.index(MoveKind.INSERT) if MoveKind.INSERT in kinds else len(kinds)
    near = insert
    while near > 0 and kinds[near - 1] is MoveKind.APPROACH:
        near -= 1
    release = next((k for k in range(insert, len(kinds)) if kinds[k] is MoveKind.RELEASE), len(kinds))
    return tuple("fetch" if k < near else "insert" if k < release else "rest" for k in range(len(kinds)))


def _at(times: Array, values: Array, t: float) -> Array:
    k = int(np.clip(np.searchsorted(times, t, side="right") - 1, 0, max(len(times) - 2, 0)))
    if len(times) < 2:
        return np.asarray(values[0])
    u = min(1.0, max(0.0, (t - times[k]) / (times[k + 1] - times[k])))
    return np.asarray(values[k] + u * (values[k + 1] - values[k]))
