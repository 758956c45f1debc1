"""Compiled passes over contact rays are the products with B that they stand for."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
import pytest

from benchmarks import growth
from benchmarks.cases import Case, arch, dome, wall
from benchmarks.design_baseline import leaning_wall
from mocca_robot.arrays import Array
from mocca_robot.contacts.find import find_contacts
from mocca_robot.runtime.compiled import compiled
from mocca_robot.statics.solver import band_kernels, kernels
from mocca_robot.statics.solver import blocks as blocks_module
from mocca_robot.statics.solver.banded import BandedLayout
from mocca_robot.statics.solver.blocks import SPARSE_COSTS
from mocca_robot.statics.solver.factors import NotPositiveDefinite
from mocca_robot.statics.solver.slopes import Slope
from mocca_robot.statics.solver.sparse import SparseLayout
from mocca_robot.statics.solver.system import ContactSystem


def unsorted(d: int) -> ContactSystem:
    """Five parts, two of them fixed; pairs of 1 to 7 rays in any order, some of them between fixed parts."""
    rng = np.random.default_rng(d)
    kinds = np.array([[0, 1], [1, 2], [2, 3], [0, 4], [3, 1], [4, 2]])
    pairs = rng.permutation(np.repeat(kinds, [1, 3, 7, 2, 4, 5], axis=0))
    points, normals = rng.normal(size=(2, len(pairs), d))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    free = np.array([False, True, True, True, False])
    return ContactSystem.build(pairs, points, normals, free, rng.normal(size=(5, d)), 0.7)


@pytest.fixture(params=[2, 3], ids=["flat", "solid"])
def system(request: pytest.FixtureRequest) -> ContactSystem:
    return unsorted(request.param)


def about_common_point(system: ContactSystem) -> tuple[Array, Array]:
    """Return dense Y and B Y, with one row per row of the blocks."""
    blocks = system.blocks
    y = np.zeros((blocks.size, blocks.size))
    for k, own in enumerate(blocks.to_own):
        mine = slice(k * blocks.dof, (k + 1) * blocks.dof)
        y[mine, mine] = own
    return y, (system.matrix @ y)[blocks.source]


def test_rays_between_fixed_parts_are_left_out_and_each_other_is_there_once(system: ContactSystem) -> None:
    between = ~system.free[system.pairs].any(axis=1)
    assert between.sum() == 2
    assert sorted(system.blocks.source) == list(np.flatnonzero(~between))


def test_products_are_those_with_the_matrix(system: ContactSystem) -> None:
    blocks, (y, b) = system.blocks, about_common_point(system)
    rng = np.random.default_rng(0)
    u, z = rng.normal(size=blocks.size), rng.uniform(size=len(blocks.source))
    assert blocks.times(u) == pytest.approx(b @ u, abs=1e-12)
    assert blocks.transposed_times(z) == pytest.approx(b.T @ z, abs=1e-12)
    assert blocks.own_gram_times(u) == pytest.approx(y.T @ y @ u, abs=1e-12)
    assert blocks.own_wrenches(blocks.own_transposed(u)) == pytest.approx(u, abs=1e-12)
    assert system.matrix.T @ blocks.forces(z) == pytest.approx(blocks.own_wrenches(b.T @ z), abs=1e-12)


@pytest.mark.parametrize("kind", [BandedLayout, SparseLayout])
def test_the_factor_is_that_of_the_normal_matrix(
    system: ContactSystem, kind: type, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blocks_module, "NARROW", 0)
    monkeypatch.setattr(blocks_module, "SPARSE_COSTS", 0.0 if kind is SparseLayout else np.inf)
    assert isinstance(system.blocks.layout, kind)
    blocks, (y, b) = system.blocks, about_common_point(system)
    rng = np.random.default_rng(1)
    d, right = rng.uniform(0.1, 10.0, size=len(b)), rng.normal(size=blocks.size)
    matrix = y.T @ y + b.T @ (b * d[:, None])
    assert blocks.factor(blocks.gram(d)).solve(right) == pytest.approx(np.linalg.solve(matrix, right), rel=1e-10)


@pytest.mark.parametrize("case", [dome(300, 0), wall(150, 0), arch(40, 0)], ids=lambda c: c.name)
def test_sparse_and_banded_factors_agree_where_much_is_filled_in(case: Case) -> None:
    blocks = case.system.blocks
    graph = blocks.first, blocks.second, len(blocks.to_own), blocks.dof
    rng = np.random.default_rng(2)
    gram, right = blocks.gram(rng.uniform(0.1, 10.0, size=len(blocks.source))), rng.normal(size=blocks.size)
    banded, sparse = (kind.of(*graph) for kind in (BandedLayout, SparseLayout))
    expected = banded.factor(blocks.own_gram, gram).solve(right)
    room = sparse.room()
    for _ in range(2):  # what was in the room before does not matter
        assert sparse.factor(blocks.own_gram, gram, room).solve(right) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    with pytest.raises(NotPositiveDefinite, match="pivot"):
        sparse.factor(-blocks.own_gram, gram, room)


@pytest.mark.parametrize(("make", "parts", "sparse"), [(growth.dome, 400, True), (leaning_wall, 1500, False)])
def test_a_wide_dome_is_sparse_and_a_flat_wall_has_a_band(make: Callable, parts: int, sparse: bool) -> None:
    assembly = make(parts)
    free = np.flatnonzero(~assembly.fixed)
    number = np.full(len(assembly.parts), len(free))
    number[free] = np.arange(len(free))
    pairs = np.unique([c.parts for c in find_contacts(assembly).contacts], axis=0)
    graph = *number[pairs].T, len(free), assembly.dof
    banded, columns = BandedLayout.of(*graph), SparseLayout.of(*graph)
    assert columns.multiplications < banded.multiplications
    assert (SPARSE_COSTS * columns.multiplications < banded.multiplications) is sparse


@pytest.mark.parametrize("case", [dome(24, 0), wall(30, 0)], ids=lambda case: case.name)
def test_slopes_that_are_not_symmetric_are_solved(case: Case) -> None:
    blocks = case.system.blocks
    rng = np.random.default_rng(2)
    grams = blocks.gram(np.ones(len(blocks.source))) + 0.3 * rng.normal(size=(len(blocks.first), 6, 6))
    diagonal, right = 0.1 * blocks.own_gram, rng.normal(size=blocks.size)
    slope = Slope.of(blocks, diagonal, grams)
    dense = np.stack([slope.times(column) for column in np.eye(blocks.size)], axis=1)
    assert np.abs(dense - dense.T).max() > 0.1
    answer = slope.solve(right)
    assert answer is not None
    np.testing.assert_allclose(answer, np.linalg.solve(dense, right), rtol=1e-8, atol=1e-8 * np.abs(answer).max())


def test_a_pivot_that_is_not_positive_is_named() -> None:
    # Two flat parts that touch: columns of the first reach the second's rows.
    matrix = np.diag([2.0, 2.0, 2.0, 2.0, -1.0, 2.0])
    matrix[3, 0] = matrix[0, 3] = 1.0
    band = np.array([[matrix[c + r, c] if c + r < 6 else 0.0 for r in range(6)] for c in range(6)])
    ends = np.array([6, 6])
    assert band_kernels.factorize(band.copy(), ends) == 5
    matrix[4, 4] = band[4, 0] = 3.0
    assert band_kernels.factorize(band, ends) == 0
    assert band[:, 0] == pytest.approx(np.diag(np.linalg.cholesky(matrix)))
    assert band[0, 3] == pytest.approx(np.linalg.cholesky(matrix)[3, 0])


def test_cones_weigh_three_rows_at_once() -> None:
    rng = np.random.default_rng(2)
    starts = np.array([0, 6, 15])
    rays, b, size = rng.normal(size=(6, 15)), rng.normal(size=(3, 5)), rng.uniform(size=5)
    out = np.empty((2, 6, 6))
    kernels.gram_of_cones(rays, starts, b, size, out)
    for p in range(2):
        expected = np.zeros((6, 6))
        for c in range(starts[p] // 3, starts[p + 1] // 3):
            g = rays[:, 3 * c : 3 * c + 3]
            expected += size[c] * g @ (2.0 * np.outer(b[:, c], b[:, c]) - np.diag([1.0, -1.0, -1.0])) @ g.T
        assert out[p] == pytest.approx(expected, abs=1e-12)


def test_a_step_goes_where_the_kernels_say() -> None:
    """`predict`, `direction`, `refine` and `advance` against the formulas they are written from."""
    rng = np.random.default_rng(3)
    rays, starts, relative = rng.normal(size=(3, 9)), np.array([0, 2, 9]), rng.normal(size=(2, 3))
    s, z, missing, goal = rng.uniform(0.5, 2.0, size=(4, 9))
    d, pair = z / s, np.repeat([0, 1], [2, 7])
    wanted = np.einsum("ak,ka->k", rays, relative[pair]) + missing

    target, wrenches, inverse = np.empty(9), np.empty((2, 3)), np.empty((2, 3))
    steepest, product = kernels.predict(rays, starts, relative, s, z, missing, target, wrenches, inverse)
    affine = -z - d * wanted
    assert steepest == pytest.approx(min((wanted / s).min(), (affine / z).min()))
    assert product == pytest.approx(wanted @ affine)
    assert target == pytest.approx(z + wanted * affine / s)
    assert wrenches[1] == pytest.approx(rays[:, 2:] @ target[2:])
    assert inverse[1] == pytest.approx(rays[:, 2:] @ (1.0 / s[2:]))

    ds, dz, target = np.empty(9), np.empty(9), goal.copy()
    steepest = kernels.direction(rays, starts, relative, s, z, d, missing, target, 0.3, ds, dz)
    assert target == pytest.approx(goal - 0.3 / s)
    assert ds == pytest.approx(wanted)
    assert dz == pytest.approx(-target - d * wanted)
    assert steepest == pytest.approx(min((ds / s).min(), (dz / z).min()))

    more, before = wanted - missing, (ds.copy(), dz.copy())
    steepest = kernels.refine(rays, starts, relative, s, z, d, ds, dz)
    assert ds == pytest.approx(before[0] + more)
    assert dz == pytest.approx(before[1] - d * more)
    assert steepest == pytest.approx(min((ds / s).min(), (dz / z).min()))

    grams, old = np.empty((2, 3, 3)), (s.copy(), z.copy())
    gap, largest = kernels.advance(rays, starts, s, z, ds, dz, 0.01, d, wrenches, grams)
    assert s == pytest.approx(old[0] + 0.01 * ds) and z == pytest.approx(old[1] + 0.01 * dz)
    assert d == pytest.approx(z / s) and gap == pytest.approx(s @ z) and largest == d.max()
    assert grams[1] == pytest.approx((rays[:, 2:] * d[2:]) @ rays[:, 2:].T)
    assert wrenches[0] == pytest.approx(rays[:, :2] @ z[:2])


def test_code_is_compiled_where_no_folder_can_keep_it(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    njit = numba.njit

    def refuses_to_cache(**options: object) -> Callable[..., object]:
        asked.append(options)
        if options.get("cache"):
            raise RuntimeError("cannot cache function: no locator available")
        return njit(**options)

    monkeypatch.setattr(numba, "njit", refuses_to_cache)
    double = compiled(lambda x: 2.0 * x)
    assert double(21.0) == 42.0 and len(asked) == 2
