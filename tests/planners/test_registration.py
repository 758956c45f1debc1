"""Registration: what was touched is found to the touch's own accuracy, and what fixes nothing is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mocca_robot.errors import InputError
from mocca_robot.plan.pose import rotation_matrix
from planners.robot.cell import RobotCell, cell_from_document, read_cell
from planners.robot.registration import RESIDUAL_M, fit, marks, registered

CELL = read_cell(Path(__file__).resolve().parents[2] / "configs" / "cells" / "ur5e_2f85.yaml")
BOXED: RobotCell = cell_from_document(
    {**CELL.document, "obstacles": {"crate": {"box_m": [[0.5, 0.5, 0.0], [0.7, 0.6, 0.2]]}}}, "boxed"
)


def turned(yaw_deg: float, lean_deg: float = 0.0) -> np.ndarray:
    yaw = rotation_matrix(np.array([0.0, 0.0, np.deg2rad(yaw_deg)]))
    return np.asarray(yaw @ rotation_matrix(np.array([np.deg2rad(lean_deg), 0.0, 0.0])))


@pytest.mark.parametrize("seed", range(5))
def test_a_plate_is_found_as_accurately_as_it_is_touched(seed: int) -> None:
    rng = np.random.default_rng(seed)
    known = marks(CELL, "build", [(0, 0), (0.2, 0), (0, 0.15), (0.2, 0.15)])
    turn, shift = turned(rng.uniform(-180, 180), rng.uniform(-0.5, 0.5)), rng.uniform(-0.5, 0.5, 3)
    exact = fit("build", known, known @ turn.T + shift)
    assert exact.turn == pytest.approx(turn, abs=1e-9) and exact.shift == pytest.approx(shift, abs=1e-9)
    assert exact.residuals_m.max() < 1e-9
    rough = fit("build", known, known @ turn.T + shift + rng.normal(0.0, 3e-4, known.shape))
    assert np.linalg.norm(rough.shift - shift) < 1.5e-3 and abs(np.sin(rough.yaw_rad - exact.yaw_rad)) < 5e-3
    assert 0.0 < rough.residuals_m.max() < RESIDUAL_M


def test_what_is_found_is_what_the_cell_file_then_says() -> None:
    found = fit("build", marks(CELL, "build"), marks(CELL, "build") @ turned(30.0).T + [0.4, 0.1, 0.02])
    again = cell_from_document(registered(CELL, "build", found), "again")
    assert again.build_origin_m == pytest.approx([0.4, 0.1, 0.02]) and np.rad2deg(again.build_yaw_rad) == pytest.approx(
        30
    )
    tray = marks(CELL, "tray") + np.array([0.21, -0.6, 0.0])
    again = cell_from_document(registered(CELL, "tray", fit("tray", marks(CELL, "tray"), tray)), "again")
    assert again.tray_m == pytest.approx(np.array([[0.21, -0.6], [0.65, -0.1]]))
    points = np.array([[0.2, 0.1, 0.004], [0.6, -0.3, 0.004], [0.1, -0.5, 0.004]])
    again = cell_from_document(registered(CELL, "table", fit("table", marks(CELL, "table"), points)), "again")
    assert again.table_m[1, 2] == pytest.approx(0.004)
    crate = marks(BOXED, "crate") @ turned(20.0).T + [0.5, 0.4, 0.21]
    again = cell_from_document(registered(BOXED, "crate", fit("crate", marks(BOXED, "crate"), crate)), "again")
    (box,) = again.obstacles
    assert box.middle == pytest.approx([0.5, 0.4, 0.11]) and np.rad2deg(box.yaw_rad) == pytest.approx(20)
    assert box.half == pytest.approx(BOXED.obstacles[0].half)


def test_points_that_fix_nothing_or_contradict_each_other_are_refused() -> None:
    known = marks(CELL, "build", [(0, 0), (0.2, 0), (0, 0.2), (0.2, 0.2)])
    moved = known.copy()
    moved[2, 0] += 0.03
    for build, touched, said in (
        (known, moved, "contradict each other: point"),
        (known, known @ turned(0.0, 3.0).T, "leans by 3.0°, limit 1°"),
        (known, np.column_stack([np.linspace(0, 0.2, 4), np.zeros(4), np.zeros(4)]), "on one line"),
        (known[:2], known[:2], "are 2; 3 are needed"),
    ):
        with pytest.raises(InputError, match=said):
            fit("build", build, touched)
    with pytest.raises(InputError, match="given points lie on one line"):
        marks(CELL, "build", [(0, 0), (0.1, 0), (0.2, 0)])
    with pytest.raises(InputError, match="did you mean 'tray'"):
        marks(CELL, "trai")
    askew = fit("tray", marks(CELL, "tray"), marks(CELL, "tray") @ turned(5.0).T + [0.2, -0.6, 0.0])
    with pytest.raises(InputError, match=r"turned by 5\.0°, limit 0\.5°"):
        registered(CELL, "tray", askew)
    assert replace(CELL).document == CELL.document  # nothing was changed on the way
