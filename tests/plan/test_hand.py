"""The hand as a state: a plan takes a part, seats it and lets it go, and opens as wide as its moves were planned."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ur_cell import CLOSED, OPENED, WIDTH, small_plan, suction_plan

from mocca_robot.errors import InputError
from mocca_robot.plan.gripper import Grip
from mocca_robot.plan.hand import Hand, hands, not_open
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.plan import MoveKind, Plan, document
from mocca_robot.plan.reader import plan_from_document
from mocca_robot.plan.safety import findings

PLANS = {"fingers": small_plan(1), "cup": suction_plan(1)}


def refused(raw: dict[str, Any]) -> str:
    """Return why a plan in JSON cannot be run, '' when it can."""
    try:
        return "\n".join(map(str, findings(plan_from_document(raw))))
    except InputError as error:
        return str(error)


def edited(plan: Plan) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    raw = copy.deepcopy(document(plan))
    return raw, raw["steps"][0]["moves"]


def test_a_step_takes_seats_and_lets_go() -> None:
    seen = hands(PLANS["fingers"].steps[0])
    kinds = [m.kind for m in PLANS["fingers"].steps[0].moves]
    at = dict(zip(kinds, seen, strict=False))  # the last of a kind
    assert (at[MoveKind.PICK], at[MoveKind.INSERT], at[MoveKind.RELEASE]) == (Hand.EMPTY, Hand.HELD, Hand.SEATED)
    assert seen[-1] is Hand.LET_GO
    assert not refused(document(PLANS["fingers"])) and not refused(document(PLANS["cup"]))


@pytest.mark.parametrize("name", PLANS)
@given(data=st.data())
def test_a_move_that_is_left_out_twice_there_or_another_kind_is_refused(name: str, data: st.DataObject) -> None:
    """Whatever happens to pick, insert or release: no order but one has each once."""
    raw, moves = edited(PLANS[name])
    key = [k for k, m in enumerate(moves) if m["kind"] in ("pick", "insert", "release")]
    k = data.draw(st.sampled_from(key))
    what = data.draw(st.sampled_from(["drop", "double", "rename"]))
    if what == "drop":
        del moves[k]
    elif what == "double":
        moves.insert(k, copy.deepcopy(moves[k]))
    else:
        moves[k]["kind"] = data.draw(st.sampled_from([str(m) for m in MoveKind if m != moves[k]["kind"]]))
    words = refused(raw)
    assert "step 0 (p01)" in words and "the hand is" in words


@pytest.mark.parametrize("name", PLANS)
@given(data=st.data())
def test_an_opening_that_does_not_fit_what_the_hand_is_is_refused(name: str, data: st.DataObject) -> None:
    plan = PLANS[name]
    raw, moves = edited(plan)
    k = data.draw(st.integers(0, len(moves) - 1))
    low, high = plan.cell.gripper_stroke_m
    seen, kind = hands(plan.steps[0])[k], moves[k]["kind"]
    holding = kind == "pick" or (seen in (Hand.HELD, Hand.SEATED) and kind != "release")
    # What holds a part is opened, what is open is closed.
    moves[k]["gripper_m"] = high if holding else low
    words = refused(raw)
    assert f"move {k} ({kind}): gripper_m is" in words


def test_a_hand_that_is_not_as_open_as_it_was_told_is_named() -> None:
    limits = MotionLimits()
    assert not_open(Grip(OPENED, False), OPENED, limits) == "" and not_open(Grip(None, None), OPENED, limits) == ""
    for found in (CLOSED, WIDTH, OPENED + 0.003):
        assert "commanded 50.0 mm" in not_open(Grip(found, False), OPENED, limits)
    assert "vacuum" in not_open(Grip(None, None, True), 0.01, limits)
