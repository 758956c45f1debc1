"""What a command tells: text or one JSON object on stdout, progress and messages on stderr."""

from __future__ import annotations

import errno
import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TextIO

from mocca_robot.cli.exit_code import ExitCode
from mocca_robot.cli.voice import silence

PROGRESS = "MOCCA_ROBOT_PROGRESS"
"""Environment variable; with the value 'lines' progress is told line by line on stderr, for a program that listens."""


class Console:
    """The two streams of one command, and the wall time of its stages.

    Text goes to stdout unless `as_json`; then `finish` prints the one JSON object there. Progress is drawn on
    stderr only where a terminal is, so that pipes and logs stay quiet.
    """

    def __init__(self, as_json: bool = False) -> None:
        self.as_json = as_json
        self.seconds: dict[str, float] = {}

    def say(self, text: str = "") -> None:
        """Print a line for people."""
        if not self.as_json:
            _write(sys.stdout, text)

    def warn(self, text: str) -> None:
        """Print a line on stderr that belongs to no result: a repair, a suspicion."""
        if not self.as_json:
            _write(sys.stderr, text)

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[[str], None]]:
        """Yield a function that shows what is being done; the stage's wall time is kept, even after an error."""
        started = time.perf_counter()
        try:
            with _spinner(name) as update:
                yield update
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - started

    def times(self) -> str:
        """Return the stages with their seconds, in the order they ran."""
        each = ", ".join(f"{name} {_seconds(value)}" for name, value in self.seconds.items())
        return f"time: {_seconds(sum(self.seconds.values()))} ({each})"

    def finish(self, status: ExitCode, document: Mapping[str, Any]) -> int:
        """Return `status` after printing the JSON object that was asked for, if it was."""
        if self.as_json:
            seconds = {name: round(value, 4) for name, value in self.seconds.items()}
            utf8 = (sys.stdout.encoding or "").lower().replace("-", "") == "utf8"  # elsewhere letters would be lost
            whole = {"ok": status == 0, "exit_status": int(status), **document, "seconds": seconds}
            _write(sys.stdout, json.dumps(plain(whole), ensure_ascii=not utf8, allow_nan=False))
        return status


class Pace:
    """How fast pieces of work get done, and from that how long the rest takes."""

    def __init__(self) -> None:
        self._total, self._first, self._started = 0, 0, time.monotonic()

    def left(self, done: int, total: int) -> str:
        """Return ', about 12 s left' once a tenth of the pieces since the first call says so, else ''."""
        if total != self._total or done < self._first:
            self._total, self._first, self._started = total, done, time.monotonic()
        ours = done - self._first
        if ours < max(2, 0.1 * (total - self._first)) or done >= total:
            return ""
        seconds = (time.monotonic() - self._started) / ours * (total - done)
        return f", about {seconds:.0f} s left" if seconds < 90 else f", about {seconds / 60:.0f} min left"


def plain(value: Any) -> Any:
    """Return `value` as JSON knows it: numbers without NaN and infinity (null instead), lists, texts."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(v) for v in value]
    if value is None or isinstance(value, (bool, int)):
        return value
    if isinstance(value, str):
        return str(value)
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value)


def _seconds(value: float) -> str:
    return f"{value:.2f} s" if value < 10 else f"{value:.0f} s"


def _write(stream: TextIO, text: str) -> None:
    """Write a line; once nobody reads any more (`mocca-robot check X | head`) the rest goes nowhere, and the verdict is
    still the exit status.
    """
    try:
        stream.write(text + "\n")
        stream.flush()
    except OSError as error:
        if error.errno not in (errno.EPIPE, errno.EINVAL):  # Windows says EINVAL
            raise
        silence(stream.fileno())


@contextmanager
def _spinner(name: str) -> Iterator[Callable[[str], None]]:
    if os.environ.get(PROGRESS) == "lines":
        _write(sys.stderr, f"{PROGRESS}: {name}")
        yield lambda text: _write(sys.stderr, f"{PROGRESS}: {name}: {text}")
        return
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console as Rich
    from rich.markup import escape

    # rich obeys NO_COLOR and TERM by itself.
    with Rich(stderr=True).status(escape(name)) as status:
        yield lambda text: status.update(escape(f"{name}: {text}"))
