"""The person at the terminal: questions on it, answers and a word to pause from it, never waiting for either."""

from __future__ import annotations

import contextlib
import os
import select
import sys
from collections.abc import Callable

YES, NO = ("y", "yes"), ("n", "no")
PAUSE, CONTINUE = ("p", "pause"), ("c", "continue")


class Terminal:
    """Asks with `say` and reads from standard input. An input that has ended is a no, and never a pause."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._typed = b""
        self._ended = False
        self._paused = False

    @property
    def there(self) -> bool:
        """Return whether there is an input at all that an answer could come from."""
        try:
            return sys.stdin is not None and select.select([sys.stdin.fileno()], [], [], 0.0) is not None
        except (OSError, ValueError):
            return False

    def ask(self, question: str) -> None:
        """Print a question; what was typed on a keyboard before it does not count."""
        with contextlib.suppress(ImportError, OSError, ValueError, AttributeError):
            import termios

            if os.isatty(sys.stdin.fileno()):
                termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
                self._typed = b""
        self._say(f"{question} Type yes to go on, no to stop.")

    def answer(self) -> bool | None:
        """Return yes or no once one of them was typed; None until then."""
        word = self._next()
        if word is None:
            return False if self._ended else None
        self._take()
        if word in YES:
            return True
        if word in NO:
            return False
        self._say(f"'{word}' is neither yes nor no. Type yes to go on, no to stop.")
        return None

    def paused(self) -> bool:
        """Return whether the person wants the arm to stand still for the moment."""
        while (word := self._next()) is not None and word in (*PAUSE, *CONTINUE):
            self._take()
            if self._paused is not (word in PAUSE):
                self._paused = word in PAUSE
                self._say("pausing; type c to continue" if self._paused else "going on")
        return self._paused

    def _next(self) -> str | None:
        """Return the line that was typed first and not yet taken, None when there is none."""
        try:
            while b"\n" not in self._typed and not self._ended:
                ready, _, _ = select.select([sys.stdin.fileno()], [], [], 0.0)
                if not ready:
                    return None
                piece = os.read(sys.stdin.fileno(), 4096)
                self._ended = not piece
                self._typed += piece
        except (OSError, ValueError, AttributeError):
            self._ended = True
        line, found, _ = self._typed.partition(b"\n")
        return line.decode(errors="replace").strip().lower() if found else None

    def _take(self) -> None:
        self._typed = self._typed.partition(b"\n")[2]
