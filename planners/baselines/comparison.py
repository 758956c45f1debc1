"""One assembly joined in several ways: planar, single-direction, cone joints, tilted tenons (Fig. 15, 16)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.design import Insertion
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.motion.ways_out import ways_out
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD
from planners.baselines.tenons import tenons_along_exits, tilted_tenons, upright_tenons
from planners.cone_joints.largest_tilt import design_as_asked
from planners.cone_joints.search import Progress

CONE_JOINTS = "cone joints"
"""The name of the designed joinery; the others are there to be compared with it."""


@dataclass(frozen=True, eq=False)
class Joinery:
    """One way to join the same parts; nobody has judged it yet.

    Attributes:
        name: 'planar', 'single direction', 'upright mortise and tenon', 'cone joints', 'tilted mortise and tenon'.
        assembly: built geometry.
        joints: one per contact of the input.
        insertion: the way in of every free part that has one.
        remarks: what a reader should know.
        friction: Coulomb coefficient to judge it with.
    """

    name: str
    assembly: Assembly
    joints: tuple[Joint, ...]
    insertion: tuple[Insertion, ...]
    remarks: tuple[str, ...] = ()
    friction: float = 0.0


def joineries(
    assembly: Assembly,
    options: JointOptions | None = None,
    *,
    contacts: ContactReport | None = None,
    progress: Progress | None = None,
) -> tuple[Joinery, ...]:
    """Return `assembly` joined in three ways (2D, Fig. 15) or four (3D, Fig. 16), built and not yet judged.

    Flat: planar contacts; tenons along each part's way out; cone joints. Solid: planar contacts; mortise and tenon
    along every contact's normal; cone joints; mortise and tenon derived from those. Raises InputError like `design`.
    """
    options = replace(options or JointOptions(), friction=0.0)  # the others count on none either
    report = contacts or find_contacts(assembly)
    require_sound(assembly, report)
    graph = PartsGraph.of(assembly, report.contacts)
    exits = _exits(graph)
    result = [Joinery("planar", assembly, graph.joints, _insertions(graph, exits))]
    if assembly.dimension == 2:
        result.append(_joined("single direction", assembly, tenons_along_exits(graph, exits, options), exits))
    else:
        result.append(_joined("upright mortise and tenon", assembly, upright_tenons(graph, options), exits))
    designed = design_as_asked(assembly, options, contacts=report, progress=progress)
    done = designed.design
    remarks = () if designed.achieved else ("The design search did not reach every goal; this is where it ended.",)
    result.append(Joinery(CONE_JOINTS, done.assembly, done.joints, done.insertion, remarks))
    if assembly.dimension == 3:
        ways = {assembly.index(i.part): -i.direction for i in done.insertion}
        tilted, ways = tilted_tenons(done.joints, ways)
        result.append(_joined("tilted mortise and tenon", assembly, tilted, ways))
    return tuple(result)


def designs_with_friction(
    assembly: Assembly,
    frictions: Sequence[float],
    options: JointOptions | None = None,
    *,
    contacts: ContactReport | None = None,
    progress: Progress | None = None,
) -> tuple[Joinery, ...]:
    """Return cone joints for every Coulomb coefficient, each designed to count on it; not yet judged.

    Raises InputError like `design`.
    """
    report = contacts or find_contacts(assembly)
    require_sound(assembly, report)
    result = []
    for friction in frictions:
        asked = replace(options or JointOptions(), friction=friction)
        designed = design_as_asked(assembly, asked, contacts=report, progress=progress)
        done = designed.design
        missed = () if designed.achieved else ("The design search did not reach every goal; this is where it ended.",)
        counts = () if done.friction is None else (f"The design {done.friction.words}.",)
        named = f"friction {friction:g}"
        remarks = (*missed, *counts, *done.notes)
        made = Joinery(named, done.assembly, done.joints, done.insertion, remarks)
        result.append(replace(made, friction=friction))
    return tuple(result)


def _exits(graph: PartsGraph) -> dict[int, Array]:
    """Return a way out (d,) per free part: one that a sweep confirms, else the axis of its widest cone."""
    free = ways_out(graph, room_rad=float(np.deg2rad(5.0)))
    return {part: free.get(part, motion.axis) for part, motion in graph.motions()}


def _joined(name: str, assembly: Assembly, joints: tuple[Joint, ...], exits: Mapping[int, Array]) -> Joinery:
    kept = sum(j.is_planar for j in joints)
    remarks = (f"{kept} of {len(joints)} contacts stay planar.",) if kept else ()
    ways = _insertions(PartsGraph.joined(assembly, joints), exits)
    return Joinery(name, build_parts(assembly, joints), joints, ways, remarks)


def _insertions(graph: PartsGraph, exits: Mapping[int, Array]) -> tuple[Insertion, ...]:
    """Return the widest cone of every part that can leave what was placed before it, about its way out."""
    ways = []
    for part, motion in graph.motions():
        rooms = [float((motion.normals @ axis).min(initial=1.0)) for axis in (exits[part], motion.axis)]
        room, axis = max(rooms), (exits[part], motion.axis)[int(rooms[1] > rooms[0])]
        if room > -ANGLE_ROUNDING_RAD:
            ways.append(Insertion(graph.assembly.parts[part].name, -axis, float(np.arcsin(np.clip(room, 0.0, 1.0)))))
    return tuple(ways)
