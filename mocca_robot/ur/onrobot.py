"""OnRobot's RG2 and RG6 behind a Compute Box, which speaks Modbus TCP: force, width and grip in holding registers.

Registers as public drivers for the Compute Box use them: 0 target force (0.1 N), 1 target width (0.1 mm), 2
control (16: grip, with the fingertips' offset), 268 status (bit 0 busy, bit 1 grip detected, bits 2 to 6 safety), 275
width with the fingertips' offset (0.1 mm); device 65. Unproven on hardware: tested against the fake controller only.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable

from mocca_robot.plan.gripper import Grip, GripperLost
from mocca_robot.plan.status import ArmState
from mocca_robot.tolerances import MM

PORT, DEVICE = 502, 65
READ, WRITE = 3, 16
STATUS, WIDTH = 268, 275
GRIP = 16
BUSY, GRIPPED, SAFETY = 1, 2, 0b1111100
TIMEOUT_S, ANSWER_S, BEGIN_S = 4.0, 1.0, 0.3
"""A motion, an answer, and the time in which a motion shows that it has begun."""
TENTH = 10.0
STILL_M = 5e-4
"""Fingers that ended closer than this to where they were sent were stopped by nothing."""


class RgFingers:
    """Two fingers behind a Compute Box at `address` (HOST or HOST:PORT); `stroke_m` and `force_n` are the largest."""

    def __init__(self, address: str, stroke_m: float, force_n: float) -> None:
        host, _, port = address.partition(":")
        self._address, self._stroke_m, self._force_n = address, stroke_m, force_n
        self._count = 0
        try:
            self._socket = socket.create_connection((host, int(port or PORT)), timeout=2.0)
        except (OSError, ValueError) as error:
            raise GripperLost(
                f"no Compute Box answers at {address} ({error}); check its address and its cable, and give the cell "
                "'gripper: {address: HOST}'"
            ) from error
        self._socket.settimeout(ANSWER_S)
        self._status()

    def move(self, width_m: float, force_n: float, tick: Callable[[], ArmState]) -> Grip:
        """Return the measured opening once the fingers have stopped; GripperLost after 4 s or on a safety switch."""
        wanted = min(max(width_m, 0.0), self._stroke_m)
        before = self._width_m()
        force = round(TENTH * min(max(force_n, 0.0), self._force_n))
        self._write(0, [force, round(TENTH * wanted / MM), GRIP])
        begun = abs(wanted - before) < STILL_M
        began = end = time.monotonic()
        end += TIMEOUT_S
        while time.monotonic() < end:
            tick()
            status, here = self._status(), self._width_m()
            # The answer may still be about the time before: busy, or another width, shows that it is not.
            begun = begun or bool(status & BUSY) or abs(here - before) > STILL_M or time.monotonic() > began + BEGIN_S
            if begun and not status & BUSY:
                return Grip(here, bool(status & GRIPPED))
            time.sleep(0.02)
        raise GripperLost(f"the fingers did not stop within {TIMEOUT_S:g} s")

    def lost(self, state: ArmState) -> str:
        """Return '': fingers are not seen between grips."""
        return ""

    def unready(self, state: ArmState) -> str:
        """Return '' or why no step can begin: the fingers hold something."""
        if not self._status() & GRIPPED:
            return ""
        wide = f"{self._width_m() / MM:.0f} mm wide"
        return f"the fingers hold something, {wide}: take hold of it, then open them with the pendant"

    def close(self) -> None:
        """Close the connection; the fingers stay as they are."""
        self._socket.close()

    def _status(self) -> int:
        status = self._read(STATUS)
        if status & SAFETY:
            raise GripperLost(
                "a safety switch of the gripper is or was pushed: free its fingers, then switch its power off and on"
            )
        return status

    def _width_m(self) -> float:
        width = self._read(WIDTH)
        return MM * (width - (1 << 16) * (width >> 15)) / TENTH  # two's complement

    def _read(self, register: int) -> int:
        answer = self._ask(struct.pack(">BHH", READ, register, 1))
        if len(answer) != 4 or answer[:2] != bytes([READ, 2]):
            raise GripperLost(f"the Compute Box answered {answer.hex()} to reading register {register}")
        return int.from_bytes(answer[2:], "big")

    def _write(self, register: int, values: list[int]) -> None:
        body = struct.pack(f">BHHB{len(values)}H", WRITE, register, len(values), 2 * len(values), *values)
        answer = self._ask(body)
        if answer != struct.pack(">BHH", WRITE, register, len(values)):
            raise GripperLost(f"the Compute Box answered {answer.hex()} to writing register {register}")

    def _ask(self, body: bytes) -> bytes:
        self._count = (self._count + 1) % (1 << 16)
        try:
            self._socket.sendall(struct.pack(">HHHB", self._count, 0, len(body) + 1, DEVICE) + body)
            number, _, length, device = struct.unpack(">HHHB", self._exactly(7))
            answer = self._exactly(length - 1)
        except (OSError, struct.error) as error:
            raise GripperLost(f"the Compute Box at {self._address} does not answer ({error})") from error
        if number != self._count or device != DEVICE:
            raise GripperLost(f"the Compute Box at {self._address} answered another question")
        return answer

    def _exactly(self, count: int) -> bytes:
        out = b""
        while len(out) < count:
            piece = self._socket.recv(count - len(out))
            if not piece:
                raise OSError("the connection was closed")
            out += piece
        return out
