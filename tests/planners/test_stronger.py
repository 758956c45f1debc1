"""Joints that a material bears: milder bounds change joints, other verdicts stay, elements confirm what was asked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mocca_robot.config.config import load
from mocca_robot.contacts.find import find_contacts
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.strength.assess import assess
from mocca_robot.strength.part_elements import solve_part
from mocca_robot.verdicts.verification import verify
from planners.cone_joints.designer import design
from planners.cone_joints.outcome import Designed
from planners.cone_joints.stronger import milder, reached, stronger

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


@pytest.mark.parametrize(
    ("name", "material", "safety"),
    [("stack", "plaster", 85.0), ("leaning_tower_10", "pla", 3300.0), ("scarecrow", "plaster", 16.5)],
)
def test_a_design_becomes_as_strong_as_asked_and_elements_confirm_it(name: str, material: str, safety: float) -> None:
    pytest.importorskip("skfem")
    config = load(CONFIGS / f"{name}.yaml", {"material": material, "strength": {"safety": safety}})
    contacts = find_contacts(config.assembly)

    def made(options: JointOptions) -> Designed:
        return design(config.assembly, options, insertion=dict(config.insertion) or None, contacts=contacts)

    first = made(config.joints)
    assert reached(first, config.strength) < safety
    best = stronger(first, config.joints, safety, made, lambda d: reached(d, config.strength))
    assert best is not first and reached(best, config.strength) >= safety
    assert verify(best.design.assembly).stands and best.achieved
    graph = PartsGraph.of(best.design.assembly)
    assert assess(graph, config.strength, states=False, elements=solve_part).holds


def test_milder_bounds_are_lower_blunter_and_further_from_the_edge_and_end_before_the_middle() -> None:
    options = JointOptions()
    for _ in range(10):
        once = milder(options)
        assert once.max_height < options.max_height and once.max_slope_rad < options.max_slope_rad
        assert options.margin <= once.margin < 0.5
        options = once
    assert milder(JointOptions(margin=0.4)).margin == 0.4


def test_where_milder_bounds_do_not_hold_the_strongest_design_before_is_kept() -> None:
    config = load(CONFIGS / "stack.yaml", {"material": "plaster"})
    first = design(config.assembly, config.joints)
    tried: list[JointOptions] = []

    def fails(options: JointOptions) -> Designed:
        tried.append(options)
        return design(config.assembly, JointOptions(max_height=1e-6, max_slope_rad=float(np.deg2rad(0.01))))

    assert stronger(first, config.joints, 1e9, fails, lambda d: 1.0) is first
    assert len(tried) == 1
