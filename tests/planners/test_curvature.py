"""The descent's matrix by products is the one written out, and its steps lead where the exact ones do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.design_baseline import leaning_wall
from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.generators import generate
from planners.cone_joints import curvature, descent
from planners.cone_joints.curvature import Products, Written
from planners.cone_joints.descent import Linear
from planners.cone_joints.designer import design
from planners.cone_joints.unknowns import JointParameters, JointProblem, UnknownsLayout

DOME = {"blocks": [8, 7, 5], "thickness": 0.15, "snap": 0.2}


def linearised_of(assembly: Assembly, monkeypatch: pytest.MonkeyPatch, limit: int) -> Linear:
    """Return the objective at the first point that the design of `assembly` descends from."""
    found: list[Linear] = []
    original = descent.linearised

    def kept(problem: JointProblem, layout: UnknownsLayout, parameters: JointParameters, warm: object = None) -> Linear:
        found.append(original(problem, layout, parameters))
        raise InterruptedError

    with monkeypatch.context() as patch:
        patch.setattr(descent, "LARGE", limit)
        patch.setattr(descent, "linearised", kept)
        patch.setattr("planners.cone_joints.search.MANY_JOINTS", 0)
        with pytest.raises(InterruptedError):
            design(assembly)
    return found[0]


@pytest.mark.parametrize("kind", ["wall", "dome"])
def test_products_agree_with_the_matrix(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if kind == "wall":
        assembly = replace(leaning_wall(40, float(np.deg2rad(30.0))), alpha_rad=np.deg2rad(4.0))
    else:
        assembly = replace(generate("dome", DOME, Path()), alpha_rad=np.deg2rad(2.0))
    written = linearised_of(assembly, monkeypatch, 10**6)
    products = linearised_of(assembly, monkeypatch, 0)
    assert products.gradient == pytest.approx(written.gradient, rel=1e-9, abs=1e-12)
    assert isinstance(written.curvature, Written) and isinstance(products.curvature, Products)
    matrix = written.curvature.matrix
    rng = np.random.default_rng(1)
    for _ in range(3):
        x: Array = rng.normal(size=len(matrix))
        assert products.curvature.times(x) == pytest.approx(matrix @ x, rel=1e-6, abs=1e-8 * np.abs(matrix).max())
    # The estimated diagonal is of the right size, and damped steps agree where they are solved to the end.
    assert 0.3 < products.curvature.diagonal.sum() / np.trace(matrix) < 3.0
    movable = rng.random(len(matrix)) < 0.8
    damping = np.full(len(matrix), 0.1 * np.diag(matrix).max())
    exact = written.curvature.solve(-written.gradient, movable, damping)
    near = products.curvature.solve(-written.gradient, movable, damping)
    assert not near[~movable].any()
    assert np.linalg.norm(near - exact) <= 0.05 * np.linalg.norm(exact)


def test_large_designs_hold_with_products_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(descent, "LARGE", 0)
    found = design(leaning_wall(60))
    assert found.achieved
    assert curvature.LARGE > 0
