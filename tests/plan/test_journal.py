"""The journal: what is on the disk survives anything, and no step is repeated by itself."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import pytest
from ur_cell import small_plan

from mocca_robot.errors import InputError
from mocca_robot.plan.journal import Journal, JournalLost, next_step, read_journal, utc_now
from mocca_robot.plan.plan import Plan
from mocca_robot.plan.status import ExecutionEvent, ExecutionStatus

PLAN = small_plan(2)
OTHER = small_plan(1)


def event(name: str, step: int | None = None) -> ExecutionEvent:
    part = None if step is None else PLAN.steps[step].part
    status = ExecutionStatus.JAMMED
    return ExecutionEvent(
        time_utc=utc_now(), event=name, step=step, part=part, status=status, detail="stuck", q=(0.1,) * 6
    )


def written(path: Path, *events: ExecutionEvent, plan: Plan = PLAN) -> Path:
    with Journal.create(path, plan, "robot-1") as journal:
        for e in events:
            journal.append(e)
    return path


def test_events_are_read_back_in_order(tmp_path: Path) -> None:
    path = written(tmp_path / "j", event("step_started", 0), event("step_finished", 0), event("step_started", 1))
    record = read_journal(path)
    assert [e["event"] for e in record.events] == ["step_started", "step_finished", "step_started"]
    assert (record.finished, record.unfinished, record.robot) == ((0,), 1, "robot-1")
    assert record.plan_sha256 == PLAN.sha256
    assert record.last_status == "jammed (p02, step_started): stuck"


def test_each_line_is_on_the_disk_when_append_returns(tmp_path: Path) -> None:
    with Journal.create(tmp_path / "j", PLAN, "r") as journal:
        for k in range(3):
            journal.append(event("step_started", 0))
            assert len(read_journal(tmp_path / "j").events) == k + 1


def test_line_cut_anywhere_is_reported_and_not_counted(tmp_path: Path) -> None:
    path = written(tmp_path / "j", event("step_started", 0), event("step_finished", 0))
    whole = path.read_bytes()
    last = whole.rstrip(b"\n").rfind(b"\n") + 1
    for cut in range(last + 1, len(whole)):
        path.write_bytes(whole[:cut])
        record = read_journal(path)
        assert record.truncated is not None
        assert (record.finished, record.unfinished) == ((), 0)


def test_resume_after_a_cut_line_keeps_it_as_evidence_and_stays_readable(tmp_path: Path) -> None:
    path = written(tmp_path / "j", event("step_started", 0), event("step_finished", 0))
    path.write_bytes(path.read_bytes()[:-20])
    journal, record = Journal.reopen(path, PLAN, "robot-1")
    with journal:
        journal.append(event("resumed"))
        journal.append(event("resolved_placed", 0))
    again = read_journal(path)
    assert again.truncated == record.truncated
    assert (again.finished, again.unfinished) == ((0,), None)


def test_damage_inside_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "j", event("step_started", 0), event("step_finished", 0))
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], lines[1][:10], lines[2]]) + "\n")
    with pytest.raises(InputError, match="line 2 is not a journal entry"):
        read_journal(path)


def test_other_files_and_versions_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("{}\n")
    with pytest.raises(InputError, match="not a journal"):
        read_journal(tmp_path / "a")
    (tmp_path / "b").write_text(json.dumps({"format": "mocca-robot/journal", "version": 9}) + "\n")
    with pytest.raises(InputError, match="version 9"):
        read_journal(tmp_path / "b")
    with pytest.raises(InputError, match="Cannot read"):
        read_journal(tmp_path / "c")


def test_journal_is_never_overwritten_and_never_continued_with_another_plan(tmp_path: Path) -> None:
    path = written(tmp_path / "j", event("step_started", 0))
    with pytest.raises(InputError, match="--resume"):
        Journal.create(path, PLAN, "r")
    with pytest.raises(InputError, match="another or an edited plan is never resumed"):
        Journal.reopen(path, OTHER, "robot-1")


def test_nothing_is_repeated_by_itself(tmp_path: Path) -> None:
    done = read_journal(written(tmp_path / "a", event("step_started", 0), event("step_finished", 0)))
    assert next_step(done, PLAN, None) == 1
    with pytest.raises(InputError, match="No step is unfinished"):
        next_step(done, PLAN, ("p01", "repeat"))
    begun = read_journal(written(tmp_path / "b", event("step_started", 0)))
    with pytest.raises(
        InputError, match=r"Step 0 \(p01\) was begun and not finished; last: jammed.*--resolve p01=placed"
    ):
        next_step(begun, PLAN, None)
    with pytest.raises(InputError, match="names 'p02'; the unfinished step is p01"):
        next_step(begun, PLAN, ("p02", "repeat"))
    assert next_step(begun, PLAN, ("p01", "placed")) == 1
    assert next_step(begun, PLAN, ("p01", "repeat")) == 0


def test_a_persons_resolution_settles_the_step(tmp_path: Path) -> None:
    record = read_journal(written(tmp_path / "j", event("step_started", 0), event("resolved_placed", 0)))
    assert (record.finished, record.unfinished) == ((0,), None)
    record = read_journal(written(tmp_path / "k", event("step_started", 0), event("resolved_repeat", 0)))
    assert next_step(record, PLAN, None) == 0


@pytest.mark.parametrize("fits", range(0, 120, 7))
@pytest.mark.parametrize("fails", ["write", "fsync"])
def test_a_line_is_on_the_disk_whole_or_it_was_never_there(
    fits: int, fails: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that fills up takes the beginning of a line without a word; the next write is an error."""
    whole, room, sync = os.write, [fits], os.fsync

    def write(descriptor: int, data: bytes) -> int:
        if fails == "fsync":
            return whole(descriptor, data[:7])
        if room[0] == 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        count = whole(descriptor, data[: room[0]])
        room[0] -= count
        return count

    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with Journal.create(tmp_path / "j", PLAN, "robot-1") as journal:
        journal.append(event("step_started", 0))
        before = (tmp_path / "j").read_bytes()
        monkeypatch.setattr(os, "write", write)
        if fails == "fsync":
            monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(JournalLost, match="No space left"):
            journal.append(event("move_started", 0))
        monkeypatch.setattr(os, "write", whole)
        monkeypatch.setattr(os, "fsync", sync)
        assert (tmp_path / "j").read_bytes() == before
        journal.append(event("step_finished", 0))
    assert read_journal(tmp_path / "j").finished == (0,)


def test_a_journal_that_cannot_be_begun_leaves_no_file_that_would_block_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(JournalLost, match="cannot be written"):
        Journal.create(tmp_path / "j", PLAN, "robot-1")
    assert not (tmp_path / "j").exists()


def test_a_journal_of_another_robot_is_not_continued(tmp_path: Path) -> None:
    path = written(tmp_path / "j", event("step_started", 0), event("step_finished", 0))
    before = path.read_bytes()
    with pytest.raises(InputError, match="begun on robot robot-1, and this is robot robot-2"):
        Journal.reopen(path, PLAN, "robot-2")
    assert path.read_bytes() == before
