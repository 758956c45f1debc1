"""Whole builds of the shipped configurations on an arm as a lab has it: miscalibrated, noisy, slowed down."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from ur_cell import fake_controller, loopback, undisturbed

from benchmarks.builds import CRADLED, FLAT, SOLID
from mocca_robot.config.config import load
from mocca_robot.files.design_json import read_design, write_design
from mocca_robot.plan.arm_models import robot_model
from mocca_robot.plan.calibration import calibrated, fitted
from mocca_robot.plan.executor import execute
from mocca_robot.plan.journal import Journal
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.person import Everybody
from mocca_robot.plan.plan import Plan, write_plan
from mocca_robot.plan.status import ExecutionStatus
from mocca_robot.plan.wiring import VacuumWiring
from mocca_robot.ur.driver import UrArm
from mocca_robot.ur.primary import read_calibration
from planners.cone_joints.designer import design
from planners.robot.build_plan import build_plan
from planners.robot.cell import read_cell

ROOT = Path(__file__).resolve().parents[2]
SERIAL = "20265500042"
AS_A_LAB_HAS_IT = ("--speedup", "1", "--noise", "1.5", "--drift", "3", "--calibration", "5")
WIRING = VacuumWiring("standard_3", "configurable_1", 0.5)


@cache
def plan_of(name: str, folder: Path) -> Plan:
    """Plan a configuration in the collaborative preset, whatever falls held."""
    config = load(ROOT / "configs" / f"{name}.yaml")
    stored = read_design(
        write_design(design(config.assembly, config.joints, insertion=config.insertion).design, folder)
    )
    cell = read_cell(ROOT / "configs" / "cells" / ("ur10e_suction.yaml" if name in SOLID else "ur5e_2f85.yaml"))
    limits = replace(MotionLimits(), contact_force_n=cell.model.contact_force_n)
    cell = replace(cell, limits=limits.lowered({"preset": "collaborative"}), serial=SERIAL)
    if name in SOLID:
        cell = replace(cell, build_size_m=SOLID[name], gripper=replace(cell.gripper, wiring=WIRING))  # type: ignore[call-arg]
    built = build_plan(stored, cell, "0" * 64)
    held = tuple(dict.fromkeys(m for f in built.falls for m in f.moving))
    if held:
        built = build_plan(stored, cell, "0" * 64, supports=held, cradles=held if name in CRADLED else ())
    assert built.plan is not None, [r.reasons for r in built.reports]
    return built.plan


@pytest.mark.long
@pytest.mark.parametrize("slider", [1.0, 0.1])
@pytest.mark.parametrize("name", [*FLAT, "sphere", "horse"])
@undisturbed
def test_a_lab_builds_it_without_a_false_stop(name: str, slider: float, tmp_path: Path) -> None:
    plan = plan_of(name, tmp_path)
    plan_file = tmp_path / "plan.json"
    write_plan(plan, plan_file)
    with fake_controller(plan_file, loopback(90), *AS_A_LAB_HAS_IT, "--slider", str(slider)) as host:
        calibration = read_calibration(host)
        assert calibration is not None
        arm_model = calibrated(robot_model(plan.robot), calibration)
        here = fitted(plan, arm_model)
        with (
            UrArm(host, here, SERIAL, model=arm_model) as arm,
            Journal.create(tmp_path / "j", here, arm.name) as journal,
        ):
            result = execute(here, arm, journal, person=Everybody())
    assert result.status is ExecutionStatus.SUCCEEDED, result.detail
    assert result.steps_finished == len(plan.steps)
    assert not [e for e in result.events if e.event == "attempt_failed"]
