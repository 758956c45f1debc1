"""The hand as a state: empty → held → seated → let go, once a step. Which move may come when, and how wide it opens."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import StrEnum
from types import MappingProxyType

from mocca_robot.plan.gripper import Grip
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import Move, MoveKind, Plan, Step

SAME_M = 1e-6
ROOM_M = 1e-3
"""Fingers that open less than this wider than their part touch it."""


class Hand(StrEnum):
    """What the hand does with the part of a step."""

    EMPTY = "empty"
    HELD = "held"
    SEATED = "seated"
    """Held, and where it belongs."""
    LET_GO = "let go"


_FREE = {MoveKind.TRANSIT, MoveKind.APPROACH, MoveKind.RETREAT}
AFTER: Mapping[Hand, Mapping[MoveKind, Hand]] = MappingProxyType(
    {
        Hand.EMPTY: {**dict.fromkeys(_FREE, Hand.EMPTY), MoveKind.PICK: Hand.HELD},
        Hand.HELD: {
            **dict.fromkeys({MoveKind.LIFT, MoveKind.TRANSIT, MoveKind.APPROACH}, Hand.HELD),
            MoveKind.INSERT: Hand.SEATED,
        },
        Hand.SEATED: {MoveKind.RELEASE: Hand.LET_GO},
        Hand.LET_GO: dict.fromkeys(_FREE, Hand.LET_GO),
    }
)
"""What the hand is after a move; a move that is missing must not happen."""


def hands(step: Step) -> tuple[Hand, ...]:
    """Return what the hand is before each move that the order allows, and after the last of them."""
    out = [Hand.EMPTY]
    for move in step.moves:
        following = AFTER[out[-1]].get(move.kind)
        if following is None:
            break
        out.append(following)
    return tuple(out)


def disorder(step: Step) -> str:
    """Return '' or why the order of a step's moves is wrong: it has to be pick, insert and release, once each."""
    seen = hands(step)
    if len(seen) <= len(step.moves):
        k = len(seen) - 1
        allowed = ", ".join(sorted(AFTER[seen[-1]]))
        return f"move {k} ({step.moves[k].kind}): the hand is {seen[-1]}, which allows only: {allowed}"
    if seen[-1] is not Hand.LET_GO:
        return f"after its last move the hand is {seen[-1]}; a step is pick, insert and release, in this order"
    return ""


def wrong_openings(step: Step, plan: Plan) -> Iterator[tuple[int, str, str]]:
    """Yield moves whose opening does not fit the hand's state: index, opening, what it has to be."""
    if plan.gripper == "none":
        return
    fingers, width = plan.gripper != "suction", step.grasp.width_m
    low, high = plan.cell.gripper_stroke_m
    closed: float | None = None
    for k, (hand, move) in enumerate(zip(hands(step), step.moves, strict=False)):
        shown, opened = f"{1e3 * move.gripper_m:.2f} mm", move.gripper_m >= _open_m(plan, width)
        if move.kind is MoveKind.PICK:
            closed = move.gripper_m
            if k == 0:
                yield k, shown, "an approach before it, which says how far the hand is open"
            if opened or (fingers and closed > max(low, width - SAME_M)):
                wanted = f"below the part's {1e3 * width:.1f} mm" if fingers else f"{1e3 * low:g} mm (vacuum)"
                yield k, shown, f"{wanted}: it has to hold the part"
        elif hand in (Hand.HELD, Hand.SEATED) and move.kind is not MoveKind.RELEASE:
            if closed is not None and abs(move.gripper_m - closed) > SAME_M:
                yield k, shown, f"{1e3 * closed:.2f} mm, as at the pick: the hand holds the part"
        elif not opened:
            wanted = f"{1e3 * (width + ROOM_M):.1f} to" if fingers else "more than half of"
            yield k, shown, f"{wanted} {1e3 * high:.1f} mm: the hand has to be open around the part, or away from it"


def _open_m(plan: Plan, width_m: float) -> float:
    """Return the smallest opening at which a part is not held."""
    return 0.5 * sum(plan.cell.gripper_stroke_m) if plan.gripper == "suction" else width_m + ROOM_M


def to_open(hand: Hand, move: Move, opened_m: float | None) -> bool:
    """Return whether an empty hand has to be opened before `move`; `opened_m` is where it was last seen, if it was."""
    empty = hand is Hand.EMPTY and move.kind is not MoveKind.PICK
    return empty and (opened_m is None or abs(opened_m - move.gripper_m) > SAME_M)


def not_open(grip: Grip, wanted_m: float, limits: MotionLimits) -> str:
    """Return '' or how a hand that was opened is not as open as it was told to be, as far as it can be measured."""
    if grip.vacuum:
        return "the cup does not let go: there is still vacuum under it"
    if grip.held:
        return "the fingers do not let go: their switch still shows something between them"
    if grip.width_m is not None and abs(grip.width_m - wanted_m) > limits.grip_tolerance_m:
        return f"the fingers stand at {1e3 * grip.width_m:.1f} mm, commanded {1e3 * wanted_m:.1f} mm"
    return ""
