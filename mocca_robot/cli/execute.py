"""The command line of the robot: `execute`, `fake-ur`, and `export --format urscript`.

`register` adds the first two to a subparsers object; each parser carries its handler as `args.run`, which returns the
exit code: 0 done, 1 not done with the reason, 2 broken input or environment (raised as MoccaError, for the caller).
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli.exit_code import positive_if
from mocca_robot.cli.terminal import Terminal
from mocca_robot.cli.voice import Voice
from mocca_robot.errors import InputError
from mocca_robot.ur.fake.serve import add_fake_ur_options, run_fake_ur

SLOWEST = 0.01

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from mocca_robot.plan.arm_models import RobotModel
    from mocca_robot.plan.executor import Execution
    from mocca_robot.plan.journal import Journal, Record, Resolution
    from mocca_robot.plan.plan import Plan
    from mocca_robot.plan.safety import PlanFinding
    from mocca_robot.plan.status import ExecutionEvent
    from mocca_robot.ur.driver import UrArm


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
    if args.robot is None:
        return _dry_run(plan, first, args, path)
    if args.confirm is None:
        raise InputError(
            f"--robot {args.robot} would move an arm. Add --confirm with its serial number (on the pendant: Settings, "
            "About), after a dry run and with the cell clear."
        )
    return _build(args, plan, path, record, first, resolution)


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


def _dry_run(plan: Plan, first: int, args: argparse.Namespace, plan_file: Path) -> int:
    from mocca_robot.plan.dry_run import dry_run

    result = dry_run(plan, first)
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


def _build(
    args: argparse.Namespace,
    plan: Plan,
    path: Path,
    record: Record | None,
    first: int,
    resolution: tuple[str, Resolution] | None,
) -> int:
    """Build on a robot. What ends it early stops the arm and is journalled; only a finished build returns 0."""
    from mocca_robot.plan.person import confirmations
    from mocca_robot.plan.safety import require_sound
    from mocca_robot.ur.driver import UrArm
    from mocca_robot.ur.link import require_client

    require_sound(plan)
    _require_looked_at(plan, path, args)
    require_client()
    voice = Voice()
    if record is not None and record.truncated is not None:
        voice.warn(f"note: a line of the journal was cut off while it was written: {record.truncated[:60]}")
    if first >= len(plan.steps) and (resolution is None or record is None):
        done = {"status": "succeeded", "detail": "every step is finished already", "journal": ""}
        return _report(voice, args.json, done)
    target = args.resume if args.resume is not None else args.journal or path.with_suffix(".journal.jsonl")
    if record is None and target.exists():
        raise InputError(
            f"The journal {target} exists. Continue it with --resume {target}, or name another with --journal."
        )
    if (asked := confirmations(plan, first)) and not Terminal(voice.say).there:
        raise InputError(
            f"Somebody has to confirm what happens to {', '.join(asked)}, but there is no input to answer on. Run this "
            "in a terminal."
        )
    with _Signals() as interrupted:

        def cancelled() -> str:
            unheard = "nobody reads what this program says any more (its output was closed)" if voice.deaf else ""
            return interrupted() or unheard

        here, model = _fitted(args.robot, plan, voice)
        with UrArm(args.robot, here, args.confirm, cancelled, model) as arm:
            journal = _open_journal(target, plan, arm.name, path, record, resolution)
            with journal:
                if first >= len(plan.steps):
                    done = {"status": "succeeded", "detail": "every step is finished", "journal": str(target)}
                    return _report(voice, args.json, done)
                result = _run(args, here, arm, journal, first, voice)
                kept = record is not None or any(e.event == "move_started" for e in result.events)
                if not kept:
                    journal.discard()  # nothing was begun: it would only stand in the way of the next attempt
    return _report(voice, args.json, _last(result, str(target) if kept else ""))


def _fitted(host: str, plan: Plan, voice: Voice) -> tuple[Plan, RobotModel]:
    """Return the plan for the arm that answers at `host`, as its factory measured it, and that arm."""
    from mocca_robot.plan.arm_models import robot_model
    from mocca_robot.plan.calibration import calibrated, difference, fitted
    from mocca_robot.ur.primary import read_calibration

    nominal = robot_model(plan.robot)
    calibration = read_calibration(host)
    if calibration is None:
        unknown = f"note: {host} does not tell its arm's calibration (port 30001)"
        voice.warn(f"{unknown}: it is taken for a {plan.robot} as published")
        return plan, nominal
    arm = calibrated(nominal, calibration)
    gap, turn = difference(nominal, arm)
    far = f"{1e3 * gap:.1f} mm and {math.degrees(turn):.2f}°"
    voice.warn(f"note: the plan is fitted to this arm: its flange is up to {far} from where a {plan.robot}'s is")
    return fitted(plan, arm), arm


def _run(args: argparse.Namespace, plan: Plan, arm: UrArm, journal: Journal, first: int, voice: Voice) -> Execution:
    """Return how the build ended."""
    from mocca_robot.plan.executor import execute
    from mocca_robot.plan.person import confirmations
    from mocca_robot.ur.preflight import QUESTION_S, questions

    if not args.json:
        places = sum(1 for _ in questions(plan, first))
        voice.say(
            f"before it moves, {places} places are put to the robot's own safety limits: "
            f"about {places * QUESTION_S:.0f} s"
        )
        moving = sum(m.path[-1].t - m.path[0].t for s in plan.steps[first:] for m in s.moves) / args.speed
        if asked := confirmations(plan, first):
            voice.say(f"you will be asked, here and on the pendant, about: {', '.join(asked)}")
        voice.say(f"about {moving:.0f} s of motion at {args.speed:.0%} speed, with the slider of the pendant at 100 %")
    listener = None if args.json else lambda event: voice.say(_line(event))
    person = Terminal(voice.warn if args.json else voice.say)
    return execute(plan, arm, journal, first, listener, speed=args.speed, person=person)


def _last(result: Execution, journal: str) -> dict[str, Any]:
    """Return how the build ended, as JSON-ready values."""
    return {
        **result.last.document(),
        "status": str(result.status),
        "detail": result.detail,
        "steps_finished": result.steps_finished,
        "journal": journal,
    }


def _open_journal(
    target: Path,
    plan: Plan,
    robot: str,
    plan_file: Path,
    record: Record | None,
    resolution: tuple[str, Resolution] | None,
) -> Journal:
    from mocca_robot.plan.journal import Journal

    if record is None:
        return Journal.create(target, plan, robot, plan_file)
    journal, _ = Journal.reopen(target, plan, robot)
    _note_resume(journal, plan, record, resolution)
    return journal


class _Signals:
    """Ctrl-C, SIGTERM and a closed terminal inside only leave word: the arm then stops within one cycle."""

    def __enter__(self) -> Callable[[], str]:
        import signal

        heard: list[int] = []
        numbers = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
        self._before = {n: signal.signal(n, lambda number, _: heard.append(number)) for n in numbers}
        return lambda: "cancelled by the user" if heard else ""

    def __exit__(self, *_: object) -> None:
        import signal

        for number, handler in self._before.items():
            signal.signal(number, handler)


def _note_resume(journal: Journal, plan: Plan, record: Record, resolution: tuple[str, Resolution] | None) -> None:
    """Write that and how a person resumed: the mark comes first, right after a line that may have been cut off."""
    from mocca_robot.plan.journal import utc_now
    from mocca_robot.plan.status import ExecutionEvent

    journal.append(ExecutionEvent(time_utc=utc_now(), event="resumed"))
    if resolution is not None and record.unfinished is not None:
        part = plan.steps[record.unfinished].part
        resolved = f"resolved_{resolution[1]}"
        journal.append(ExecutionEvent(time_utc=utc_now(), event=resolved, step=record.unfinished, part=part))


def _report(voice: Voice, as_json: bool, values: dict[str, Any]) -> int:
    if as_json:
        voice.say(json.dumps(values))
    else:
        where = f" at step {values['step']} ({values.get('part')})" if values.get("step") is not None else ""
        voice.say(f"{values['status']}{where}: {values.get('detail', '')}".rstrip(": "))
        if values["status"] != "succeeded":
            seen = values.get("stop_observed")
            measured = "yes" if seen else "not needed" if seen is None else "NO: look at the robot"
            voice.say(f"standstill measured: {measured}")
        if values.get("journal"):
            voice.say(f"journal: {values['journal']}")
    return positive_if(values["status"] == "succeeded")


def _line(event: ExecutionEvent) -> str:
    where = " ".join(str(v) for v in (event.part, event.kind) if v is not None)
    return f"{event.time_utc}  {event.event:15s} {where:20s} {event.status or ''} {event.detail}".rstrip()


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
