"""A plan is fitted to one arm: its places stay, its joint angles follow what the factory measured."""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np
import pytest
from ur_cell import MODEL, TOOL, small_plan

from mocca_robot.errors import InputError
from mocca_robot.plan.arm_models import MODELS, RobotModel
from mocca_robot.plan.calibration import Calibration, calibrated, difference, fitted
from mocca_robot.plan.pose import six
from mocca_robot.plan.safety import findings
from mocca_robot.ur.primary import HEADER, _kinematics, _next, kinematics_message

PLAN = small_plan(1)


def off(seed: int, model: RobotModel = MODEL, size: float = 1e-3) -> Calibration:
    rng = np.random.default_rng(seed)
    d, a, theta, alpha = (
        six(np.array(v) + size * rng.normal(size=6)) for v in (model.d, model.a, model.theta, model.alpha)
    )
    return Calibration(theta=theta, a=a, d=d, alpha=alpha, checksum=tuple(range(6)))


@pytest.mark.parametrize("seed", range(4))
def test_a_fitted_plan_brings_the_tool_to_the_planned_places(seed: int) -> None:
    arm = calibrated(MODEL, off(seed))
    plan = fitted(PLAN, arm)
    assert findings(plan, arm) == []
    for step, before in zip(plan.steps, PLAN.steps, strict=True):
        for move, old in zip(step.moves, before.moves, strict=True):
            for path, planned in zip((move.path, *move.alternatives), (old.path, *old.alternatives), strict=True):
                for point, wanted in zip(path, planned, strict=True):
                    assert point.tcp == wanted.tcp and point.t == wanted.t
                    assert arm.tcp_pose(point.q, TOOL) == pytest.approx(wanted.tcp, abs=5e-6)
                    assert np.abs(np.subtract(point.q, wanted.q)).max() < 0.05
    assert fitted(PLAN, MODEL).steps[0].moves[0].path[0].q == pytest.approx(PLAN.first_waypoint.q, abs=1e-5)


def test_without_the_calibration_a_fitted_plan_is_not_sound() -> None:
    arm = calibrated(MODEL, off(1, size=3e-3))
    assert difference(MODEL, arm)[0] > 2e-3
    assert any(f.quantity == "tcp against joint angles" for f in findings(fitted(PLAN, arm)))


@pytest.mark.parametrize("other", ["ur3e", "ur10e", "ur20"])
def test_the_figures_of_another_model_are_refused(other: str) -> None:
    with pytest.raises(InputError, match="this is no ur5e"):
        calibrated(MODEL, off(0, MODELS[other]))
    broken = replace(off(0), theta=six([np.nan] * 6))
    with pytest.raises(InputError, match="this is no ur5e"):
        calibrated(MODEL, broken)


def test_the_controllers_table_is_read_as_it_is_sent() -> None:
    message = kinematics_message(off(2))
    assert _next(message[:-1]) is None
    found = _next(message + b"more")
    assert found is not None and found[2] == b"more"
    assert _kinematics(found[1]) == off(2)
    other = HEADER.pack(HEADER.size + 4, 0) + b"mode"
    assert _kinematics(other + found[1]) == off(2) and _kinematics(other) is None
    for size in (0, -5, 1 << 30):
        with pytest.raises(ValueError, match="a message of"):
            _next(struct.pack(">iB", size, 16) + bytes(20))
