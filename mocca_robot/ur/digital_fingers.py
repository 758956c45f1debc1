"""Fingers behind digital outputs, as most pneumatic ones are: closed or wide open, and what switches say about it.

They are opened by a planned release and by nothing else: a stop or a lost connection leaves the outputs as they are.
"""

from __future__ import annotations

from collections.abc import Callable

from mocca_robot.plan.gripper import Grip, GripperLost
from mocca_robot.plan.status import ArmState
from mocca_robot.plan.wiring import SIGNALS, FingerWiring
from mocca_robot.ur.outputs import Outputs, is_on

FLICKER_S = 0.1
"""A switch that opens for less than this has not lost its part."""


class DigitalFingers:
    """Fingers with an output that closes them; an opening of `open_m` or more opens them, any other closes them."""

    def __init__(self, host: str, wiring: FingerWiring, open_m: float) -> None:
        self._wiring, self._open_m = wiring, open_m
        self._holding = False
        self._gone_at: float | None = None
        self._outputs = Outputs(host)

    def move(self, width_m: float, force_n: float, tick: Callable[[], ArmState]) -> Grip:
        """Switch the fingers and wait for their switches; the force is the air's. What has no switch is not measured.

        GripperLost when they were opened and the switch that says so does not come.
        """
        wiring, closes = self._wiring, width_m < self._open_m
        if wiring.open_output is not None:
            self._outputs.switch(wiring.open_output, not closes, tick)
        state = self._outputs.switch(wiring.close_output, closes, tick)
        end = state.time_s + wiring.wait_s
        while not self._done(state, closes) and state.time_s < end:
            state = tick()
        if not closes and wiring.open_input is not None and not _shows(state, wiring.open_input):
            raise GripperLost(f"the fingers were opened, but input {wiring.open_input} does not show it")
        held = None if wiring.held_input is None else _shows(state, wiring.held_input)
        self._holding, self._gone_at = closes and held is not False, None
        if closes or wiring.open_input is None:
            return Grip(None, None, held=held)
        return Grip(self._open_m, False, held=held)

    def _done(self, state: ArmState, closes: bool) -> bool:
        """Return whether what is waited for is there; without a switch, the whole time is waited."""
        wanted = self._wiring.held_input if closes else self._wiring.open_input
        return wanted is not None and _shows(state, wanted)

    def lost(self, state: ArmState) -> str:
        """Return '' or how the part that the fingers held was lost."""
        wiring = self._wiring
        if not self._holding:
            return ""
        if not is_on(state, wiring.close_output):
            return f"the part is not held: output {wiring.close_output} was switched off by somebody else"
        if wiring.held_input is None or _shows(state, wiring.held_input):
            self._gone_at = None
        elif self._gone_at is None:
            self._gone_at = state.time_s
        elif state.time_s - self._gone_at >= FLICKER_S:
            return f"part lost: input {wiring.held_input} shows none"
        return ""

    def unready(self, state: ArmState) -> str:
        """Return '' or why no step can begin: the fingers may hold something."""
        wiring = self._wiring
        if wiring.held_input is not None and _shows(state, wiring.held_input):
            return f"input {wiring.held_input} shows a part between the fingers: take it out, then start again"
        if wiring.held_input is None and is_on(state, wiring.close_output):
            return (
                f"the fingers are closed (output {wiring.close_output}): a part may be between them. Take hold of it, "
                "then switch the output off at the pendant (I/O)"
            )
        return ""

    def close(self) -> None:
        """Close the connection; the outputs stay as they are."""
        self._outputs.close()


def _shows(state: ArmState, signal: str) -> bool:
    return bool(state.digital_inputs >> SIGNALS.index(signal) & 1)
