"""Ways out: the widest cone's axis where it is free, another direction inside the cone where it is not."""

from __future__ import annotations

import numpy as np
import pytest
from solids import box

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.motion.insertion import insertion_verdicts
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.motion.ways_out import free_half_angle, insertion_rim, sweep_blockers, ways_out


def flat(points: list[list[float]]) -> Polygon:
    return Polygon(np.array(points, dtype=float))


def test_a_block_before_a_wall_leaves_upwards():
    # The widest cone of a block against the left wall points to the right, into the right wall; up is free.
    assembly = Assembly(
        "slot",
        (
            Part("left", box((0, 0, 0), (0.1, 1, 1)), fixed=True),
            Part("right", box((0.5, 0, 0), (0.6, 1, 1)), fixed=True),
            Part("block", box((0.1, 0.2, 0.2), (0.2, 0.8, 0.8))),
        ),
        alpha_rad=np.deg2rad(5),
    )
    graph = PartsGraph.of(assembly)
    assert sweep_blockers(assembly, 2, np.array([[1.0, 0, 0]])) == (1,)
    way = ways_out(graph)[2]
    assert way[0] >= np.sin(np.deg2rad(5))
    assert not sweep_blockers(assembly, 2, insertion_rim(way, assembly.alpha_rad))


def test_a_closed_in_block_has_no_way_out():
    shell = [Part(f"s{k}", b, fixed=True) for k, b in enumerate([
        box((0, 0, 0), (3, 3, 1)), box((0, 0, 2), (3, 3, 3)), box((0, 0, 1), (1, 3, 2)), box((2, 0, 1), (3, 3, 2)),
        box((1, 0, 1), (2, 1, 2)), box((1, 2, 1), (2, 3, 2)),
    ])]  # fmt: skip
    assembly = Assembly("box", (*shell, Part("inside", box((1, 1, 1), (2, 2, 2)))))
    assert ways_out(PartsGraph.of(assembly)) == {}


def test_a_free_axis_is_kept():
    assembly = Assembly(
        "pair", (Part("a", box((0, 0, 0), (1, 1, 1)), fixed=True), Part("b", box((0, 0, 1), (1, 1, 2))))
    )
    assert np.allclose(ways_out(PartsGraph.of(assembly))[1], [0, 0, 1])


def test_a_flat_part_s_free_cone_ends_where_sweeps_begin_to_hit():
    """A lid on a block, a post off to the right: contacts leave 90°, the post's corner leaves less."""
    ground = Part("ground", flat([[0, 0], [10, 0], [10, 1], [0, 1]]), fixed=True)
    post = Part("post", flat([[6, 1], [7, 1], [7, 5], [6, 5]]), fixed=True)
    lid = Part("lid", flat([[1, 1], [4, 1], [4, 2], [1, 2]]))
    assembly = Assembly("posts", (ground, post, lid))
    up = np.array([0.0, 1.0])
    angle = free_half_angle(assembly, 2, up, np.pi / 2)
    # The lid's right bottom corner passes the post's nearest top corner, which lies 2 beside and 4 above it.
    assert angle == pytest.approx(np.arctan2(2, 4), abs=1e-4)
    for lean, hit in ((angle - 0.01, ()), (angle + 0.01, (1,))):
        assert sweep_blockers(assembly, 2, np.array([[np.sin(lean), np.cos(lean)]])) == hit
    assert free_half_angle(assembly, 2, up, 0.1) == 0.1
    assert free_half_angle(assembly, 2, np.array([1.0, 0.0]), np.pi / 2) == 0.0


def test_a_solid_part_s_free_cone_was_swept():
    parts = (
        Part("ground", box((0, 0, 0), (10, 10, 1)), fixed=True),
        Part("wall", box((6, 0, 1), (7, 10, 5)), fixed=True),
        Part("block", box((1, 4, 1), (4, 6, 2))),
    )
    assembly = Assembly("beside", parts)
    up = np.array([0.0, 0.0, 1.0])
    angle = free_half_angle(assembly, 2, up, np.deg2rad(80))
    assert np.arctan2(2, 4) - np.deg2rad(1.0) <= angle <= np.arctan2(2, 4) + 1e-6
    assert not sweep_blockers(assembly, 2, insertion_rim(up, angle, 16))


def test_a_part_that_touches_nothing_and_cannot_leave_upwards_leaves_sideways():
    ceiling = Part("ceiling", flat([[0, 3], [1, 3], [1, 4], [0, 4]]), fixed=True)
    assembly = Assembly("gap", (ceiling, Part("block", flat([[0, 0], [1, 0], [1, 1], [0, 1]]))))
    (verdict,) = insertion_verdicts(PartsGraph.of(assembly, ()))
    assert verdict.assemblable and not verdict.blockers and verdict.alpha_rad > 0.0
