"""One window's work: its history, its worker, what was computed last, and who is listening."""

from __future__ import annotations

import asyncio
import multiprocessing
import tempfile
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mocca_robot.cli.studio import opening, saving, worker
from mocca_robot.cli.studio.history import History, Saved, Snapshot, changed
from mocca_robot.cli.studio.jobs import Jobs
from mocca_robot.errors import InputError
from mocca_robot.files.output import write_atomic

STUCK_S = 2.0
"""A worker that is by then still busy with an older change is replaced: nobody waits for that."""
STAGES = ("input", "before", "result")


class Helper:
    """A worker process, and a thread that hands what it says to the server's loop."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self.process = context.Process(target=worker.main, args=(theirs,), daemon=True)
        self.process.start()
        theirs.close()
        self._heard: Callable[[dict[str, Any] | None], None] | None = None
        self._early: list[dict[str, Any] | None] = []
        self._lock = threading.Lock()
        threading.Thread(target=self._read, daemon=True).start()

    def listen(self, heard: Callable[[dict[str, Any] | None], None]) -> None:
        """Hand everything it says, None at its end, to `heard`, which is called on another thread."""
        with self._lock:
            self._heard = heard
            early, self._early = self._early, []
        for message in early:
            heard(message)

    def send(self, message: Mapping[str, Any]) -> None:
        """Give it something to do; a worker that has ended hears nothing."""
        try:
            self._connection.send(message)
        except OSError:
            return

    def end(self) -> None:
        """End the process, whatever it does."""
        self._heard = None
        self.process.kill()
        self._connection.close()

    def _read(self) -> None:
        message: dict[str, Any] | None = {}
        while message is not None:
            try:
                message = self._connection.recv()
            except (EOFError, OSError):
                message = None
            with self._lock:
                heard = self._heard
                if heard is None:
                    self._early.append(message)
            if heard is not None:
                heard(message)


class Session:
    """One window's work. Every method is called on the server's loop."""

    def __init__(self, name: str, start: Path, helper: Callable[[], Helper]) -> None:
        self.name = name
        self.start = start
        self.history: History | None = None
        self.saved = Saved()
        self.revision = 0
        self.computed: dict[str, dict[str, Any]] = {}
        self.problem: dict[str, Any] | None = None
        self.busy = False
        self._temporary = tempfile.TemporaryDirectory(prefix="mocca-studio-", ignore_cleanup_errors=True)
        self.folder = Path(self._temporary.name)
        self.jobs = Jobs(self.folder, self._tell_jobs)
        self._new_helper = helper
        self._helper: Helper | None = None
        self._working_on: int | None = None
        self._listeners: set[asyncio.Queue[dict[str, Any]]] = set()
        self._loop = asyncio.get_running_loop()

    # --- what the page asks for

    def open(self, path: Path, units: str | None = None, example: bool = False) -> None:
        """Begin anew with a file or folder; an example is saved elsewhere. Raises InputError."""
        snapshot, saved = opening.open_path(path, units)
        self._begin(snapshot, Saved(None, saved.text, saved.data) if example else saved)

    def drop(self, files: list[tuple[str, bytes]], units: str | None) -> None:
        """Begin anew with dropped files. Raises InputError."""
        target = Path(tempfile.mkdtemp(prefix="dropped-", dir=self.folder))
        snapshot, saved = opening.open_path(opening.unpack(files, target), units)
        self._begin(snapshot, Saved(None, saved.text, saved.data))

    def change(self, path: list[str], value: Any, merge: bool) -> None:
        """Set one key. Raises InputError, and nothing has changed then."""
        self._step(changed(self.now, path, value, self.unit_m), merge)

    def move_corner(self, corner: list[float], to: list[float]) -> None:
        """Move a corner of flat parts, metres. Raises InputError, and nothing has changed then."""
        self._step(opening.with_corner_moved(self.now, self.source, self.folder, corner, to), False)

    def travel(self, by: int) -> None:
        """Undo (−1) or redo (1)."""
        if self.history is not None:
            self.history = self.history.moved(by)
            self._compute()

    def ask(self, question: Mapping[str, Any]) -> None:
        """Ask the worker about what was computed last."""
        if self._helper is not None:
            self._helper.send({**question, "revision": self.revision})

    def save(self, target: Path, overwrite: bool) -> Path:
        """Return the path that the configuration was saved to, with the model where it can be found again.

        Raises InputError when another file is there, or the file changed since it was opened, unless `overwrite`.
        """
        if target.suffix.lower() not in opening.CONFIGURATIONS:
            raise InputError(f"'{target}' has to end in .yaml; the command line runs that.")
        mine = self.saved.path is not None and target.resolve() == self.saved.path
        if target.exists() and not overwrite:
            if not mine:
                raise InputError(f"'{target}' is there already.")
            if target.read_text(encoding="utf-8") != self.saved.text:
                raise InputError(f"'{target}' was changed by something else since it was opened.")
        data = self._with_model_beside(target)
        text = saving.as_yaml(data, self.saved.text, self.saved.data)
        write_atomic(target, text)
        self.saved = Saved(target.resolve(), text, data)
        assert self.history is not None
        now = Snapshot(data=data, folder=target.parent.resolve(), label=self.now.label, path=self.now.path)
        past = (*self.history.snapshots[: self.history.place], now)
        self.history = History(snapshots=past, place=len(past) - 1)
        self._tell(self.document())
        return target

    def text(self) -> str:
        """Return the configuration as YAML, its model by its full path."""
        return saving.as_yaml(saving.with_full_paths(self.now.data, self.now.folder), self.saved.text, self.saved.data)

    # --- what the page is told

    @property
    def now(self) -> Snapshot:
        """Return the present snapshot. Raises InputError before anything was opened."""
        if self.history is None:
            raise InputError("Nothing is open; open a file or drop one.")
        return self.history.now

    @property
    def source(self) -> Path:
        """Return what messages call the configuration."""
        name = self.now.data.get("name") or Path(str(self.now.data.get("model", "studio"))).stem
        return self.saved.path or self.now.folder / f"{name}.yaml"

    @property
    def unit_m(self) -> float:
        """Return metres per unit of lengths, as far as it is known."""
        return float(self.computed.get("input", {}).get("unit_m", 1.0))

    def document(self) -> dict[str, Any]:
        """Return what is in hand, for the page."""
        if self.history is None:
            return {"stage": "document", "open": False, "revision": self.revision, "start": str(self.start)}
        saved = self.saved.path is not None and saving.same(self.now, self.saved)
        return {
            "stage": "document",
            "open": True,
            "revision": self.revision,
            "data": dict(self.now.data),
            "name": self.source.stem,
            "file": None if self.saved.path is None else _as_typed(self.saved.path),
            "suggested": str(self.start / f"{self.source.stem}.yaml"),
            "saved": saved,
            "undo": self.history.undoes,
            "redo": self.history.redoes,
            "changed": self.now.path,
            "busy": self.busy,
            "start": str(self.start),
        }

    def listen(self) -> asyncio.Queue[dict[str, Any]]:
        """Return a queue that is told everything from now on, beginning with all that is known."""
        queue: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        for event in self._everything():
            queue.put_nowait(event)
        self._listeners.add(queue)
        return queue

    def stop_listening(self, queue: asyncio.Queue[dict[str, Any]]) -> None:
        """Tell this queue nothing more."""
        self._listeners.discard(queue)

    @property
    def watched(self) -> bool:
        """Return whether a page listens."""
        return bool(self._listeners)

    def close(self) -> None:
        """End the worker and the jobs, and forget the temporary files."""
        if self._helper is not None:
            self._helper.end()
        self.jobs.close()
        self._temporary.cleanup()

    # --- inside

    def _everything(self) -> list[dict[str, Any]]:
        problem = [self.problem] if self.problem is not None else []
        stages = [self.computed[s] for s in STAGES if s in self.computed]
        return [self.document(), *stages, *problem, {"stage": "jobs", "jobs": self.jobs.listed()}]

    def _begin(self, snapshot: Snapshot, saved: Saved) -> None:
        self.history, self.saved, self.computed = History(snapshots=(snapshot,)), saved, {}
        self._tell({"stage": "opened"})
        self._compute()

    def _step(self, snapshot: Snapshot, merge: bool) -> None:
        assert self.history is not None
        if snapshot.data != self.now.data:
            self.history = self.history.with_step(snapshot, merge)
            self._compute()

    def _compute(self) -> None:
        self.revision += 1
        self.problem, self.busy = None, True
        if self._helper is None:
            self._helper = self._new_helper()
            self._listen_to(self._helper)
        self._helper.send(
            {
                "do": "compute",
                "revision": self.revision,
                "data": dict(self.now.data),
                "source": str(self.source),
                "folder": str(self.now.folder),
            }
        )
        self._loop.call_later(STUCK_S, self._replace_if_stuck, self.revision, self._helper)
        self._tell(self.document())

    def _replace_if_stuck(self, revision: int, helper: Helper) -> None:
        elsewhere = self._working_on is not None and self._working_on < revision
        if helper is self._helper and elsewhere and revision == self.revision:
            helper.end()
            self._helper = self._working_on = None
            self._compute()

    def _listen_to(self, helper: Helper) -> None:
        def heard(message: dict[str, Any] | None) -> None:
            self._loop.call_soon_threadsafe(self._hear, helper, message)

        helper.listen(heard)

    def _hear(self, helper: Helper, message: dict[str, Any] | None) -> None:
        if helper is not self._helper:
            return
        if message is None:
            self._helper = self._working_on = None
            if self.busy:
                text = "The computation ended unexpectedly, perhaps for want of memory. Undo, or simplify the parts."
                self._hear_stage({"stage": "problem", "revision": self.revision, "text": text, "internal": False})
            return
        if message["stage"] == "taken":
            self._working_on = message["revision"]
        elif message["stage"] == "idle":
            self._working_on = None
        elif message.get("revision") == self.revision:
            self._hear_stage(message)

    def _hear_stage(self, message: dict[str, Any]) -> None:
        stage = message["stage"]
        if stage in STAGES:
            if stage != "input":  # the parts in the order that its indices mean
                message = {**message, "assembly": self.computed["input"]["assembly"]}
            self.computed[stage] = message
        if stage == "problem":
            self.problem = {**message, "path": self.now.path}
            message = self.problem
        if stage in ("result", "problem"):
            self.busy = False
        self._tell(message)

    def _tell_jobs(self) -> None:
        self._tell({"stage": "jobs", "jobs": self.jobs.listed()})

    def _tell(self, event: dict[str, Any]) -> None:
        for queue in self._listeners:
            queue.put_nowait(event)

    def _with_model_beside(self, target: Path) -> dict[str, Any]:
        """Return the data to save to `target`; a model that lies in this window's own folder is copied beside it."""
        return saving.with_model_beside(self.now.data, self.now.folder, target, self.folder)


def _as_typed(path: Path) -> str:
    """Return a path as one would type it in the folder where the studio was started."""
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)
