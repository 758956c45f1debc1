"""What a build says while an arm moves, and whether anybody can still hear it."""

from __future__ import annotations

import os
import sys
from typing import TextIO


class Voice:
    """Lines on stdout. Once nobody reads that (`| head`, a closed window), `deaf` is true and the rest goes to stderr.

    Writing never raises: an arm must not be left to itself because of a line that could not be printed.
    """

    def __init__(self) -> None:
        self.deaf = False

    def say(self, text: str) -> None:
        """Print a line where it can be read."""
        if not self.deaf:
            try:
                _write(sys.stdout, text)
                return
            except (OSError, ValueError):
                self._stop_listening()
        self.warn(text)

    def warn(self, text: str) -> None:
        """Print a line to stderr, if that is there."""
        try:
            _write(sys.stderr, text)
        except (OSError, ValueError):
            silence(2)

    def _stop_listening(self) -> None:
        self.deaf = True
        silence(1)


def silence(descriptor: int) -> None:
    """Send the rest of a stream nowhere: what Python still holds back must not fail again when the process ends."""
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, descriptor)
        os.close(nowhere)
    except OSError:
        return


def _write(stream: TextIO | None, text: str) -> None:
    if stream is not None:
        stream.write(text + "\n")
        stream.flush()
