"""A UR arm behind ur-rtde, supervised: every motion is watched in a 20 ms loop and ends with a status and evidence.

What the library does not do is done here: deadlines of its own, stale and non-finite states, safety stops, forces,
path deviation. It never unlocks a stop. Unproven on hardware: tested against the fake controller only.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from types import TracebackType

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.plan.arm_models import robot_model
from mocca_robot.plan.gripper import Grip, Gripper, GripperLost, require_drivable
from mocca_robot.plan.guards import SEATING_PACE, PushGuard, arrived, check_forces, check_path, check_start
from mocca_robot.plan.limits import Limits
from mocca_robot.plan.plan import Plan, Waypoint
from mocca_robot.plan.pose import Three, distance_m
from mocca_robot.plan.push_frame import frame_along
from mocca_robot.plan.safety import require_sound
from mocca_robot.plan.status import ArmState, ExecutionStatus, Outcome
from mocca_robot.plan.supervision import Stopped
from mocca_robot.ur import dashboard
from mocca_robot.ur.grippers import connect
from mocca_robot.ur.link import Link, LinkLost
from mocca_robot.ur.monitor import CONNECT_S, CYCLE_S, Monitor
from mocca_robot.ur.owner import RobotLock
from mocca_robot.ur.preflight import blocking_findings, require_robot
from mocca_robot.ur.priority import preferred

CALL_S = 1.0
"""A command of the control script answers within a few cycles; a second means that nobody is there."""
DECELERATION_M_S2 = 2.0
LEAD_IN_S = 0.5
LONGEST_CYCLE_S = 0.1
HURRY = 1.2
"""How much longer than its fellows a cycle may count on the path's clock."""
SERVO_GAIN = 300.0
SERVO_LOOKAHEAD_S = 0.05


