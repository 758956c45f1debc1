"""The fake controller as a whole: its servers on one loopback address, and the clock that moves its arm.

Ports: 30004 RTDE, 29999 dashboard, 30003 script upload, 63352 gripper, 30099 the fake's own (JSON lines: inject a
fault, restore, read the true state). Several controllers live side by side on 127.0.0.2, 127.0.0.3, …
"""

from __future__ import annotations

import asyncio
import json
import math
import time
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import EnvironmentNeeded, InputError
from mocca_robot.plan.arm_models import RobotModel, robot_model
from mocca_robot.plan.calibration import Calibration
from mocca_robot.plan.gripper import FINGERS
from mocca_robot.plan.plan import Plan
from mocca_robot.plan.pose import six
from mocca_robot.tolerances import MM
from mocca_robot.ur import primary
from mocca_robot.ur.fake.arm import NORMAL, PLAYING, PROTECTIVE, ROBOT_EMERGENCY, RUNNING, SAFEGUARD, FakeArm
from mocca_robot.ur.fake.compute_box import RG_PORT, ComputeBox
from mocca_robot.ur.fake.rtde import VERSION, RtdeServer
from mocca_robot.ur.fake.world import Fault, Trigger, World
from mocca_robot.ur.priority import prefer_this_process

PROBE = 1e-4
"""Change of the lengths (m) from which the change that moves the flange as far as asked is reckoned."""

TICK_S = 0.008
LONGEST_TICK_S = 0.05
"""What the computer kept from running for longer counts as this: neither the arm nor its watchdog makes up for it."""
FINEST_STEP_S = 0.03
"""Of robot time: force control of the arm stays stable on a seat in steps of this length."""
CONTROL_PORT = 30099
HOME = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
_SAFETY = {
    NORMAL: "NORMAL",
    PROTECTIVE: "PROTECTIVE_STOP",
    SAFEGUARD: "SAFEGUARD_STOP",
    ROBOT_EMERGENCY: "ROBOT_EMERGENCY_STOP",
}
Handler = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


def _share(slider: float) -> float:
    if not 0 <= slider <= 1:
        raise InputError(f"The speed slider cannot stand at {slider:g}; give a number from 0 to 1.")
    return slider


def _off_by(model: RobotModel, q: Array, distance: float) -> RobotModel:
    """Return an arm whose flange, at `q`, is so far from its model's: by lengths and angles of every link."""
    rng = np.random.default_rng(5)
    lengths, angles = rng.normal(0.0, 1.0, (2, 6)), rng.normal(0.0, 1.0, (2, 6))

    def at(size: float) -> RobotModel:
        a, d = np.array([model.a, model.d]) + size * lengths
        theta, alpha = np.array([model.theta, model.alpha]) + 2.0 * size * angles
        return replace(model, a=six(a), d=six(d), theta=six(theta), alpha=six(alpha))

    unit = float(np.linalg.norm(at(PROBE).tcp_matrix(q)[:3, 3] - model.tcp_matrix(q)[:3, 3]))
    return at(PROBE * distance / unit)


