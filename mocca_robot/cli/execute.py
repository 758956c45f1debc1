"""The command line of the robot: `execute`, `fake-ur`, and `export --format urscript`.

`register` adds the first two to a subparsers object; each parser carries its handler as `args.run`, which returns the
exit code: 0 done, 1 not done with the reason, 2 broken input or environment (raised as MoccaError, for the caller).
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli.build import build
from mocca_robot.cli.exit_code import positive_if
from mocca_robot.cli.voice import Voice
from mocca_robot.errors import InputError, nearest
from mocca_robot.ur.fake.serve import add_fake_ur_options, run_fake_ur

SLOWEST = 0.01

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mocca_robot.plan.journal import Record, Resolution
    from mocca_robot.plan.plan import Plan
    from mocca_robot.plan.safety import PlanFinding


def register(subparsers: Any) -> None:
    """Add `execute` and `fake-ur` to an argparse subparsers object."""
    parser = subparsers.add_parser("execute", help="check a plan (dry run), or build it on a named robot")
    add_execute_options(parser)
    parser.set_defaults(run=run_execute)
    parser = subparsers.add_parser("fake-ur", help="serve a fake UR controller on loopback, with faults on demand")
    add_fake_ur_options(parser)
    parser.set_defaults(run=run_fake_ur)


def add_execute_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `execute`."""
    parser.description = (
        "Without --robot: a dry run that prints and checks every waypoint. With --robot and --confirm the robot moves."
    )
    parser.add_argument("plan", nargs="?", type=Path, help="plan.json; may be left out with --resume")
    parser.add_argument("--robot", metavar="HOST", help="address of the controller: the arm WILL MOVE")
    parser.add_argument(
        "--confirm", metavar="NAME", help="the robot's serial number, or the cell's name if it records it"
    )
    parser.add_argument(
        "--speed",
        type=float,
        default=1.0,
        metavar="SHARE",
        help="of the planned speeds, 0.01 to 1 (default 1); the pendant's slider slows down further",
    )
    parser.add_argument(
        "--parts",
        metavar="NAME..NAME",
        help="only these steps: NAME..NAME, NAME.., ..NAME or NAME; the rest another time",
    )
    parser.add_argument("--step", action="store_true", help="confirm every move, here and on the pendant's popup")
    parser.add_argument("--journal", type=Path, help="journal to write (default: PLAN.journal.jsonl)")
    parser.add_argument("--resume", type=Path, metavar="JOURNAL", help="go on after an interruption")
    parser.add_argument(
        "--resolve", metavar="PART=placed|repeat", help="what a person found out about the step that was not finished"
    )
    parser.add_argument("--design", type=Path, help="design.json that the plan must still belong to")
    parser.add_argument(
        "--unchecked",
        action="store_true",
        help="run a plan that does not say enough to be looked at for collisions once more",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON document instead of text")


def run_execute(args: argparse.Namespace) -> int:
    """Run `execute`: a dry run, or an execution on a robot."""
    from mocca_robot.plan.journal import next_step, read_journal
    from mocca_robot.plan.reader import read_plan
    from mocca_robot.plan.safety import require_sound

    if not SLOWEST <= args.speed <= 1.0:
        raise InputError(f"--speed is {args.speed:g}; give a share of the planned speeds from {SLOWEST:g} to 1.")
    if args.robot is None and args.confirm is not None:
        raise InputError("--confirm names a robot, but --robot does not say where it is. Give both, or neither.")
    record = read_journal(args.resume) if args.resume is not None else None
    path = args.plan if args.plan is not None or record is None else Path(record.plan_file)
    if path is None or (record is not None and args.plan is None and not record.plan_file):
        raise InputError("No plan is given. Name the plan.json, or a journal that knows it with --resume.")
    plan = read_plan(path, args.design)
    if record is None and args.resolve is not None:
        raise InputError("--resolve belongs to --resume JOURNAL.")
    _require_same_plan(plan, record)
    resolution = _resolution(args.resolve) if args.resolve else None
    first = next_step(record, plan, resolution) if record is not None else 0
    first, last = _part_range(args.parts, plan, first, record is not None)
    if args.robot is None:
        return _dry_run(plan, first, last, args, path)
    if args.confirm is None:
        raise InputError(
            f"--robot {args.robot} would move an arm. Add --confirm with its serial number (on the pendant: Settings, "
            "About), after a dry run and with the cell clear."
        )
    from mocca_robot.ur.link import require_client  # where a robot is asked for: planning needs none

    require_client()
    require_sound(plan)
    _require_looked_at(plan, path, args)
    return build(args, plan, path, record, range(first, last + 1), resolution)


def _require_same_plan(plan: Plan, record: Record | None) -> None:
    if record is not None and record.plan_sha256 != plan.sha256:
        raise InputError(
            f"The journal {record.path} belongs to a plan with hash {record.plan_sha256[:12]}…, this one has "
            f"{plan.sha256[:12]}…: another or an edited plan is never resumed. Give the plan it was begun with."
        )


def _resolution(text: str) -> tuple[str, Resolution]:
    part, _, found = text.rpartition("=")
    if found == "placed":
        return part, "placed"
    if found == "repeat":
        return part, "repeat"
    raise InputError(f"--resolve is '{text}'; write PART=placed or PART=repeat.")


def _dry_run(plan: Plan, first: int, last: int, args: argparse.Namespace, plan_file: Path) -> int:
    from mocca_robot.plan.dry_run import dry_run

    result = dry_run(plan, first, last)
    found, untaken = (result.findings, "") if result.findings else look(plan, plan_file, args.design)
    result = replace(result, findings=tuple(found))
    voice = Voice()
    if args.json:
        voice.say(json.dumps({**result.document(), "second_look": untaken or "taken"}))
    else:
        voice.say(result.text())
        voice.say(f"no second look: {untaken}" if untaken else "second look: parts carried along every waypoint")
    return positive_if(not result.findings)


def look(plan: Plan, plan_file: Path, design_file: Path | None) -> tuple[Sequence[PlanFinding], str]:
    """Return what an independent look at a sound plan finds, against design and cell; or why it cannot be taken."""
    if not plan.cell.description:
        return (), f"the plan does not describe its cell '{plan.cell.name}'"
    source = design_file or (plan_file.parent / plan.design if plan.design else None)
    if source is None or not source.is_file():
        return (), f"the design {source or ''} is not there; give it with --design".replace("  ", " ")
    from mocca_robot.files.design_json import read_design
    from planners.robot.second_look import look_again

    return look_again(plan, read_design(source).assembly), ""


def _require_looked_at(plan: Plan, plan_file: Path, args: argparse.Namespace) -> None:
    """Return once an independent look has found nothing, or if a person goes without one."""
    found, untaken = look(plan, plan_file, args.design)
    if found:
        more = f"\n… and {len(found) - 5} more." if len(found) > 5 else ""
        raise InputError("The plan is refused:\n" + "\n".join(str(f) for f in found[:5]) + more)
    if untaken and not args.unchecked:
        raise InputError(
            f"The plan cannot be looked at again before it runs: {untaken}. Plan again with this version, or add "
            "--unchecked to run it without knowing whether something collides."
        )


def _part_range(text: str | None, plan: Plan, first: int, resumed: bool) -> tuple[int, int]:
    """Return the first and the last step that `--parts` asks for; `first` is where a build, or its journal, begins."""
    last = len(plan.steps) - 1
    if text is None or first > last:
        return first, last
    names = [s.part for s in plan.steps]
    begin, dots, end = text.partition("..")
    for name in (begin, end):
        if name and name not in names:
            raise InputError(f"--parts names '{name}'; {nearest(name, names)}")
    low = names.index(begin) if begin else first
    high = names.index(end) if end else (last if dots else low)
    if resumed and low != first:
        raise InputError(
            f"--parts begins with {names[low]}, but the journal goes on with {names[first]}. Write ..NAME to say where "
            "to end."
        )
    if low > high:
        raise InputError(f"--parts is '{text}', but {names[low]} comes after {names[high]} in the plan. Swap them.")
    return low, high


def export_urscript(plan_file: Path, output: Path, design: Path | None = None) -> Path:
    """Write `plan_file` as a stand-alone URScript program and return where; InputError when the plan is not sound."""
    from mocca_robot.files.output import write_atomic
    from mocca_robot.plan.reader import read_plan
    from mocca_robot.ur.urscript import urscript

    plan = read_plan(plan_file, design)
    text = urscript(plan)
    found, _ = look(plan, plan_file, design)
    if found:
        raise InputError("The plan is refused:\n" + "\n".join(str(f) for f in found[:5]))
    return write_atomic(output, text)