class UrArm:
    """One UR arm, owned from `__enter__` to `__exit__` by this process and by the thread that entered it.

    Entering takes the lock, checks who and in which state the robot is, connects the eyes, then the hands (which
    uploads a control script that does not move), and starts the watchdog; until it is left, this process is preferred
    by the scheduler where that is allowed. InputError and EnvironmentNeeded say why a
    robot cannot be used. `cancelled` is asked in every cycle; once it returns True, motions end with CANCELLED.
    """

    def __init__(self, host: str, plan: Plan, confirm: str, cancelled: Callable[[], bool] = lambda: False) -> None:
        self.host = host
        self.plan = plan
        self.limits: Limits = plan.cell.limits
        self.model = robot_model(plan.robot)
        self._confirm = confirm
        self._lock = RobotLock(host)
        self._preferred = ExitStack()
        self._monitor = Monitor(host, self.limits, cancelled)
        self._hands: Link | None = None
        self._gripper: Gripper | None = None
        self._serial = ""
        self._forcing = False
        self._moving = False
        self._program_stopped = False
        self._cleared = False
        self._fed_at = 0.0
        self._unfed_s = 0.0
        self._bias = np.zeros(6)

    # Opening and closing

    def __enter__(self) -> UrArm:
        require_sound(self.plan)
        require_drivable(self.plan)
        self._lock.__enter__()
        self._preferred.enter_context(preferred())
        try:
            identity = require_robot(self.host, self.plan, self._confirm)
            self._serial = identity.serial
            self._gripper = connect(self.plan, self.host)
            self._monitor.open()
            self._monitor.poll()
            self._hands = Link("hands", self.host, CONNECT_S)
            self._order("setWatchdog", self.limits.watchdog_hz)
            self._order("setTcp", list(self.plan.cell.tcp_offset))
            self._settle(0.1)
        except (LinkLost, GripperLost) as error:
            self.__exit__(None, None, None)
            raise InputError(f"Robot {self.host} cannot be used: {error}. Nothing was moved.") from error
        except Stopped as stop:
            self.__exit__(None, None, None)
            remedy = "A person has to clear this at the pendant"
            if stop.status is ExecutionStatus.CONNECTION_LOST:
                remedy = "Check the cable and the controller's RTDE service"
            raise InputError(
                f"Robot {self.host} is not ready ({stop.status}): {stop.detail}. {remedy}; nothing was moved."
            ) from stop
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._hands is not None and self._hands.alive:
            if self._moving or self._forcing:
                self.stop()
            try:
                self._hands.call("stopScript", deadline_s=CALL_S)
            except LinkLost:
                dashboard.stop_program(self.host)
            self._hands.kill()
        self._monitor.close()
        if self._gripper is not None:
            self._gripper.close()
        self._preferred.close()
        self._lock.__exit__(kind, error, trace)

    @property
    def name(self) -> str:
        """Return the controller's serial number."""
        return self._serial

    # Questions

    def preflight(self, plan: Plan, first_step: int) -> Outcome:
        """Return SUCCEEDED, or REFUSED naming what must be put right before `first_step` can start."""
        try:
            self._order("setPayload", plan.cell.tool_mass_kg, list(plan.cell.tool_cog_m))
            self._settle(0.1)
            state = self._watch()
            tcp = self._hands_call("getTCPOffset")
            assert self._gripper is not None
            problem = self._gripper.unready(state) or next(
                blocking_findings(plan, first_step, state, tcp, self._safe), ""
            )
        except Stopped as stop:
            return self._end(stop)
        if problem:
            return Outcome(ExecutionStatus.REFUSED, problem, state)
        self._cleared = True
        return Outcome(ExecutionStatus.SUCCEEDED, "preflight passed", state)

    def _require_clearance(self) -> None:
        if not self._cleared:
            raise Stopped(
                ExecutionStatus.REFUSED, "no preflight has passed since the robot was taken", self._monitor.last
            )

    def _safe(self, point: Waypoint) -> bool:
        """Return whether the controller's own safety limits allow a waypoint."""
        self._watch()
        pose = self._hands_call("isPoseWithinSafetyLimits", list(point.tcp))
        joints = self._hands_call("isJointsWithinSafetyLimits", list(point.q))
        if pose is True and joints is True:
            return True
        self._watch()  # a stopped program makes the library answer False, too
        return False

    # Settings

    def set_payload(self, mass_kg: float, cog_m: Three) -> Outcome:
        """Set what the arm carries and read it back; REFUSED when the controller does not take it over."""
        try:
            self._order("setPayload", mass_kg, list(cog_m))
            self._settle(0.1)
            state = self._watch()
        except Stopped as stop:
            return self._end(stop)
        if abs(state.payload_kg - mass_kg) > 1e-3:
            detail = f"payload reads back as {state.payload_kg:.3f} kg after setting {mass_kg:.3f} kg"
            return Outcome(ExecutionStatus.REFUSED, detail, state)
        return Outcome(ExecutionStatus.SUCCEEDED, "", state)

    def zero_force(self) -> Outcome:
        """Pause, zero the sensor, and take what it then shows as the bias; REFUSED when that is still large."""
        try:
            self._settle(0.2)
            self._order("zeroFtSensor")
            self._settle(0.1)
            state = self._watch()
        except Stopped as stop:
            return self._end(stop)
        self._bias = np.array(state.force)
        size = float(np.linalg.norm(self._bias[:3]))
        if size > self.limits.contact_force_n:
            detail = f"the force sensor shows {size:.1f} N after zeroing, limit {self.limits.contact_force_n:g} N"
            return Outcome(ExecutionStatus.REFUSED, detail, state)
        return Outcome(ExecutionStatus.SUCCEEDED, "", state)

    # Motions

    def follow(self, path: Sequence[Waypoint], *, force_limit_n: float, contact_force_n: float | None) -> Outcome:
        """Follow a timed path by joint servoing on the controller's clock; see `interface.Arm`."""
        waypoint = 0
        try:
            self._require_clearance()
            state = self._watch()
            check_start(state, path[0], self.limits)
            times = np.array([w.t - path[0].t for w in path])
            joints = np.array([w.q for w in path])
            places = np.array([w.tcp[:3] for w in path])
            offset = np.subtract(state.q, path[0].q)  # re-synced to where the arm really is, blended out below
            lead_in = max(LEAD_IN_S, 2.0 * distance_m(state.tcp, path[0].tcp) / self.limits.approach_speed_m_s)
            last = max(float(times[-1]), lead_in)
            end = time.monotonic() + 1.1 * last + 2.0
            clock, arm_time, pace = 0.0, state.time_s, CYCLE_S
            trail: deque[Array] = deque(maxlen=50)
            self._moving, self._fed_at, self._unfed_s = True, time.monotonic(), 0.0
            while True:
                # A late cycle is not made up for: the path only takes longer, the arm never hurries after it.
                elapsed = max(state.time_s - arm_time, 0.0)
                pace += 0.1 * (min(elapsed, LONGEST_CYCLE_S) - pace)
                elapsed, arm_time = min(elapsed, HURRY * pace), state.time_s
                clock = min(clock + elapsed * state.speed_scaling, last)
                waypoint = int(np.searchsorted(times, clock, side="right")) - 1
                fade = max(0.0, 1.0 - clock / lead_in)
                goal = _interpolate(times, joints, clock) + offset * (fade * fade * (3.0 - 2.0 * fade))
                trail.append(_interpolate(times, places, clock))
                self._hands_call("servoJ", goal.tolist(), 0.0, 0.0, CYCLE_S, SERVO_LOOKAHEAD_S, SERVO_GAIN)
                time.sleep(CYCLE_S)
                state = self._watch()
                check_forces(state, self._bias, self.limits, force_limit_n, contact_force_n)
                check_path(state, trail, self.limits)
                self._check_part(state)
                if clock >= last and arrived(state, path[-1], self.limits):
                    break
                if time.monotonic() > end:
                    slow = f" at {state.speed_scaling:.0%} speed" if state.speed_scaling < 1.0 else ""
                    detail = f"not there after 1.1 × {last:.1f} s + 2 s{slow}"
                    raise Stopped(ExecutionStatus.TIMED_OUT, detail, state)
            self._order("servoStop", DECELERATION_M_S2)
            self._moving = False
            state = self._watch()
        except Stopped as stop:
            return self._end(stop, waypoint)
        return Outcome(ExecutionStatus.SUCCEEDED, "", state, len(path) - 1)

    def push(self, axis: Array, depth_m: float, *, force_limit_n: float) -> Outcome:
        """Push along `axis` in force mode, sideways compliant, until the measured depth is reached."""
        limits = self.limits
        guard: PushGuard | None = None
        try:
            self._require_clearance()
            start = self._watch()
            guard = PushGuard(start, axis, depth_m, self._bias, limits)
            self._order("forceModeSetDamping", limits.force_damping)
            self._order("forceModeSetGainScaling", limits.force_gain)
            end = time.monotonic() + 1.1 * depth_m / limits.insert_speed_m_s + 2.0
            speeds = [limits.insert_speed_m_s] * 3 + [limits.abort_tilt_rad] * 3
            wrench = [0.0, 0.0, limits.push_force_n, 0.0, 0.0, 0.0]
            self._forcing = self._moving = True
            self._fed_at, self._unfed_s = time.monotonic(), 0.0
            frame, seating = list(frame_along(axis, start.tcp)), False
            self._hands_call("forceMode", frame, [1, 1, 1, 0, 0, 0], wrench, 2, speeds)
            while True:
                time.sleep(CYCLE_S)
                if guard.seating and not seating:
                    seating = True
                    slow = [SEATING_PACE * v for v in speeds[:3]] + speeds[3:]
                    self._hands_call("forceMode", frame, [1, 1, 1, 0, 0, 0], wrench, 2, slow)
                else:
                    self._hands_call("kickWatchdog")
                state = self._watch()
                self._check_part(state)
                if guard.check(state, force_limit_n):
                    break
                if time.monotonic() > end:
                    raise Stopped(
                        ExecutionStatus.TIMED_OUT,
                        "the planned depth was not reached in 1.1 × its duration + 2 s",
                        state,
                    )
            self._leave_force_mode()
            self._settle(0.1)
            state = self._watch()
            if guard.measure(state) < depth_m - limits.depth_tolerance_m:
                raise Stopped(ExecutionStatus.JAMMED, "the part sprang back after the push", state)
        except Stopped as stop:
            outcome = self._end(stop)
            depth = guard.depth_m if guard is not None else 0.0
            detail = f"{outcome.detail} (depth {1e3 * depth:.1f} of {1e3 * depth_m:.1f} mm)"
            return Outcome(outcome.status, detail, outcome.state, None, depth, outcome.stop_observed)
        finally:
            # Normally force mode is over here; an exception that nobody foresaw must not leave it on either.
            if self._forcing:
                self.stop()
        return Outcome(ExecutionStatus.SUCCEEDED, f"depth {1e3 * guard.depth_m:.2f} mm", state, None, guard.depth_m)

    def grip(self, width_m: float, force_n: float) -> tuple[Outcome, Grip]:
        """Move the fingers, or switch the vacuum, while the arm stands still under supervision."""
        assert self._gripper is not None
        try:
            self._require_clearance()
            grip = self._gripper.move(width_m, force_n, self._attend)
            return Outcome(ExecutionStatus.SUCCEEDED, "", self._watch()), grip
        except GripperLost as error:
            return self._end(Stopped(ExecutionStatus.CONNECTION_LOST, str(error), self._monitor.last)), Grip(None, None)
        except Stopped as stop:
            return self._end(stop), Grip(None, None)

    # Ending

    def stop(self) -> bool:
        """Order the arm to stop by whatever way is left; return whether it was then measured to stand still."""
        if self._hands is not None and self._hands.alive:
            try:
                if self._forcing:
                    self._hands.call("forceModeStop", deadline_s=CALL_S)
                self._hands.call("servoStop", DECELERATION_M_S2, deadline_s=CALL_S)
            except LinkLost:
                pass  # the hands have been killed by that: the next lines go round them
            else:
                if self._monitor.stands_still():
                    self._moving = self._forcing = False
                    return True
        if self._hands is not None:
            # The watchdog stops the program now that the hands are gone; the dashboard is asked to do it at once.
            self._hands.kill()
        self._program_stopped = dashboard.stop_program(self.host)
        self._moving = self._forcing = False
        return self._monitor.stands_still()

    def _end(self, stop: Stopped, waypoint: int | None = None) -> Outcome:
        """Return the outcome of a motion that must end, after ending it."""
        detail = stop.detail
        unfed = max(self._unfed_s, time.monotonic() - self._fed_at)
        if stop.status is ExecutionStatus.PROGRAM_STOPPED and self._moving and unfed > 0.9 / self.limits.watchdog_hz:
            detail += f"; this computer was too busy to feed the controller's watchdog, once for {1e3 * unfed:.0f} ms"
        if stop.status is ExecutionStatus.CONNECTION_LOST and self._hands is not None:
            # A library that finds its connection again would repeat its last command: it must not get the chance.
            self._hands.kill()
        observed = self.stop()
        if not observed:
            detail += (
                "; the arm cannot be seen, the controller says that its program has stopped"
                if self._program_stopped
                else "; the arm cannot be seen, its watchdog has to stop it"
            )
        return Outcome(stop.status, detail, stop.state or self._monitor.last, waypoint, None, observed)

    def _leave_force_mode(self) -> None:
        self._order("forceModeStop")
        self._forcing = self._moving = False

    # Supervision

    def _watch(self) -> ArmState:
        return self._monitor.watch()

    def _attend(self) -> ArmState:
        time.sleep(CYCLE_S)
        return self._watch()

    def _check_part(self, state: ArmState) -> None:
        assert self._gripper is not None
        if words := self._gripper.lost(state):
            raise Stopped(ExecutionStatus.DEVIATED, words, state)

    def _settle(self, seconds: float) -> None:
        self._monitor.settle(seconds)

    def _hands_call(self, name: str, *args: object) -> object:
        assert self._hands is not None
        try:
            answer = self._hands.call(name, *args, deadline_s=CALL_S)
        except LinkLost as error:
            self._watch()  # a safety stop explains more than a lost call
            raise Stopped(ExecutionStatus.CONNECTION_LOST, f"command {error}", self._monitor.last) from error
        now = time.monotonic()
        self._unfed_s, self._fed_at = max(self._unfed_s, now - self._fed_at), now
        return answer

    def _order(self, name: str, *args: object) -> None:
        """Give a command that must be obeyed; a bare False of the library becomes its reason."""
        if self._hands_call(name, *args) is not True:
            self._watch()
            raise Stopped(ExecutionStatus.PROGRAM_STOPPED, f"the controller did not obey {name}", self._monitor.last)


def _interpolate(times: Array, values: Array, t: float) -> Array:
    """Return values (k,) at time t of a piecewise linear path; its ends beyond them."""
    return np.array([float(np.interp(t, times, column)) for column in values.T])
