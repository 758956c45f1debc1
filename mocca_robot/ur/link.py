"""The client library in a process of its own, so that a call which never returns can be ended.

ur-rtde may block for seconds on a dead connection, holds the interpreter while it connects, and, once the network is
back, uploads its script again and *repeats the interrupted command*. None of this can be prevented from inside the
process; so the library lives in a child that is killed the moment a deadline passes. Its connections close with it and
the controller's watchdog stops the program. The eyes only receive, the hands command, the valve
switches a suction cup's output: a child each.

While something moves, the hands feed the watchdog only when the parent asks them to: motion needs a living decision.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import select
import socket
import subprocess
import sys
import tempfile
import time
from typing import IO, Any

from mocca_robot.errors import EnvironmentNeeded
from mocca_robot.tolerances import LEAST_WAIT_S
from mocca_robot.ur.priority import prefer_this_process

FREQUENCY_HZ = 125.0
IDLE_KICK_S = 0.05
STATE_VARIABLES = [
    "timestamp",
    "actual_q",
    "actual_qd",
    "actual_TCP_pose",
    "actual_TCP_force",
    "speed_scaling",
    "target_speed_fraction",
    "robot_mode",
    "safety_mode",
    "runtime_state",
    "robot_status_bits",
    "safety_status_bits",
    "payload",
    "actual_digital_input_bits",
    "actual_digital_output_bits",
]
READINGS = {
    "time_s": "getTimestamp",
    "q": "getActualQ",
    "qd": "getActualQd",
    "tcp": "getActualTCPPose",
    "force": "getActualTCPForce",
    "robot_mode": "getRobotMode",
    "safety_mode": "getSafetyMode",
    "runtime_state": "getRuntimeState",
    "status_bits": "getRobotStatus",
    "safety_bits": "getSafetyStatusBits",
    "payload_kg": "getPayload",
    "digital_inputs": "getActualDigitalInputBits",
    "digital_outputs": "getActualDigitalOutputBits",
}
"""Fields of `ArmState` and the library's name for each."""
STARTS_MOTION = frozenset({"servoJ", "forceMode"})
ENDS_MOTION = frozenset({"servoStop", "forceModeStop", "stopScript"})


class LinkLost(Exception):
    """A child did not answer within its deadline, or its library failed; the child has been killed."""


def require_client() -> None:
    """Raise EnvironmentNeeded when the package that talks to the robot is not installed."""
    if importlib.util.find_spec("rtde_control") is None:
        raise EnvironmentNeeded(
            "The package ur-rtde is missing, which talks to the robot. Run: pip install 'mocca-robot[robot]'"
        )


class ChildLink:
    """One child process and the pipe to it. `call` returns within its deadline or raises LinkLost."""

    def __init__(self, role: str, host: str, deadline_s: float) -> None:
        require_client()
        self.role = role
        parent, child = socket.socketpair()
        self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the link
        self._socket = parent
        self._buffer = b""
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "mocca_robot.ur.link", role, host, str(child.fileno())],
                pass_fds=[child.fileno()],
                # The child sees the modules that this process sees, installed or not.
                env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
                stdin=subprocess.DEVNULL,
                stdout=self._log,
                stderr=self._log,
            )
        finally:
            child.close()
        self._alive = True
        self._said = 0
        self._receive(deadline_s, "connect")
        self._said = self._log_size()

    @property
    def alive(self) -> bool:
        """Return whether the child can still be called."""
        return self._alive

    def call(self, name: str, *args: Any, deadline_s: float = 1.0) -> Any:
        """Return the library's answer to method `name`; LinkLost after `deadline_s` or on an error of the library."""
        if not self._alive:
            raise LinkLost(f"the {self.role} are gone")
        request = {"call": name, "args": args, "within": deadline_s + 1.0}
        try:
            self._socket.settimeout(deadline_s)
            self._socket.sendall((json.dumps(request) + "\n").encode())
        except OSError as error:
            self.kill()
            raise LinkLost(f"{name}: {error}") from error
        answer = self._receive(deadline_s, name)
        if self._log_size() > self._said:
            # The library speaks only when something is wrong, such as when it reconnects behind our back.
            words = self._last_words()
            self.kill()
            raise LinkLost(f"{name}: the client library reports '{words}'")
        return answer

    def _log_size(self) -> int:
        return os.fstat(self._log.fileno()).st_size

    def _receive(self, deadline_s: float, name: str) -> Any:
        end = time.monotonic() + deadline_s
        while b"\n" not in self._buffer:
            try:
                self._socket.settimeout(max(end - time.monotonic(), LEAST_WAIT_S))
                piece = self._socket.recv(65536)
            except TimeoutError:
                self.kill()
                raise LinkLost(f"{name} was not answered within {deadline_s:.2g} s") from None
            except OSError as error:
                self.kill()
                raise LinkLost(f"{name}: {error}") from error
            if not piece:
                words = self._last_words()
                self.kill()
                raise LinkLost(f"{name}: the connection's process ended ({words})")
            self._buffer += piece
        line, _, self._buffer = self._buffer.partition(b"\n")
        answer = json.loads(line)
        if not answer["ok"]:
            self.kill()
            raise LinkLost(f"{name}: {answer['error']}")
        return answer["value"]

    def _last_words(self) -> str:
        self._log.seek(0)
        lines = self._log.read()[-2000:].decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else "without a word"

    def kill(self) -> None:
        """End the child at once, and with it its connections."""
        if not self._alive:
            return
        self._alive = False
        self._process.kill()
        self._process.wait()
        self._socket.close()
        self._log.close()


