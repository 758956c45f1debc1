"""Ways out: the widest cone's axis where it is free, another direction inside the cone where it is not."""

from __future__ import annotations

import numpy as np
from solids import box

from mocca_robot.assembly import Assembly, Part
from mocca_robot.contacts import find_contacts
from mocca_robot.verify import insertion_rim, sweep_blockers
from mocca_robot.ways_out import ways_out


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
    contacts = find_contacts(assembly).contacts
    assert sweep_blockers(assembly, 2, np.array([[1.0, 0, 0]])) == (1,)
    way = ways_out(assembly, contacts)[2]
    assert way[0] >= np.sin(np.deg2rad(5))
    assert not sweep_blockers(assembly, 2, insertion_rim(way, assembly.alpha_rad))


def test_a_closed_in_block_has_no_way_out():
    shell = [Part(f"s{k}", b, fixed=True) for k, b in enumerate([
        box((0, 0, 0), (3, 3, 1)), box((0, 0, 2), (3, 3, 3)), box((0, 0, 1), (1, 3, 2)), box((2, 0, 1), (3, 3, 2)),
        box((1, 0, 1), (2, 1, 2)), box((1, 2, 1), (2, 3, 2)),
    ])]  # fmt: skip
    assembly = Assembly("box", (*shell, Part("inside", box((1, 1, 1), (2, 2, 2)))))
    assert ways_out(assembly, find_contacts(assembly).contacts) == {}


def test_a_free_axis_is_kept():
    assembly = Assembly(
        "pair", (Part("a", box((0, 0, 0), (1, 1, 1)), fixed=True), Part("b", box((0, 0, 1), (1, 1, 2))))
    )
    assert np.allclose(ways_out(assembly, find_contacts(assembly).contacts)[1], [0, 0, 1])
