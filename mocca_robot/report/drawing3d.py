"""Solid assemblies as flat drawings: what an orthographic camera sees, and over it how the parts would move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.geometry.frames import tangents
from mocca_robot.joints.joint import Joint
from mocca_robot.report import raster
from mocca_robot.report.drawing2d import GHOST_REACH, View, arrow, view_of
from mocca_robot.report.joint_faces import EMPHASIS, curved_faces, with_joints_apart
from mocca_robot.report.markup import point_list, px
from mocca_robot.report.palette import FIXED, LIGHT
from mocca_robot.statics.cases import CaseVerdict
from mocca_robot.tolerances import COARSE

DENSITY = 1.5
"""Pixels of the picture per unit of the drawing."""
FINER = 2
"""Pixels a side that are averaged into one: smooth lines."""
LEAN_RAD = np.deg2rad(32.0)
"""How far a close-up looks at a joint from the side: straight on, a bump has no height."""
AROUND = 0.35
"""What a close-up shows around a joint, as a share of the joint's size."""
CLOSE_UP_PX = 190.0
"""The longer side of a close-up."""
MANY_GHOSTS = 24
"""With more moving parts than this only arrows are drawn: outlines would hide the picture."""


def camera(azimuth_rad: float = np.deg2rad(-60.0), elevation_rad: float = np.deg2rad(24.0)) -> Array:
    """Return rows right, up, towards the eye (3, 3) of a camera that looks at the origin from an azimuth."""
    ca, sa, ce, se = np.cos(azimuth_rad), np.sin(azimuth_rad), np.cos(elevation_rad), np.sin(elevation_rad)
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


def solids_layer(
    assembly: Assembly,
    colours: Sequence[int],
    axes: Array,
    view: View,
    apart: float = 0.0,
    joints: Sequence[Joint] = (),
) -> str:
    """Return the parts as the camera sees them, moved `apart` (see `exploded`), as one picture inside the drawing.

    The faces of curved `joints` are emphasised.
    """
    fills = [FIXED if c < 0 else LIGHT[c] for c in colours]
    meshes, fills, hatched = with_joints_apart(assembly, joints, exploded(assembly, apart), fills)
    return _seen(meshes, fills, hatched, axes, view)


def _seen(meshes: Sequence[Mesh], fills: Sequence[str], hatched: Sequence[bool], axes: Array, view: View) -> str:
    scale = DENSITY * FINER
    width, height = round(view.width * scale), round(view.height * scale)
    seen = raster.look(meshes, axes, view.scale * scale, view.low, width, height)
    pixels = raster.painted(seen, fills, hatched, FINER)
    size = f'width="{px(pixels.shape[1] / DENSITY)}" height="{px(pixels.shape[0] / DENSITY)}"'
    return f'<image class="solids" x="0" y="0" {size} href="{raster.data_uri(pixels)}"/>'


def close_up(assembly: Assembly, joint: Joint, side: int, fill: str) -> str:
    """Return an SVG of one side of a joint, 0 the earlier part's and 1 the later one's, as one who holds it sees it."""
    part = assembly.parts[joint.contact.parts[side]]
    assert isinstance(part.shape, Mesh)
    outwards = joint.contact.normal if side == 0 else -joint.contact.normal
    axes = _looking_at(outwards)
    plane = joint.vertices @ axes[:2].T
    low, high = plane.min(axis=0), plane.max(axis=0)
    around = AROUND * float((high - low).max())
    view = view_of(np.array([low - around, high + around]), CLOSE_UP_PX, 0.0)
    curved = curved_faces(part.shape, [joint])
    meshes = [Mesh(part.shape.vertices, part.shape.faces[mine]) for mine in (~curved, curved)]
    picture = _seen(meshes, [fill, EMPHASIS], [part.fixed, False], axes, view)
    return view.svg(picture, f"The joint's face on {part.name}")


def _looking_at(outwards: Array) -> Array:
    """Return the rows right, up, towards the eye (3, 3) of a camera that looks at a face from its front, from above."""
    up = np.array([0.0, 0.0, 1.0])
    side = np.cross(up, outwards)
    right = side / np.linalg.norm(side) if np.linalg.norm(side) > COARSE else tangents(outwards)[0]
    over = np.cross(outwards, right)
    eye = np.cos(LEAN_RAD) * outwards + np.sin(LEAN_RAD) * over
    return np.array([right, np.cross(eye, right), eye])


def exploded(assembly: Assembly, apart: float) -> list[Mesh]:
    """Return the parts' meshes moved outwards from the middle of the ground, by the share `apart` of their distance."""
    meshes = [p.shape for p in assembly.parts if isinstance(p.shape, Mesh)]
    centroids = np.array([p.centroid for p in assembly.parts])
    middle = np.array([*centroids.mean(axis=0)[:2], centroids[:, 2].min()])
    return [Mesh(m.vertices + apart * (c - middle), m.faces) for m, c in zip(meshes, centroids)]


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
