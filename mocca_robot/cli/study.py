"""`mocca-robot study`: one configuration at many values, on all cores or a cluster → table, figures, page."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode, positive_if
from mocca_robot.errors import InputError

if TYPE_CHECKING:
    from sim.studies.run import StudyResult

SHOWN = 40
"""Points that are listed one by one."""
DESCRIPTION = """Varies keys of a configuration over lists of values and designs every point: study.csv, study.json,
figures and study.html. Finished points are kept in points.jsonl: after Ctrl-C, or when the study has grown, the same
command computes only what is missing. Exit status 0: every point has a verdict, positive or negative; 1: some
point could not be used or failed, and the table says why."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "study", help="one configuration at many values: table, figures and a page", description=DESCRIPTION
    )
    parser.add_argument("study", metavar="STUDY", help="YAML file: base, vary, combine, set, stages")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a key of the configuration at every point, such as friction=0.2; may be repeated",
    )
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for the results (default: out/NAME)")
    parser.add_argument("--jobs", type=int, metavar="N", help="processes side by side (default: one per core)")
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="a Dask scheduler that computes instead, such as tcp://10.0.0.5:8786"
    )
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 when every point has a verdict, 1 when some have none. Ctrl-C keeps the points that are finished."""
    from mocca_robot.report.study_page import write_study_page
    from mocca_robot.runtime.executors import executor
    from sim.studies.run import run_study
    from sim.studies.study import read_study
    from sim.studies.table import study_data, write_study
    from sim.trial_store import TrialStore

    if args.jobs is not None and args.jobs < 1:
        raise InputError(f"--jobs is {args.jobs}; give at least 1.")
    if args.jobs is not None and args.scheduler is not None:
        raise InputError("--jobs and --scheduler exclude each other: a cluster has its own number of workers.")
    console = Console(args.json)
    with console.stage("read"):
        further = dict(_assignment(text) for text in args.set)
        study = read_study(args.study, further)
        study.config(study.points[0])  # what no point could survive is an error, not a table of errors
    folder = arguments.prepare_output(args, study.name)
    over = ", ".join(f"{key} ({len(values)})" for key, values in study.vary.items())
    console.say(f"{study.name}: {len(study.points)} points of '{study.base}' over {over}")
    store = TrialStore(folder / "points.jsonl")
    with console.stage("study") as show, executor(args.jobs, args.scheduler) as pool:
        found = run_study(study, pool, store, lambda what, done, total: show(f"{done} of {total}: {what}"))
        if found.interrupted:
            pool.shutdown(wait=False)
    with console.stage("report"):
        files = write_study(found, folder)
        files |= write_study_page(folder, study_data(found))
    return _conclude(found, files, console)


def _assignment(text: str) -> tuple[str, Any]:
    """Return key and value of 'key=value'; the key stays flat, as in a study's file."""
    from mocca_robot.files.documents import parse_yaml

    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise InputError(f"--set {text}: write KEY=VALUE, such as --set friction=0.2.")
    return key.strip(), parse_yaml(value, f"--set {text}")


def _conclude(found: StudyResult, files: dict[str, Path], console: Console) -> int:
    done = [(point, row) for point, row in zip(found.study.points, found.rows) if row is not None]
    counts = dict(Counter(row["status"] for _, row in done))
    for point, row in done[:SHOWN]:
        why = f" ({row['reason']})" if row["reason"] else ""
        console.say(f"{point.label}: {row['status']}{why}")
    if len(done) > SHOWN:
        console.say(f"… and {len(done) - SHOWN} more points; the table has them all")
    told = ", ".join(f"{n} {status}" for status, n in counts.items())
    if found.kept:
        console.say(f"{found.kept} of them were kept from an earlier run")
    if found.interrupted:
        console.say("Interrupted: the table holds what was finished; the same command goes on from there.")
    console.say(f"{told or 'nothing was finished'}; {len(found.study.points)} points in all")
    console.say(console.times())
    for path in files.values():
        console.say(f"{path}")
    status = ExitCode.INTERRUPTED if found.interrupted else positive_if(not found.unfinished)
    document = {
        "name": found.study.name,
        "points": len(found.study.points),
        "counts": counts,
        "kept": found.kept,
        "unfinished": [p.label for p in found.unfinished],
        "interrupted": found.interrupted,
        "files": {kind: str(path) for kind, path in files.items()},
    }
    return console.finish(status, document)
