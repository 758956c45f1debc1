"""How joints look where users want it: one shape for all, or the user's own profile; what no joint can be is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from solids import box

from mocca_robot.assembly import Assembly, Lateral, Part
from mocca_robot.config.config import load
from mocca_robot.errors import InputError
from mocca_robot.joints.options import JointOptions
from mocca_robot.verdicts.verification import verify
from planners.cone_joints.designer import design

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def pile(tilt_deg: float = 12.0) -> Assembly:
    """Return two blocks on each other, of different size, to be designed for a tilted ground."""
    parts = (
        Part("ground", box((-0.2, -0.2, -0.1), (0.2, 0.2, 0)), fixed=True),
        Part("low", box((-0.15, -0.1, 0), (0.15, 0.1, 0.05))),
        Part("high", box((-0.08, -0.06, 0.05), (0.08, 0.06, 0.1))),
    )
    goals = (Lateral(float(np.deg2rad(tilt_deg)), 4),)
    return Assembly("pile", parts, goals=goals, alpha_rad=float(np.deg2rad(5.0)))


def test_joints_that_are_to_look_alike_have_one_shape() -> None:
    outcome = design(pile(), JointOptions(alike=True))
    assert outcome.achieved
    curved = [j for j in outcome.design.joints if not j.is_planar]
    assert len(curved) == 2
    ratios = {round(j.parameters["height_m"] / j.parameters["l2_m"], 9) for j in curved}
    assert len(ratios) == 1
    flat = load(CONFIGS / "leaning_tower_10.yaml").assembly
    outcome = design(flat, JointOptions(alike=True, tilt_margin_rad=0.0))
    curved = [j for j in outcome.design.joints if not j.is_planar]
    shapes = {tuple(round(j.parameters[k] / j.contact.measure, 9) for k in ("w1", "w2", "h")) for j in curved}
    assert len(curved) > 5 and len(shapes) == 1
    assert outcome.achieved


def test_a_drawn_profile_is_what_is_built() -> None:
    profile = ((0.0, 1.0, 0.0), (1.0, 1.0, 1.0), (0.0, 1.0, 0.0))
    outcome = design(pile(5.0), JointOptions(profile=profile, kinds=("n",)))
    assert outcome.achieved
    for joint in (j for j in outcome.design.joints if not j.is_planar):
        assert joint.kind == "drawn"
        heights = np.array([joint.parameters[f"height_{k}_m"] for k in range(9)]) / joint.parameters["height_m"]
        np.testing.assert_allclose(heights, np.ravel(profile), atol=1e-12)
    built = outcome.design
    assert verify(built.assembly, directions={i.part: i.direction for i in built.insertion}).assemblable


@pytest.mark.parametrize(
    ("joints", "words"),
    [
        ("profile: [[0, 1], [1]]", "rows of 1 and of 2 heights"),
        ("profile: [[0, 0], [0, 0]]", "is flat"),
        ("profile: [[[0, 0, 1], [0, 0, 2]]]", "one height above every place"),
        ("profile: 3", "must be rows of heights"),
        ("kinds: [z]", "which only flat parts have"),
        ("control_heights: 9", "at most 6"),
        ("kinds: [rib]", r"without n.*Write .*kinds: \[n, rib\]"),
    ],
)
def test_what_no_joint_can_be_is_named_with_the_remedy(joints: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(f"generator: {{kind: stack}}\njoints: {{{joints}}}\n", encoding="utf-8")
    with pytest.raises(InputError, match=words):
        load(file)


def test_cells_too_small_for_the_tool_are_named() -> None:
    options = JointOptions(kinds=("heights",), control_heights=6, min_radius=0.02)
    with pytest.raises(InputError, match="control_heights is 6"):
        design(pile(), options)
