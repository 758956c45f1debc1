"""Statics: closed forms, invariances, agreement of all solvers, certificates that refuse wrong answers."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.cases import Case, arch, dome, stack, wall
from mocca_robot.arrays import Array
from mocca_robot.errors import InputError, MoccaError
from mocca_robot.statics.equilibrium import equilibrium
from mocca_robot.statics.friction import CONE_SOLVERS
from mocca_robot.statics.solution import EquilibriumResult, Status, solve_system, verdict
from mocca_robot.statics.solver.face import on_face
from mocca_robot.statics.solver.interior_point import solve_interior_point
from mocca_robot.statics.solver.solvers import SOLVERS, kkt_residual

UNIT_BLOCK = np.array([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]])


def solved(case: Case, friction: float = 0.0, tilt_rad: float = 0.0, solver: str = "auto") -> EquilibriumResult:
    result = equilibrium(
        case.pairs,
        case.points,
        case.normals,
        case.wrenches(tilt_rad),
        fixed=~case.free,
        friction=friction,
        about=case.centroids,
        length=case.length,
        solver=solver,
    )
    assert isinstance(result, EquilibriumResult)
    return result


# Closed forms


@pytest.mark.parametrize(("shift", "stands"), [(0.05, True), (0.095, True), (0.105, False), (0.20, False)])
def test_ten_cubes_stand_up_to_a_shift_of_a_tenth(shift: float, stands: bool) -> None:
    result = solved(stack(10, shift=shift))
    assert result.status is (Status.EQUILIBRIUM if stands else Status.NOT_IN_EQUILIBRIUM)


@pytest.mark.parametrize(("thickness", "stands"), [(0.12, True), (0.09, False)])
def test_semicircular_arch_needs_a_tenth_of_its_radius(thickness: float, stands: bool) -> None:
    assert solved(arch(27, thickness=thickness), friction=0.55).stands is stands


@pytest.mark.parametrize(("slope_deg", "stands"), [(16.0, True), (17.5, False)])
def test_block_on_a_slope_slides_at_the_friction_angle(slope_deg: float, stands: bool) -> None:
    # atan 0.3 = 16.7°
    assert solved(stack(1), friction=0.3, tilt_rad=np.deg2rad(slope_deg)).stands is stands


def test_block_on_a_frictionless_slope_keeps_the_part_of_its_weight_along_it() -> None:
    # Nothing transmits the component along the slope: the residual is sin θ of the weight, E = ½ sin² θ.
    slope = np.deg2rad(10.0)
    normal = np.array([0.0, 1.0])
    weight = 7.0 * np.array([np.sin(slope), -np.cos(slope), 0.0])
    result = equilibrium(
        np.array([[0, 1]] * 2), UNIT_BLOCK[:, :2], np.tile(normal, (2, 1)), np.array([0 * weight, weight]), fixed=[0]
    )
    assert isinstance(result, EquilibriumResult)
    assert result.infeasibility == pytest.approx(0.5 * np.sin(slope) ** 2, rel=1e-9)
    assert result.motions[1, 0] == pytest.approx(7.0 * np.sin(slope))
    assert result.forces.sum() == pytest.approx(7.0 * np.cos(slope))


def test_two_blocks_carry_the_weight_of_one_and_of_both() -> None:
    result = solved(stack(2, shift=0.0))
    weights = stack(2).weights
    assert result.stands
    assert result.forces[:4].sum() == pytest.approx(weights[1:].sum())
    assert result.forces[4:].sum() == pytest.approx(weights[2])


def test_a_part_that_touches_nothing_falls_with_its_whole_weight() -> None:
    empty = np.zeros((0, 3))
    result = equilibrium(np.zeros((0, 2), dtype=np.int64), empty, empty, np.ones((1, 6)))
    assert isinstance(result, EquilibriumResult)
    assert result.status is Status.NOT_IN_EQUILIBRIUM
    assert result.infeasibility == 0.5


# Invariances


@pytest.fixture(scope="module")
def uneven() -> Case:
    """A dome that is not in equilibrium, so that E is a number and not zero."""
    return dome(36)


def turned(case: Case, rotation: Array, shift: Array, scale: float) -> tuple[Array, Array, Array, Array]:
    points, centroids = scale * case.points @ rotation.T + shift, scale * case.centroids @ rotation.T + shift
    force = case.wrenches(0.1)[:, :3] @ rotation.T
    return points, case.normals @ rotation.T, np.c_[force, np.cross(centroids, force)], centroids


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_rigid_motion_and_scale_change_nothing(uneven: Case, friction: float) -> None:
    rotation = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    rotation *= np.linalg.det(rotation)
    points, normals, wrenches, centroids = turned(uneven, rotation, np.array([3.0, -2.0, 5.0]), 1e-3)
    before = solved(uneven, friction, tilt_rad=0.1)
    after = equilibrium(
        uneven.pairs,
        points,
        normals,
        wrenches,
        fixed=[0],
        friction=friction,
        about=centroids,
        length=1e-3 * uneven.length,
    )
    assert isinstance(after, EquilibriumResult)
    assert after.status is before.status
    assert after.infeasibility == pytest.approx(before.infeasibility, rel=1e-6)


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_order_of_contacts_and_parts_changes_nothing(uneven: Case, friction: float) -> None:
    rng = np.random.default_rng(2)
    rays, parts = rng.permutation(len(uneven.pairs)), rng.permutation(len(uneven.free))
    new = np.argsort(parts)  # part p is now called new[p]
    after = equilibrium(
        new[uneven.pairs][rays],
        uneven.points[rays],
        uneven.normals[rays],
        uneven.wrenches(0.1)[parts],
        fixed=[int(new[0])],
        friction=friction,
        about=uneven.centroids[parts],
        length=uneven.length,
    )
    assert isinstance(after, EquilibriumResult)
    before = solved(uneven, friction, tilt_rad=0.1)
    assert after.infeasibility == pytest.approx(before.infeasibility, rel=1e-6)
    assert after.motions == pytest.approx(before.motions[parts], abs=1e-5 * np.abs(before.motions).max())


def test_stacked_load_cases_are_the_cases_one_by_one(uneven: Case) -> None:
    loads = np.array([uneven.wrenches(t) for t in (0.0, 0.1, 0.2)])
    together = equilibrium(
        uneven.pairs, uneven.points, uneven.normals, loads, fixed=[0], about=uneven.centroids, length=uneven.length
    )
    assert isinstance(together, list)
    for tilt, result in zip((0.0, 0.1, 0.2), together, strict=True):
        assert result.infeasibility == pytest.approx(solved(uneven, tilt_rad=tilt).infeasibility, rel=1e-6)


@pytest.mark.parametrize("case", [arch(20), arch(20, 20), dome(36, 10), dome(36, 40)], ids=lambda c: c.name)
def test_a_sweep_that_starts_each_load_from_the_last_gives_every_load_its_own_answer(case: Case) -> None:
    # Neighbouring tilts in a row, then back upright, then the other way: kept faces and points must not mislead.
    system = case.system
    loads = np.array([system.scaled(case.wrenches(t)) for t in (*np.linspace(0.0, 0.3, 13), 0.0, -0.05, -0.1, -0.4)])
    c = np.zeros(len(case.pairs))
    motions, forces = solve_interior_point(system, loads, c)
    for w, v, f in zip(loads, motions, forces, strict=True):
        assert kkt_residual(system.matrix, w, c, v, f) < 1e-8
        exact, _ = SOLVERS["clarabel"](system.matrix, w, c)
        assert v @ v / (w @ w) == pytest.approx(exact @ exact / (w @ w), abs=1e-8)


def test_a_face_is_refused_unless_exactly_its_rays_press() -> None:
    system = stack(6, shift=0.3).system
    blocks = system.blocks
    w = system.scaled(stack(6, shift=0.3).wrenches())
    _, f = solve_interior_point(system, w, np.zeros(len(system.pairs)))
    pull, z = blocks.own_transposed(w) / np.linalg.norm(w), f[blocks.source] / np.linalg.norm(w)
    pressing, c = z > 1e-6, np.zeros(len(z))
    found = on_face(blocks, pull, c, z, pressing)
    assert found is not None
    assert blocks.forces(found) * np.linalg.norm(w) == pytest.approx(f, abs=1e-6 * np.linalg.norm(w))
    unsupported, glued = pressing.copy(), np.ones_like(pressing)
    unsupported[:4] = False  # the lowest contact: the stack would fall through it
    assert on_face(blocks, pull, c, z, unsupported) is None
    assert on_face(blocks, pull, c, z, glued) is None  # it topples: edges open that would have to be pulled


# Cross-checks

STRUCTURES = [stack(6, 10, shift=0.3), arch(12), arch(12, 10), wall(20, 10), dome(24, 10), dome(24)]


@pytest.mark.parametrize("case", STRUCTURES, ids=lambda c: c.name)
@pytest.mark.parametrize("tilt_rad", [0.0, 0.3])
def test_all_solvers_agree(case: Case, tilt_rad: float) -> None:
    exact = solved(case, tilt_rad=tilt_rad, solver="daqp")
    for solver in ["interior_point", *SOLVERS]:
        if solver == "osqp" and "planar" not in case.name:
            continue  # operator splitting is not to be trusted on curved contacts
        result = solved(case, tilt_rad=tilt_rad, solver=solver)
        assert result.infeasibility == pytest.approx(exact.infeasibility, abs=2e-9), solver
        if solver != "osqp":
            assert result.status in (exact.status, Status.INACCURATE), solver
    assert solved(case, tilt_rad=tilt_rad, solver="interior_point").status is exact.status


@pytest.mark.parametrize("case", STRUCTURES, ids=lambda c: c.name)
def test_force_form_and_motion_form_have_the_same_optimum(case: Case) -> None:
    # Eq. 7: max wᵀv − ½|v|² over motions; Eq. 8: min ½|w + Bᵀf|² over forces.
    system = case.system
    w = system.scaled(case.wrenches(0.3))
    w /= np.linalg.norm(w)
    v, f = solve_interior_point(system, w, np.zeros(len(case.pairs)))
    residual = w + system.matrix.T @ f
    assert (system.matrix @ v).min() > -1e-8
    assert f.min() >= 0.0
    assert w @ v - 0.5 * v @ v == pytest.approx(0.5 * residual @ residual, abs=1e-8)


@pytest.mark.parametrize(
    ("case", "friction"), [(arch(27), 0.55), (arch(27), 0.1), (dome(36), 0.2), (stack(8, shift=0.11), 0.5)]
)
@pytest.mark.parametrize("tilt_rad", [0.0, 0.2])
def test_friction_cones_agree_between_solvers(case: Case, friction: float, tilt_rad: float) -> None:
    ours, other = (solved(case, friction, tilt_rad, solver) for solver in CONE_SOLVERS)
    assert ours.status is other.status
    assert ours.infeasibility == pytest.approx(other.infeasibility, abs=1e-8)


def test_contact_forces_stay_in_the_friction_cone_and_balance_the_load() -> None:
    case, friction = dome(36), 0.55
    result = solved(case, friction)
    assert result.stands
    along = (result.forces * case.normals).sum(axis=1)
    across = np.linalg.norm(result.forces - along[:, None] * case.normals, axis=1)
    assert (across <= friction * along * (1 + 1e-9) + 1e-12).all()
    balance = case.wrenches()[:, :3].copy()
    np.add.at(balance, case.pairs[:, 1], result.forces)
    np.add.at(balance, case.pairs[:, 0], -result.forces)
    assert np.abs(balance[case.free]).max() < 1e-6 * case.weights.sum()


def test_planar_friction_is_the_limit_of_the_solid_one() -> None:
    # The arch lies in a plane: as flat contacts with two rays each it stands or falls with its solid twin.
    for thickness in (0.12, 0.09):
        case = arch(27, thickness=thickness)
        front = case.points[:, 1] > 0
        flat = equilibrium(
            case.pairs[front],
            case.points[front][:, [0, 2]],
            case.normals[front][:, [0, 2]],
            case.wrenches()[:, [0, 2, 4]] * [1, 1, -1],
            fixed=[0],
            friction=0.55,
        )
        assert isinstance(flat, EquilibriumResult)
        assert flat.stands is solved(case, friction=0.55).stands


def test_price_of_force_shows_in_the_slack() -> None:
    system = dome(24, 10).system
    w = system.scaled(dome(24, 10).wrenches(0.2))
    cost = np.full(len(system.pairs), 0.01 * np.linalg.norm(w))
    v, f = solve_interior_point(system, w, cost)
    assert kkt_residual(system.matrix, w, cost, v, f) < 1e-8
    free = solve_system(system, w)
    assert f.sum() < free.forces.sum()


# Certificates and refusals


def test_certificate_refuses_perturbed_solutions(uneven: Case) -> None:
    system = uneven.system
    w = system.scaled(uneven.wrenches(0.1))
    c = np.zeros(len(uneven.pairs))
    v, f = solve_interior_point(system, w, c)
    assert kkt_residual(system.matrix, w, c, v, f) < 1e-8
    rng = np.random.default_rng(3)
    for _ in range(20):
        dv, df = rng.normal(size=len(v)), rng.normal(size=len(f))
        assert kkt_residual(system.matrix, w, c, v + 1e-4 * np.linalg.norm(w) * dv, f) > 1e-6
        assert kkt_residual(system.matrix, w, c, v, f + 1e-4 * np.linalg.norm(w) * df) > 1e-6


def test_verdict_needs_a_certificate() -> None:
    assert verdict(1e-8, np.inf) is Status.EQUILIBRIUM
    assert verdict(1e-2, 1e-9) is Status.NOT_IN_EQUILIBRIUM
    assert verdict(1e-2, 1e-2) is Status.INACCURATE
    # E = 5e-11, and the optimality conditions leave 1e-9 open: nobody knows.
    assert verdict(1e-5, 1e-9) is Status.INACCURATE


def test_refusals_name_what_is_wrong(uneven: Case) -> None:
    good = (uneven.pairs, uneven.points, uneven.normals, uneven.wrenches())
    with pytest.raises(InputError, match=r"\(N, 6\)"):
        equilibrium(*good[:3], uneven.wrenches()[:, :3])
    with pytest.raises(InputError, match="finite"):
        equilibrium(*good[:3], uneven.wrenches() * np.nan)
    with pytest.raises(InputError, match="finite"):
        equilibrium(good[0], np.full_like(good[1], np.inf), *good[2:])
    with pytest.raises(InputError, match="length 2"):
        equilibrium(good[0], good[1], 2 * good[2], good[3])
    with pytest.raises(InputError, match="pairs name part"):
        equilibrium(good[0] + 100, *good[1:])
    with pytest.raises(InputError, match="part 37, but there are parts 0 … 36"):
        equilibrium(*good, fixed=[0, 37])
    with pytest.raises(InputError, match=r"shape \(5,\)"):
        equilibrium(*good, fixed=np.ones(5, dtype=np.bool_))
    with pytest.raises(InputError, match="Contact 0 is between part 2 and itself"):
        equilibrium(np.full_like(good[0], 2), *good[1:])
    with pytest.raises(InputError, match="about"):
        equilibrium(*good, about=uneven.centroids[1:])
    with pytest.raises(InputError, match="unit of length"):
        equilibrium(*good, length=0.0)
    with pytest.raises(InputError, match="Friction"):
        equilibrium(*good, friction=-0.1)
    with pytest.raises(InputError, match="clarabel"):
        equilibrium(*good, friction=0.1, solver="clarabell")
    with pytest.raises(MoccaError, match="piqp"):
        equilibrium(*good, solver="piq")
