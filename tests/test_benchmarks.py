"""Benchmarks run as commands: one row a measurement, a peer's failure is a row, the cases are what they claim."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.cases import KINDS, wall
from benchmarks.contacts import box_wall
from benchmarks.measurement import Outcome, measure
from mocca_robot.contacts import find_contacts

KEYS = {"bench", "case", "tool", "seconds", "repeats", "verdict", "kkt", "memory_mb"}


@pytest.mark.parametrize(
    ("bench", "case"), [("statics", "stack-10-planar"), ("friction", "arch"), ("contacts", "wall-20")]
)
def test_every_line_is_a_row(bench: str, case: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([bench, "--case", case, "--json"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert all(set(row) == KEYS for row in rows)
    ours = next(row for row in rows if row["tool"] == "ours")
    assert ours["bench"] == bench
    assert ours["kkt"] < 1e-8
    assert ours["seconds"] > 0 and ours["memory_mb"] > 0


def test_an_unknown_case_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["statics", "--case", "pyramid"]) == 2
    assert "pyramid" in capsys.readouterr().err


def test_a_tool_that_fails_or_hangs_is_a_row() -> None:
    def broken() -> Outcome:
        raise ValueError("no such thing")

    def endless() -> Outcome:
        time.sleep(60)
        return Outcome("never")

    assert measure("b", "c", "t", broken).verdict.startswith("failed: ValueError: no such thing")
    assert measure("b", "c", "t", endless, limit_s=0.3).verdict == "timeout"


@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("samples", [0, 10])
def test_cases_are_sound(kind: str, samples: int) -> None:
    case = KINDS[kind](24, samples)
    per_contact = samples or 4
    assert len(case.pairs) % per_contact == 0
    assert np.linalg.norm(case.normals, axis=1) == pytest.approx(1.0)
    # Normals point from i into j, the ground lies below everything.
    i, j = case.pairs.T
    towards = case.centroids[j] - case.centroids[i]
    inner = case.free[i] & case.free[j]
    assert ((towards * case.normals).sum(axis=1)[inner] > 0).mean() > 0.95


def test_walls_have_the_contacts_that_are_counted() -> None:
    assembly, expected = box_wall(150)
    assert expected == 411
    assert len(find_contacts(assembly).contacts) == 411
    assert len(wall(150).pairs) == 411 * 4
