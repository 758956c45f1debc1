"""The solid configurations designed, written, read back, and judged from the files alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mocca_robot.config.config import load
from mocca_robot.files.design_json import read_design, write_design
from mocca_robot.statics.cases import critical_tilt
from mocca_robot.verdicts.verification import verify
from planners.cone_joints.designer import design

CONFIGS = Path(__file__).parents[2] / "configs"
OVERLAP = 1e-6
"""Of a part's volume."""


@pytest.mark.parametrize(
    "name",
    [
        "sphere",
        "horse",
        pytest.param("pavilion", marks=pytest.mark.long),
        pytest.param("lilium_tower", marks=pytest.mark.long),
    ],
)
def test_what_is_written_stands_and_goes_together(name: str, tmp_path: Path) -> None:
    config = load(CONFIGS / f"{name}.yaml")
    found = design(config.assembly, config.joints, insertion=dict(config.insertion))
    assert found.achieved
    before = [case.infeasibility_before for case in found.design.load_cases]
    assert min(before) > 1e-9, "the planar input falls"

    written = read_design(write_design(found.design, tmp_path))
    judged = verify(written.assembly, directions={i.part: np.asarray(i.direction) for i in written.insertion})
    assert judged.stands
    assert judged.assemblable
    assert judged.part_overlap < OVERLAP
    alpha = config.assembly.alpha_rad
    assert alpha is not None
    assert min(i.alpha_rad for i in judged.insertions) >= alpha - 1e-6


def test_the_ball_interlocks_with_joints_of_flat_flanks_too(tmp_path: Path) -> None:
    config = load(CONFIGS / "sphere.yaml", {"joints": {"piecewise_planar": True}})
    found = design(config.assembly, config.joints)
    assert found.achieved
    curved = [joint for joint in found.design.joints if not joint.is_planar]
    assert {joint.kind for joint in curved} == {"piecewise"}
    # A truncated pyramid has 18 triangles in at most 13 planes: four flanks, four corners of two, the top.
    for joint in curved:
        assert len(np.unique(joint.facet_normals.round(6), axis=0)) <= 14, "and the flat rim"
    written = read_design(write_design(found.design, tmp_path))
    judged = verify(written.assembly, directions={i.part: np.asarray(i.direction) for i in written.insertion})
    assert judged.stands and judged.assemblable
    assert judged.part_overlap < OVERLAP


@pytest.mark.long
def test_a_small_subset_of_the_towers_contacts_changes() -> None:
    config = load(CONFIGS / "lilium_tower.yaml")
    joints = design(config.assembly, config.joints).design.joints
    assert 0 < sum(not joint.is_planar for joint in joints) <= len(joints) / 5


@pytest.mark.long
def test_the_igloo_stands_tilted_to_every_side(tmp_path: Path) -> None:
    config = load(CONFIGS / "igloo.yaml")
    found = design(config.assembly, config.joints)
    assert found.achieved
    written = read_design(write_design(found.design, tmp_path))
    judged = verify(written.assembly, directions={i.part: np.asarray(i.direction) for i in written.insertion})
    assert judged.stands
    assert judged.assemblable
    assert judged.part_overlap < OVERLAP
    # Eight azimuths are asked for; the directions between them are no weaker.
    for azimuth_deg in (22.5, 202.5, 247.5, 292.5):
        assert critical_tilt(judged.graph, np.deg2rad(azimuth_deg)) >= np.deg2rad(35.0)
