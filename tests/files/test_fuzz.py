"""Broken and hostile inputs of every kind end in a verdict or a clear error: never a traceback, never a stray file."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from fuzzing import Case, cases, hostile, outcome

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
SECONDS = 20
"""Processor time that one input may take."""


def look(given: list[Case] | object, guarded: Path) -> list[str]:
    """Return what went wrong, for each input that did not end as it should, and files written beside the sandbox."""
    wrong = []
    for case in given:  # type: ignore[attr-defined]
        if said := outcome(case, SECONDS):
            wrong.append(f"{case.what}: {case.arguments}\n{said}")
    strays = [str(p) for p in guarded.iterdir() if p.name != "inside"]
    return wrong + [f"written outside: {s}" for s in strays]


@pytest.fixture
def inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder three levels deep to run in: what climbs out of it lands where it is seen."""
    folder = tmp_path / "guarded" / "inside" / "a" / "b"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    return folder


def guarded(inside: Path) -> Path:
    return inside.parents[2]


@pytest.mark.parametrize("seed", [11])
def test_broken_files_end_in_a_verdict_or_an_error(seed: int, inside: Path) -> None:
    assert look(cases(inside / "c", seed, 76), guarded(inside)) == []


@pytest.mark.long
@pytest.mark.parametrize("seed", [21, 22, 23])
def test_a_thousand_broken_files_end_in_a_verdict_or_an_error(seed: int, inside: Path) -> None:
    assert look(cases(inside / "c", seed, 1000), guarded(inside)) == []


@pytest.mark.long
def test_hostile_inputs_end_in_an_error(inside: Path) -> None:
    assert look(hostile(inside / "h"), guarded(inside)) == []
    assert not os.path.exists("/tmp/owned")
    assert list(guarded(inside).rglob("owned*")) == []
