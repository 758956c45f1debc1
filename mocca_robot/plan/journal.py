"""The memory of an execution: one JSON line per event, appended and synced to the disk before the arm goes on.

The first line names the plan by its hash. A line that was cut off by a power failure or `kill -9` can only be the last
one; it is reported and not counted. A resume goes on after the finished steps; a step that was begun and not finished
is never repeated by itself: a person looks at the cell and says what became of it.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

from mocca_robot.errors import EnvironmentNeeded, InputError
from mocca_robot.files.versions import JOURNAL
from mocca_robot.plan.plan import Plan
from mocca_robot.plan.status import ExecutionEvent

Resolution = Literal["placed", "repeat"]
"""What a person found: the part stands where it belongs, or everything is back as it was before the step."""


def utc_now() -> str:
    """Return the present time in UTC, ISO 8601 with milliseconds."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


class JournalLost(EnvironmentNeeded):
    """A line could not be written whole, or the disk did not confirm it: whatever it announces must not happen."""


class Journal:
    """An open journal. `append` returns when the line is on the disk; JournalLost when it cannot get there."""

    def __init__(self, descriptor: int, path: Path) -> None:
        self._descriptor = descriptor
        self.path = path

    @classmethod
    def create(cls, path: Path | str, plan: Plan, robot: str, plan_file: Path | str = "") -> Journal:
        """Return a new journal for `plan` (read from `plan_file`) on `robot`; InputError when the file exists."""
        path = Path(path)
        try:
            descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError as error:
            raise InputError(
                f"The journal {path} exists. Continue it with --resume {path}, or name another with --journal."
            ) from error
        except OSError as error:
            raise InputError(f"Cannot create the journal {path}: {error.strerror}. Name another file.") from error
        journal = cls(descriptor, path)
        header = {
            "format": JOURNAL.name,
            "version": JOURNAL.version,
            "plan_sha256": plan.sha256,
            "plan": str(Path(plan_file).resolve()) if plan_file else "",
            "robot": robot,
            "time": utc_now(),
        }
        try:
            journal._write(header)
            _sync_folder(path.parent)
        except JournalLost:
            journal.discard()
            raise
        return journal

    @classmethod
    def reopen(cls, path: Path | str, plan: Plan, robot: str) -> tuple[Journal, Record]:
        """Return an existing journal opened for appending, and what it holds.

        InputError if it is of another plan, or of another robot: the parts that it speaks of stand elsewhere.
        """
        record = read_journal(path)
        if record.robot != robot:
            raise InputError(
                f"The journal {path} was begun on robot {record.robot}, and this is robot {robot}: what is built "
                "stands in front of the other one. Connect to that, or begin a new journal here."
            )
        if record.plan_sha256 != plan.sha256:
            raise InputError(
                f"The journal {path} belongs to a plan with hash {record.plan_sha256[:12]}…, not to this one "
                f"({plan.sha256[:12]}…): another or an edited plan is never resumed. Give the plan it was begun with."
            )
        journal = cls(os.open(path, os.O_WRONLY | os.O_APPEND), Path(path))
        if record.truncated is not None:
            # The cut line stays in the file as evidence; a newline keeps it apart from what follows.
            journal._append(b"\n")
        return journal, record

    def append(self, event: ExecutionEvent) -> None:
        """Write one event and wait until the disk has it."""
        self._write(event.document())

    def discard(self) -> None:
        """Close the journal and remove its file: nothing has moved that it would have to remember."""
        self.close()
        self.path.unlink(missing_ok=True)

    def _write(self, values: Mapping[str, Any]) -> None:
        self._append((json.dumps(values) + "\n").encode())

    def _append(self, line: bytes) -> None:
        """Write all of `line` and sync it, or take back what was written of it."""
        before = os.fstat(self._descriptor).st_size
        try:
            rest = line
            while rest:
                written = os.write(self._descriptor, rest)  # a disk that is almost full takes a part
                if written == 0:
                    raise OSError(errno.EIO, os.strerror(errno.EIO))
                rest = rest[written:]
            os.fsync(self._descriptor)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._descriptor, before)
            raise JournalLost(
                f"the journal {self.path} cannot be written ({error.strerror}): free space on that disk, or name "
                "another one with --journal"
            ) from error

    def close(self) -> None:
        """Close the file; the journal cannot be written to any more."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


@dataclass(frozen=True, kw_only=True)
class Record:
    """What a journal says.

    Attributes:
        finished: indices of the steps that ended well, ascending.
        unfinished: the step that was begun and neither finished nor resolved by a person; None if there is none.
        events: every whole line after the header.
        truncated: the text of lines that were cut off while being written, None if there are none.
    """

    path: Path
    plan_sha256: str
    plan_file: str
    robot: str
    finished: tuple[int, ...]
    unfinished: int | None
    events: tuple[Mapping[str, Any], ...]
    truncated: str | None

    @property
    def last_status(self) -> str:
        """Return how the last motion ended, in words, and which was begun after it; empty when none was recorded."""
        begun = ""
        for event in reversed(self.events):
            if "status" in event:
                place = f"{event.get('part', '?')}, {event.get('kind', event['event'])}"
                return f"{event['status']} ({place}): {event.get('detail', '')}".rstrip(": ") + begun
            if event.get("event") == "move_started" and not begun:
                begun = f", then {event.get('kind', '?')} was begun"
        return begun.removeprefix(", then ")


def read_journal(path: Path | str) -> Record:
    """Return what a journal says, even after `kill -9`; InputError when it is not a journal or damaged inside."""
    path = Path(path)
    try:
        lines = path.read_bytes().split(b"\n")
    except OSError as error:
        raise InputError(f"Cannot read the journal {path}: {error.strerror}. Check the path.") from error
    parsed: list[dict[str, Any]] = []
    cut: list[str] = []
    for number, line in enumerate(lines):
        if not line:
            continue
        last = number == len(lines) - 1
        try:
            values = json.loads(line)
            if last or not isinstance(values, dict):
                raise ValueError
        except ValueError:
            following = next((x for x in lines[number + 1 :] if x), b"")
            # A cut line is the last one, or is followed by the mark that a resume left behind it.
            if not last and b'"resumed"' not in following:
                raise InputError(
                    f"{path}, line {number + 1} is not a journal entry. The file was edited or damaged: look at the "
                    "cell and start a new journal."
                ) from None
            cut.append(line.decode(errors="replace"))
            continue
        parsed.append(values)
    if not parsed or parsed[0].get("format") != JOURNAL.name:
        raise InputError(f"{path} is not a journal of this program. Give the file that `execute` named.")
    JOURNAL.current(parsed[0], str(path))
    finished, open_step = _progress(parsed[1:])
    return Record(
        path=path,
        plan_sha256=str(parsed[0].get("plan_sha256")),
        plan_file=str(parsed[0].get("plan", "")),
        robot=str(parsed[0].get("robot")),
        finished=tuple(sorted(finished)),
        unfinished=open_step,
        events=tuple(parsed[1:]),
        truncated="\n".join(cut) if cut else None,
    )


def next_step(record: Record, plan: Plan, resolution: tuple[str, Resolution] | None) -> int:
    """Return the step to go on with (`len(plan.steps)` when all are done).

    Nothing is repeated by itself: with an unfinished step InputError asks for `resolution`, the part's name and what
    a person found. A resolution of anything but that part is refused.
    """
    if record.unfinished is None:
        if resolution is not None:
            raise InputError(f"No step is unfinished in {record.path}; leave out '{resolution[0]}={resolution[1]}'.")
        return max(record.finished, default=-1) + 1
    part = plan.steps[record.unfinished].part
    if resolution is None:
        raise InputError(
            f"Step {record.unfinished} ({part}) was begun and not finished; last: {record.last_status or 'no motion'}. "
            f"Look at the cell, then resume with --resolve {part}=placed (it stands where it belongs) or "
            f"--resolve {part}=repeat (part back in its tray, gripper empty)."
        )
    if resolution[0] != part:
        raise InputError(f"--resolve names '{resolution[0]}'; the unfinished step is {part}.")
    return record.unfinished + (1 if resolution[1] == "placed" else 0)


def _progress(events: list[dict[str, Any]]) -> tuple[set[int], int | None]:
    finished: set[int] = set()
    begun: int | None = None
    for event in events:
        step = event.get("step")
        if not isinstance(step, int):
            continue
        if event.get("event") == "step_started":
            begun = step
        elif event.get("event") in ("step_finished", "resolved_placed"):
            finished.add(step)
            begun = None
        elif event.get("event") == "resolved_repeat":
            begun = None
    return finished, begun


def _sync_folder(folder: Path) -> None:
    """Make a new file's name durable, not only its contents."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
