"""The fast estimate against the elements on 50 random parts: how far it may be on the unsafe side."""

from __future__ import annotations

import numpy as np
import pytest

from mocca_robot.actions import Combination, PointForce
from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.strength.assess import assess
from mocca_robot.strength.options import StrengthOptions
from mocca_robot.strength.part_elements import solve_part

pytest.importorskip("skfem")
UNSAFE = 1.3


def random_assembly(seed: int) -> Assembly:
    """Return a block of random proportions with a curved bump or dent on ground of the same shape, under two forces."""
    rng = np.random.default_rng(seed)
    width, height = rng.uniform(0.5, 2.0), rng.uniform(0.2, 1.0)
    middle, half = rng.uniform(0.35, 0.65) * width, rng.uniform(0.1, 0.3) * width
    bump = rng.uniform(-0.35, 0.35) * min(half, 0.6 * height)
    share = np.linspace(-1.0, 1.0, int(rng.integers(9, 25)))
    curve = np.column_stack([middle + half * share, bump * (0.5 + 0.5 * np.cos(np.pi * share))])
    low = np.concatenate([[[0.0, 0.0]], curve, [[width, 0.0]]])
    lean = rng.uniform(-0.1, 0.1) * width
    block = Polygon(np.concatenate([low, [[width + lean, height], [lean, height]]]), (), 0.1)
    ground = Polygon(np.concatenate([[[0.0, -1.0], [width, -1.0]], low[::-1]]), (), 0.1)
    loads = []
    for k in range(2):
        at = np.array([lean + rng.uniform(0.15, 0.85) * width, height])
        loads.append(PointForce(name=f"p{k}", part="block", force=np.array([0.0, -rng.uniform(10.0, 500.0)]), at=at))
    return Assembly(
        f"random {seed}",
        (Part("ground", ground, fixed=True), Part("block", block, 1100.0, material="plaster")),
        alpha_rad=None,
        actions=tuple(loads),
        combinations=(Combination(name="all", factors={a.name: 1.0 for a in loads}),),
    )


def unsafe_by(seed: int) -> float:
    """Return the share that elements find over that of the estimate, each the worst of the block."""
    graph = PartsGraph.of(random_assembly(seed))
    options = StrengthOptions()
    estimate = assess(graph, options, states=False)
    elements = assess(graph, options, states=False, elements=solve_part)
    assert elements.parts[0].method == "elements"
    return estimate.reached / elements.reached


@pytest.mark.parametrize("seed", range(50))
def test_the_estimate_is_not_unsafe_by_more_than_thirty_percent(seed: int) -> None:
    assert unsafe_by(seed) < UNSAFE
