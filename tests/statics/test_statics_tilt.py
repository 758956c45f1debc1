"""Critical tilt: closed forms, and the linear program that maximises tan θ."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from benchmarks.cases import GRAVITY, Case, arch, dome, stack, wall
from mocca_robot.statics.equilibrium import equilibrium
from mocca_robot.statics.solution import EquilibriumResult, Status
from mocca_robot.statics.tilt import critical_angle


def critical(case: Case, friction: float = 0.0, azimuth_rad: float = 0.0) -> tuple[float, int]:
    def solve(angle: float) -> EquilibriumResult:
        result = equilibrium(
            case.pairs,
            case.points,
            case.normals,
            case.wrenches(angle, azimuth_rad),
            fixed=~case.free,
            friction=friction,
            about=case.centroids,
            length=case.length,
        )
        assert isinstance(result, EquilibriumResult)
        return result

    side = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0])
    return critical_angle(solve, case.weights / GRAVITY, GRAVITY * np.array([0.0, 0.0, -1.0]), GRAVITY * side)


def by_linear_program(case: Case) -> float:
    system = case.system
    upright, sideways = (system.scaled(case.wrenches(t)) for t in (0.0, np.pi / 2))
    solution = linprog(
        np.r_[np.zeros(len(case.pairs)), -1.0],
        A_eq=np.c_[system.matrix.toarray().T, sideways] / np.linalg.norm(upright),
        b_eq=-upright / np.linalg.norm(upright),
        bounds=(0, None),
    )
    assert solution.success
    return float(np.arctan(solution.x[-1]))


@pytest.mark.parametrize("azimuth_rad", [0.0, 1.0, np.pi / 2])
def test_a_cube_slides_at_the_friction_angle(azimuth_rad: float) -> None:
    assert critical(stack(1), 0.3, azimuth_rad)[0] == pytest.approx(np.arctan(0.3), abs=2e-5)


@pytest.mark.parametrize("count", [2, 4])
def test_a_column_of_cubes_tips_over_its_edge(count: int) -> None:
    # The centre of mass is count/2 high and half a width from the edge.
    assert critical(stack(count, shift=0.0), 5.0)[0] == pytest.approx(np.arctan(1.0 / count), abs=2e-5)


@pytest.mark.parametrize(
    "case", [stack(3, 10, shift=0.0), stack(3, 50, shift=0.1), wall(20, 10), dome(24, 50)], ids=lambda c: c.name
)
def test_collapse_motions_find_what_the_linear_program_finds(case: Case) -> None:
    angle, solves = critical(case)
    assert angle == pytest.approx(by_linear_program(case), abs=5e-5)
    assert solves <= 12


@pytest.mark.parametrize(("case", "friction"), [(arch(20), 0.6), (dome(24), 0.4)])
def test_below_the_angle_it_stands_above_it_falls(case: Case, friction: float) -> None:
    angle, _ = critical(case, friction)
    assert 0.01 < angle < np.pi / 2
    for factor, status in ((0.995, Status.EQUILIBRIUM), (1.005, Status.NOT_IN_EQUILIBRIUM)):
        result = equilibrium(
            case.pairs, case.points, case.normals, case.wrenches(factor * angle), fixed=[0], friction=friction,
            about=case.centroids, length=case.length,
        )  # fmt: skip
        assert isinstance(result, EquilibriumResult)
        assert result.status is status


def test_without_a_verdict_bisection_goes_on() -> None:
    def solve(angle: float) -> EquilibriumResult:
        nothing = np.zeros((1, 6))
        if angle > 1.0:
            return EquilibriumResult(Status.INACCURATE, 0.1, nothing, nothing, 1.0)
        status = Status.EQUILIBRIUM if angle <= 0.4 else Status.NOT_IN_EQUILIBRIUM
        return EquilibriumResult(status, 0.0 if angle <= 0.4 else 0.1, nothing, nothing, 0.0)

    angle, _ = critical_angle(solve, np.ones(1), np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]))
    assert angle == pytest.approx(0.4, abs=2e-4)
