"""From the parameters of joints to parts: joints cut in, and the way along which each part goes in."""

from __future__ import annotations

from dataclasses import dataclass

from mocca_robot.arrays import Array, BoolArray, read_only
from mocca_robot.assembly import Assembly
from mocca_robot.design import Insertion
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.motion.parts_graph import PartMotion, PartsGraph
from mocca_robot.motion.ways_out import first_free, free_half_angle, roomiest, spread_directions
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD
from planners.cone_joints.unknowns import JointParameters, JointProblem


@dataclass(frozen=True, eq=False, kw_only=True)
class Built:
    """Parts with their joints.

    Attributes:
        assembly: the parts as they are made.
        joints: one per contact, planar ones included.
        insertion: how each free part goes in, and the cone that is promised about it.
    """

    assembly: Assembly
    joints: tuple[Joint, ...]
    insertion: tuple[Insertion, ...]


def build(assembly: Assembly, problem: JointProblem, parameters: JointParameters, given: BoolArray) -> Built:
    """Return the parts of `assembly` with joints of `parameters`; `given` (N,) parts keep their way out."""
    joints = joints_of(problem, parameters)
    built = build_parts(assembly, joints)
    insertion = tuple(
        Insertion(assembly.parts[p].name, read_only(-way), _free_cone(built, p, m, way))
        for p, m in PartsGraph.joined(assembly, joints).motions()
        for way in [parameters.axis[p] if given[p] else _confirmed_way(built, p, m, parameters.axis[p])]
    )
    return Built(assembly=built, joints=joints, insertion=insertion)


def joints_of(problem: JointProblem, parameters: JointParameters) -> tuple[Joint, ...]:
    """Return the joints of `parameters`, one per contact."""
    u = problem.shapes.directions(parameters.lean)
    return tuple(
        problem.shapes.joint(e, parameters.shape[e], u[e]) if curved else planar(contact)
        for e, (contact, curved) in enumerate(zip(problem.shapes.contacts, parameters.curved))
    )


def _free_cone(built: Assembly, part: int, motion: PartMotion, way: Array) -> float:
    """Return the half-angle of the cone about `way` that is promised, radians; negative when contacts block it.

    Flat parts get all that is free. For solids sweeps are dear: the cone that was asked for, when contacts leave it.
    """
    room = motion.room(way)
    asked = built.alpha_rad
    if room <= 0.0:
        return room
    if built.dimension == 3 and asked is not None:
        return min(room, asked)
    return free_half_angle(built, part, way, room)


def _confirmed_way(built: Assembly, part: int, motion: PartMotion, designed: Array) -> Array:
    """Return the way out that a part is inserted along: the widest cone's axis if a sweep confirms it, else the
    designed one, or another where joints have made the part a little larger than its way was wide. In 3D the designed
    one, which was found by sweeps and has kept its cone since."""
    if built.dimension == 3:
        return designed
    alpha = built.alpha_rad or 0.0
    if not len(motion.normals) or motion.alpha_rad < alpha:
        return designed
    usable = [motion.axis] if motion.room(designed) < alpha - ANGLE_ROUNDING_RAD else [motion.axis, designed]
    way = first_free(built, part, usable)
    if way is None:
        way = first_free(built, part, roomiest(spread_directions(2, 360), motion, alpha))
    return usable[-1] if way is None else way
