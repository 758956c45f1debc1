"""The errors a user can meet, with one root, so that a caller can catch them all; and names in messages."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence


class MoccaError(Exception):
    """Root of every error this package raises on purpose.

    A message says what is wrong, where (part, joint, key, waypoint), the value found, the limit it breaks
    and what to do next, in that order and in one or two sentences.
    """


class InputError(MoccaError):
    """The input cannot be used as it is: an unreadable file, an unknown name, an impossible geometry."""


class NearlyTouching(InputError):
    """Parts overlap, or miss each other, by so little that they were probably meant to touch.

    `tolerance_m` is within which they do, rounded up to two digits; commands say how to go on with it.
    """

    def __init__(self, message: str, tolerance_m: float) -> None:
        super().__init__(message)
        self.tolerance_m = tolerance_m


class EnvironmentNeeded(MoccaError):
    """Something outside the input is missing: an optional package, OpenGL, a writable folder."""


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a clause such as ``"did you mean 'alpha_deg'? Known: …"`` for an unknown `name`."""
    names = sorted(str(k) for k in known)
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f"did you mean '{close[0]}'? K" if close else "k"
    listed = ", ".join(names[:20]) + (", …" if len(names) > 20 else "")
    return f"{hint}nown: {listed}."


def quoted(names: Sequence[str], limit: int = 6) -> str:
    """Return names in quotes, at most `limit`, and how many more."""
    more = f" and {len(names) - limit} more" if len(names) > limit else ""
    return ", ".join(f"'{n}'" for n in names[:limit]) + more
