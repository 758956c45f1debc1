"""A UR arm behind ur-rtde: its commands, each with a deadline, and every way to stop it. `plan.motions` has the loop.

What the library does not do is done here: deadlines of its own, stale and non-finite states, safety stops, and who
feeds the controller's watchdog. It never unlocks a stop. Unproven on hardware: tested against the fake controller only.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from types import TracebackType

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.plan.arm_models import RobotModel, robot_model
from mocca_robot.plan.gripper import Grip, Gripper, GripperLost, require_drivable
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Plan, Waypoint
from mocca_robot.plan.pose import Six, Three
from mocca_robot.plan.safety import require_sound
from mocca_robot.plan.status import ArmState, ExecutionStatus, MotionOutcome
from mocca_robot.plan.supervision import Stopped
from mocca_robot.ur import dashboard
from mocca_robot.ur.grippers import connect
from mocca_robot.ur.link import ChildLink, LinkLost
from mocca_robot.ur.monitor import CONNECT_S, CYCLE_S, Monitor
from mocca_robot.ur.owner import RobotLock
from mocca_robot.ur.preflight import blocking_findings, require_robot, wrong_payload
from mocca_robot.ur.priority import preferred

CALL_S = 1.0
"""A command of the control script answers within a few cycles; a second means that nobody is there."""
DECELERATION_RAD_S2, STOPPING_S = 2.0, 0.5
"""Joints brake with at least this, and from their fastest within this time."""
SERVO_GAIN = 300.0
SERVO_LOOKAHEAD_S = 0.05


class UrArm:
    """One UR arm, owned from `__enter__` to `__exit__` by this process and by the thread that entered it.

    Entering takes the lock, checks who and in which state the robot is, connects the eyes, then the hands (which
    uploads a control script that does not move), and starts the watchdog; until it is left, this process is preferred
    by the scheduler where that is allowed. InputError and EnvironmentNeeded say why a
    robot cannot be used. `cancelled` is asked in every cycle; once it returns a reason, motions end
    with CANCELLED and that. `model` is the calibrated arm that `plan` was fitted to, if it was (`plan.calibration`).
    """

    def __init__(
        self,
        host: str,
        plan: Plan,
        confirm: str,
        cancelled: Callable[[], str] = lambda: "",
        model: RobotModel | None = None,
    ) -> None:
        self.host = host
        self.plan = plan
        self.limits: MotionLimits = plan.cell.limits
        self.model = model or robot_model(plan.robot)
        self._confirm = confirm
        self._lock = RobotLock(host)
        self._preferred = ExitStack()
        self._monitor = Monitor(host, self.limits, cancelled)
        self._hands: ChildLink | None = None
        self._gripper: Gripper | None = None
        self._serial = ""
        self._forcing = False
        self._moving = False
        self._program_stopped = False
        self._cleared = False
        self._fed_at = 0.0
        self._unfed_s = 0.0
        self._braking = max(DECELERATION_RAD_S2, self.limits.joint_speed_rad_s / STOPPING_S)

    # Opening and closing

    def __enter__(self) -> UrArm:
        require_sound(self.plan, self.model)
        require_drivable(self.plan)
        self._lock.__enter__()
        self._preferred.enter_context(preferred())
        try:
            identity = require_robot(self.host, self.plan, self._confirm)
            self._serial = identity.serial
            self._gripper = connect(self.plan, self.host)
            self._monitor.open()
            self._monitor.poll()
            self._hands = ChildLink("hands", self.host, CONNECT_S)
            self._order("setWatchdog", self.limits.watchdog_hz)
            self._order("setTcp", list(self.plan.cell.tcp_offset))
            self._settle(0.1)
        except (LinkLost, GripperLost) as error:
            self.__exit__(None, None, None)
            raise InputError(f"Robot {self.host} cannot be used: {error}. Nothing was moved.") from error
        except Stopped as stop:
            self.__exit__(None, None, None)
            if stop.status is ExecutionStatus.CANCELLED:
                words = f"Cancelled while connecting to robot {self.host} ({stop.detail}). Nothing was moved."
                raise InputError(words) from stop
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

    def preflight(self, plan: Plan, first_step: int) -> MotionOutcome:
        """Return SUCCEEDED, or REFUSED naming what must be put right before `first_step` can start."""
        try:
            state = self.watch()
            tcp = self._hands_call("getTCPOffset")
            assert self._gripper is not None
            problem = self._gripper.unready(state) or next(
                blocking_findings(plan, first_step, state, tcp, self._safe), ""
            )
            if not problem:
                # Not before: what is refused may still have a part in its hand, and keeps its payload.
                self._order("setPayload", plan.cell.tool_mass_kg, list(plan.cell.tool_cog_m))
                self._settle(0.1)
                state = self.watch()
                problem = wrong_payload(plan, state)
        except GripperLost as error:
            problem = str(error)
        except Stopped as stop:
            return self.halt(stop)
        if problem:
            return MotionOutcome(ExecutionStatus.REFUSED, problem, state)
        self._cleared = True
        words = f"preflight passed; speed slider at {state.speed_scaling:.0%}"
        return MotionOutcome(ExecutionStatus.SUCCEEDED, words, state)

    def _require_clearance(self) -> None:
        if not self._cleared:
            raise Stopped(
                ExecutionStatus.REFUSED, "no preflight has passed since the robot was taken", self._monitor.last
            )

    def _safe(self, point: Waypoint) -> bool:
        """Return whether the controller's own safety limits allow a waypoint."""
        self.watch()
        pose = self._hands_call("isPoseWithinSafetyLimits", list(point.tcp))
        joints = self._hands_call("isJointsWithinSafetyLimits", list(point.q))
        if pose is True and joints is True:
            return True
        self.watch()  # a stopped program makes the library answer False, too
        return False

    # What an arm does (see `plan.arm.Arm`)

    def now(self) -> float:
        """Return the time of this computer's clock, seconds."""
        return time.monotonic()

    def watch(self) -> ArmState:
        """Return a fresh state in which our program runs; Stopped otherwise."""
        return self._monitor.watch()

    def attend(self) -> ArmState:
        """Let a cycle pass and `watch`; the watchdog is fed while a push lasts, a path feeds it by its commands."""
        state = self._tick()
        assert self._gripper is not None
        if words := self._gripper.lost(state):
            raise Stopped(ExecutionStatus.DEVIATED, words, state)
        return state

    def servo(self, q: Array) -> None:
        """Have the joints follow to `q`."""
        self._begin()
        self._hands_call("servoJ", q.tolist(), 0.0, 0.0, CYCLE_S, SERVO_LOOKAHEAD_S, SERVO_GAIN)

    def end_servo(self) -> None:
        """Come to rest."""
        self._order("servoStop", self._braking)
        self._moving = False

    def push_along(self, frame: Six, force_n: float, speed_m_s: float) -> None:
        """Push along z of `frame` in force mode, compliant sideways."""
        if not self._forcing:
            self._require_clearance()
            self._order("forceModeSetDamping", self.limits.force_damping)
            self._order("forceModeSetGainScaling", self.limits.force_gain)
            self._begin()
            self._forcing = True
        speeds = [speed_m_s] * 3 + [self.limits.abort_tilt_rad] * 3
        wrench = [0.0, 0.0, force_n, 0.0, 0.0, 0.0]
        self._hands_call("forceMode", list(frame), [1, 1, 1, 0, 0, 0], wrench, 2, speeds)

    def end_push(self) -> None:
        """Leave force mode."""
        self._order("forceModeStop")
        self._forcing = self._moving = False

    def zero_force(self) -> None:
        """Zero the controller's force sensor."""
        self._order("zeroFtSensor")

    def set_payload(self, mass_kg: float, cog_m: Three) -> None:
        """Set what the arm carries."""
        self._order("setPayload", mass_kg, list(cog_m))

    def grip(self, width_m: float, force_n: float) -> Grip:
        """Move the fingers, or switch the vacuum, while the arm stands still under supervision."""
        assert self._gripper is not None
        self._require_clearance()
        try:
            return self._gripper.move(width_m, force_n, self._tick)
        except GripperLost as error:
            raise Stopped(ExecutionStatus.CONNECTION_LOST, str(error), self._monitor.last) from error

    def show(self, text: str) -> None:
        """Show a popup on the pendant, or close it; a pendant that does not answer changes nothing."""
        dashboard.show(self.host, text)

    # Ending

    def stop(self) -> bool:
        """Order the arm to stop by whatever way is left; return whether it was then measured to stand still."""
        if self._hands is not None and self._hands.alive:
            try:
                if self._forcing:
                    self._hands.call("forceModeStop", deadline_s=CALL_S)
                self._hands.call("servoStop", self._braking, deadline_s=CALL_S)
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

    def halt(self, stop: Stopped) -> MotionOutcome:
        """Stop the arm for the reason in `stop`; return that and whether standstill was measured."""
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
        return MotionOutcome(stop.status, detail, stop.state or self._monitor.last, stop_observed=observed)

    # Supervision

    def _begin(self) -> None:
        """Note that a motion begins: from now on the controller's watchdog is fed by this thread alone."""
        if not self._moving:
            self._require_clearance()
            self._moving, self._fed_at, self._unfed_s = True, time.monotonic(), 0.0

    def _tick(self) -> ArmState:
        time.sleep(CYCLE_S)
        if self._forcing:
            self._hands_call("kickWatchdog")
        return self.watch()

    def _settle(self, seconds: float) -> None:
        self._monitor.settle(seconds)

    def _hands_call(self, name: str, *args: object) -> object:
        assert self._hands is not None
        try:
            answer = self._hands.call(name, *args, deadline_s=CALL_S)
        except LinkLost as error:
            self.watch()  # a safety stop explains more than a lost call
            raise Stopped(ExecutionStatus.CONNECTION_LOST, f"command {error}", self._monitor.last) from error
        now = time.monotonic()
        self._unfed_s, self._fed_at = max(self._unfed_s, now - self._fed_at), now
        return answer

    def _order(self, name: str, *args: object) -> None:
        """Give a command that must be obeyed; a bare False of the library becomes its reason."""
        if self._hands_call(name, *args) is not True:
            self.watch()
            raise Stopped(ExecutionStatus.PROGRAM_STOPPED, f"the controller did not obey {name}", self._monitor.last)
