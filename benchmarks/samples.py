"""The published samples of compas_cra, with their own friction: its verdict and ours on the contacts that it finds.

Needs an interpreter that has compas_cra (`make compas`); without one no sample is tried.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.contacts import COMPAS_PYTHON
from benchmarks.measurement import Measurement
from mocca_robot.statics.coulomb import standing
from mocca_robot.statics.friction_verdict import FrictionVerdict
from mocca_robot.statics.frictional_contacts import FrictionalContacts

LIMIT_S = 60.0
REPEATS = 5
COARSE, FINE = {"nmax": 10, "amin": 1e-2, "tmax": 1e-2}, {"amin": 1e-6, "tmax": 1e-4}
ALONG_Y, ALONG_X, OFF_X = (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (math.sqrt(3.0), 1.0, 0.0)
WIDE = {"d_bnd": 1e-1, "eps": 0.0}


@dataclass(frozen=True, kw_only=True)
class Sample:
    """A sample as its published script asks for it.

    Attributes:
        sample: its file, without the ending.
        stands: what is right, found by at least two independent ways.
        fixed: its supports.
        friction, density: as in the script.
        axis, deg: how the script turns it.
        detect: how contacts are looked for; empty where the file has them.
        options: of compas_cra's solver.
        heavy: densities by block.
    """

    sample: str
    stands: bool
    fixed: tuple[int, ...] = (0,)
    friction: float = 0.84
    density: float = 1.0
    axis: tuple[float, float, float] = ALONG_Y
    deg: float = 0.0
    detect: Mapping[str, float] = field(default_factory=lambda: COARSE)
    options: Mapping[str, float] = field(default_factory=dict)
    heavy: Mapping[str, float] = field(default_factory=dict)


def _wedge(kind: str, stands: bool, axis: tuple[float, float, float] = ALONG_Y, deg: float = 0.0) -> Sample:
    return Sample(sample=f"type-{kind}", stands=stands, fixed=(0, 1), axis=axis, deg=deg, options={"d_bnd": 1e-2})


def _concave(length: str, deg: float, stands: bool) -> Sample:
    options = {"d_bnd": 1e-2, "eps": 1e-3}
    return Sample(sample=f"concave-{length}", stands=stands, deg=deg, detect={}, options=options)


def _curved(sample: str) -> Sample:
    return Sample(sample=sample, stands=True, density=0.1, detect={})


def _shelf(stage: str, stands: bool) -> Sample:
    return Sample(
        sample=f"shelf{stage}", stands=stands, friction=0.9, detect=FINE, options={"d_bnd": 1e-1, "eps": 1e-3}
    )


SAMPLES: dict[str, Sample] = {
    "cubes": Sample(sample="cubes", stands=True),
    "type-a": _wedge("a", True),
    "type-a, turned about y": _wedge("a", True, ALONG_Y, 90.0),
    "type-a, turned about x": _wedge("a", False, ALONG_X, 90.0),
    "type-a, turned 30° off x": _wedge("a", False, OFF_X, 90.0),
    "type-b": _wedge("b", True),
    "type-b, turned about y": _wedge("b", True, ALONG_Y, 90.0),
    "type-b, turned about x": _wedge("b", False, ALONG_X, 90.0),
    "type-b, turned 30° off x": _wedge("b", False, OFF_X, 90.0),
    "type-c": _wedge("c", True),
    "type-c, turned about y": _wedge("c", False, ALONG_Y, 90.0),
    "type-c, turned about x": _wedge("c", False, ALONG_X, 90.0),
    "type-c, turned 30° off x": _wedge("c", False, OFF_X, 90.0),
    "A": Sample(sample="A", stands=False, fixed=(0, 1)),
    "H": Sample(sample="H", stands=False, fixed=(0, 1)),
    "shelf-stable": _shelf("-stable", True),
    "shelf": _shelf("", False),
    **{f"shelf-{s}": _shelf(f"-{s}", False) for s in ("s1", "s2", "s3")},
    "snake": Sample(sample="snake", stands=True, friction=0.7, detect={"amin": 1e-4, "tmax": 1e-2}, options=WIDE),
    "bridge": Sample(
        sample="bridge", stands=True, fixed=(0, 1), friction=0.9, detect=FINE, options=WIDE,
        heavy={str(n): 3.51 for n in range(11, 16)},
    ),
    "concave-short, 40°": _concave("short", 40.0, True),
    "concave-short, 50°": _concave("short", 50.0, False),
    "concave-long, 40°": _concave("long", 40.0, True),
    "concave-long, 50°": _concave("long", 50.0, True),
    **{name: _curved(name) for name in ("cube-curve-short", "cube-curve-tall", "curve-3-blocks")},
}  # fmt: skip
"""The published samples by name, with what is right."""


def samples(quick: bool = False, only: str | None = None) -> Iterator[Measurement]:
    """Yield compas_cra's row and ours for every sample; the small ones only when `quick`."""
    python = os.environ.get(COMPAS_PYTHON)
    for name, sample in SAMPLES.items():
        if (only and only not in name) or (quick and "curve" in name):
            continue
        if not python:
            yield _row(name, "compas_cra", math.nan, 0, "not tried: run make compas")
            continue
        answer = _asked(python, sample)
        if "pairs" not in answer:
            yield _row(name, "compas_cra", LIMIT_S, 0, answer["verdict"])
            continue
        yield _row(name, "compas_cra", answer["seconds"], 1, _judged(answer["verdict"], sample))
        found, seconds = _ours(answer, sample)
        verdict = _judged("stands" if found.stands else found.standing.value.replace("_", " "), sample)
        yield _row(name, "ours", seconds, REPEATS, verdict, found.complementarity)


