"""Measurements kept by machine in out/bench/, so that a later run can be compared and a page written from them."""

from __future__ import annotations

import json
import math
import os
import platform
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from benchmarks.measurement import Measurement
from mocca_robot.runtime.machine import processor

FOLDER = Path(__file__).parents[1] / "out" / "bench"
NOISE_RATIO, NOISE_S = 1.5, 0.02
"""Slower by this factor and by this many seconds: less is what the same programme shows on a shared machine."""
PACKAGES = ("mocca-robot", "numpy", "scipy", "shapely", "mujoco", "clarabel", "piqp", "daqp", "osqp", "qpalm", "numba")


@dataclass(frozen=True)
class Run:
    """Rows of one benchmark with when, where and with which versions they were measured."""

    bench: str
    rows: tuple[Measurement, ...]
    about: dict[str, str]


def about_here() -> dict[str, str]:
    """Return date, machine and versions; 'load' is the number of other processes that wanted a core at the end."""
    found = {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "machine": f"{processor()}, {os.cpu_count()} cores",
        "system": f"{platform.system()} {platform.release()}, Python {platform.python_version()}",
        "load": f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown",
    }
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def machine_key() -> str:
    """Return a name of this machine for files: its processor and number of cores."""
    return re.sub(r"[^a-z0-9]+", "-", f"{processor()}-{os.cpu_count()}".lower()).strip("-")[:80]


def path_of(bench: str, quick: bool, folder: Path = FOLDER) -> Path:
    """Return where a benchmark's last run on this machine is kept."""
    return folder / machine_key() / f"{bench}{'-quick' if quick else ''}.json"


def keep(bench: str, rows: Sequence[Measurement], quick: bool, folder: Path = FOLDER, merge: bool = False) -> Path:
    """Return the file after writing a run there; with `merge` rows of other cases and tools stay."""
    path = path_of(bench, quick, folder)
    old = read(path) if merge else None
    fresh = {(r.case, r.tool) for r in rows}
    kept = [r for r in old.rows if (r.case, r.tool) not in fresh] if old is not None else []
    path.parent.mkdir(parents=True, exist_ok=True)
    data = {"bench": bench, "about": about_here(), "rows": [json.loads(r.json()) for r in (*kept, *rows)]}
    part = path.with_suffix(".part")
    part.write_text(json.dumps(data, indent=1), encoding="utf-8")
    return part.replace(path)


def read(path: Path) -> Run | None:
    """Return a kept run; None when there is none, or none that can be read."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        rows = tuple(Measurement(**{k: math.nan if v is None else v for k, v in row.items()}) for row in data["rows"])
        return Run(data["bench"], rows, data["about"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


@dataclass(frozen=True)
class Change:
    """A measurement that is slower than last time by more than noise, or says something else."""

    row: Measurement
    before: Measurement

    def words(self) -> str:
        """Return the change as a line."""
        where = f"{self.row.bench} {self.row.case}, {self.row.tool}"
        if slower(self.row, self.before):
            ratio = self.row.seconds / self.before.seconds
            return f"SLOWER {ratio:.1f}×  {where}: {self.before.seconds:.3g} s → {self.row.seconds:.3g} s"
        return f"CHANGED      {where}: '{self.before.verdict}' → '{self.row.verdict}'"


def slower(row: Measurement, before: Measurement) -> bool:
    """Return whether a row is slower than before by more than noise."""
    return row.seconds > NOISE_RATIO * before.seconds and row.seconds > before.seconds + NOISE_S


def changes(rows: Iterable[Measurement], before: Run | None) -> list[Change]:
    """Return what is slower beyond noise, and verdicts that differ, against the last run; peers are left out."""
    if before is None:
        return []
    known = {(r.case, r.tool): r for r in before.rows}
    found = []
    for row in rows:
        old = known.get((row.case, row.tool))
        if old is None or not row.tool.startswith("ours"):
            continue
        if slower(row, old) or _first_word(row) != _first_word(old):
            found.append(Change(row, old))
    return found


def _first_word(row: Measurement) -> str:
    return re.split(r"[;,]", row.verdict)[0]
