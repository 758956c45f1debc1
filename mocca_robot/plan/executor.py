"""Walking a plan on any Arm: every motion into the journal before and after it, nothing repeated by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from mocca_robot.plan.arm import Arm
from mocca_robot.plan.gripper import Grip, holds
from mocca_robot.plan.hand import disorder, hands, not_open, to_open
from mocca_robot.plan.insertion_skill import insert
from mocca_robot.plan.journal import JournalLost, utc_now
from mocca_robot.plan.motions import Motions
from mocca_robot.plan.person import Person, after_grip, before_release
from mocca_robot.plan.plan import Move, MoveKind, Plan, Step
from mocca_robot.plan.status import ExecutionEvent, ExecutionStatus, MotionOutcome
from mocca_robot.plan.supervision import Stopped

GUARDED = frozenset({MoveKind.APPROACH, MoveKind.PICK})
ZEROED = frozenset({MoveKind.TRANSIT, MoveKind.APPROACH, MoveKind.INSERT})
"""Moves before which the force sensor is zeroed: the hand hangs free then. A pick keeps its approach's zero."""
OPENING_N = 20.0
"""An empty hand opens and narrows as gently as it can."""
Listener = Callable[[ExecutionEvent], None]


class Log(Protocol):
    """Where events go before the next motion begins: a journal on disk, or the notes of a rehearsal."""

    def append(self, event: ExecutionEvent) -> None:
        """Keep one event, durably where that matters."""
        ...


@dataclass(frozen=True)
class Execution:
    """How an execution ended: the last status, where, and everything that happened."""

    status: ExecutionStatus
    detail: str
    steps_finished: int
    events: tuple[ExecutionEvent, ...]

    @property
    def last(self) -> ExecutionEvent:
        """Return the last event."""
        return self.events[-1]


class _Recorder:
    """Journal, listener and list in one; the journal comes first, so that what is seen is also remembered.

    `journal` becomes None once it is lost.
    """

    def __init__(self, journal: Log, listener: Listener | None) -> None:
        self.journal: Log | None = journal
        self.listener = listener
        self.events: list[ExecutionEvent] = []

    def __call__(self, event: ExecutionEvent) -> None:
        if self.journal is not None:
            self.journal.append(event)
        self.events.append(event)
        if self.listener is not None:
            self.listener(event)


def execute(
    plan: Plan,
    arm: Arm,
    journal: Log,
    first_step: int = 0,
    listener: Listener | None = None,
    *,
    speed: float = 1.0,
    person: Person | None = None,
    last_step: int | None = None,
    stepwise: bool = False,
) -> Execution:
    """Return how building `plan` on `arm` ended, from `first_step` on, at a share `speed` of the planned speeds.

    It ends after `last_step`; `stepwise`, `person` confirms every move. They confirm before a part is let go that
    something has to hold, and after grips that nothing measures; without one such a build ends there. Every event is in
    the journal before the next motion begins: UNRECORDED when it cannot be. The first motion that does not succeed ends
    the execution; its event carries status, measured pose, force and whether the stop was seen.
    """
    record = _Recorder(journal, listener)
    try:
        last = len(plan.steps) - 1 if last_step is None else last_step
        outcome = _steps(plan, range(first_step, last + 1), Motions(arm, speed, person), record, stepwise)
    except JournalLost as lost:
        record.journal = None
        outcome = arm.halt(Stopped(ExecutionStatus.UNRECORDED, str(lost)))
    finished = first_step + sum(e.event == "step_finished" for e in record.events)
    ended = "finished" if outcome.succeeded else "stopped"
    step, part = (record.events[-1].step, record.events[-1].part) if record.events else (None, None)
    try:
        record(_event(ended, outcome, step, part))
    except JournalLost as lost:
        record.journal = None
        detail = f"{outcome.detail}; {lost}" if outcome.detail else str(lost)
        record(_event(ended, replace(outcome, detail=detail), step, part))
    return Execution(outcome.status, record.events[-1].detail, finished, tuple(record.events))


def _steps(plan: Plan, steps: range, motions: Motions, record: _Recorder, stepwise: bool) -> MotionOutcome:
    """Return how the last step ended that was begun, or the preflight."""
    outcome = motions.arm.preflight(plan, steps.start)
    record(_event("preflight", outcome))
    if not outcome.succeeded:
        return outcome
    for i in steps:
        part = plan.steps[i].part
        record(ExecutionEvent(time_utc=utc_now(), event="step_started", step=i, part=part))
        outcome = _run_step(plan, i, motions, record, stepwise)
        if not outcome.succeeded:
            return outcome
        record(_event("step_finished", outcome, i, part))
    return outcome


