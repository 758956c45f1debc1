"""Grippers: open, close, and the width that was really reached. A width is evidence: it says whether a part is held."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from mocca_robot.errors import InputError
from mocca_robot.ur.limits import Limits


class GripperLost(Exception):
    """The gripper did not answer in time or reports a fault."""


@dataclass(frozen=True)
class Grip:
    """What the fingers did: measured opening in metres (None without a sensor), and whether something stopped them."""

    width_m: float | None
    blocked: bool | None


class Gripper(Protocol):
    """Two fingers. `tick` is called while waiting, so that the robot's connection stays supervised."""

    def move(self, width_m: float, force_n: float, tick: Callable[[], None]) -> Grip:
        """Return what was reached after moving the fingers to an opening of `width_m`."""
        ...

    def close(self) -> None:
        """Release the connection; the fingers stay as they are."""
        ...


class NoGripper:
    """A tool without fingers: every grip is taken on trust, and says so by measuring nothing."""

    def move(self, width_m: float, force_n: float, tick: Callable[[], None]) -> Grip:
        """Return a grip without measurement."""
        tick()
        return Grip(None, None)

    def close(self) -> None:
        """Do nothing: there is no connection."""


class RobotiqSocket:
    """A Robotiq 2F-85 behind its URCap's text protocol on port 63352 (variables ACT, GTO, POS, SPE, FOR, OBJ, FLT)."""

    PORT = 63352
    STROKE_M = 0.085
    FORCE_N = (20.0, 235.0)
    """Published range of gripping force: 0 and 255 in the register FOR."""
    TIMEOUT_S = 4.0

    def __init__(self, host: str) -> None:
        try:
            self._socket = socket.create_connection((host, self.PORT), timeout=2.0)
        except OSError as error:
            raise GripperLost(
                f"the gripper does not answer at {host}, port {self.PORT} ({error}); install and enable its URCap"
            ) from error
        self._socket.settimeout(1.0)
        if self._get("STA") != 3:
            raise GripperLost("the gripper is not activated; activate it from the pendant (it moves when activated)")

    def move(self, width_m: float, force_n: float, tick: Callable[[], None]) -> Grip:
        """Return the measured opening once the fingers have stopped; GripperLost after 4 s or on a fault."""
        position = round(255 * (1.0 - min(max(width_m / self.STROKE_M, 0.0), 1.0)))
        low, high = self.FORCE_N
        force = round(255 * min(max((force_n - low) / (high - low), 0.0), 1.0))
        self._say(f"SET POS {position} SPE 64 FOR {force} GTO 1")
        end = time.monotonic() + self.TIMEOUT_S
        while time.monotonic() < end:
            tick()
            # The register PRE echoes the request: before that, OBJ still speaks of the previous motion.
            if self._get("PRE") == position and (state := self._get("OBJ")) != 0:
                fault = self._get("FLT")
                if fault:
                    raise GripperLost(f"the gripper reports fault {fault}")
                return Grip(self.STROKE_M * (1.0 - self._get("POS") / 255.0), state in (1, 2))
            time.sleep(0.02)
        raise GripperLost(f"the fingers did not stop within {self.TIMEOUT_S:g} s")

    def close(self) -> None:
        """Close the connection; the fingers stay as they are."""
        self._socket.close()

    def _get(self, name: str) -> int:
        answer = self._say(f"GET {name}").split()
        if len(answer) != 2 or answer[0] != name or not answer[1].isdigit():
            raise GripperLost(f"the gripper answered {' '.join(answer)!r} to GET {name}")
        return int(answer[1])

    def _say(self, text: str) -> str:
        try:
            self._socket.sendall((text + "\n").encode())
            # Answers are a few bytes, in one packet, with or without a newline depending on the URCap's version.
            answer = self._socket.recv(64).strip()
            if not answer:
                answer = self._socket.recv(64).strip()
            if not answer:
                raise GripperLost("the gripper closed the connection")
        except OSError as error:
            raise GripperLost(f"the gripper does not answer ({error})") from error
        return answer.decode(errors="replace").strip()


def require_drivable(name: str) -> None:
    """Return if this package can drive the gripper that a plan calls `name`; InputError says what to do otherwise."""
    if name == "suction":
        raise InputError(
            "The plan's gripper is a suction cup. How its valve and vacuum switch are wired differs from cell to cell, "
            "so this program does not drive it: rehearse the plan, or plan with a parallel gripper (kind: parallel)."
        )


def connect(name: str, host: str) -> Gripper:
    """Return the gripper that a plan calls `name`, connected; InputError for one that cannot be driven."""
    require_drivable(name)
    return NoGripper() if name == "none" else RobotiqSocket(host)


def holds(grip: Grip, width_m: float, limits: Limits) -> bool | None:
    """Return whether the fingers stopped on a part of `width_m`; None when nothing was measured."""
    if grip.width_m is None:
        return None
    return bool(grip.blocked) and abs(grip.width_m - width_m) <= limits.grip_tolerance_m
