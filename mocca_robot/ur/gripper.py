"""Grippers: open, close, and the width that was really reached. A width is evidence: it says whether a part is held."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from mocca_robot.ur.limits import Limits
from mocca_robot.ur.status import ArmState


class GripperLost(Exception):
    """The gripper did not answer in time or reports a fault."""


@dataclass(frozen=True)
class Grip:
    """What was measured of a grip; None is what has no sensor.

    Attributes:
        width_m, blocked: of fingers: their opening, and whether something stopped them.
        vacuum: of a suction cup: whether there is vacuum under it.
    """

    width_m: float | None
    blocked: bool | None
    vacuum: bool | None = None


class Gripper(Protocol):
    """Fingers or a cup. `tick` is called while waiting, so that the arm stays supervised, and returns its state."""

    def move(self, width_m: float, force_n: float, tick: Callable[[], ArmState]) -> Grip:
        """Return what was reached after moving to an opening of `width_m`; GripperLost when nothing answers."""
        ...

    def lost(self, state: ArmState) -> str:
        """Return '' or how the part that was held got lost on the way, as far as the arm's state shows it."""
        ...

    def unready(self, state: ArmState) -> str:
        """Return '' or why no step can begin, as far as the arm's state shows it."""
        ...

    def close(self) -> None:
        """Release the connection; what is held stays held."""
        ...


class _NotInTheState:
    """A gripper that the arm's state says nothing about."""

    def lost(self, state: ArmState) -> str:
        """Return '': it is not seen between grips."""
        return ""

    def unready(self, state: ArmState) -> str:
        """Return '': nothing speaks against it."""
        return ""


class NoGripper(_NotInTheState):
    """A tool without fingers: every grip is taken on trust, and says so by measuring nothing."""

    def move(self, width_m: float, force_n: float, tick: Callable[[], ArmState]) -> Grip:
        """Return a grip without measurement."""
        tick()
        return Grip(None, None)

    def close(self) -> None:
        """Do nothing: there is no connection."""


class RobotiqSocket(_NotInTheState):
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

    def move(self, width_m: float, force_n: float, tick: Callable[[], ArmState]) -> Grip:
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


def holds(grip: Grip, width_m: float, limits: Limits) -> bool | None:
    """Return whether a part of `width_m` is held: vacuum, or fingers stopped by it; None when nothing was measured."""
    if grip.width_m is None:
        return grip.vacuum
    return bool(grip.blocked) and abs(grip.width_m - width_m) <= limits.grip_tolerance_m