class FakeController:
    """One controller. `run` serves until it is cancelled."""

    def __init__(
        self,
        plan: Plan | None = None,
        robot: str = "ur5e",
        faults: Sequence[str] = (),
        speedup: float = 1.0,
        serial: str | None = None,
        *,
        slider: float = 1.0,
        noise_n: float = 0.0,
        drift_n_min: float = 0.0,
        calibration_mm: float = 0.0,
    ) -> None:
        model = robot_model(plan.robot if plan else robot)
        world = World.of_plan(plan) if plan else World()
        q = np.array(plan.first_waypoint.q if plan else HOME)
        if calibration_mm:
            model = _off_by(model, q, calibration_mm * MM)
        self.calibration = Calibration(theta=model.theta, a=model.a, d=model.d, alpha=model.alpha)
        if plan is not None:
            q = model.solve_pose(plan.first_waypoint.tcp, q, plan.cell.tcp_offset)
        self.arm = FakeArm(model, q, world)
        if plan is not None and plan.gripper == "suction":
            self.arm.wiring = plan.cell.vacuum
        if plan is not None:
            self.arm.fingers = plan.cell.fingers
            published = FINGERS.get(plan.gripper)
            self.arm.stroke_m = self.arm.gripper_m = published.stroke_m if published else plan.cell.gripper_stroke_m[1]
        self.rg = ComputeBox(self.arm)
        if plan is not None and plan.cell.serial:
            self.arm.serial = plan.cell.serial
        if serial is not None:
            self.arm.serial = serial
        if not 0 < speedup <= 20:
            raise InputError(f"--speedup is {speedup:g}; give a number above 0 and at most 20.")
        self.speedup = speedup
        self.arm.slider = _share(slider)
        self.arm.noise_n, self.arm.drift_n_min = noise_n, drift_n_min
        self.longest_pause_s = 0.0
        self.popup = ""
        self.popups: list[str] = []
        self.rtde = RtdeServer(self.arm)
        for text in faults:
            self.arm.inject(Trigger.parse(text))

    async def run(self, host: str, ready: Callable[[], None]) -> None:
        """Serve on `host` until cancelled; call `ready` once every port listens."""
        handlers: dict[int, Handler] = {
            30004: self.rtde.serve,
            29999: self._dashboard,
            30003: self._script,
            primary.PORT: self._primary,
            63352: self._gripper,
            RG_PORT: self.rg.serve,
            CONTROL_PORT: self._control,
        }
        servers = []
        for port, handler in handlers.items():
            guarded = handler if port == CONTROL_PORT else self._reachable(handler)
            try:
                servers.append(await asyncio.start_server(guarded, host, port))
            except OSError as error:
                raise EnvironmentNeeded(
                    f"Cannot listen on {host}:{port} ({error.strerror}). Choose another one, such as 127.0.0.7."
                ) from error
        ready()
        before = time.monotonic()
        while True:
            await asyncio.sleep(TICK_S)
            now = time.monotonic()
            self.longest_pause_s = max(self.longest_pause_s, now - before)
            self.advance(now - before)
            before = now
            if {Fault.CONNECTION_DROPPED, Fault.CONNECTION_BLIP} & self.arm.world.active:
                self.rtde.drop()
                self.arm.world.clear({Fault.CONNECTION_BLIP})
            else:
                self.rtde.broadcast()

    def advance(self, passed_s: float) -> None:
        """Move arm and watchdog on by the wall time that has passed, at most `LONGEST_TICK_S` of it."""
        wall_s = min(passed_s, LONGEST_TICK_S)
        steps = max(1, math.ceil(wall_s * self.speedup / FINEST_STEP_S))
        for _ in range(steps):
            self.arm.step(wall_s * self.speedup / steps, wall_s / steps)

    def _reachable(self, handler: Handler) -> Handler:
        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            if Fault.CONNECTION_DROPPED in self.arm.world.active:
                writer.transport.abort()
                return
            await handler(reader, writer)

        return serve

    async def _lines(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, answer: Callable[[str], str]
    ) -> None:
        try:
            while line := await reader.readline():
                writer.write((answer(line.decode(errors="replace").strip()) + "\n").encode())
                await writer.drain()
        except ConnectionError:
            pass
        finally:
            writer.close()

    async def _dashboard(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"Connected: Universal Robots Dashboard Server\n")
        await self._lines(reader, writer, self._dashboard_answer)

    def _dashboard_answer(self, question: str) -> str:
        arm = self.arm
        playing = arm.runtime_state == PLAYING
        if Fault.CONNECTION_DROPPED in arm.world.active:
            return ""
        answers = {
            "PolyscopeVersion": f"URSoftware {VERSION[0]}.{VERSION[1]}.{VERSION[2]}.{VERSION[3]} (fake controller)",
            "get serial number": arm.serial,
            "get robot model": arm.model.dashboard_name,
            "robotmode": "Robotmode: " + ("RUNNING" if arm.robot_mode == RUNNING else "POWER_OFF"),
            "safetystatus": f"Safetystatus: {_SAFETY[arm.safety_mode]}",
            "safetymode": f"Safetymode: {_SAFETY[arm.safety_mode]}",
            "is in remote control": "false" if Fault.LOCAL_CONTROL in arm.world.active else "true",
            "running": f"Program running: {str(playing).lower()}",
            "programState": ("PLAYING" if playing else "STOPPED") + " <unnamed>",
            "get loaded program": "No program loaded",
        }
        if question in answers:
            return answers[question]
        if question.startswith("popup "):
            self.popups.append(question.removeprefix("popup "))
            self.popup = self.popups[-1]
            return "showing popup"
        if question == "close popup":
            self.popup = ""
            return "closing popup"
        if question == "stop":
            arm.stop_program("dashboard")
            return "Stopped"
        if question == "unlock protective stop":
            arm.log.append("unlock requested")
            return "Cannot unlock protective stop: this is left to a person at the pendant"
        return f"could not understand: '{question}'"

    async def _script(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        text = ""
        try:
            while piece := await reader.read(65536):
                text += piece.decode(errors="replace")
                if text.startswith("def ") and text.rstrip().endswith("\nend"):
                    self.arm.start_program()
                    text = ""
        except ConnectionError:
            pass
        finally:
            writer.close()

    async def _primary(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Tell who it is, then its state ten times a second, in pieces as a network may deliver it."""
        version = b"\x00" * 40
        message = primary.kinematics_message(self.calibration)
        try:
            writer.write(primary.HEADER.pack(primary.HEADER.size + len(version), 20) + version)
            while True:
                writer.write(message[:100])
                await writer.drain()
                await asyncio.sleep(0.05)
                writer.write(message[100:])
                await writer.drain()
                await asyncio.sleep(0.05)
        except ConnectionError:
            pass
        finally:
            writer.close()

    async def _gripper(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await self._lines(reader, writer, self._gripper_answer)

    def _gripper_answer(self, question: str) -> str:
        arm = self.arm
        words = question.split()
        if len(words) > 2 and words[0] == "SET":
            settings = dict(zip(words[1::2], words[2::2], strict=False))
            if "POS" in settings:
                self._requested = int(settings["POS"])
                arm.close_gripper(arm.stroke_m * (1.0 - self._requested / 255.0))
            return "ack"
        values = {
            "POS": round(255 * (1.0 - arm.gripper_m / arm.stroke_m)),
            "PRE": self._requested,
            "OBJ": 2 if arm.gripper_blocked else 3,
            "STA": 3,
            "FLT": 0,
        }
        if len(words) == 2 and words[0] == "GET" and words[1] in values:
            return f"{words[1]} {values[words[1]]}"
        return "?"

    _requested = 0

    async def _control(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await self._lines(reader, writer, self._control_answer)

    def _control_answer(self, question: str) -> str:
        arm = self.arm
        try:
            request = json.loads(question)
            if "fault" in request:
                arm.inject(Trigger.parse(str(request["fault"])))
            elif request.get("restore"):
                arm.restore()
            elif "q" in request:
                arm.q = np.array([float(v) for v in request["q"]])
            elif "gripper_m" in request:
                arm.gripper_m, arm.gripper_blocked = float(request["gripper_m"]), False
            elif "payload_kg" in request:
                arm.payload_kg = float(request["payload_kg"])
            elif "slider" in request:
                arm.slider = _share(float(request["slider"]))
            elif "output" in request:
                arm.switch(int(request["output"]), bool(request["on"]))
        except (KeyError, ValueError, InputError, AttributeError) as error:
            return json.dumps({"error": str(error)})
        return json.dumps(self.truth())

    def truth(self) -> dict[str, Any]:
        """Return what the arm really does, whatever its connections claim."""
        arm = self.arm
        return {
            "q": [float(v) for v in arm.q],
            "speed_rad_s": float(np.abs(arm.qd).max()),
            "tcp": arm.tcp_pose(),
            "mode": arm.mode,
            "program_running": arm.runtime_state == PLAYING,
            "safety_mode": arm.safety_mode,
            "gripper_m": arm.gripper_m,
            "digital_outputs": arm.digital_outputs,
            "on_cup": arm.on_cup,
            "payload_kg": arm.payload_kg,
            "largest_speed_m_s": arm.largest_speed_m_s,
            "begun": arm.begun,
            "faults": sorted(arm.world.active),
            "log": arm.log[-50:],
            "popup": self.popup,
            "popups": self.popups[-50:],
            "longest_pause_s": self.longest_pause_s,
        }


def serve(controller: FakeController, host: str, ready: Callable[[], None]) -> None:
    """Run `controller` on `host` until Ctrl-C or SIGTERM."""
    import signal

    if not host.startswith("127."):
        raise InputError(f"The fake controller serves loopback addresses only, not {host}. Give one such as 127.0.0.2.")

    prefer_this_process()

    async def main() -> None:
        task = asyncio.ensure_future(controller.run(host, ready))
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, task.cancel)
        try:
            await task
        except asyncio.CancelledError:
            return

    asyncio.run(main())


def ask(host: str, **request: Any) -> dict[str, Any]:
    """Return the true state of the fake controller at `host`, after it did what `request` says (see the module)."""
    import socket

    with socket.create_connection((host, CONTROL_PORT), timeout=5.0) as connection:
        connection.sendall((json.dumps(request) + "\n").encode())
        stream = connection.makefile("r", encoding="utf-8")
        answer: dict[str, Any] = json.loads(stream.readline())
    if "error" in answer:
        raise InputError(f"The fake controller refused {request}: {answer['error']}")
    return answer
