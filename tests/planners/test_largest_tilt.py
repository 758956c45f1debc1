"""How far a structure can be tilted: the climb ends between a design that stands and what is known beyond it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mocca_robot import load
from mocca_robot.assembly import Assembly, Equilibrium, Lateral, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.errors import InputError
from mocca_robot.files.assembly_json import write_assembly
from mocca_robot.joints.bounds import Bound
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.insertion import insertion_verdicts
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import critical_tilt
from mocca_robot.statics.tilt_reserve import tilt_reserve
from planners.cone_joints.designer import design
from planners.cone_joints.largest_tilt import RESOLUTION, design_as_asked, largest_tilt
from planners.cone_joints.outcome import Designed


def rectangle(name: str, x: float, y: float, w: float, h: float, fixed: bool = False) -> Part:
    return Part(name, Polygon(np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])), fixed=fixed)


def block(height: float = 0.1, angle_deg: float = 10.0) -> Assembly:
    """Return a block 0.1 wide on the ground."""
    parts = (rectangle("ground", -0.1, -0.1, 0.3, 0.1, True), rectangle("block", 0.0, 0.0, 0.1, height))
    return Assembly("block", parts, goals=(Lateral(float(np.deg2rad(angle_deg))),))


@pytest.mark.parametrize("steepest_deg", [25.0, 40.0])
def test_no_block_stands_on_a_slope_steeper_than_its_joint(steepest_deg: float) -> None:
    """Every contact force leans from the bed's normal by at most the joint's slope; so then may the weight."""
    climb = largest_tilt(block(), JointOptions(tilt_margin_rad=0.0, max_slope_rad=float(np.deg2rad(steepest_deg))))
    assert climb.angle_rad is not None
    assert np.deg2rad(10.0) <= climb.angle_rad <= np.deg2rad(steepest_deg)
    assert climb.impossible_rad is not None
    assert climb.angle_rad < climb.impossible_rad <= np.deg2rad(steepest_deg) + RESOLUTION
    built = climb.designed.design.assembly
    graph = PartsGraph.of(built)
    assert min(critical_tilt(graph, a) for a in (0.0, np.pi)) >= climb.angle_rad - 1e-6
    assert climb.failed_rad is None or climb.angle_rad < climb.failed_rad


def test_the_proven_angle_is_proven_by_a_design_run_too() -> None:
    bounds = JointOptions(tilt_margin_rad=0.0, max_slope_rad=float(np.deg2rad(15.0)))
    climb = largest_tilt(block(), bounds)
    assert climb.impossible_rad is not None
    over = block(0.1, float(np.rad2deg(climb.impossible_rad)))
    assert design(over, bounds).impossible is not None
    under = block(0.1, float(np.rad2deg(climb.impossible_rad - 2 * RESOLUTION)))
    assert design(under, bounds).impossible is None


def test_without_a_lateral_goal_there_is_nothing_to_climb() -> None:
    upright = Assembly("block", block().parts)
    with pytest.raises(InputError, match="lateral"):
        largest_tilt(upright)


def test_the_command_says_how_far_and_why_not_further(
    tmp_path,
    capsys: pytest.CaptureFixture[str],  # type: ignore[no-untyped-def]
) -> None:
    path = write_assembly(block(), tmp_path / "block.json")
    command = ["design", str(path), "-o", str(tmp_path / "out"), "--largest-angle", "--set", "joints.max_slope_deg=15"]
    assert main([*command, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    climb = said["largest_angle"]
    assert climb["angle_deg"] >= 10.0
    assert climb["tried"][0]["angle_deg"] == pytest.approx(10.0)
    tilted = [c["case"] for c in said["cases"]]
    assert "tilt_000" in tilted
    assert main(command) == 0
    assert "largest tilt: a design was found up to" in capsys.readouterr().out


def reserve_deg(found: Designed) -> float:
    measured = tilt_reserve(PartsGraph.of(found.design.assembly), 0.0)
    assert measured is not None
    return float(np.rad2deg(measured.reserve_rad))


LARGEST = JointOptions(tilt_margin_rad=np.inf)


@pytest.mark.parametrize("name", ["m", "stack", "tree", "leaning_tower_20", "leaning_tower_30"])
def test_the_largest_margin_at_least_doubles_a_small_reserve_and_keeps_alpha(name: str) -> None:
    config = load(f"configs/{name}.yaml")
    usual = reserve_deg(design_as_asked(config.assembly, config.joints))
    assert usual < 5.0
    most = design_as_asked(config.assembly, replace(config.joints, tilt_margin_rad=np.inf))
    assert most.achieved and reserve_deg(most) >= 2.0 * usual
    assert all(way.assemblable for way in insertion_verdicts(PartsGraph.of(most.design.assembly)))


def test_no_margin_is_larger_than_the_steepest_joint() -> None:
    upright = replace(block(), goals=(Equilibrium(),))
    most = design_as_asked(upright, replace(LARGEST, max_slope_rad=float(np.deg2rad(30.0))))
    assert 10.0 < reserve_deg(most) <= 30.0
    assert most.tight and Bound.SLOPE in most.tight[0].bounds


def test_what_only_interlocks_has_no_margin_to_climb() -> None:
    config = load("configs/sphere.yaml")
    asked = [replace(config.joints, tilt_margin_rad=margin) for margin in (JointOptions().tilt_margin_rad, np.inf)]
    usual, most = (design_as_asked(config.assembly, options) for options in asked)
    assert most.achieved and most.evaluations == usual.evaluations


def test_one_design_alone_cannot_have_the_largest_margin() -> None:
    with pytest.raises(InputError, match="design_as_asked"):
        design(replace(block(), goals=(Equilibrium(),)), LARGEST)


def test_one_climb_at_a_time() -> None:
    with pytest.raises(InputError, match=r"joints\.tilt_margin_deg"):
        largest_tilt(block(), LARGEST)


def test_the_command_asks_for_the_largest_margin(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    setting = ["--set", "joints.tilt_margin_deg=max"]
    assert main(["design", "configs/stack.yaml", "-o", str(tmp_path), "--json", *setting]) == 0
    told = json.loads(capsys.readouterr().out)["reserve"]
    assert told["margin_deg"] == "max" and told["reached"] is True and told["critical_deg"] > 5.0
    assert main(["design", "configs/stack.yaml", "-o", str(tmp_path), "--set", "joints.tilt_margin_deg=most"]) == 2
    assert "joints.tilt_margin_deg" in capsys.readouterr().err
