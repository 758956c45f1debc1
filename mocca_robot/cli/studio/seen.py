"""What the studio's page draws and tells, as plain data: shapes, contacts, joints, verdicts, forces, motions.

Lengths in metres, angles in degrees, unless a name says otherwise. Parts, and pairs of parts, are indices.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.contacts.contact import Contact, ContactReport
from mocca_robot.design import Design
from mocca_robot.joints.joint import Joint
from mocca_robot.motion.insertion import InsertionVerdict
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report.case_words import case_words
from mocca_robot.report.cone_plots import free_reach, tangent_axes
from mocca_robot.report.drawing2d import displaced, free_interval, merged_forces
from mocca_robot.report.drawing3d import displaced_3d
from mocca_robot.report.palette import part_colours
from mocca_robot.report.pictures import joint_shape
from mocca_robot.report.scene3d import packed
from mocca_robot.statics.cases import CaseVerdict
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD

RIM = 24
"""Directions around a solid part's cone in which its reach is drawn."""
SMALLEST_FORCE = 1e-3
"""Share of the largest force below which an arrow is left out."""


def numbers(values: Array | Sequence[float], digits: int = 7) -> Any:
    """Return an array as nested lists of numbers with so many significant digits: enough for any screen."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 0:
        return float(f"{float(array):.{digits}g}")
    return [numbers(row, digits) for row in array]


def assembly_data(assembly: Assembly, graph: PartsGraph) -> dict[str, Any]:
    """Return the parts as they were handed in, with colours that keep neighbours apart."""
    bounds = np.array([p.shape.bounds for p in assembly.parts])
    colours = part_colours(graph)
    return {
        "dimension": assembly.dimension,
        "name": assembly.name,
        "size": assembly.size,
        "bounds": numbers([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)]),
        "alpha_deg": None if assembly.alpha_rad is None else float(np.rad2deg(assembly.alpha_rad)),
        "parts": [
            {
                "name": part.name,
                "fixed": part.fixed,
                "colour": colours[k],
                "mass": part.mass,
                "density": part.density,
                "material": part.material,
                "centroid": numbers(part.centroid),
                "extent": numbers(np.ptp(part.shape.bounds, axis=0)),
                "neighbours": sorted(graph.neighbours(k)),
            }
            for k, part in enumerate(assembly.parts)
        ],
    }


def shapes_data(assembly: Assembly) -> list[Any]:
    """Return every part's shape: rings of corners of flat ones, a packed mesh (`packed`) of solid ones."""
    return [
        [numbers(ring, 9) for ring in p.shape.rings] if isinstance(p.shape, Polygon) else packed(p.shape)
        for p in assembly.parts
    ]


def contacts_data(report: ContactReport) -> list[dict[str, Any]]:
    """Return where parts touch."""
    return [
        {
            "parts": list(c.parts),
            "k": c.k,
            "outline": numbers(c.polygon),
            "measure": c.measure,
            "normal": numbers(c.normal),
        }
        for c in report.contacts
    ]


def joints_data(joints: Sequence[Joint]) -> list[dict[str, Any]]:
    """Return every joint's surface, with how steep, high and sharp it is (metres; None where nothing bends)."""
    found = []
    for joint in joints:
        slope, radius = joint_shape(joint)
        height = (joint.vertices - joint.contact.polygon[0]) @ joint.contact.normal
        found.append(
            {
                "parts": list(joint.contact.parts),
                "k": joint.contact.k,
                "kind": joint.kind,
                "planar": joint.is_planar,
                "vertices": numbers(joint.vertices),
                "facets": joint.facets.tolist() if joint.vertices.shape[1] == 3 else [],
                "slope_deg": float(np.rad2deg(slope)),
                "height": float(np.abs(height).max(initial=0.0)),
                "radius": radius if np.isfinite(radius) else None,
            }
        )
    return found


def cases_data(graph: PartsGraph, cases: Iterable[CaseVerdict]) -> list[dict[str, Any]]:
    """Return load cases: what stands with its forces, what falls with its motion."""
    return [case_data(graph, case) for case in cases]


