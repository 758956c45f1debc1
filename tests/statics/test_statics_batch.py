"""Batched small load cases: the same answers as one by one, whatever they start from."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.cases import Case, dome, wall
from mocca_robot.arrays import Array, BoolArray
from mocca_robot.errors import InputError
from mocca_robot.statics.batch import solve_cases
from mocca_robot.statics.solution import solve_system
from mocca_robot.statics.solver.system import ContactSystem


@pytest.fixture(scope="module")
def case() -> Case:
    return wall(10, 10)


def tilts(case: Case) -> Array:
    return case.system.scaled(np.array([case.wrenches(t, a) for t in (0.0, 0.2, 0.6) for a in (0.0, 2.0)]))


def states(case: Case) -> tuple[Array, BoolArray, BoolArray]:
    """Return loads, rays and free parts of every state of the assembly, part by part."""
    count = len(case.free)
    present = np.tril(np.ones((count, count), dtype=np.bool_))[1:]
    wrenches = np.where(present[:, :, None], case.wrenches(0.1), 0.0)
    return case.system.scaled(wrenches), present[:, case.pairs].all(axis=2), present & case.free


def test_cases_together_are_the_cases_one_by_one(case: Case) -> None:
    system, loads = case.system, tilts(case)
    result = solve_cases(system, loads)
    assert result.kkt.max() < 1e-8
    for k, w in enumerate(loads):
        single = solve_system(system, w, solver="daqp")
        assert result.infeasibility[k] == pytest.approx(single.infeasibility, abs=1e-10)
        residual = w + system.matrix.T @ result.forces[k]
        assert np.linalg.norm(residual - result.residual[k]) < 1e-9 * np.linalg.norm(w)


def test_states_are_systems_of_the_parts_that_are_there(case: Case) -> None:
    loads, active, free = states(case)
    result = solve_cases(case.system, loads, active=active, free=free)
    assert result.kkt.max() < 1e-8
    assert (result.forces[~active] == 0.0).all()
    for k in range(len(loads)):
        alone = case.system.holding(free[k]).subset(active[k])
        w = case.system.scaled(np.where(free[k][:, None], case.wrenches(0.1), 0.0))
        w = w[np.repeat(free[k][case.free], 6)]
        assert result.infeasibility[k] == pytest.approx(solve_system(alone, w).infeasibility, abs=1e-9)


def test_start_changes_the_answer_only_within_tolerance(case: Case) -> None:
    loads = tilts(case)
    rng = np.random.default_rng(0)
    warm = solve_cases(case.system, loads)
    for _ in range(3):
        normals = case.normals + 0.02 * rng.normal(size=case.normals.shape)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        moved = ContactSystem.build(case.pairs, case.points, normals, case.free, case.centroids, case.length)
        cold, warm = solve_cases(moved, loads), solve_cases(moved, loads, warm=warm)
        assert warm.kkt.max() < 1e-8
        assert warm.infeasibility == pytest.approx(cold.infeasibility, abs=1e-9)


def test_a_warm_start_of_another_shape_is_ignored(case: Case) -> None:
    loads = tilts(case)
    other = solve_cases(case.system, loads[:2])
    assert solve_cases(case.system, loads, warm=other).kkt.max() < 1e-8


def test_price_of_force_is_part_of_the_optimum(case: Case) -> None:
    system, loads = case.system, tilts(case)[:2]
    cost = np.full(len(case.pairs), 0.02 * np.linalg.norm(loads[0]))
    result = solve_cases(system, loads, cost=cost)
    assert result.kkt.max() < 1e-8
    for k, w in enumerate(loads):
        single = solve_system(system, w, cost=cost, solver="daqp")
        value = 0.5 * result.residual[k] @ result.residual[k] + cost @ result.forces[k]
        scaled = 0.5 * (2 * single.infeasibility * (w @ w)) + cost @ single.forces
        assert value == pytest.approx(scaled, rel=1e-8)


def test_residual_and_forces_give_the_gradient() -> None:
    # dE/dB = r fᵀ (envelope theorem): a finite difference of ½|r|² with respect to one normal agrees.
    case = dome(12, 10)
    w = case.system.scaled(case.wrenches(0.4))
    base = solve_cases(case.system, w)
    ray = int(base.forces[0].argmax())
    step, change = 1e-6, np.zeros_like(case.system.rays_j)
    change[ray, 0] = step
    energies = []
    for sign in (1.0, -1.0):
        s = case.system
        moved = ContactSystem(
            pairs=s.pairs,
            rays_i=s.rays_i + sign * change,
            rays_j=s.rays_j + sign * change,
            free=s.free,
            about=s.about,
            length=s.length,
        )
        r = solve_cases(moved, w).residual[0]
        energies.append(0.5 * r @ r)
    j, i = case.system.columns[case.pairs[ray, 1]], case.system.columns[case.pairs[ray, 0]]
    r = base.residual[0]
    relative = (r[j] if j >= 0 else 0.0) - (r[i] if i >= 0 else 0.0)
    expected = relative * base.forces[0, ray]
    assert (energies[0] - energies[1]) / (2 * step) == pytest.approx(expected, rel=1e-3, abs=1e-6 * (w @ w))


def test_nothing_pulls_nothing_moves(case: Case) -> None:
    result = solve_cases(case.system, np.zeros((2, len(tilts(case)[0]))))
    assert (result.infeasibility == 0.0).all()
    assert (result.residual == 0.0).all()


def test_shapes_that_do_not_fit_are_refused(case: Case) -> None:
    with pytest.raises(InputError, match="unknowns"):
        solve_cases(case.system, np.zeros((2, 5)))
    with pytest.raises(InputError, match="'active'"):
        solve_cases(case.system, tilts(case), active=np.ones((2, 3), dtype=np.bool_))
