"""Whole builds: designed, planned, rehearsed in MuJoCo, and executed by the real client on a fake controller.

Seconds are wall time of one run. A fake controller runs four times as fast as a robot would.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.measurement import Measurement, peak_memory_mb

if TYPE_CHECKING:
    from mocca_robot.plan.plan import Plan

ROOT = Path(__file__).resolve().parents[1]
FLAT = (
    *("scarecrow", "stack", "tree", "m", "leaning_tower_10", "leaning_tower_20", "leaning_tower_30"),
    *("leaning_tower_support_free", "deer"),
)
SOLID = {"sphere": 0.14, "horse": 0.3, "pavilion": 0.6}
"""Solids are held by a cup at these sizes, metres."""
CRADLED = ("pavilion",)
"""What falls while it is built lies in cradles here, and is held where it was let go elsewhere: along a ring of spars
errors would double from one to the next."""
SPEEDUP = 4.0
HOST = "127.77.0.1"


def builds(quick: bool, only: str | None) -> Iterator[Measurement]:
    """Yield up to three rows per configuration: plan, rehearse, execute. Quick: the scarecrow, not executed."""
    for name in FLAT[:1] if quick else (*FLAT, *SOLID):
        if only is None or only in name:
            with tempfile.TemporaryDirectory() as folder:
                yield from _build(name, Path(folder), execute=not quick)


def _build(name: str, folder: Path, *, execute: bool) -> Iterator[Measurement]:
    from mocca_robot.config.config import load
    from mocca_robot.files.design_json import read_design, write_design
    from mocca_robot.plan.plan import write_plan
    from mocca_robot.plan.reader import file_sha256, read_plan
    from planners.cone_joints.designer import design
    from planners.robot.build_plan import build_plan
    from planners.robot.cell import read_cell
    from sim.cell.rehearsal import rehearse

    config = load(ROOT / "configs" / f"{name}.yaml")
    file = write_design(design(config.assembly, config.joints, insertion=config.insertion).design, folder)
    stored = read_design(file)
    cell = read_cell(ROOT / "configs" / "cells" / ("ur10e_suction.yaml" if name in SOLID else "ur5e_2f85.yaml"))
    if name in SOLID:
        cell = replace(cell, build_size_m=SOLID[name])
    started = time.perf_counter()
    sha = file_sha256(file)
    built = build_plan(stored, cell, sha)
    held = tuple(dict.fromkeys(m for f in built.falls for m in f.moving))
    if held:
        built = build_plan(stored, cell, sha, supports=held, cradles=held if name in CRADLED else ())
    seconds = time.perf_counter() - started
    if built.plan is None:
        last = built.reports[-1] if built.reports else None
        reason = f"{last.part}: {last.reasons}" if last else f"out of reach: {', '.join(built.out_of_reach)}"
        yield _row(name, "plan", seconds, f"no plan: {reason[:80]}")
        return
    how = "in cradles" if name in CRADLED else "supported"
    yield _row(name, "plan", seconds, f"{len(built.plan.steps)} parts, {len(held)} {how}")
    write_plan(built.plan, folder / "plan.json")
    plan = read_plan(folder / "plan.json")
    result = rehearse(plan, stored)
    placed = sum(p.succeeded for p in result.parts)
    whole = "not reached" if result.whole is None else result.whole.reason
    word = "built" if result.succeeded else f"{placed} placed"
    yield _row(name, "rehearse", result.seconds, f"{word}, {result.simulated_s:.0f} s; {whole}")
    if execute:
        yield _execution(name, plan, folder)


def _execution(name: str, plan: Plan, folder: Path) -> Measurement:
    from mocca_robot.plan.executor import execute
    from mocca_robot.plan.journal import Journal
    from mocca_robot.plan.person import Everybody
    from mocca_robot.ur.driver import UrArm

    started = time.perf_counter()
    with (
        _fake(folder / "plan.json", plan),
        UrArm(HOST, plan, plan.cell.serial or SERIAL) as arm,
        Journal.create(folder / "journal", plan, arm.name) as journal,
    ):
        result = execute(plan, arm, journal, person=Everybody())
    where = "" if result.status == "succeeded" else f" at {result.last.part} ({result.last.kind}): {result.detail}"
    verdict = f"{result.status}, {result.steps_finished} of {len(plan.steps)} parts{where}"
    return _row(name, "execute (fake)", time.perf_counter() - started, verdict)


SERIAL = "20265500001"


@contextlib.contextmanager
def _fake(plan_file: Path, plan: Plan) -> Iterator[None]:
    command = [sys.executable, "-m", "mocca_robot.ur.fake", "--host", HOST, "--plan", str(plan_file)]
    command += ["--speedup", str(SPEEDUP), "--serial", plan.cell.serial or SERIAL]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=ROOT)
    try:
        assert process.stdout is not None
        first = process.stdout.readline()
        if "serving" not in first:
            raise RuntimeError(f"the fake controller does not serve: {first}")
        yield
    finally:
        process.terminate()
        process.wait(10)


def _row(case: str, tool: str, seconds: float, verdict: str) -> Measurement:
    memory = peak_memory_mb()
    return Measurement(
        bench="builds",
        case=case,
        tool=tool,
        seconds=seconds,
        repeats=1,
        verdict=verdict,
        kkt=float("nan"),
        memory_mb=memory,
    )
