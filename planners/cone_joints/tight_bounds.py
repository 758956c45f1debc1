"""Which of its bounds every designed joint has reached: what would have to be let go of to make it stronger."""

from __future__ import annotations

import numpy as np

from mocca_robot.joints.bounds import Bound, TightJoint
from planners.cone_joints.descent import hinge_values, surface_of
from planners.cone_joints.unknowns import JointParameters, JointProblem

NEAR_RAD = float(np.deg2rad(0.5))
"""How near, beyond the designer's own reserve, an angle counts as being at its bound."""
NEAR_SHARE = 0.01
"""How near a length counts as being at its bound, as a share of the contact's."""


def tight_joints(problem: JointProblem, parameters: JointParameters) -> tuple[TightJoint, ...]:
    """Return one entry per joint, in their order; without bounds where a joint could still be made stronger."""
    shapes = problem.shapes
    names = [p.name for p in shapes.assembly.parts]
    surface = surface_of(problem, parameters)
    hinges = hinge_values(problem, parameters, surface, shapes.options.alpha_margin_rad + NEAR_RAD)
    rays = shapes.rays(surface)[1].shape[1]
    last = hinges.shape[1] - (rays if problem.alpha_rad is not None else 0)
    room = shapes.violations(surface, parameters.shape)
    radius = np.zeros(len(room), dtype=np.bool_)
    if shapes.options.min_radius > 0.0 and not shapes.options.piecewise_planar:
        radius, room = room[:, -1] > -NEAR_SHARE, room[:, :-1]
    heights = np.abs(parameters.shape[:, list(shapes.heights)]).max(axis=1)
    reached = {
        Bound.FLAT: ~shapes.can_curve,
        Bound.SLOPE: (hinges[:, :rays] > 0.0).any(axis=1),
        Bound.ALPHA: (hinges[:, last:] > 0.0).any(axis=1),
        Bound.HEIGHT: heights > shapes.options.max_height - NEAR_SHARE,
        Bound.ROOM: (room > -NEAR_SHARE).any(axis=1),
        Bound.RADIUS: radius,
    }
    tight = []
    for e, (i, j) in enumerate(problem.pairs.tolist()):
        mine = tuple(b for b, where in reached.items() if where[e] and (b is Bound.FLAT or parameters.curved[e]))
        tight.append(TightJoint((names[i], names[j]), (Bound.FLAT,) if Bound.FLAT in mine else mine))
    return tuple(tight)
