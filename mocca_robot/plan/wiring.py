"""How a suction cup, or fingers, are wired to the controller: the outputs of valves, the inputs of switches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

BANKS = {"standard": 8, "configurable": 8, "tool": 2}
"""Digital signals of a UR controller, in the order in which RTDE packs their states into bits."""
SIGNALS = tuple(f"{bank}_{k}" for bank, count in BANKS.items() for k in range(count))
WAIT_S = (0.05, 10.0)
DEFAULT_WAIT_S = 1.0


@dataclass(frozen=True)
class VacuumWiring:
    """Signals are named `standard_0`–`7`, `configurable_0`–`7`, `tool_0`–`1`, as on the pendant.

    Attributes:
        output: on while the cup sucks.
        input: on while there is vacuum; None without a switch: then every grip is taken on trust.
        wait_s: how long vacuum may take to come or to go; without a switch, how long it is given.
    """

    output: str
    input: str | None = None
    wait_s: float = DEFAULT_WAIT_S

    @property
    def output_bit(self) -> int:
        """Return the output's place among RTDE's bits of all outputs."""
        return SIGNALS.index(self.output)

    @property
    def input_bit(self) -> int | None:
        """Return the input's place among RTDE's bits of all inputs; None without a switch."""
        return None if self.input is None else SIGNALS.index(self.input)

    def document(self) -> dict[str, Any]:
        """Return the wiring as a plan records it."""
        switch = {} if self.input is None else {"input": self.input}
        return {"output": self.output, **switch, "wait_s": self.wait_s}


@dataclass(frozen=True, kw_only=True)
class FingerWiring:
    """How fingers are wired that are closed or wide open. Signals are named as in `VacuumWiring`.

    Attributes:
        close_output: on while the fingers close.
        open_output: on while they open, of a valve with two coils; None where they open without the other.
        open_input: on while they are wide open; None without a switch.
        held_input: on while something is between them; None without a switch: then a person is asked.
        wait_s: how long they may take; without a switch, how long they are given.
    """

    close_output: str
    open_output: str | None = None
    open_input: str | None = None
    held_input: str | None = None
    wait_s: float = DEFAULT_WAIT_S

    def document(self) -> dict[str, Any]:
        """Return the wiring as a plan records it."""
        return {name: value for name, value in vars(self).items() if value is not None}


def bank_and_number(signal: str) -> tuple[str, int]:
    """Return `("standard", 3)` for `standard_3`."""
    bank, _, number = signal.rpartition("_")
    return bank, int(number)
