"""Parameters of a generator: each with its default and its range, and errors that teach."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mocca_robot.errors import InputError, nearest

REQUIRED = object()
"""Default of a parameter that has to be given."""

MAX_PARTS = 5000


class GeneratorParameters:
    """The parameters of one generator; raises InputError for unknown keys when made.

    `defaults` maps every known key to its default value, or to REQUIRED.
    """

    def __init__(self, kind: str, given: Mapping[str, Any], defaults: Mapping[str, Any]) -> None:
        self.kind = kind
        for key in given:
            if key not in defaults:
                raise InputError(f"Generator '{kind}' has no parameter '{key}'; {nearest(key, defaults)}")
        missing = [k for k, v in defaults.items() if v is REQUIRED and given.get(k) is None]
        if missing:
            raise InputError(f"Generator '{kind}' needs '{missing[0]}'; known parameters: {', '.join(defaults)}.")
        self._values = {**defaults, **{k: v for k, v in given.items() if v is not None}}

    def number(self, key: str, low: float, high: float) -> float:
        """Return a finite number strictly between `low` and `high`."""
        value = self._values[key]
        if isinstance(value, bool) or not isinstance(value, int | float) or not low < value < high:
            raise InputError(f"{self.kind}.{key} is {value!r}; it must be a number between {low:g} and {high:g}.")
        return float(value)

    def at_least(self, key: str, low: float, high: float) -> float:
        """Return a finite number of at least `low` and less than `high`."""
        value = self._values[key]
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value < high:
            raise InputError(f"{self.kind}.{key} is {value!r}; it must be at least {low:g} and less than {high:g}.")
        return float(value)

    def count(self, key: str, low: int, high: int = 2000) -> int:
        """Return a whole number from `low` to `high`."""
        return self._count(self._values[key], f"{self.kind}.{key}", low, high)

    def counts(self, key: str, low: int, high: int = 500) -> list[int]:
        """Return a list of whole numbers from `low` to `high`, not empty."""
        values = self._values[key]
        if not isinstance(values, list) or not values or len(values) > high:
            raise InputError(f"{self.kind}.{key} is {values!r}; it must be a list of whole numbers.")
        return [self._count(v, f"{self.kind}.{key}[{k}]", low, high) for k, v in enumerate(values)]

    def _count(self, value: object, where: str, low: int, high: int) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise InputError(f"{where} is {value!r}; it must be a whole number from {low} to {high}.")
        return value

    def require_few(self, parts: int) -> None:
        """Raise InputError when the generator would make more parts than anything here can work with."""
        if parts > MAX_PARTS:
            raise InputError(f"{self.kind} would make {parts} parts; at most {MAX_PARTS} are made. Use smaller counts.")

    def flag(self, key: str) -> bool:
        """Return true or false."""
        value = self._values[key]
        if not isinstance(value, bool):
            raise InputError(f"{self.kind}.{key} is {value!r}; it must be true or false.")
        return value

    def choice(self, key: str, known: tuple[str, ...]) -> str:
        """Return one of `known`."""
        value = self._values[key]
        if value not in known:
            raise InputError(f"{self.kind}.{key} is {value!r}; {nearest(str(value), known)}")
        return str(value)

    def text(self, key: str) -> str:
        """Return a text that is not empty."""
        value = self._values[key]
        if not isinstance(value, str) or not value:
            raise InputError(f"{self.kind}.{key} is {value!r}; it must be a text.")
        return value

    def given(self, key: str) -> bool:
        """Return whether there is a value at all, by default or given."""
        return self._values[key] is not None

    def vector(self, key: str, length: int) -> list[float]:
        """Return a list of `length` finite numbers."""
        values = self._values[key]
        usable = isinstance(values, list) and len(values) == length
        if not usable or not all(
            isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < 1e9 for v in values
        ):
            raise InputError(f"{self.kind}.{key} is {values!r}; it must be a list of {length} numbers.")
        return [float(v) for v in values]
