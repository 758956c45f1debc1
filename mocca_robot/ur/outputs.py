"""Digital outputs of the controller: switched through ur-rtde, believed only when the stream of states shows it."""

from __future__ import annotations

from collections.abc import Callable

from mocca_robot.plan.gripper import GripperLost
from mocca_robot.plan.status import ArmState
from mocca_robot.plan.wiring import SIGNALS, bank_and_number
from mocca_robot.ur.link import ChildLink, LinkLost

CALL_S = 1.0
CONNECT_S = 8.0
SWITCH_S = 0.5
"""An output reads back within a few cycles."""


class Outputs:
    """The outputs of the controller at `host`; GripperLost when they cannot be reached."""

    def __init__(self, host: str) -> None:
        try:
            self._link = ChildLink("valve", host, CONNECT_S)
        except LinkLost as error:
            raise GripperLost(f"the controller's digital outputs cannot be reached ({error})") from error

    def switch(self, signal: str, on: bool, tick: Callable[[], ArmState]) -> ArmState:
        """Switch an output and return the state that shows it; GripperLost when none does."""
        bank, number = bank_and_number(signal)
        state = tick()
        try:
            obeyed = self._link.call(f"set{bank.capitalize()}DigitalOut", number, on, deadline_s=CALL_S)
        except LinkLost as error:
            raise GripperLost(f"output {signal} cannot be switched ({error})") from error
        end = state.time_s + SWITCH_S
        while obeyed and is_on(state, signal) is not on and state.time_s < end:
            state = tick()
        if is_on(state, signal) is not on:
            asked, found = ("on", "off") if on else ("off", "on")
            raise GripperLost(f"output {signal} was switched {asked} and reads back as {found}")
        return state

    def close(self) -> None:
        """Close the connection; every output stays as it is."""
        self._link.kill()


def is_on(state: ArmState, signal: str) -> bool:
    """Return whether the controller reports an output as on."""
    return bool(state.digital_outputs >> SIGNALS.index(signal) & 1)
