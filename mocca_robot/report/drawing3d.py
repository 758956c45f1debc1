"""Solid assemblies as flat SVG: orthographic, hidden parts painted over, shaded by their faces' tilt to the light."""

from __future__ import annotations

from collections.abc import Sequence

import networkx as nx
import numpy as np
import shapely

from mocca_robot.assembly import Array, Assembly, Mesh
from mocca_robot.contacts import Contact
from mocca_robot.report.drawing2d import GHOST_REACH, View, arrow
from mocca_robot.report.markup import esc, point_list, px
from mocca_robot.report.palette import fills
from mocca_robot.verify import CaseVerdict

LIGHT = np.array([0.3, 0.6, 0.74])
"""Towards the light in camera axes (right, up, towards the eye)."""
SMALL_FACE = 0.02
"""Faces below this share of a part's visible area (a joint's facets) are drawn as one."""

MANY_GHOSTS = 24
"""With more moving parts than this only arrows are drawn: outlines would hide the picture."""


def camera(azimuth_rad: float = np.deg2rad(-60.0), elevation_rad: float = np.deg2rad(24.0)) -> Array:
    """Return rows right, up, towards the eye (3, 3) of a camera that looks at the origin from an azimuth."""
    ca, sa, ce, se = np.cos(azimuth_rad), np.sin(azimuth_rad), np.cos(elevation_rad), np.sin(elevation_rad)
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


def paint_order(assembly: Assembly, contacts: Sequence[Contact], eye: Array) -> list[int]:
    """Return part indices from back to front: across a contact the part on the eye's side comes later.

    Where that is circular, by the depth of the centroids alone.
    """
    depth = [float(p.centroid @ eye) for p in assembly.parts]
    graph: nx.DiGraph[int] = nx.DiGraph()
    graph.add_nodes_from(range(len(depth)))
    facing: dict[tuple[int, int], float] = {}
    for contact in contacts:
        facing[contact.parts] = facing.get(contact.parts, 0.0) + contact.measure * float(contact.normal @ eye)
    for (i, j), value in facing.items():
        graph.add_edge(*((i, j) if value > 0 else (j, i)))
    try:
        return list(nx.lexicographical_topological_sort(graph, key=lambda p: depth[p]))
    except nx.NetworkXUnfeasible:
        return sorted(range(len(depth)), key=lambda p: depth[p])


def solids_layer(
    assembly: Assembly, contacts: Sequence[Contact], colours: Sequence[int], axes: Array, view: View
) -> str:
    """Return every part's visible faces, painted from back to front."""
    classes = fills()
    drawn = []
    for k in paint_order(assembly, contacts, axes[2]):
        part = assembly.parts[k]
        assert isinstance(part.shape, Mesh)
        faces = [_face(path, shade, classes[colours[k]]) for path, shade in visible_faces(part.shape, axes, view)]
        kind = " (fixed)" if part.fixed else ""
        drawn.append(f'<g data-part="{k}"><title>{esc(part.name)}{kind}</title>{"".join(faces)}</g>')
    return "\n".join(drawn)


def _face(path: str, shade: float, cls: str) -> str:
    return (
        f'<path class="solid part {cls}" d="{path}"/><path class="shade" opacity="{px(shade)}" d="{path}"/>'
        f'<path class="solid-edge" d="{path}"/>'
    )


def visible_faces(mesh: Mesh, axes: Array, view: View) -> list[tuple[str, float]]:
    """Return (path data, darkness 0 … 0.34) of the mesh's flat regions that face the eye, curved ones merged."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(doubled, 1e-300)[:, None] @ axes.T
    front = (normals[:, 2] > 1e-3) & (doubled > 0)
    if not front.any():
        return []
    flat, normals, area = corners[front] @ axes[:2].T, normals[front], (doubled * 0.5)[front]
    _, group = np.unique(np.round(normals, 2), axis=0, return_inverse=True)
    group = group.ravel()
    share = np.bincount(group, weights=area) / area.sum()
    group = np.where(share[group] < SMALL_FACE, len(share), group)
    faces = []
    for g in np.unique(group):
        mine = group == g
        region = shapely.union_all(shapely.polygons(flat[mine]), grid_size=1e-7 * float(np.ptp(flat)))
        normal = area[mine] @ normals[mine]
        shade = 0.34 * (1.0 - max(float(normal / np.linalg.norm(normal) @ (LIGHT / np.linalg.norm(LIGHT))), 0.0))
        faces.append((region_path(region, view), shade))
    return faces


def region_path(region: shapely.Geometry, view: View) -> str:
    """Return SVG path data of a (multi-)polygon in view-plane metres."""
    rings = []
    for piece in shapely.get_parts(region):
        if piece.geom_type == "Polygon":
            rings.extend([piece.exterior, *piece.interiors])
    return " ".join(f"M{point_list(view(np.array(r.coords[:-1])))}Z" for r in rings)


def displaced_3d(assembly: Assembly, motions: Array, reach: float = GHOST_REACH) -> Array:
    """Return `motions` (N, 6) scaled so that the fastest vertex moves by `reach` times the assembly's size."""
    fastest = 0.0
    for part, motion in zip(assembly.parts, motions):
        assert isinstance(part.shape, Mesh)
        velocity = motion[:3] + np.cross(motion[3:], part.shape.vertices - part.centroid)
        fastest = max(fastest, float(np.linalg.norm(velocity, axis=1).max()))
    return np.asarray(motions * (reach * assembly.size / fastest if fastest > 0 else 0.0))


def collapse_layer_3d(assembly: Assembly, verdict: CaseVerdict, axes: Array, view: View) -> str:
    """Return dashed silhouettes of the parts where the collapse motion takes them, with arrows."""
    drawn = []
    for part, step in zip(assembly.parts, displaced_3d(assembly, verdict.result.motions)):
        if part.name not in verdict.moving:
            continue
        assert isinstance(part.shape, Mesh)
        moved = part.shape.vertices + step[:3] + np.cross(step[3:], part.shape.vertices - part.centroid)
        if len(verdict.moving) <= MANY_GHOSTS:
            outline = shapely.MultiPoint(moved @ axes[:2].T).convex_hull
            drawn.append(f'<path class="ghost" d="{region_path(outline, view)}"/>')
        start, end = view(np.array([part.centroid, part.centroid + step[:3]]) @ axes[:2].T)
        drawn.append(arrow(start, end, "moves", f"{part.name} moves this way"))
    return f'<g class="layer collapse">{"".join(drawn)}</g>'
