"""The process beside the server that computes for one window: newest change first, older ones abandoned."""

from __future__ import annotations

import os
import sys
import threading
import traceback
from collections.abc import Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from mocca_robot.errors import MoccaError


class Superseded(BaseException):
    """A newer change has come: what is being computed is of no interest any more."""


class Desk:
    """What waits for the worker: at most one change, the newest, and questions about what was computed last."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._change: dict[str, Any] | None = None
        self._questions: list[dict[str, Any]] = []

    def look(self) -> None:
        """Take in everything that has come. Raises EOFError when the server is gone."""
        while self._connection.poll():
            self._take(self._connection.recv())

    def next(self) -> dict[str, Any]:
        """Return what to do next, waiting for it; a change goes before questions."""
        self.look()
        while self._change is None and not self._questions:
            self._take(self._connection.recv())
            self.look()
        if self._change is not None:
            found, self._change, self._questions = self._change, None, []
            return found
        return self._questions.pop(0)

    @property
    def superseded(self) -> bool:
        """Return whether a newer change waits."""
        self.look()
        return self._change is not None

    def _take(self, message: dict[str, Any]) -> None:
        if message["do"] == "compute":
            self._change = message
            return
        # Of two questions of a kind only the newer one is of interest: a slider asks many.
        self._questions = [q for q in self._questions if q["do"] != message["do"]] + [message]


def main(connection: Connection) -> None:
    """Serve until the server closes the connection. Every answer carries the revision that it belongs to."""
    _end_with_parent()
    computed: Any = None
    try:
        desk = Desk(connection)
        while True:
            job = desk.next()
            if job["do"] == "compute":
                computed = _compute(job, desk, connection)
                connection.send({"stage": "idle", "revision": job["revision"]})
            elif computed is not None:
                _answer(job, computed, connection)
    except (EOFError, OSError, KeyboardInterrupt):
        return


def _compute(job: dict[str, Any], desk: Desk, connection: Connection) -> Any:
    from mocca_robot.cli.studio.compute import compute

    revision = job["revision"]

    def tell(stage: str, data: Mapping[str, Any]) -> None:
        connection.send({"stage": stage, "revision": revision, **data})
        if desk.superseded:
            raise Superseded

    connection.send({"stage": "taken", "revision": revision})
    try:
        return compute(job["data"], Path(job["source"]), Path(job["folder"]), tell)
    except Superseded:
        return None
    except (MoccaError, MemoryError) as error:
        text = str(error) or "There is not enough memory for this; simplify the parts."
        connection.send({"stage": "problem", "revision": revision, "text": text, "internal": False})
    except Exception as error:
        sys.stderr.write(traceback.format_exc())
        text = f"This is an error in mocca-robot, not in your input ({type(error).__name__}: {error})."
        connection.send({"stage": "problem", "revision": revision, "text": text, "internal": True})
    return None


def _answer(job: dict[str, Any], computed: Any, connection: Connection) -> None:
    from mocca_robot.cli.studio import physics

    ask = physics.let_go if job["do"] == "let_go" else physics.tilted
    try:
        found = ask(computed, job["which"], job["angle_deg"], job["azimuth_deg"])
        connection.send({"stage": job["do"], "revision": job["revision"], "question": job["question"], **found})
    except MoccaError as error:
        connection.send({"stage": "refused", "revision": job["revision"], "text": str(error)})


def _end_with_parent() -> None:
    """End this process when the server is gone, even in the middle of a computation."""
    from multiprocessing import parent_process

    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(0)

    threading.Thread(target=watch, daemon=True).start()
