"""The grippers that this package drives, and from the one that a plan names to the one that is driven."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable

from mocca_robot.plan.gripper import COMPUTE_BOX, FINGERS, Grip, Gripper, GripperLost, require_drivable
from mocca_robot.plan.plan import Plan
from mocca_robot.plan.status import ArmState
from mocca_robot.tolerances import MM
from mocca_robot.ur.digital_fingers import DigitalFingers
from mocca_robot.ur.onrobot import RgFingers
from mocca_robot.ur.suction import SuctionCup

OPENED_INTO_SOMETHING, CLOSED_ON_SOMETHING = 1, 2
"""Values of the register OBJ; 0 is moving, 3 there."""


class NoGripper:
    """A tool without fingers: every grip is taken on trust, and says so by measuring nothing."""

    def lost(self, state: ArmState) -> str:
        """Return '': it is never seen."""
        return ""

    def unready(self, state: ArmState) -> str:
        """Return '': nothing speaks against it."""
        return ""

    def move(self, width_m: float, force_n: float, tick: Callable[[], ArmState]) -> Grip:
        """Return a grip without measurement."""
        tick()
        return Grip(None, None)

    def close(self) -> None:
        """Do nothing: there is no connection."""


class RobotiqSocket:
    """A Robotiq 2F-85 behind its URCap's text protocol on port 63352 (variables ACT, GTO, POS, SPE, FOR, OBJ, FLT)."""

    PORT = 63352
    STROKE_M = FINGERS["2f85"].stroke_m
    FORCE_N = FINGERS["2f85"].force_n
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
                return Grip(MM * self._opening_mm(), state in (OPENED_INTO_SOMETHING, CLOSED_ON_SOMETHING))
            time.sleep(0.02)
        raise GripperLost(f"the fingers did not stop within {self.TIMEOUT_S:g} s")

    def lost(self, state: ArmState) -> str:
        """Return '': fingers are not seen between grips."""
        return ""

    def unready(self, state: ArmState) -> str:
        """Return '' or why no step can begin: the fingers hold something."""
        if self._get("OBJ") != CLOSED_ON_SOMETHING:
            return ""
        wide = f"{self._opening_mm():.0f} mm wide"
        return f"the fingers hold something, {wide}: take hold of it, then open them with the pendant"

    def _opening_mm(self) -> float:
        return 1e3 * self.STROKE_M * (1.0 - self._get("POS") / 255.0)

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


class HandE(RobotiqSocket):
    """A Robotiq Hand-E: the same protocol, fingers that stay parallel, a shorter stroke."""

    STROKE_M = FINGERS["hande"].stroke_m
    FORCE_N = FINGERS["hande"].force_n


ROBOTIQ: dict[str, type[RobotiqSocket]] = {"2f85": RobotiqSocket, "hande": HandE}
"""Those of Robotiq's grippers by the name that a plan gives them."""
ONROBOT = ("rg2", "rg6")


def connect(plan: Plan, host: str) -> Gripper:
    """Return the plan's gripper, connected; InputError for one that cannot be driven."""
    require_drivable(plan)
    if plan.cell.vacuum is not None and plan.gripper == "suction":
        return SuctionCup(host, plan.cell.vacuum, 0.5 * sum(plan.cell.gripper_stroke_m))
    if plan.cell.fingers is not None and plan.gripper == "digital":
        return DigitalFingers(host, plan.cell.fingers, plan.cell.gripper_stroke_m[1])
    if plan.gripper in ONROBOT:
        fingers = FINGERS[plan.gripper]
        return RgFingers(plan.cell.gripper_address or COMPUTE_BOX, fingers.stroke_m, fingers.force_n[1])
    return NoGripper() if plan.gripper == "none" else ROBOTIQ[plan.gripper](host)
