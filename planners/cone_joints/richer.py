"""Richer families of joints, for what plain ones do not hold: where such searches start from, fewest numbers first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mocca_robot.arrays import IntArray
from planners.cone_joints.catalogue import select
from planners.cone_joints.shapes import Shapes
from planners.cone_joints.unknowns import JointParameters, JointProblem


def chosen_among_all(
    problem: JointProblem, start: JointParameters, cases: IntArray
) -> tuple[Shapes, JointParameters] | None:
    """Return joints chosen from a catalogue of all families for the given load cases; None where none are richer."""
    shapes = problem.shapes.mixed()
    if not problem.shapes.further():
        return None
    rows = np.tile(shapes.rest, (len(start.shape), 1))
    return select(replace(problem, shapes=shapes), replace(start, shape=rows), cases, leaning=False)


def refinements(shapes: Shapes, near: JointParameters) -> Iterator[tuple[str, Shapes, JointParameters]]:
    """Yield the joints `near` with more heights: every step of the search is open to them that was before, and more."""
    for family in shapes.further():
        found = shapes.refined(family, near.shape)
        if found is not None:
            yield family, found[0], replace(near, shape=found[1])


def beginnings(problem: JointProblem, start: JointParameters) -> Iterator[tuple[str, Shapes, JointParameters]]:
    """Yield joints of one richer family on all contacts: those to which no refinement leads, like other outlines.

    Where the families allow no refinement at all, each of them is begun with.
    """
    families = problem.shapes.further()
    sure = [f for f in families if problem.shapes.refined(f, start.shape) is not None]
    for family in (f for f in families if not sure or f == "outline"):
        for shapes, rows in problem.shapes.begun(family):
            yield family, shapes, JointParameters(rows, start.lean, start.axis, problem.shapes.can_curve)
