"""Benchmarks run as commands: one row a measurement, a peer's failure is a row, the cases are what they claim."""

from __future__ import annotations

import json
import math
import re
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.cases import KINDS, wall
from benchmarks.contacts import box_wall
from benchmarks.growth import STRUCTURES
from benchmarks.measurement import Measurement, ToolAnswer, measure
from benchmarks.page import chapters_of, write_page
from benchmarks.profile import profile
from benchmarks.store import changes, keep, read
from mocca_robot.contacts.find import find_contacts

KEYS = {"bench", "case", "tool", "seconds", "repeats", "verdict", "kkt", "memory_mb"}


@pytest.mark.parametrize(
    ("bench", "case"),
    [("statics", "stack-10-planar"), ("friction", "arch"), ("states", "ring03"), ("contacts", "wall-20")],
)
def test_every_line_is_a_row(bench: str, case: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([bench, "--case", case, "--json"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert all(set(row) == KEYS for row in rows)
    ours = next(row for row in rows if row["tool"] == "ours")
    assert ours["bench"] == bench
    assert ours["kkt"] < 1e-8
    assert ours["seconds"] > 0 and ours["memory_mb"] > 0


def test_a_sample_without_its_peer_is_told_and_one_with_its_answer_is_decided(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MOCCA_COMPAS_PYTHON", raising=False)
    assert main(["samples", "--case", "cubes"]) == 0
    assert "not tried: run make compas" in capsys.readouterr().out
    square = [[x, y, 0.0] for x in (0.0, 1.0) for y in (0.0, 1.0)]
    found = {
        "seconds": 1.0, "verdict": "no answer (solve failed)", "pairs": [[0, 1]] * 4, "points": square,
        "normals": [[0.0, 0.0, 1.0]] * 4, "centres": [[0.5, 0.5, -0.5], [0.5, 0.5, 0.5]], "weights": [1.0, 1.0],
        "fixed": [0],
    }  # fmt: skip
    monkeypatch.setenv("MOCCA_COMPAS_PYTHON", "python")
    monkeypatch.setattr("benchmarks.samples._asked", lambda python, sample: found)
    assert main(["samples", "--case", "cubes", "--json"]) == 0
    theirs, ours = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert theirs["verdict"] == "no answer (solve failed); WRONG"
    assert ours["verdict"] == "stands" and ours["kkt"] < 1e-8


def test_an_unknown_case_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["statics", "--case", "pyramid"]) == 2
    assert "pyramid" in capsys.readouterr().err


def test_a_tool_that_fails_or_hangs_is_a_row() -> None:
    def broken() -> ToolAnswer:
        raise ValueError("no such thing")

    def endless() -> ToolAnswer:
        time.sleep(60)
        return ToolAnswer("never")

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


def row(case: str, tool: str, seconds: float, verdict: str = "holds; 20 parts, 30 joints") -> Measurement:
    return Measurement(
        bench="growth",
        case=case,
        tool=tool,
        seconds=seconds,
        repeats=1,
        verdict=verdict,
        kkt=math.nan,
        memory_mb=100.0 + seconds,
    )


def test_rows_are_kept_and_merged_by_case_and_tool(tmp_path: Path) -> None:
    keep("growth", [row("dome-50", "ours", 1.0), row("dome-100", "ours", 2.0)], False, tmp_path)
    path = keep("growth", [row("dome-100", "ours", 3.0)], False, tmp_path, merge=True)
    run = read(path)
    assert run is not None and {(r.case, r.seconds) for r in run.rows} == {("dome-50", 1.0), ("dome-100", 3.0)}
    assert math.isnan(run.rows[0].kkt)  # null in the file
    path.write_text("{", encoding="utf-8")
    assert read(path) is None


def test_only_what_is_slower_beyond_noise_or_answers_otherwise_is_reported(tmp_path: Path) -> None:
    old = [row("a-1", "ours", 1.0), row("b-1", "ours", 0.001), row("c-1", "ours", 1.0), row("d-1", "piqp", 1.0)]
    before = read(keep("growth", old, True, tmp_path))
    new = [row("a-1", "ours", 1.4), row("b-1", "ours", 0.009), row("c-1", "ours", 1.0), row("d-1", "piqp", 9.0)]
    assert changes(new, before) == []
    slow = changes([row("a-1", "ours", 1.6), row("c-1", "ours", 0.5, "falls short; 20 parts")], before)
    assert ["SLOWER 1.6×" in slow[0].words(), "falls short" in slow[1].words()] == [True, True]
    assert changes(new, None) == []


def test_the_page_has_a_chapter_per_benchmark_that_was_run(tmp_path: Path) -> None:
    sizes = (50, 100, 200, 400)
    rows = [row(f"dome-{n}", "ours", 1e-3 * n**1.5, f"holds; {n} parts, {2 * n} joints") for n in sizes]
    keep("growth", rows, False, tmp_path)
    keep(
        "profile",
        [
            Measurement(
                bench="profile",
                case="deer",
                tool="statics",
                seconds=0.1,
                repeats=1,
                verdict="50% of 0.2 s",
                kkt=math.nan,
                memory_mb=math.nan,
            )
        ],
        False,
        tmp_path,
    )
    text = write_page(tmp_path, tmp_path).read_text(encoding="utf-8")
    assert re.findall("^## (.*)$", text, re.MULTILINE) == [
        "Growth",
        "Where the time goes",
        "Not measured for this page",
    ]
    assert "`python -m benchmarks friction --keep`" in text
    assert "| dome | 50 – 400 | 1.50 |" in text
    for figure in re.findall(r"\((figures/\S+\.svg)\)", text):
        assert ET.parse(tmp_path / figure).getroot().tag.endswith("svg")


def test_chapters_that_were_not_measured_here_stay(tmp_path: Path) -> None:
    there, here = tmp_path / "there", tmp_path / "here"
    for name in ("growth", "friction"):
        keep(name, [row("dome-50", "ours", 1.0, "holds; 50 parts, 100 joints")], False, there)
    keep("growth", [row("dome-60", "ours", 2.0, "holds; 60 parts, 120 joints")], False, here)
    before = chapters_of(write_page(tmp_path, there).read_text(encoding="utf-8"))
    after = chapters_of(write_page(tmp_path, here).read_text(encoding="utf-8"))
    assert after["Statics with friction"] == before["Statics with friction"]
    assert "dome-60" in after["Growth"] and "dome-50" not in after["Growth"]
    assert after.keys() == before.keys()


def test_the_profile_shares_out_all_time() -> None:
    rows = list(profile(quick=True))
    assert sum(r.seconds for r in rows) > 0
    assert {"statics", "joint geometry"} <= {r.tool for r in rows}
    assert sum(float(r.verdict.partition("%")[0]) for r in rows) == pytest.approx(100.0, abs=len(rows))


def test_structures_grow_as_asked() -> None:
    for size in (50, 200):
        for make in STRUCTURES.values():
            assert len(make(size).parts) == pytest.approx(size, rel=0.12)
