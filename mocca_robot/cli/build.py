"""Building a plan on a robot from the command line: its journal, its signals, and what is said of it."""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli.exit_code import positive_if
from mocca_robot.cli.terminal import Terminal
from mocca_robot.cli.voice import Voice
from mocca_robot.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from mocca_robot.plan.arm_models import RobotModel
    from mocca_robot.plan.executor import Execution
    from mocca_robot.plan.journal import Journal, Record, Resolution
    from mocca_robot.plan.plan import Plan
    from mocca_robot.plan.status import ExecutionEvent
    from mocca_robot.ur.driver import UrArm


def build(
    args: argparse.Namespace,
    plan: Plan,
    path: Path,
    record: Record | None,
    steps: range,
    resolution: tuple[str, Resolution] | None,
) -> int:
    """Build on a robot. What ends it early stops the arm and is journalled; only a finished build returns 0."""
    from mocca_robot.plan.person import confirmations
    from mocca_robot.ur.driver import UrArm

    voice, first = Voice(), steps.start
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
    person = Terminal(voice.warn if args.json else voice.say)
    if (args.step or confirmations(plan, first) or (record is None and first > 0)) and not person.there:
        raise InputError("Somebody has to confirm what happens, but there is no input to answer on: use a terminal.")
    if record is None and first > 0:
        _require_standing(plan, first, person)
    with Signals() as interrupted:

        def cancelled() -> str:
            unheard = "nobody reads what this program says any more (its output was closed)" if voice.deaf else ""
            return interrupted() or unheard

        here, model = _fit_to_arm(args.robot, plan, voice)
        with UrArm(args.robot, here, args.confirm, cancelled, model) as arm:
            journal = _open_journal(target, plan, arm.name, path, record, resolution, first)
            with journal:
                if first >= len(plan.steps):
                    done = {"status": "succeeded", "detail": "every step is finished", "journal": str(target)}
                    return _report(voice, args.json, done)
                result = _run(args, here, arm, journal, steps, voice, person=person)
                kept = record is not None or any(e.event == "move_started" for e in result.events)
                if not kept:
                    journal.discard()  # nothing was begun: it would only stand in the way of the next attempt
    return _report(voice, args.json, _last(result, str(target) if kept else ""))


def _fit_to_arm(host: str, plan: Plan, voice: Voice) -> tuple[Plan, RobotModel]:
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


def _run(
    args: argparse.Namespace,
    plan: Plan,
    arm: UrArm,
    journal: Journal,
    steps: range,
    voice: Voice,
    *,
    person: Terminal,
) -> Execution:
    """Return how the build ended."""
    from mocca_robot.plan.executor import execute
    from mocca_robot.plan.person import confirmations
    from mocca_robot.ur.preflight import QUESTION_S, questions

    first = steps.start
    if not args.json:
        places = sum(1 for _ in questions(plan, first))
        voice.say(
            f"before it moves, {places} places are put to the robot's own safety limits: "
            f"about {places * QUESTION_S:.0f} s"
        )
        if asked := confirmations(plan, first):
            voice.say(f"you will be asked, here and on the pendant, about: {', '.join(asked)}")
        moving = sum(m.path[-1].t - m.path[0].t for i in steps for m in plan.steps[i].moves) / args.speed
        voice.say(f"about {moving:.0f} s of motion at {args.speed:.0%} speed, with the slider of the pendant at 100 %")
        voice.say("type p to pause on the way, c to continue; Ctrl-C stops")
    listener = None if args.json else lambda event: voice.say(_line(event))
    return execute(
        plan,
        arm,
        journal,
        first,
        listener,
        speed=args.speed,
        person=person,
        last_step=steps.stop - 1,
        stepwise=args.step,
    )


def _require_standing(plan: Plan, first: int, person: Terminal) -> None:
    """Return once a person has said that the parts before step `first` stand; InputError when they do not."""
    there = [s.part for s in plan.steps[:first]]
    person.ask(f"{', '.join(there)} {'has' if len(there) == 1 else 'have'} to stand, and nothing else. Is it so?")
    while (answer := person.answer()) is None:
        time.sleep(0.05)
    if not answer:
        raise InputError(f"{plan.steps[first].part} is built onto what stands before it. Nothing was moved.")


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
    first: int,
) -> Journal:
    from mocca_robot.plan.journal import Journal, utc_now
    from mocca_robot.plan.status import ExecutionEvent

    if record is None:
        journal = Journal.create(target, plan, robot, plan_file)
        for i in range(first):
            said = ExecutionEvent(time_utc=utc_now(), event="resolved_placed", step=i, part=plan.steps[i].part)
            journal.append(said)
        return journal
    journal, _ = Journal.reopen(target, plan, robot)
    _note_resume(journal, plan, record, resolution)
    return journal


class Signals:
    """Ctrl-C, SIGTERM and a closed terminal inside only leave word: the arm then stops within one cycle."""

    def __enter__(self) -> Callable[[], str]:
        import signal

        heard: list[int] = []
        # A terminal that closes sends SIGHUP; Windows has none and sends SIGBREAK.
        names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
        numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
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