def case_data(graph: PartsGraph, verdict: CaseVerdict) -> dict[str, Any]:
    """Return one load case: verdict, forces (N, on the later part of each pair) and the collapse motion.

    Motions are finite displacements per part, scaled for a picture: x, y and an angle, or six numbers.
    """
    assembly = graph.assembly
    data: dict[str, Any] = {
        "case": verdict.case.name,
        "words": case_words(verdict.case.name),
        "stands": bool(verdict.result.stands),
        "status": str(verdict.result.status),
        "clamped": verdict.only_clamped,
        "infeasibility": float(verdict.result.infeasibility),
        "moving": [assembly.index(name) for name in verdict.moving],
        "forces": [],
        "motions": None,
    }
    if verdict.moving:
        grown = displaced if assembly.dimension == 2 else displaced_3d
        data["motions"] = numbers(grown(assembly, verdict.result.motions), 5)
    if verdict.result.stands:
        data["forces"] = forces_data(graph.contacts, verdict.result.forces)
    return data


def forces_data(contacts: Sequence[Contact], forces: Array) -> list[dict[str, Any]]:
    """Return contact forces, N: at every corner of flat parts' contacts, one resultant per pair of solid parts."""
    if not contacts:
        return []
    pairs, points, vectors = merged_forces(contacts, np.nan_to_num(forces))
    if points.shape[1] == 3:
        pairs, points, vectors = resultants(pairs, points, vectors)
    sizes = np.linalg.norm(vectors, axis=1)
    kept = sizes > SMALLEST_FORCE * sizes.max(initial=0.0)
    return [
        {"parts": pair.tolist(), "at": numbers(point, 6), "vector": numbers(vector, 5)}
        for pair, point, vector in zip(pairs[kept], points[kept], vectors[kept])
    ]


def resultants(pairs: IntArray, points: Array, vectors: Array) -> tuple[IntArray, Array, Array]:
    """Return one force per pair: (P, 2) pairs, (P, d) centres weighted by force, (P, d) sums."""
    unique, owner = np.unique(pairs, axis=0, return_inverse=True)
    owner = owner.ravel()
    weight = np.linalg.norm(vectors, axis=1)
    total = np.bincount(owner, weights=weight)
    total[total == 0.0] = 1.0

    def summed(values: Array) -> Array:
        return np.stack([np.bincount(owner, weights=column) for column in values.T], axis=1)

    return unique, summed(weight[:, None] * points) / total[:, None], summed(vectors)


def insertions_data(
    graph: PartsGraph, verdicts: Sequence[InsertionVerdict], ways: Mapping[str, Array]
) -> list[dict[str, Any]]:
    """Return how every free part goes in, with its motion cone.

    `cone` is, of flat parts, two angles (degrees) about the way out between which the part can leave; of solid ones
    points at unit distance around it. None where the way out itself is barred.
    """
    assembly, found = graph.assembly, []
    for verdict in verdicts:
        part = assembly.index(verdict.part)
        motion = graph.motion(part)
        out = -np.asarray(ways[verdict.part]) if verdict.part in ways else motion.axis
        found.append(
            {
                "part": part,
                "out": numbers(out),
                "alpha_deg": float(np.rad2deg(verdict.alpha_rad)),
                "required_deg": None if verdict.required_rad is None else float(np.rad2deg(verdict.required_rad)),
                "assemblable": verdict.assemblable,
                "blockers": [assembly.index(b) for b in verdict.blockers],
                "cone": _cone(motion.normals, out),
            }
        )
    return found


def _cone(normals: Array, out: Array) -> Any:
    if len(out) == 2:
        free = free_interval(normals, out)
        return None if free is None else numbers(np.rad2deg(free))
    if len(normals) and float((normals @ out).min()) < -ANGLE_ROUNDING_RAD:
        return None
    axes = tangent_axes(out)
    azimuths = np.linspace(0.0, 2 * np.pi, RIM, endpoint=False)
    lean = free_reach(normals, out, axes, azimuths)
    around = np.cos(azimuths)[:, None] * axes[0] + np.sin(azimuths)[:, None] * axes[1]
    return numbers(np.cos(lean)[:, None] * out + np.sin(lean)[:, None] * around, 5)


def ways_of(design: Design) -> dict[str, Array]:
    """Return the insertion directions of a design by part name."""
    return {i.part: np.asarray(i.direction) for i in design.insertion}