def _asked(python: str, sample: Sample) -> dict[str, Any]:
    """Return what the peer says about a sample, and the contacts that it found."""
    script = Path(__file__).with_name("samples_peer.py")
    asked = json.dumps(asdict(sample))
    try:
        done = subprocess.run(
            [python, str(script)], input=asked, capture_output=True, text=True, timeout=LIMIT_S, check=True
        )
        return dict(json.loads(done.stdout.splitlines()[-1]))
    except subprocess.TimeoutExpired:
        return {"verdict": "timeout"}
    except subprocess.CalledProcessError as error:
        return {"verdict": f"failed: {(error.stderr.strip().splitlines() or [''])[-1][:80]}"}


def _ours(answer: Mapping[str, Any], sample: Sample) -> tuple[FrictionVerdict, float]:
    """Return our verdict on the contacts in a peer's answer, and the CPU seconds that it takes."""
    centres, weights = np.array(answer["centres"]), np.array(answer["weights"])
    free = np.ones(len(centres), dtype=np.bool_)
    free[answer["fixed"]] = False
    push = np.column_stack([0.0 * weights, 0.0 * weights, -weights])
    wrenches = np.column_stack([push, np.cross(centres, push)])
    times = []
    for _ in range(REPEATS):
        begin = time.process_time()
        contacts = FrictionalContacts.of(
            np.array(answer["pairs"]), np.array(answer["points"]), np.array(answer["normals"]), free,
            sample.friction, about=centres,
        )  # fmt: skip
        found = standing(contacts, wrenches)
        times.append(time.process_time() - begin)
    return found, float(np.median(times))


def _judged(verdict: str, sample: Sample) -> str:
    right = verdict == "stands" if sample.stands else verdict in ("falls", "stands only clamped")
    silent = verdict.startswith("no answer")
    wrong = "" if right or (silent and not sample.stands) else "; WRONG"
    return f"{verdict}{wrong}"


def _row(case: str, tool: str, seconds: float, repeats: int, verdict: str, kkt: float = math.nan) -> Measurement:
    return Measurement(
        bench="samples", case=case, tool=tool, seconds=seconds, repeats=repeats, verdict=verdict, kkt=kkt,
        memory_mb=math.nan,
    )  # fmt: skip
