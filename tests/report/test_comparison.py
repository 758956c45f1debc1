"""Fig. 15 and Fig. 16 on our own models: what each way of joining the same parts can and cannot do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mocca_robot.assembly import Equilibrium
from mocca_robot.cli.compare import judged
from mocca_robot.config.config import load
from mocca_robot.report.comparison import Variant
from planners.baselines.comparison import CONE_JOINTS, joineries

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.fixture(scope="module")
def scarecrow() -> dict[str, Variant]:
    config = load(CONFIGS / "scarecrow.yaml")
    return {j.name: judged(j) for j in joineries(config.assembly, config.joints)}


@pytest.fixture(scope="module")
def sphere() -> dict[str, Variant]:
    config = load(CONFIGS / "sphere.yaml")
    return {j.name: judged(j) for j in joineries(config.assembly, config.joints)}


def cone_of(variant: Variant) -> dict[str, float]:
    return {i.part: i.alpha_rad for i in variant.verification.insertions}


def test_flat_scarecrow_falls_in_statics_and_in_physics(scarecrow: dict[str, Variant]) -> None:
    planar = scarecrow["planar"]
    assert not planar.verification.stands and planar.physics_stands is False
    assert planar.verification.cases[0].moving == ("arm_left", "arm_right")


def test_single_direction_scarecrow_stands_but_every_part_has_one_way_in(scarecrow: dict[str, Variant]) -> None:
    single = scarecrow["single direction"]
    assert single.verification.stands and single.physics_stands is True
    assert single.goes_in and not single.verification.assemblable
    assert np.abs(list(cone_of(single).values())).max() < 1e-9
    assert single.verification.part_overlap < 1e-9 and not single.deadlocked


def test_cone_joint_scarecrow_stands_and_goes_in_within_25_degrees(scarecrow: dict[str, Variant]) -> None:
    cones = scarecrow[CONE_JOINTS]
    assert cones.verification.stands and cones.physics_stands is True
    assert cones.verification.assemblable
    assert min(cone_of(cones).values()) >= np.deg2rad(25.0)
    assert cones.physics_tilt_rad is not None and cones.tilt_rad is not None
    assert abs(cones.physics_tilt_rad - cones.tilt_rad) < np.deg2rad(0.5)


def test_flat_sphere_falls_even_with_its_key_held(sphere: dict[str, Variant]) -> None:
    planar = sphere["planar"]
    assert not any(c.result.stands for c in planar.verification.cases)
    assert {c.case.name for c in planar.verification.cases} == {"interlocking", "gravity_key_held"}
    assert planar.physics_stands is False


def test_upright_tenons_deadlock_the_sphere(sphere: dict[str, Variant]) -> None:
    upright = sphere["upright mortise and tenon"]
    assert upright.verification.stands and upright.physics_stands is True
    assert upright.deadlocked and not upright.goes_in
    blocked = {i.part: i.blockers for i in upright.verification.insertions if i.alpha_rad < -1e-9}
    assert set(blocked) == {"north", "west", "south", "key"}, "only the first can still go in, along its own normal"
    assert all(blocked.values())
    assert any("no part can leave" in r for r in upright.remarks)


@pytest.mark.parametrize("name", [CONE_JOINTS, "tilted mortise and tenon"])
def test_cone_joints_and_tenons_derived_from_them_interlock(sphere: dict[str, Variant], name: str) -> None:
    variant = sphere[name]
    assert variant.verification.stands and variant.physics_stands is True
    assert not variant.deadlocked and variant.goes_in, "the key comes out, and everything went in"
    assert variant.verification.part_overlap < 1e-6
    if name == CONE_JOINTS:
        assert variant.verification.assemblable
    else:
        assert np.abs(list(cone_of(variant).values())).max() < 1e-6, "one direction each"


def test_every_variant_keeps_parts_contacts_and_total_volume(sphere: dict[str, Variant]) -> None:
    volumes = [sum(p.shape.volume for p in v.assembly.parts) for v in sphere.values()]
    assert volumes == pytest.approx([volumes[0]] * 4)
    assert len({len(v.joints) for v in sphere.values()}) == 1
    assert sphere["planar"].assembly.goals != (Equilibrium(),)
