"""The directed parts-graph: who was placed before whom, and which motions that leaves (Eq. 11, 12)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import networkx as nx
import numpy as np

from mocca_robot.arrays import Array, read_only
from mocca_robot.assembly import Assembly
from mocca_robot.geometry.cones import MotionCone, generalized_normals, largest_cone
from mocca_robot.joints.joint import Joint


@dataclass(frozen=True, eq=False)
class PartMotion:
    """V_j of one part: the translations that take it out of what was placed before it.

    Attributes:
        part: index.
        normals: (m, d) normals of the earlier contacts; V_j = {x : normals·x ≥ 0}.
        alpha_rad: half-angle of the widest circular cone in V_j (negative: how deep the best direction is
            blocked); π/2 when the part touches nothing placed before it.
        axis: (d,) the axis of that cone, the best way *out*; insertion runs along −axis.
        blockers: indices of the earlier parts whose normals limit the cone.
    """

    part: int
    normals: Array
    alpha_rad: float
    axis: Array
    blockers: tuple[int, ...]


def parts_graph(assembly: Assembly, joints: Sequence[Joint]) -> nx.DiGraph[int]:
    """Return the parts-graph: an edge j → i means that P_i is placed before its neighbour P_j.

    Nodes are part indices with 'part' and 'motion' (PartMotion; None for fixed parts); edges carry 'joints'
    (list of Joint) and 'motion_cone' (V_ij, rows about P_j's centroid).
    """
    graph: nx.DiGraph[int] = nx.DiGraph(name=assembly.name)
    motions = part_motions(assembly, joints)
    for index, part in enumerate(assembly.parts):
        graph.add_node(index, part=part, motion=motions.get(index))
    for joint in joints:
        i, j = joint.contact.parts
        if not graph.has_edge(j, i):
            graph.add_edge(j, i, joints=[])
        graph.edges[j, i]["joints"].append(joint)
    for j, _, data in graph.edges(data=True):
        about = assembly.parts[j].centroid
        rays = [joint.rays for joint in data["joints"]]
        rows = [generalized_normals(points, normals, about) for points, normals in rays]
        data["motion_cone"] = MotionCone(read_only(np.concatenate(rows)))
    return graph


def part_motions(assembly: Assembly, joints: Sequence[Joint]) -> dict[int, PartMotion]:
    """Return V_j for every free part, by index: its contacts with all earlier parts (Eq. 11)."""
    earlier: dict[int, list[Joint]] = {p: [] for p in range(len(assembly.parts)) if not assembly.fixed[p]}
    for joint in joints:
        if joint.contact.parts[1] in earlier:
            earlier[joint.contact.parts[1]].append(joint)
    motions = {}
    for part, mine in earlier.items():
        d = assembly.dimension
        normals = np.concatenate([j.facet_normals for j in mine]) if mine else np.zeros((0, d))
        owners = np.concatenate([np.full(len(j.facets), j.contact.parts[0]) for j in mine]) if mine else np.zeros(0)
        alpha, axis = largest_cone(normals)
        limiting = np.asarray(normals @ axis <= np.sin(alpha) + 1e-6) if mine else np.zeros(0, dtype=bool)
        blockers = tuple(sorted({int(o) for o in np.asarray(owners)[limiting]}))
        motions[part] = PartMotion(part, read_only(normals), alpha, axis, blockers)
    return motions
