"""Background jobs: the command line itself on what is in hand, with progress and a way to stop it."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mocca_robot.cli.console import PROGRESS
from mocca_robot.errors import InputError

KILLED_AFTER_S = 10.0
"""A job that was told to stop and has not by then is ended."""
KINDS = ("design", "run", "export", "study")


@dataclass(eq=False)
class Job:
    """One command and where it stands. `folder` is where its results lie."""

    number: int
    title: str
    folder: Path
    process: subprocess.Popen[str]
    started: float = field(default_factory=time.time)
    doing: str = "starting"
    share: float | None = None
    state: str = "running"
    words: str = ""
    files: list[str] = field(default_factory=list)
    ended: float | None = None
    share_since: float = 0.0

    def data(self) -> dict[str, Any]:
        """Return it for the page; `left_s` is an estimate, None where there is nothing to go by."""
        left = None
        if self.state == "running" and self.share:
            spent = time.time() - self.share_since
            left = spent * (1.0 - self.share) / self.share
        return {
            "number": self.number,
            "title": self.title,
            "state": self.state,
            "doing": self.doing,
            "share": self.share,
            "left_s": left,
            "seconds": (self.ended or time.time()) - self.started,
            "words": self.words,
            "files": self.files,
            "folder": str(self.folder),
        }


class Jobs:
    """The jobs of one window."""

    def __init__(self, folder: Path, tell: Callable[[], None]) -> None:
        import asyncio

        self._folder, self._tell = folder, tell
        self._loop = asyncio.get_running_loop()
        self._jobs: list[Job] = []

    def start(self, title: str, command: Sequence[str], folder: Path) -> Job:
        """Return the job that runs `mocca-robot COMMAND`; its results go to `folder`."""
        if sum(job.state == "running" for job in self._jobs) >= 3:
            raise InputError("Three jobs are running already; wait for one, or cancel one.")
        flags = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
        process = subprocess.Popen(
            [sys.executable, "-m", "mocca_robot.cli", *command, "--json"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            stdin=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
            errors="replace",
            env={**os.environ, PROGRESS: "lines", "PYTHONIOENCODING": "utf-8"},
            creationflags=flags,
            start_new_session=os.name == "posix",
        )
        job = Job(len(self._jobs) + 1, title, folder, process)
        self._jobs.append(job)
        threading.Thread(target=self._watch, args=(job,), daemon=True).start()
        self._tell()
        return job

    def cancel(self, number: int) -> None:
        """Stop a job as Ctrl-C would: what it has finished is kept."""
        job = self.job(number)
        if job.state != "running":
            return
        job.state, job.doing = "stopping", "stopping"
        job.process.send_signal(signal.SIGINT if os.name == "posix" else signal.CTRL_BREAK_EVENT)  # type: ignore[attr-defined,unused-ignore]
        threading.Timer(KILLED_AFTER_S, self._kill, args=(job,)).start()
        self._tell()

    def job(self, number: int) -> Job:
        """Return a job by its number. Raises InputError when there is none."""
        if not 1 <= number <= len(self._jobs):
            raise InputError(f"There is no job {number}.")
        return self._jobs[number - 1]

    def listed(self) -> list[dict[str, Any]]:
        """Return every job for the page, newest first."""
        return [job.data() for job in reversed(self._jobs)]

    def close(self) -> None:
        """Stop what still runs."""
        for job in self._jobs:
            self._kill(job)

    @staticmethod
    def _kill(job: Job) -> None:
        if job.process.poll() is None:
            job.process.kill()

    def _watch(self, job: Job) -> None:
        messages: list[str] = []
        reader = threading.Thread(target=self._read_progress, args=(job, messages), daemon=True)
        reader.start()
        assert job.process.stdout is not None
        told = job.process.stdout.read()
        status = job.process.wait()
        reader.join()
        self._loop.call_soon_threadsafe(self._ended, job, status, told, messages)

    def _read_progress(self, job: Job, messages: list[str]) -> None:
        assert job.process.stderr is not None
        for line in job.process.stderr:
            if line.startswith(f"{PROGRESS}:"):
                doing = line.split(":", 1)[1].strip()
                self._loop.call_soon_threadsafe(self._progress, job, doing)
            elif line.strip():
                messages.append(line.strip())

    def _progress(self, job: Job, doing: str) -> None:
        if job.state == "running":
            job.doing = doing
            counted = re.search(r"(\d+) of (\d+)", doing)
            share = int(counted[1]) / max(int(counted[2]), 1) if counted else None
            if share is None or job.share is None:
                job.share_since = time.time()
            job.share = share
            self._tell()

    def _ended(self, job: Job, status: int, told: str, messages: list[str]) -> None:
        job.ended = time.time()
        document = _document(told)
        stopped = job.state == "stopping"
        job.state = {0: "done", 1: "negative"}.get(status, "failed")
        if status == 130 or stopped:
            job.state = "cancelled"
        job.files = sorted({str(f) for f in _files(document) if Path(f).exists()})
        job.doing, job.share = "", None
        job.words = _words(job.state, document, messages)
        self._tell()


def _document(told: str) -> dict[str, Any]:
    try:
        found = json.loads(told)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _files(document: dict[str, Any]) -> list[str]:
    files = document.get("files", {})
    listed = list(files.values()) if isinstance(files, dict) else list(files)
    return [f for f in (*listed, document.get("file")) if isinstance(f, str)]


def _words(state: str, document: dict[str, Any], messages: list[str]) -> str:
    if state == "cancelled":
        return "Cancelled; what was finished is kept."
    if "error" in document:
        return str(document["error"])
    findings = document.get("findings") or []
    if findings:
        return " ".join(str(f.get("text", "")) for f in findings[:3])
    if state == "failed":
        return messages[-1] if messages else "It ended without a word."
    return "Every verdict is positive." if "findings" in document else "Done."
