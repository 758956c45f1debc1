"""One picture of an assembly, flat or solid, with the layers a panel asks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.design import Insertion
from mocca_robot.joints.joint import Joint
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report import drawing2d, drawing3d
from mocca_robot.report.drawing2d import View
from mocca_robot.report.load_arrows import REACH, loads_layer
from mocca_robot.report.markup import esc
from mocca_robot.statics.cases import CaseVerdict
from mocca_robot.tolerances import ROUNDING

BENT_RAD = 1e-4
"""Faces that differ by less are drawn without an edge between them."""

FLAT_MARGIN, SOLID_MARGIN = 0.09, 0.13
"""Free room around a picture, as a share of its diagonal; arrows of loads need as much more as they are long."""

HATCH = (
    '<pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
    '<rect class="hatch-bg" width="6" height="6"/><line class="hatch-line" x1="0" y1="0" x2="0" y2="6"/></pattern>'
)
PAGE_DEFS = (
    f'<svg xmlns="http://www.w3.org/2000/svg" width="0" height="0" style="position:absolute" aria-hidden="true">'
    f"<defs>{HATCH}</defs></svg>"
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Picture:
    """What a panel draws.

    Attributes:
        graph: parts and contacts; these place the forces.
        colours: index per part, see `palette.part_colours`.
        cases: load cases whose forces (where it stands) or collapse motion (where not) are drawn; each in a group
            `data-case`, the first one visible.
        joints: drawn as curves in 2D; in 3D their faces are emphasised.
        insertions: drawn as cones in 2D.
        names: whether the parts' names are drawn (2D).
        apart: how far solid parts are moved from each other, as a share of their distance from the middle.
    """

    graph: PartsGraph
    colours: Sequence[int]
    cases: Sequence[CaseVerdict] = ()
    joints: Sequence[Joint] = ()
    insertions: Sequence[Insertion] = ()
    names: bool = True
    apart: float = 0.0


def shared_view(assemblies: Sequence[Assembly], size_px: float = 460.0, apart: float = 0.0) -> View:
    """Return a view in which all `assemblies` (of one dimension) appear at the same scale and place."""
    room = REACH if apart == 0.0 and any(a.actions for a in assemblies) else 0.0
    if assemblies[0].dimension == 2:
        corners = np.concatenate([drawing2d.corners(a) for a in assemblies])
        return drawing2d.view_of(corners, size_px, FLAT_MARGIN + room)
    points = np.concatenate([m.vertices for a in assemblies for m in drawing3d.exploded(a, apart)])
    return drawing2d.view_of(points @ drawing3d.camera()[:2].T, size_px, SOLID_MARGIN + room)


def draw(picture: Picture, view: View, label: str, style: str = "") -> str:
    """Return the picture as an SVG element; `style` goes inside, for figures that stand alone."""
    flat = picture.graph.assembly.dimension == 2
    layers = [_solid(picture, view)] if not flat else [_flat(picture, view)]
    for number, verdict in enumerate(picture.cases):
        shown = "" if number == 0 else ' style="display:none"'
        layers.append(f'<g data-case="{esc(verdict.case.name)}"{shown}>{_case(picture, verdict, view)}</g>')
    if not picture.insertions and picture.apart == 0.0:
        layers.append(loads_layer(picture.graph, view, None if flat else drawing3d.camera()))
    if flat and picture.names:
        layers.append(drawing2d.names_layer(picture.graph.assembly, view))
    return view.svg("\n".join(layers), label, "drawing", style)


def _flat(picture: Picture, view: View) -> str:
    layers = [drawing2d.parts_layer(picture.graph.assembly, picture.colours, view)]
    if picture.joints:
        layers.append(drawing2d.joints_layer(picture.graph.assembly, picture.joints, view))
    if picture.insertions:
        layers.append(drawing2d.cones_layer(picture.graph, picture.insertions, view))
    return "\n".join(layers)


def _solid(picture: Picture, view: View) -> str:
    assembly, axes = picture.graph.assembly, drawing3d.camera()
    return drawing3d.solids_layer(assembly, picture.colours, axes, view, picture.apart, picture.joints)


def _case(picture: Picture, verdict: CaseVerdict, view: View) -> str:
    if verdict.moving:
        if picture.graph.assembly.dimension == 2:
            return drawing2d.collapse_layer(picture.graph.assembly, verdict, view)
        return drawing3d.collapse_layer_3d(picture.graph.assembly, verdict, drawing3d.camera(), view)
    if picture.graph.assembly.dimension == 2 and verdict.result.stands:
        return drawing2d.forces_layer(picture.graph, verdict, view)
    return ""


def joint_shape(joint: Joint) -> tuple[float, float]:
    """Return the joint's steepest slope against its contact (radians) and its smallest radius of curvature (m).

    Both are read off the facets: the radius of the circle through three neighbouring points in 2D, in 3D the
    distance of two neighbouring facets' centres over the angle between them. Infinite where nothing bends.
    """
    normals = joint.facet_normals
    slope = float(np.arccos(np.clip(normals @ joint.contact.normal, -1.0, 1.0)).max())
    if joint.is_planar or len(normals) < 2:
        return (0.0 if joint.is_planar else slope), float("inf")
    if joint.vertices.shape[1] == 2:
        return slope, _circumradius(joint.vertices)
    edges: dict[tuple[int, int], list[int]] = {}
    for face, (a, b, c) in enumerate(joint.facets):
        for edge in ((a, b), (b, c), (c, a)):
            edges.setdefault((int(min(edge)), int(max(edge))), []).append(face)
    pairs = np.array([f for f in edges.values() if len(f) == 2]).reshape(-1, 2)
    centres = joint.vertices[joint.facets].mean(axis=1)
    distance = np.linalg.norm(centres[pairs[:, 0]] - centres[pairs[:, 1]], axis=1)
    cosine = np.einsum("ij,ij->i", normals[pairs[:, 0]], normals[pairs[:, 1]])
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    bent = angle > BENT_RAD
    return slope, float((distance[bent] / angle[bent]).min(initial=np.inf))


def _circumradius(points: Array) -> float:
    a, b, c = points[:-2], points[1:-1], points[2:]
    u, v = b - a, c - a
    doubled = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    product = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1) * np.linalg.norm(c - b, axis=1)
    bent = doubled > ROUNDING * np.linalg.norm(v, axis=1) ** 2
    return float((product[bent] / (2.0 * doubled[bent])).min(initial=np.inf))
