"""Obstacles of a cell: kept clear of, refused where the arm or a part has to be, seen again by every later look."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_plan_build import cell, plan_of, tower

from mocca_robot.errors import InputError
from planners.robot.build_plan import build_plan
from planners.robot.cell import RobotCell, cell_of, read_cell
from planners.robot.obstacles import CellBox, require_room
from planners.robot.recheck import recheck

TEXT = (Path(__file__).resolve().parents[2] / "configs" / "cells" / "ur5e_2f85.yaml").read_text()


def with_obstacles(folder: Path, **boxes: object) -> RobotCell:
    file = folder / "cell.yaml"
    file.write_text(f"{TEXT}\nobstacles: {json.dumps(boxes)}\n")
    return replace(read_cell(file), build_size_m=None)


POST = {"box_m": [[0.40, -0.06, 0.0], [0.44, -0.02, 0.6]]}


def test_the_arm_goes_round_an_obstacle_that_stands_in_its_way(tmp_path: Path) -> None:
    here = with_obstacles(tmp_path, post=POST)
    result = build_plan(tower(1), here, "0" * 64)
    plan = plan_of(result)
    assert recheck(plan, result.cell, result.site, result.tray) == []
    assert [o.name for o in cell_of(plan).obstacles] == ["post"]  # a plan knows them without its cell file
    without = build_plan(tower(1), cell(), "0" * 64)
    blocked = recheck(plan_of(without), here, without.site, without.tray)
    assert any("obstacle post" in f.value for f in blocked)


@pytest.mark.parametrize(
    ("box", "said"),
    [
        ([[-0.1, -0.1, -0.1], [0.1, 0.1, 0.5]], "contains link 0"),
        ([[-0.4, -0.3, 0.3], [0.4, 0.3, 0.9]], "link"),
    ],
)
def test_an_obstacle_around_the_arm_is_refused(tmp_path: Path, box: object, said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        with_obstacles(tmp_path, cage={"box_m": box})
    assert "obstacles.cage" in str(refused.value) and "home_deg" in str(refused.value)


def test_a_pedestal_may_carry_the_base(tmp_path: Path) -> None:
    here = with_obstacles(tmp_path, pedestal={"box_m": [[-0.2, -0.2, -0.8], [0.2, 0.2, 0.0]]})
    assert here.obstacles[0].carries_base


def test_an_obstacle_where_a_part_belongs_or_waits_is_refused(tmp_path: Path) -> None:
    x, y, _ = cell().build_origin_m
    inside = {"box_m": [[x - 0.02, y - 0.02, 0.0], [x + 0.02, y + 0.02, 0.2]], "yaw_deg": 30}
    with pytest.raises(InputError, match=r"'crate' stands where part '\w+' belongs"):
        build_plan(tower(1), with_obstacles(tmp_path, crate=inside), "0" * 64)
    tray = cell().tray_m
    over = {"box_m": [[*tray[0].tolist(), 0.0], [*tray[1].tolist(), 0.02]]}
    with pytest.raises(InputError, match="waits in the tray"):
        build_plan(tower(1), with_obstacles(tmp_path, rack=over), "0" * 64)


def test_pieces_meet_boxes_exactly_also_turned() -> None:
    box = CellBox("o", np.zeros(3), np.array([1.0, 0.1, 1.0]), float(np.pi / 4))
    edge = np.array([[0.5, -0.5, 0.0], [0.9, -0.9, 0.0], [0.7, -0.7, 0.2], [0.6, -0.6, -0.2]])
    assert not box.meets(edge) and box.meets(edge + np.array([-0.6, 0.6, 0.0]))
    # Their bounding boxes overlap in every frame, they do not.
    flat = CellBox("o", np.zeros(3), np.array([1.0, 1.0, 1.0]), 0.0)
    corner = np.array([[1.6, 0.6, 0.0], [0.6, 1.6, 0.0], [1.6, 1.6, 0.0], [1.1, 1.1, 0.5]])
    assert not flat.meets(corner) and flat.meets(corner - 0.11)
    require_room([flat], [], {})
    assert flat.distance(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])).tolist() == [0.0, 1.0]


def test_unknown_keys_and_empty_boxes_are_named(tmp_path: Path) -> None:
    for bad, said in (({"size": 1}, "box_m"), ({"box_m": [[0, 0, 0], [0, 1, 1]]}, "obstacles.wall.box_m")):
        with pytest.raises(InputError, match=said):
            with_obstacles(tmp_path, wall=bad)
