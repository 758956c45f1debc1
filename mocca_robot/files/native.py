"""Formats that native libraries read, each file in a process of its own: what a damaged one does to them ends there."""

from __future__ import annotations

import importlib
import importlib.util
import io
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.errors import EnvironmentNeeded, InputError, MoccaError

MOST_SECONDS, MEMORY = 240.0, 8 * 1024**3
"""What reading one file may take: processor time, and address space where the system can limit it."""
SECONDS = {"step": (MOST_SECONDS, 0.0), "3dm": (5.0, 3.0)}
"""Processor time for any file, and more per MB. Curved solids of STEP files are cut into triangles, however short the
file; 3DM files hold triangles, which take 0.7 s per MB, and damaged ones keep the reader busy for ever."""
ROOT = Path(__file__).parents[2]

Piece = tuple[str, Array, IntArray]


def require_package(package: str, extra: str, path: Path, instead: str) -> None:
    """Raise EnvironmentNeeded, with the line that installs it, where a package is missing."""
    if importlib.util.find_spec(package) is None:
        raise EnvironmentNeeded(
            f"'{path}' needs the package {package}: pip install 'mocca-robot[{extra}]'. Or use {instead}."
        )


def read_apart(kind: str, path: Path, module: str) -> bytes:
    """Return what `module.converted(path)` gives in a process of its own, for a file of `kind`, 'step' or '3dm'.

    Raises InputError if it fails.
    """
    told = f"'{path}' cannot be read as {kind.upper()}"
    with tempfile.TemporaryDirectory(prefix="mocca-read-") as folder:
        out = Path(folder) / "out"
        command = [sys.executable, "-m", "mocca_robot.files.native", kind, str(path.resolve()), str(out), module]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
        limit = 3.0 * allowed_seconds(kind, path)  # for a busy machine: processor time ends it sooner
        try:
            done = subprocess.run(command, capture_output=True, timeout=limit, env=environment, check=False)
        except subprocess.TimeoutExpired:
            raise InputError(
                f"{told} in {limit:.0f} s; it may be damaged. Export it again, with fewer parts."
            ) from None
        said = out.with_suffix(".error")
        if said.is_file():
            raise InputError(said.read_text(encoding="utf-8").replace(str(path.resolve()), str(path)))
        if done.returncode != 0 or not out.is_file():
            raise InputError(f"{told}: its reader gave up; the file is damaged or too large. Export it again.")
        return out.read_bytes()


def allowed_seconds(kind: str, path: Path) -> float:
    """Return the processor time that reading a file of `kind` may take: more for a larger one."""
    least, per_mb = SECONDS[kind]
    return min(least + per_mb * path.stat().st_size / 1e6, MOST_SECONDS)


def packed(pieces: list[Piece], unit: float | None, notes: list[str]) -> bytes:
    """Return pieces as the bytes of an archive that `unpacked` reads."""
    head = json.dumps({"names": [p[0] for p in pieces], "unit": unit, "notes": notes})
    arrays: dict[str, Any] = {f"{letter}{k}": p[n] for k, p in enumerate(pieces) for n, letter in ((1, "v"), (2, "f"))}
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, head=np.frombuffer(head.encode("utf-8"), dtype=np.uint8), **arrays)
    return stream.getvalue()


def unpacked(content: bytes) -> tuple[list[Piece], float | None, list[str]]:
    """Return the pieces, metres per unit and notes that `packed` was given."""
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        head = json.loads(arrays["head"].tobytes().decode("utf-8"))
        pieces = [(name, arrays[f"v{k}"], arrays[f"f{k}"]) for k, name in enumerate(head["names"])]
    return pieces, head["unit"], head["notes"]


def _limit(kind: str, path: Path) -> None:
    try:
        import resource
    except ImportError:  # Windows
        return
    seconds = math.ceil(allowed_seconds(kind, path))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    if sys.platform == "linux":
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


if __name__ == "__main__":
    _limit(sys.argv[1], Path(sys.argv[2]))
    target = Path(sys.argv[3])
    try:
        target.write_bytes(importlib.import_module(sys.argv[4]).converted(Path(sys.argv[2])))
    except MoccaError as error:
        target.with_suffix(".error").write_text(str(error), encoding="utf-8")
