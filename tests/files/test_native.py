"""Native readers run apart, within limits that a damaged file meets soon and a large one does not."""

from __future__ import annotations

from pathlib import Path

import pytest

from mocca_robot.errors import InputError
from mocca_robot.files.native import MOST_SECONDS, allowed_seconds, read_apart


def test_larger_files_may_take_longer_up_to_a_limit(tmp_path: Path) -> None:
    path = tmp_path / "parts"
    allowed = []
    for size in (0, 10**6, 2 * 10**7, 10**9):
        with path.open("wb") as file:
            file.truncate(size)
        allowed.append(allowed_seconds("3dm", path))
        assert allowed_seconds("step", path) == MOST_SECONDS
    assert allowed == sorted(set(allowed)) and allowed[0] <= 5.0 and allowed[-1] == MOST_SECONDS


@pytest.mark.parametrize("does", ["while True: pass", "raise SystemExit(3)", "import os; os.abort()"])
def test_a_reader_that_stays_busy_or_dies_is_an_error(
    does: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_reader.py").write_text(f"def converted(path):\n    {does}\n", encoding="utf-8")
    (tmp_path / "a.3dm").write_bytes(b"3D")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(InputError, match=r"a\.3dm' cannot be read as 3DM.*Export it again"):
        read_apart("3dm", tmp_path / "a.3dm", "broken_reader")