def _run_step(plan: Plan, index: int, arm: Motions, record: _Recorder, stepwise: bool) -> MotionOutcome:
    step = plan.steps[index]
    if words := disorder(step):
        return MotionOutcome(ExecutionStatus.REFUSED, words)
    outcome = MotionOutcome(ExecutionStatus.SUCCEEDED)
    opened: float | None = None
    for k, (hand, move) in enumerate(zip(hands(step), step.moves, strict=False)):
        if stepwise:
            outcome = arm.confirm(f"Next, for {step.part}: {move.kind} ({move.path[-1].t:.0f} s).")
            if not outcome.succeeded:
                record(_event("move_stopped", outcome, index, step.part, k, move.kind))
                return outcome
        record(
            ExecutionEvent(time_utc=utc_now(), event="move_started", step=index, part=step.part, move=k, kind=move.kind)
        )

        def note(event: str, outcome: MotionOutcome, attempt: int | None = None, grip: Grip | None = None) -> None:
            record(_event(event, outcome, index, step.part, k, move.kind, attempt, grip))  # noqa: B023 - called at once

        if to_open(hand, move, opened):
            outcome, grip = _open(plan, move, arm)
            note("hand_opened" if outcome.succeeded else "move_stopped", outcome, None, grip)
            if not outcome.succeeded:
                return outcome
            opened = move.gripper_m
        outcome = _run_move(plan, step, move, arm, note)
        if not outcome.succeeded:
            return outcome
    return outcome


def _open(plan: Plan, move: Move, arm: Motions) -> tuple[MotionOutcome, Grip]:
    """Open the empty hand as far as the coming move was planned with, and see that it is so."""
    outcome, grip = arm.grip(move.gripper_m, OPENING_N)
    words = not_open(grip, move.gripper_m, plan.cell.limits)
    if outcome.succeeded and words:
        return MotionOutcome(ExecutionStatus.DEVIATED, words, outcome.state), grip
    return outcome, grip


def _run_move(plan: Plan, step: Step, move: Move, arm: Motions, note: Callable[..., None]) -> MotionOutcome:
    """Return how one move ended; `note` writes what happened, intermediate results included."""
    limits = plan.cell.limits
    outcome, grip = MotionOutcome(ExecutionStatus.SUCCEEDED), None
    if move.kind in ZEROED:
        outcome = arm.zero_force()
    if outcome.succeeded and move.kind is MoveKind.INSERT:
        outcome = insert(arm, step, move, limits, note, outcome.state)
    elif outcome.succeeded and len(move.path) > 1:
        guard = limits.contact_force_n if move.kind in GUARDED else None
        outcome = arm.follow(move.path, force_limit_n=move.force_limit_n, contact_force_n=guard)
    if outcome.succeeded and move.kind is MoveKind.RELEASE and (question := before_release(plan, step)):
        outcome = _confirm(arm, question, note)
    if outcome.succeeded and move.kind in (MoveKind.PICK, MoveKind.RELEASE):
        outcome, grip = _grip(plan, step, move, arm)
        if outcome.succeeded and (question := after_grip(step, move.kind, grip)):
            outcome = _confirm(arm, question, note)
    note("move_finished" if outcome.succeeded else "move_stopped", outcome, None, grip)
    return outcome


def _confirm(arm: Motions, question: str, note: Callable[..., None]) -> MotionOutcome:
    outcome = arm.confirm(question)
    if outcome.succeeded:
        note("confirmed", outcome)
        return replace(outcome, detail="")
    return outcome


def _grip(plan: Plan, step: Step, move: Move, arm: Motions) -> tuple[MotionOutcome, Grip]:
    """Take a part and see that it is held, or see that it was let go; then say what is carried."""
    outcome, grip = arm.grip(move.gripper_m, step.grasp.force_n)
    if not outcome.succeeded:
        return outcome, grip
    cell, grasp = plan.cell, step.grasp
    if move.kind is MoveKind.PICK:
        if holds(grip, grasp.width_m, cell.limits) is False:
            detail = "part missing: no vacuum under the cup; the vacuum stays on"
            if grip.held is False:
                detail = "part missing: the fingers closed, and their switch shows nothing between them"
            if grip.width_m is not None:
                found = f"{1e3 * grip.width_m:.1f} mm"
                detail = f"part missing: the fingers closed to {found}, the part is {1e3 * grasp.width_m:.1f} mm wide"
            return MotionOutcome(ExecutionStatus.DEVIATED, detail, outcome.state), grip
        return arm.set_payload(*cell.payload(grasp)), grip
    if words := not_open(grip, move.gripper_m, cell.limits):
        return MotionOutcome(ExecutionStatus.DEVIATED, words, outcome.state), grip
    return arm.set_payload(*cell.payload()), grip


def _event(
    event: str,
    outcome: MotionOutcome,
    step: int | None = None,
    part: str | None = None,
    move: int | None = None,
    kind: str | None = None,
    attempt: int | None = None,
    grip: Grip | None = None,
) -> ExecutionEvent:
    state = outcome.state
    return ExecutionEvent(
        time_utc=utc_now(),
        event=event,
        step=step,
        part=part,
        move=move,
        kind=str(kind) if kind else None,
        attempt=attempt,
        waypoint=outcome.waypoint,
        status=outcome.status,
        detail=outcome.detail,
        q=state.q if state else None,
        tcp=state.tcp if state else None,
        force=state.force if state else None,
        robot_time_s=state.time_s if state else None,
        depth_m=outcome.depth_m,
        width_m=grip.width_m if grip else None,
        vacuum=grip.vacuum if grip else None,
        held=grip.held if grip else None,
        stop_observed=outcome.stop_observed,
    )
