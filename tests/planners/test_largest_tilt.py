"""How far a structure can be tilted: the climb ends between a design that stands and what is known beyond it."""

from __future__ import annotations

import json

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Lateral, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.errors import InputError
from mocca_robot.files.assembly_json import write_assembly
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import critical_tilt
from planners.cone_joints.designer import design
from planners.cone_joints.largest_tilt import RESOLUTION, largest_tilt


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
