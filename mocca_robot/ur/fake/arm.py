"""The fake arm: joints that follow commands to first order, a control script's commands, a program that can stop."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.plan.arm_models import RobotModel
from mocca_robot.plan.pose import pose_of, rotation_vector, transform
from mocca_robot.plan.wiring import SIGNALS, FingerWiring, VacuumWiring
from mocca_robot.tolerances import ROUNDING
from mocca_robot.ur.fake.world import Fault, Trigger, World

SLOWEST = 1e-6
"""Speed (rad/s, m/s) and acceleration that a move has at least, whatever it is sent with."""
LOWEST_HZ = 1e-3
"""Of a watchdog."""
STILL_RAD_S = 1e-3
"""Joints slower than this stand still."""
THERE = 1e-5
"""Distance (rad, m) at which a move has arrived."""
SINGULAR_RIDGE = 1e-3
"""Added to a singular Jacobian."""

SERVO_LAG_S = 0.04
ZERO_S = 0.1
"""Over which the controller averages when it zeroes its sensor."""
LEVER_M = 0.05
"""Noise of the sensor's torques for that of its forces."""
DRIFT = np.array([0.6, 0.0, 0.8, 0.0, 0.0, 0.0])
"""Where the sensor drifts to."""
STOP_RAD_S2 = 10.0
STOPPED, PLAYING, PAUSED = 1, 2, 4
NORMAL, PROTECTIVE, SAFEGUARD, ROBOT_EMERGENCY = 1, 3, 5, 7
RUNNING, POWER_OFF = 7, 3
REALTIME = frozenset({6, 9, 10, 11})
"""Commands whose effect lasts until another one; the script never reports them as done."""


