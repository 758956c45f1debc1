"""A suction cup behind a digital output. Its vacuum is switched off by a planned release and by nothing else.

A stop, a fault or a lost connection leaves the valve as it is: a part that hangs on the cup is safer there than on its
way to the floor. Signals are read from the supervised stream of states, not from what was ordered.
"""

from __future__ import annotations

from collections.abc import Callable

from mocca_robot.plan.gripper import Grip
from mocca_robot.plan.status import ArmState, ExecutionStatus
from mocca_robot.plan.supervision import Stopped
from mocca_robot.plan.wiring import VacuumWiring
from mocca_robot.ur.outputs import Outputs, is_on

FLICKER_S = 0.1
"""A vacuum switch that opens for less than this has not lost its part."""


class SuctionCup:
    """A valve and perhaps a vacuum switch. An opening below `middle_m` means suck, above it let go."""

    def __init__(self, host: str, wiring: VacuumWiring, middle_m: float) -> None:
        self._wiring = wiring
        self._middle_m = middle_m
        self._holding = False
        self._gone_at: float | None = None
        self._outputs = Outputs(host)

    def move(self, width_m: float, force_n: float, tick: Callable[[], ArmState]) -> Grip:
        """Switch the vacuum and wait for the switch: the grip says whether there is vacuum, None without a switch.

        Stopped(DEVIATED) instead of letting go when the part is not there any more: it has not been placed.
        """
        on = width_m < self._middle_m
        if not on:
            self._require_part(tick)
        self._outputs.switch(self._wiring.output, on, tick)
        grip = self._await(on, tick)
        self._holding, self._gone_at = on and grip.vacuum is not False, None
        return grip

    def lost(self, state: ArmState) -> str:
        """Return '' or how the part that the cup held was lost."""
        if not self._holding:
            return ""
        if not self._is_on(state):
            return f"the part is not held: output {self._wiring.output} was switched off by somebody else"
        if self._vacuum(state) is not False:
            self._gone_at = None
        elif self._gone_at is None:
            self._gone_at = state.time_s
        elif state.time_s - self._gone_at >= FLICKER_S:
            return f"part lost: input {self._wiring.input} shows no vacuum"
        return ""

    def unready(self, state: ArmState) -> str:
        """Return '' or why no step can begin: the cup may hold something."""
        if self._is_on(state):
            return (
                f"the vacuum is on (output {self._wiring.output}): a part may hang on the cup. Take hold of it, then "
                "switch the output off at the pendant (I/O)"
            )
        if self._vacuum(state):
            return (
                f"input {self._wiring.input} shows vacuum although output {self._wiring.output} is off: check the "
                "vacuum switch and its wiring"
            )
        return ""

    def close(self) -> None:
        """Close the connection; the valve stays as it is."""
        self._outputs.close()

    def _is_on(self, state: ArmState) -> bool:
        return is_on(state, self._wiring.output)

    def _vacuum(self, state: ArmState) -> bool | None:
        bit = self._wiring.input_bit
        return None if bit is None else bool(state.digital_inputs >> bit & 1)

    def _require_part(self, tick: Callable[[], ArmState]) -> None:
        state = tick()
        while self._holding and self._vacuum(state) is False:
            if words := self.lost(state):
                raise Stopped(ExecutionStatus.DEVIATED, words, state)
            state = tick()

    def _await(self, on: bool, tick: Callable[[], ArmState]) -> Grip:
        state = tick()
        end = state.time_s + self._wiring.wait_s
        while self._vacuum(state) is not on and state.time_s < end:
            state = tick()
        return Grip(None, None, self._vacuum(state))
