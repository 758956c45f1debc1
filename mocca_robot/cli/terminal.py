"""The person at the terminal: questions on it, answers from it, never waiting for either."""

from __future__ import annotations

import contextlib
import os
import select
import sys
from collections.abc import Callable

YES, NO = ("y", "yes"), ("n", "no")


class Terminal:
    """Asks with `say` and reads answers from standard input. An input that has ended is a no."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._typed = b""

    @property
    def there(self) -> bool:
        """Return whether there is an input at all that an answer could come from."""
        try:
            return sys.stdin is not None and select.select([sys.stdin.fileno()], [], [], 0.0) is not None
        except (OSError, ValueError):
            return False

    def ask(self, question: str) -> None:
        """Print a question; what was typed on a keyboard before it does not count."""
        with contextlib.suppress(ImportError, OSError, ValueError):
            import termios

            if os.isatty(sys.stdin.fileno()):
                termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
                self._typed = b""
        self._say(f"{question} Type yes to go on, no to stop.")

    def answer(self) -> bool | None:
        """Return yes or no once one of them was typed; None until then."""
        try:
            while b"\n" not in self._typed:
                ready, _, _ = select.select([sys.stdin.fileno()], [], [], 0.0)
                if not ready:
                    return None
                piece = os.read(sys.stdin.fileno(), 4096)
                if not piece:
                    return False
                self._typed += piece
        except (OSError, ValueError, AttributeError):
            return False
        line, _, self._typed = self._typed.partition(b"\n")
        word = line.decode(errors="replace").strip().lower()
        if word in YES:
            return True
        if word in NO:
            return False
        self._say(f"'{word}' is neither yes nor no. Type yes to go on, no to stop.")
        return None
