"""The paper's two-stage programme for flat assemblies (§6), for comparison with the convex default.

Kinematic design asks for motion cones, realization builds joints that come nearest to them, and the next round knows
the masses that moved. Within a round centroids stay where they were; that is the paper's assumption.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.errors import InputError
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions
from mocca_robot.tolerances import CASE_SOLVED, VIOLATED
from planners.baselines.direct_search import planar_problem, searched
from planners.baselines.paper_kinematics import RequiredCones, kinematic_design
from planners.baselines.paper_realization import REACHED, reached, realize
from planners.cone_joints.descent import moved_wrenches, surface_of
from planners.cone_joints.shapes2d import Shapes2D

STEEPEST = float(np.tan(np.deg2rad(45.0)))
"""Upper bound of s: a bump that must also stay within its part reaches 45° on both flanks, seldom more."""
WIDEST = 1.3
"""Upper bound of r: how far beyond its contact's ends an upright force of a joint may act."""
INSIDE = 0.2
"""Where s starts: at zero, faces that carry no force would have no gradient."""
ROUNDS = 4


@dataclass(frozen=True, eq=False, kw_only=True)
class PaperDesign:
    """What the two-stage programme leaves.

    Attributes:
        cones: required motion cones of the last round.
        joints: one per contact.
        infeasibility: (K,) E/|w|² on the true geometry, moved centroids included.
        violation: worst violated constraint on the true geometry.
        missed: (E,) squared distance of the worst face to cone(N), 0 where nothing was required (Eq. 18).
        rounds: of kinematic design and realization.
        evaluations: of E, in kinematic design.
    """

    cones: RequiredCones
    joints: tuple[Joint, ...]
    infeasibility: Array
    violation: float
    missed: Array
    rounds: int
    evaluations: int

    @property
    def achieved(self) -> bool:
        """Return whether every load case holds on the true geometry, within all constraints."""
        return bool(self.infeasibility.max(initial=0.0) <= CASE_SOLVED and self.violation <= VIOLATED)


def paper_design(
    assembly: Assembly,
    options: JointOptions | None = None,
    *,
    contacts: ContactReport | None = None,
    rounds: int = ROUNDS,
) -> PaperDesign:
    """Return what the paper's programme makes of a flat assembly; it may fall short, then `achieved` is False.

    Where a joint cannot be realised, what it does reach bounds the next round. Joints do not lean (u is the pair's
    reference direction). Raises InputError for solids, and like `planners.cone_joints.designer.design`.
    """
    if assembly.dimension != 2:
        raise InputError(f"'{assembly.name}' is solid; the paper's programme is here for flat assemblies only.")
    problem, parameters = planar_problem(assembly, options or JointOptions(), contacts)
    shapes = problem.shapes
    assert isinstance(shapes, Shapes2D)
    count = len(shapes.contacts)
    parameters = replace(parameters, curved=np.zeros(count, dtype=bool))
    bounds = np.where(shapes.can_curve[:, None], [[STEEPEST, STEEPEST, WIDEST, WIDEST]], [[0.0, 0.0, 1.0, 1.0]])
    cones = RequiredCones(np.full((count, 2), INSIDE), np.ones((count, 2)), parameters.axis, np.zeros(0))
    missed, evaluations, turn = np.zeros(count), 0, 0
    for turn in range(1, rounds + 1):
        wrenches = moved_wrenches(problem, surface_of(problem, parameters))
        cones, used = kinematic_design(problem, cones, bounds, wrenches)
        evaluations += used
        shapes, parameters, missed = realize(problem, cones)
        problem = replace(problem, shapes=shapes)
        result = searched(problem, parameters, evaluations)
        if result.infeasibility.max(initial=0.0) <= CASE_SOLVED or turn == rounds:
            break
        cones = replace(cones, slopes=np.maximum(cones.slopes, INSIDE))
        bounds = np.where((missed > REACHED)[:, None], reached(problem, parameters, cones), bounds)
    return PaperDesign(
        cones=cones,
        joints=result.joints,
        infeasibility=result.infeasibility,
        violation=result.violation,
        missed=missed,
        rounds=turn,
        evaluations=evaluations,
    )
