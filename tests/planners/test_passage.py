"""Insertion past everything that is placed before: joints leave ways open, also past parts that do not touch."""

from __future__ import annotations

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Interlocking, Part, Polygon
from mocca_robot.verdicts.verification import verify
from planners.cone_joints import passage
from planners.cone_joints.designer import design
from planners.cone_joints.outcome import Designed
from planners.cone_joints.passage import Outcome


def puzzle(columns: int, rows: int, offset: float, alpha_deg: float) -> Assembly:
    """Return a puzzle of four-sided tiles, 60 mm wide, whose inner corners are moved to and fro by `offset`, m."""
    corner = {}
    for x in range(columns + 1):
        for y in range(rows + 1):
            move = offset if (x + y) % 2 else -offset
            corner[x, y] = (0.06 * x + move * (0 < x < columns), 0.06 * y - move * (0 < y < rows))
    parts = []
    for y in range(rows):
        for x in range(columns):
            ring = [corner[x, y], corner[x + 1, y], corner[x + 1, y + 1], corner[x, y + 1]]
            parts.append(Part(f"p{x}{y}", Polygon(np.array(ring)), fixed=x + y == 0))
    goals = (Interlocking(parts[-1].name),)
    return Assembly("puzzle", tuple(parts), goals=goals, alpha_rad=float(np.deg2rad(alpha_deg)))


def barred(outcome: Designed) -> list[str]:
    """Return the parts that an independent check of the built parts cannot put in."""
    ways = {i.part: i.direction for i in outcome.design.insertion}
    return [i.part for i in verify(outcome.design.assembly, directions=ways).insertions if not i.assemblable]


@pytest.mark.parametrize(("columns", "rows", "alpha_deg"), [(3, 3, 3.0), (4, 3, 6.0)])
def test_bumps_leave_the_way_of_parts_that_they_do_not_touch(
    columns: int, rows: int, alpha_deg: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    assembly = puzzle(columns, rows, 0.006, alpha_deg)
    with monkeypatch.context() as patched:
        patched.setattr(passage.WayOpener, "open", lambda self, first: first)
        before = design(assembly)
    assert not before.achieved
    assert barred(before)
    after = design(assembly)
    assert after.achieved
    assert barred(after) == []


def test_a_way_that_stays_closed_is_told_with_the_joints_that_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    ends: list[Outcome] = []
    opened = passage.WayOpener.open

    def kept(self: passage.WayOpener, first: Outcome) -> Outcome:
        ends.extend([first, opened(self, first)])
        return ends[1]

    monkeypatch.setattr(passage.WayOpener, "open", kept)
    outcome = design(puzzle(3, 3, 0.010, 9.0))
    first, last = ends
    assert first.closed
    assert outcome.achieved == (not last.closed)
    assert sorted(barred(outcome)) == sorted(outcome.design.assembly.parts[c.part].name for c in last.closed)


def test_a_direction_that_somebody_has_chosen_stays() -> None:
    assembly = puzzle(3, 3, 0.006, 3.0)
    way = np.array([-0.6, -0.8])
    outcome = design(assembly, insertion={"p11": way})
    kept = next(i.direction for i in outcome.design.insertion if i.part == "p11")
    assert kept == pytest.approx(way)
    assert outcome.achieved == (barred(outcome) == [])