def main(role: str, host: str, descriptor: int) -> None:
    """Serve requests from the parent until it closes its end; the hands then stop whatever moves."""
    import faulthandler
    import signal

    prefer_this_process()
    # Ctrl-C reaches the whole process group; the parent decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    pipe = socket.socket(fileno=descriptor)
    ended = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - lives as long as the process
    # A C thread ends this process when the library blocks, even while it holds the interpreter.
    faulthandler.dump_traceback_later(15.0, exit=True, file=ended)
    try:
        interface = _connect(role, host)
    except Exception as error:
        _answer(pipe, ok=False, error=f"{type(error).__name__}: {error}")
        os._exit(1)
    faulthandler.cancel_dump_traceback_later()
    _answer(pipe, ok=True, value=None)
    buffer, moving, watched = b"", False, False
    while True:
        ready, _, _ = select.select([pipe], [], [], IDLE_KICK_S)
        if not ready:
            if watched and not moving:
                faulthandler.dump_traceback_later(2.0, exit=True, file=ended)
                interface.kickWatchdog()
                faulthandler.cancel_dump_traceback_later()
            continue
        piece = pipe.recv(65536)
        if not piece:
            break
        buffer += piece
        while b"\n" in buffer:
            line, _, buffer = buffer.partition(b"\n")
            request = json.loads(line)
            name = request["call"]
            faulthandler.dump_traceback_later(request["within"], exit=True, file=ended)
            moving = (moving or name in STARTS_MOTION) and name not in ENDS_MOTION
            watched = watched or name == "setWatchdog"
            try:
                value = _state(interface) if name == "state" else getattr(interface, name)(*request["args"])
                _answer(pipe, ok=True, value=value)
            except OSError:
                break
            except Exception as error:
                _answer(pipe, ok=False, error=f"{type(error).__name__}: {error}")
            faulthandler.cancel_dump_traceback_later()
    faulthandler.dump_traceback_later(2.0, exit=True, file=ended)
    if role == "hands":
        # The parent died: end the motion in order; should this fail, the watchdog does it.
        with contextlib.suppress(Exception):
            if moving:
                interface.servoStop(2.0)
                interface.forceModeStop()
            interface.stopScript()
    os._exit(0)


def _connect(role: str, host: str) -> Any:
    if role == "eyes":
        import rtde_receive

        return rtde_receive.RTDEReceiveInterface(host, FREQUENCY_HZ, STATE_VARIABLES)
    if role == "valve":
        import rtde_io

        return rtde_io.RTDEIOInterface(host)
    import rtde_control

    return rtde_control.RTDEControlInterface(host, FREQUENCY_HZ)


def _state(receive: Any) -> dict[str, Any]:
    """Return the present state by the names of `ArmState`."""
    state = {name: getattr(receive, getter)() for name, getter in READINGS.items()}
    return {**state, "speed_scaling": receive.getSpeedScaling() * receive.getTargetSpeedFraction()}


def _answer(pipe: socket.socket, **values: Any) -> None:
    pipe.sendall((json.dumps(values) + "\n").encode())


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
