"""How a suction cup is wired to the controller: the output that opens its valve, the input of its vacuum switch."""

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


def bank_and_number(signal: str) -> tuple[str, int]:
    """Return `("standard", 3)` for `standard_3`."""
    bank, _, number = signal.rpartition("_")
    return bank, int(number)
