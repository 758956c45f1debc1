"""A study's rows as study.json and study.csv, for other programs."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mocca_robot.files.output import write_atomic, write_json
from mocca_robot.files.versions import STUDY
from sim.studies.run import StudyResult


def columns(result: StudyResult) -> tuple[str, ...]:
    """Return the names of all figures that some row has, in the order of their first appearance; 'seconds' last."""
    known = dict.fromkeys(name for row in result.rows if row is not None for name in row)
    return (*(n for n in known if n != "seconds"), "seconds")


def study_data(result: StudyResult) -> dict[str, Any]:
    """Return the study as plain JSON values; a point that was not computed has the status 'not computed'."""
    study = result.study
    return {
        "format": STUDY.name,
        "version": STUDY.version,
        "name": study.name,
        "base": str(study.base),
        "vary": {k: list(v) for k, v in study.vary.items()},
        "set": dict(study.fixed),
        "combine": study.combine,
        "stages": list(study.stages),
        "interrupted": result.interrupted,
        "points": [
            {"values": dict(point.values), **(row or {"status": "not computed", "reason": "", "seconds": None})}
            for point, row in zip(study.points, result.rows)
        ],
    }


def write_study(result: StudyResult, folder: Path) -> dict[str, Path]:
    """Return the files of a study: study.json and study.csv, each written whole or not at all."""
    data = study_data(result)
    return {
        "study": write_json(folder / "study.json", data),
        "table": write_atomic(folder / "study.csv", table_text(result)),
    }


def table_text(result: StudyResult) -> str:
    """Return the table as CSV: the varied keys, then every figure; lists and mappings as JSON."""
    keys, names = tuple(result.study.vary), columns(result)
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*keys, *names])
    for point in study_data(result)["points"]:
        writer.writerow(_cells([point["values"][k] for k in keys]) + _cells([point.get(n) for n in names]))
    return stream.getvalue()


def _cells(values: Sequence[Any]) -> list[Any]:
    return [
        json.dumps(v) if isinstance(v, list | dict) else "" if v is None else repr(v) if isinstance(v, float) else v
        for v in values
    ]
