"""Timed motions: within all caps, close to the fastest, smooth round corners, and cells that choose how fast."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mocca_robot.errors import InputError
from mocca_robot.plan.cycle import RAMPS, cycle_times
from mocca_robot.plan.limits import NEEDS_ACCEPTANCE, SPEEDS, MotionLimits
from mocca_robot.plan.plan import MoveKind, Waypoint
from planners.robot.cell import RobotCell, read_cell
from planners.robot.effort import flips, strain
from planners.robot.time_optimal import passing_times, reachable_speeds
from planners.robot.trajectory import fastest_s, jerk_cap, joint_motion, line_motion, timed
from planners.robot.transit import rounded

CELLS = Path(__file__).resolve().parents[2] / "configs" / "cells"
STILL = np.array([0.3, -1.4, 1.7, -1.8, -1.5, 0.2])


@cache
def cell(preset: str = "reduced") -> RobotCell:
    base = read_cell(CELLS / "ur5e_2f85.yaml")
    asked = {"preset": preset, **({"accepted": "R. Roe: behind a fence"} if preset in NEEDS_ACCEPTANCE else {})}
    return replace(base, limits=MotionLimits().lowered(asked))


def straight_line(n: int = 401) -> tuple[np.ndarray, ...]:
    """One joint, one metre of path, the tool somewhere else."""
    return np.full(n, 4.0), np.ones((n, 1)), np.zeros((n, 1)), np.zeros((n, 3)), np.zeros((n, 3))


@pytest.mark.parametrize(("top", "change"), [(2.0, 3.0), (0.5, 3.0)])
def test_one_joint_on_a_straight_way_takes_what_a_trapezoid_takes(top: float, change: float) -> None:
    cap, dq, ddq, dp, ddp = straight_line()
    squared = reachable_speeds(cap / 4.0 * top**2, dq, ddq, change, dp, ddp, 1.0, 1.0 / 400)
    exact = 1.0 / top + top / change if top**2 / change < 1.0 else 2.0 * math.sqrt(1.0 / change)
    assert passing_times(squared, 1.0 / 400)[-1] == pytest.approx(exact, rel=2e-3)


def test_the_fastest_way_is_at_some_cap_everywhere() -> None:
    # Bang-bang: where speed is below its cap, an acceleration is at its own.
    s = np.linspace(0.0, 2.0, 801)
    dq = np.column_stack([np.cos(3 * s), 0.4 * np.ones_like(s)])
    ddq = np.column_stack([-3 * np.sin(3 * s), np.zeros_like(s)])
    dp = 0.3 * np.column_stack([np.cos(s), np.sin(s), np.zeros_like(s)])
    ddp = 0.3 * np.column_stack([-np.sin(s), np.cos(s), np.zeros_like(s)])
    cap = np.full(len(s), 1.5)
    b = reachable_speeds(cap, dq, ddq, 1.2, dp, ddp, 0.35, s[1])
    a = np.diff(b) / (2.0 * s[1])
    joint = np.abs(dq[:-1] * a[:, None] + ddq[:-1] * b[:-1, None]).max(axis=1) / 1.2
    tool = np.linalg.norm(dp[:-1] * a[:, None] + ddp[:-1] * b[:-1, None], axis=1) / 0.35
    share = np.maximum(np.maximum(joint, tool), b[:-1] / cap[:-1])
    assert share.max() < 1.01
    assert np.quantile(share, 0.02) > 0.98


def rates(path: list[Waypoint]) -> tuple[np.ndarray, np.ndarray]:
    t = np.array([w.t for w in path])
    return np.diff([w.q for w in path], axis=0) / np.diff(t)[:, None], np.diff([w.tcp[:3] for w in path], axis=0)


@pytest.mark.parametrize("preset", SPEEDS)
@pytest.mark.parametrize("seed", range(4))
def test_motions_keep_their_caps_and_are_nearly_as_fast_as_any(preset: str, seed: int) -> None:
    here, rng = cell(preset), np.random.default_rng(seed)
    goal = STILL + rng.uniform(-0.9, 0.9, 6)
    corner = STILL + rng.uniform(-0.9, 0.9, 6)
    legs = rounded([STILL, corner, goal], lambda q: True)
    assert len(legs) == 1
    limits = here.limits
    path = timed(here, legs[0], limits.transfer_speed_m_s, limits.transfer_acceleration_m_s2)
    assert path[0].q == pytest.approx(STILL) and path[-1].q == pytest.approx(goal)
    steps = np.diff([w.t for w in path])
    turns, moved = rates(path)
    assert (np.abs(turns) <= np.minimum(here.model.joint_speed_rad_s, limits.joint_speed_rad_s) + 1e-9).all()
    assert (np.linalg.norm(moved, axis=1) / steps).max() <= limits.transfer_speed_m_s + 1e-9
    spans = np.concatenate([[steps[0]], steps[:-1] + steps[1:], [steps[-1]]]) / 2.0
    still = np.zeros((1, 6))
    change = np.diff(np.vstack([still, turns, still]), axis=0) / spans[:, None]
    assert np.abs(change).max() <= 1.1 * limits.joint_acceleration_rad_s2
    assert np.abs(np.diff(change, axis=0) / steps[:, None]).max() <= 1.25 * jerk_cap(limits)
    bound = fastest_s(here, legs[0], limits.transfer_speed_m_s, limits.transfer_acceleration_m_s2)
    # The bound knows no jerk, which sharp bends cost most where accelerations are largest.
    slack = {"reduced": 1.1, "collaborative": 1.35, "fenced": 1.6}[preset]
    assert bound <= path[-1].t <= slack * bound


def test_lines_are_straight_and_end_at_rest_where_they_should() -> None:
    here = cell()
    start = here.model.frames(STILL)[-1]
    path, reason = line_motion(here, start, np.array([0.0, 0.0, 0.06]), STILL, 0.02, 0.5)
    assert reason == ""
    places = np.array([w.tcp[:3] for w in path])
    assert np.abs(places[:, :2] - places[0, :2]).max() < 1e-5
    assert places[-1, 2] - places[0, 2] == pytest.approx(0.06, abs=1e-6)
    assert path[-1].t < 1.15 * (0.06 / 0.02)
    assert np.linalg.norm(places[1] - places[0]) / path[1].t < 0.01  # it starts from rest


def test_corners_are_cut_as_widely_as_is_free_and_else_stopped_at() -> None:
    a, b, c = np.zeros(6), np.array([1.0, 0, 0, 0, 0, 0]), np.array([1.0, 1.0, 0, 0, 0, 0])
    (wide,) = rounded([a, b, c], lambda q: True)
    inside = np.minimum(wide[:, 0], 1.0 - wide[:, 1])
    assert np.abs(wide - b).max(axis=1).min() > 0.08 and (wide[:, 0] <= 1.0 + 1e-12).all() and (inside >= -1e-12).all()
    assert np.linalg.norm(np.diff(wide, axis=0), axis=1).max() < 0.06
    (narrow,) = rounded([a, b, c], lambda q: bool(np.linalg.norm(q - b) < 0.1 or q[0] > 0.999 or q[1] < 1e-3))
    assert np.linalg.norm(narrow - b, axis=1).min() < np.linalg.norm(wide - b, axis=1).min()
    stopped = rounded([a, b, c], lambda q: bool(q[0] > 1 - 1e-9 or q[1] < 1e-9))
    assert [leg[-1].tolist() for leg in stopped] == [b.tolist(), c.tolist()]
    both = joint_motion(cell(), stopped)
    at_corner = min(range(len(both)), key=lambda k: np.linalg.norm(np.subtract(both[k].q, b)))
    assert both[at_corner].q == pytest.approx(b)
    assert np.all(np.diff([w.t for w in both]) > 0)


def test_strain_counts_flips_and_long_turns_before_length() -> None:
    here = cell()
    q = here.home
    other = q.copy()
    other[2] = -q[2]
    assert flips(q, other) and not flips(q, 0.5 * q)
    near, far = [np.array([q, q + 0.2])], [np.array([q, q + 0.2, q])]
    flipped = [np.linspace(q, other, 20)]
    assert strain(here, [near])[0] == 0 and strain(here, [near])[1] < strain(here, [far])[1]
    assert strain(here, [flipped])[0] >= 1
    long = q.copy()
    long[5] += 5.0
    assert strain(here, [[np.linspace(q, long, 20)]])[0] == 1


def test_presets_choose_speeds_and_the_fastest_is_only_for_those_who_say_so() -> None:
    assert MotionLimits().lowered({"preset": "reduced"}) == MotionLimits()
    both = MotionLimits().lowered({"preset": "collaborative", "transfer_speed_m_s": 0.3})
    assert both.transfer_speed_m_s == 0.3 and both.lift_speed_m_s == SPEEDS["collaborative"]["lift_speed_m_s"]
    assert MotionLimits().lowered(both.changed()) == both
    with pytest.raises(InputError, match="'accepted: WHO, WHY'"):
        MotionLimits().lowered({"preset": "fenced"})
    for bad in ("fast", 3, None):
        with pytest.raises(InputError, match="preset is"):
            MotionLimits().lowered({"preset": bad})
    with pytest.raises(InputError, match="only lower"):
        MotionLimits().lowered({"preset": "collaborative", "transfer_speed_m_s": 0.6})
    for name in ("approach_speed_m_s", "insert_speed_m_s", "contact_force_n", "push_force_n"):
        assert {getattr(cell(p).limits, name) for p in SPEEDS} == {getattr(MotionLimits(), name)}


def test_cycle_times_add_up_and_name_what_limits() -> None:
    from test_plan_build import built, plan_of

    plan = plan_of(built())
    cycles = cycle_times(plan)
    assert [c.part for c in cycles] == [s.part for s in plan.steps]
    for cycle, step in zip(cycles, plan.steps, strict=True):
        assert cycle.moving_s == pytest.approx(sum(m.path[-1].t for m in step.moves))
        assert sum(cycle.limits.values()) == pytest.approx(cycle.moving_s)
        known = {"joint_acceleration_rad_s2", "joint_speed_rad_s", "transfer_acceleration_m_s2", RAMPS}
        known |= {f"{k}_speed_m_s" for k in ("transfer", "approach", "lift", "retreat", "insert")}
        assert set(cycle.limits) <= known | {"insert_acceleration_m_s2"}
        assert max(cycle.limits, key=lambda k: cycle.limits[k]) == "transfer_speed_m_s"
    slow = replace(plan.steps[0].moves[0], kind=MoveKind.TRANSIT, speed_m_s=0.05)
    words = cycle_times(replace(plan, steps=(replace(plan.steps[0], moves=(slow, *plan.steps[0].moves[1:])),)))[0]
    assert "the move's own speed" in words.limits


def test_joints_turn_no_farther_than_the_cells_cables_allow(tmp_path: Path) -> None:
    text = (CELLS / "ur5e_2f85.yaml").read_text()
    file = tmp_path / "cell.yaml"
    file.write_text(text + "\njoint_range_deg: [360, 360, 360, 360, 360, 200]\n")
    assert read_cell(file).model.joint_limit_rad[5] == pytest.approx(np.deg2rad(200))
    for bad, said in (("[360, 360, 360, 360, 360, 5]", "joint 5"), ("[20, 20, 20, 20, 20, 20]", "home_deg")):
        file.write_text(text + f"\njoint_range_deg: {bad}\n")
        with pytest.raises(InputError, match=said):
            read_cell(file)