@dataclass
class FakeArm:
    """State of the arm and of its controller. `step` advances time, `command` takes what the client wrote.

    Attributes:
        q, qd: joint angles and speeds.
        ints, doubles: RTDE input registers; out_ints, out_doubles: output registers.
        time_s: the controller's clock.
        mode: what moves the arm: idle, servo, path, speed, force.
        digital_outputs: one bit per output; nothing but its client and a person change them.
        noise_n: of the force sensor, white, 1σ per axis; drift_n_min: of its zero in a minute.
        wiring: of a suction cup, if the arm has one; on_cup: whether a part hangs on it.
    """

    model: RobotModel
    q: Array
    world: World
    serial: str = "20265500001"
    qd: Array = field(default_factory=lambda: np.zeros(6))
    ints: list[int] = field(default_factory=lambda: [0] * 48)
    doubles: list[float] = field(default_factory=lambda: [0.0] * 48)
    out_ints: list[int] = field(default_factory=lambda: [0] * 48)
    out_doubles: list[float] = field(default_factory=lambda: [0.0] * 48)
    time_s: float = 0.0
    mode: str = "idle"
    runtime_state: int = STOPPED
    safety_mode: int = NORMAL
    robot_mode: int = RUNNING
    slider: float = 1.0
    tcp_offset: Array = field(default_factory=lambda: np.zeros(6))
    payload_kg: float = 0.0
    payload_cog: Array = field(default_factory=lambda: np.zeros(3))
    triggers: list[Trigger] = field(default_factory=list)
    begun: dict[str, int] = field(default_factory=dict)
    watchdog_s: float | None = None
    unfed_s: float = 0.0
    gripper_m: float = 0.085
    stroke_m: float = 0.085
    gripper_blocked: bool = False
    log: list[str] = field(default_factory=list)
    digital_outputs: int = 0
    wiring: VacuumWiring | None = None
    fingers: FingerWiring | None = None
    on_cup: bool = False
    largest_speed_m_s: float = 0.0
    _executing: bool = False
    _busy: bool = False
    _target_q: Array = field(default_factory=lambda: np.zeros(6))
    _speed: Array = field(default_factory=lambda: np.zeros(6))
    _linear: bool = False
    _task: Array = field(default_factory=lambda: np.eye(4))
    _compliant: list[int] = field(default_factory=lambda: [0] * 6)
    _wrench: Array = field(default_factory=lambda: np.zeros(6))
    _limits: Array = field(default_factory=lambda: np.zeros(6))
    _rates: tuple[float, float] = (0.25, 1.2)
    noise_n: float = 0.0
    drift_n_min: float = 0.0
    _shown: Array = field(default_factory=lambda: np.zeros(6))
    _quiet: Array = field(default_factory=lambda: np.zeros(6))
    _random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    _zero: Array = field(default_factory=lambda: np.zeros(6))
    _raw: Array = field(default_factory=lambda: np.zeros(6))

    @property
    def tcp(self) -> Array:
        """Return the (4, 4) pose of the tool's centre point."""
        return self.model.tcp_matrix(self.q, list(self.tcp_offset))

    @property
    def force(self) -> Array:
        """Return what the sensor shows, (6,): the wrench over the zeroed bias, with its noise and its drift."""
        return self._raw + self._shown - self._zero

    def begin(self, mode: str) -> None:
        """Note that a kind of action begins, which is what faults wait for."""
        self.begun[mode] = self.begun.get(mode, 0) + 1
        if mode == "force":
            self.world.clear({Fault.JAM_ONCE})
        for trigger in self.triggers:
            if trigger.armed_at is None and trigger.mode == mode and self.begun[mode] == trigger.nth:
                trigger.armed_at = self.time_s + trigger.delay_s
        self._fire()

    def inject(self, trigger: Trigger) -> None:
        """Add a fault, due at once when it names no moment."""
        if trigger.mode == "any":
            trigger.armed_at = self.time_s + trigger.delay_s
        else:
            trigger.nth += self.begun.get(trigger.mode, 0)
        self.triggers.append(trigger)
        self._fire()

    def _fire(self) -> None:
        for trigger in [t for t in self.triggers if t.armed_at is not None and t.armed_at <= self.time_s]:
            self.triggers.remove(trigger)
            self.log.append(f"fault {trigger.fault}")
            self.world.active.add(trigger.fault)
            if trigger.fault is Fault.PROTECTIVE_STOP:
                self._halt(PAUSED, PROTECTIVE)
            elif trigger.fault is Fault.SAFEGUARD_STOP:
                self._halt(PAUSED, SAFEGUARD)
            elif trigger.fault is Fault.EMERGENCY_STOP:
                self._halt(STOPPED, ROBOT_EMERGENCY)
                self.robot_mode = POWER_OFF
            elif trigger.fault is Fault.PROGRAM_STOPPED:
                self.stop_program("pendant")
            elif trigger.fault is Fault.OTHER_PROGRAM:
                self.stop_program("replaced by another one")
                self.runtime_state = PLAYING
            elif trigger.fault is Fault.SLIDER_ZERO:
                self.slider = 0.0
            elif trigger.fault is Fault.PART_LOST:
                self.on_cup = False

    def restore(self) -> None:
        """Do what an operator does after a fault: clear it, leaving the program stopped and the arm where it is."""
        self.world.clear(set(Fault))
        self.triggers.clear()
        self.world.taken.clear()
        self.slider, self.safety_mode, self.robot_mode = 1.0, NORMAL, RUNNING
        self.stop_program("restored")

    def _halt(self, runtime: int, safety: int) -> None:
        self.runtime_state, self.safety_mode, self.mode, self._busy = runtime, safety, "idle", False

    def start_program(self) -> None:
        """Start the client's control script: it reports ready."""
        if self.safety_mode != NORMAL or self.robot_mode != RUNNING:
            self.log.append("script refused: not in normal mode")
            return
        self.stop_program("replaced")
        self.runtime_state = PLAYING
        self.out_ints[0] = 1
        self._executing = self._busy = False
        self.log.append("program started")

    def stop_program(self, why: str) -> None:
        """Stop the program and with it every motion."""
        if self.runtime_state != STOPPED:
            self.log.append(f"program stopped: {why}")
        self.runtime_state, self.mode, self._busy, self.watchdog_s = STOPPED, "idle", False, None

    def feed(self) -> None:
        """Note that the client wrote its command register."""
        self.unfed_s = 0.0

    def command(self) -> None:
        """Obey the command register, as the client's control script would."""
        if self.runtime_state != PLAYING or Fault.OTHER_PROGRAM in self.world.active:
            return
        command = self.ints[0]
        if command in REALTIME:
            self._continuous(command)
            self.out_ints[0] = 1
        elif command == 0:
            if not self._busy:
                self._executing = False
                self.out_ints[0] = 1
        elif not self._executing:
            self._executing = True
            try:
                self._once(command)
            except InputError as error:
                self.stop_program(f"script error: {error}")
                return
            if not self._busy and self.runtime_state == PLAYING:
                self.out_ints[0] = 2

    def _continuous(self, command: int) -> None:
        values = np.array(self.doubles[:18])
        if command == 11:
            if self.mode != "servo":
                self.begin("servo")
                if self.runtime_state != PLAYING:
                    return
            self.mode, self._target_q = "servo", values[:6]
        elif command == 6:
            if self.mode != "force":
                self.begin("force")
                if self.runtime_state != PLAYING:
                    return
            self.mode, self._task = "force", transform(values[:6])
            self._compliant, self._wrench, self._limits = self.ints[2:8], values[6:12], values[12:18]
        else:
            self.mode, self._speed, self._linear = "speed", values[:6], command == 10

    def _once(self, command: int) -> None:
        values = np.array(self.doubles[:18])
        if command in (1, 3):
            self._linear = command == 3
            self._target_q = (
                self.model.solve_pose(values[:6], self.q, list(self.tcp_offset)) if self._linear else values[:6]
            )
            self._rates = (max(values[6], SLOWEST), max(values[7], SLOWEST))
            self.begin("path")
            self.mode, self._busy = "path", self.ints[1] == 0
        elif command in (7, 15, 16, 33, 34):
            self.mode, self._busy = "idle", bool(self.qd.any())
        elif command == 8:
            self._zero = self._raw + self._quiet
        elif command == 17 and Fault.PAYLOAD_IGNORED not in self.world.active:
            self.payload_kg, self.payload_cog = float(values[0]), values[1:4]
        elif command == 29 and Fault.TCP_IGNORED not in self.world.active:
            self.tcp_offset = values[:6]
        elif command == 35:
            self.watchdog_s, self.unfed_s = 1.0 / max(values[0], LOWEST_HZ), 0.0
        elif command in (36, 37):
            self.out_ints[1] = int(self._safe(values[:6], joints=command == 37))
        elif command == 40:
            self.out_doubles[:6] = list(self.tcp_offset)
        elif command in (43, 44):
            q, tool = (self.q, self.tcp_offset) if command == 43 else (values[:6], values[6:12])
            self.out_doubles[:6] = list(self.model.tcp_pose(q, list(tool)))
        elif command in (30, 46):
            near = values[6:12] if command == 30 else self.q
            self.out_doubles[:6] = list(self.model.solve_pose(values[:6], near, list(self.tcp_offset)))
        elif command == 47:
            self.out_ints[1] = int(float(np.abs(self.qd).max()) < STILL_RAD_S)
        elif command == 255:
            self.stop_program("by its client")
        elif command not in (17, 20, 21, 29):
            raise InputError(f"command {command} is not part of the fake controller")

    def _safe(self, values: Array, joints: bool) -> bool:
        if Fault.UNSAFE_POSE in self.world.active or not np.all(np.isfinite(values)):
            return False
        if joints:
            return bool(np.all(np.abs(values) <= self.model.joint_limit_rad))
        reach = self.model.reach_m + self.model.d[5] + float(np.linalg.norm(self.tcp_offset[:3]))
        return float(np.linalg.norm(values[:3] - [0, 0, self.model.d[0]])) <= reach

    def step(self, dt: float, wall_s: float) -> None:
        """Advance by `dt` seconds of robot time and `wall_s` of wall time, on which the watchdog runs."""
        self.time_s += dt
        self._fire()
        self.unfed_s += wall_s
        if self.watchdog_s is not None and self.runtime_state == PLAYING and self.unfed_s > self.watchdog_s:
            self.stop_program("watchdog")
        before = self.tcp
        wanted = self._velocity(dt) * self.slider
        if self.mode == "idle":
            fastest = float(np.abs(self.qd).max())
            wanted = self.qd * (max(fastest - STOP_RAD_S2 * dt, 0.0) / max(fastest, ROUNDING))
            if self._busy and not wanted.any():
                self._busy = False
                self.out_ints[0] = 2
        self.qd = np.clip(wanted, -np.array(self.model.joint_speed_rad_s), self.model.joint_speed_rad_s)
        self.q = self.q + self.qd * dt
        velocity = (self.tcp[:3, 3] - before[:3, 3]) / dt
        self.largest_speed_m_s = max(self.largest_speed_m_s, float(np.linalg.norm(velocity)))
        push = self._task[:3, 2] if self.mode == "force" else None
        fingers = None if self.wiring is not None else self.gripper_m
        self._shown = np.concatenate([self._random.normal(0.0, 1.0, 3), self._random.normal(0.0, LEVER_M, 3)])
        self._shown = self.noise_n * self._shown + self.drift_n_min * self.time_s / 60.0 * DRIFT
        self._quiet = self._quiet + (self._shown - self._quiet) * min(1.0, dt / ZERO_S)
        self._raw = self.world.force(self.tcp[:3, 3], velocity, push, float(self._wrench[2]), fingers)

    def _velocity(self, dt: float) -> Array:
        if Fault.STUCK in self.world.active:
            return np.zeros(6)
        if self.mode == "servo":
            return (self._target_q - self.q) / max(SERVO_LAG_S, dt)
        if self.mode == "speed":
            return self._joint_rates(self._speed) if self._linear else self._speed
        if self.mode == "path":
            return self._path_velocity(dt)
        if self.mode == "force":
            return self._force_velocity()
        return np.zeros(6)

    def _path_velocity(self, dt: float) -> Array:
        speed, acceleration = self._rates
        if self._linear:
            now, goal = self.tcp, self.model.tcp_matrix(self._target_q, list(self.tcp_offset))
            error = np.concatenate([goal[:3, 3] - now[:3, 3], rotation_vector(goal[:3, :3] @ now[:3, :3].T)])
            left = max(float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:])) * 0.1)
        else:
            error = self._target_q - self.q
            left = float(np.abs(error).max())
        if left < THERE:
            self.mode, self._busy = "idle", False
            self.qd = np.zeros(6)
            if self._executing:
                self.out_ints[0] = 2
            return np.zeros(6)
        rate = min(speed, math.sqrt(2 * acceleration * left), left / dt)
        twist = error * (rate / left)
        return self._joint_rates(twist) if self._linear else twist

    def _force_velocity(self) -> Array:
        if self.world.jammed:
            return np.zeros(6)
        frame = self._task[:3, :3]
        felt = frame.T @ (self._raw + self.drift_n_min * self.time_s / 60.0 * DRIFT - self._zero)[:3]
        local = np.zeros(6)
        for k in range(3):
            if self._compliant[k]:
                limit = float(self._limits[k])
                pull = float(self._wrench[k] + felt[k])
                local[k] = np.clip(pull * limit / max(abs(float(self._wrench[2])), 1.0), -limit, limit)
        return self._joint_rates(np.concatenate([frame @ local[:3], np.zeros(3)]))

    def _joint_rates(self, twist: Array) -> Array:
        """Return the joint speeds of a tool speed, damped near singularities."""
        jacobian = self.model.jacobian(self.q, list(self.tcp_offset))
        if abs(float(np.linalg.det(jacobian))) < ROUNDING:
            jacobian = jacobian + SINGULAR_RIDGE * np.eye(6)
        return np.asarray(np.linalg.solve(jacobian, twist), dtype=np.float64)

    def tcp_pose(self) -> list[float]:
        """Return the pose of the tool's centre point as the controller reports it."""
        return list(pose_of(self.tcp))

    def tcp_speed(self) -> list[float]:
        """Return velocity and angular velocity of the tool's centre point."""
        return [float(v) for v in self.model.jacobian(self.q, list(self.tcp_offset)) @ self.qd]

    @property
    def digital_inputs(self) -> int:
        """Return one bit per input: the vacuum switch's, if there is one."""
        if self.fingers is not None:
            wide, held = self.gripper_m >= self.stroke_m, self.gripper_blocked
            shown = ((self.fingers.open_input, wide), (self.fingers.held_input, held))
            return sum(int(on) << SIGNALS.index(name) for name, on in shown if name is not None)
        if self.wiring is None or self.wiring.input_bit is None:
            return 0
        return int(self.on_cup or Fault.PART_STICKS in self.world.active) << self.wiring.input_bit

    def switch(self, bit: int, on: bool) -> None:
        """Set a digital output; the one of the cup's valve takes the part at the cup, or lets it go."""
        before = self.digital_outputs
        self.digital_outputs = before | 1 << bit if on else before & ~(1 << bit)
        if self.fingers is not None and bit == SIGNALS.index(self.fingers.close_output):
            self.close_gripper(0.0 if on else self.stroke_m)
        if self.wiring is None or bit != self.wiring.output_bit or self.digital_outputs == before:
            return
        self.begin("grip")
        self.on_cup = on and self.world.part_at(self.tcp[:3, 3])
        self.log.append(f"vacuum {'on' if on else 'off'}")

    def close_gripper(self, wanted_m: float) -> None:
        """Move the fingers: they stop on a part where there is one."""
        self.begin("grip")
        if Fault.FINGERS_STUCK in self.world.active:
            return
        if wanted_m < self.gripper_m:
            self.gripper_m, self.gripper_blocked = self.world.grip_width(self.tcp[:3, 3], wanted_m)
        else:
            self.gripper_m, self.gripper_blocked = wanted_m, False
