"""Solid assemblies as flat drawings: what an orthographic camera sees, and over it how the parts would move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.report import raster
from mocca_robot.report.drawing2d import GHOST_REACH, View, arrow
from mocca_robot.report.markup import point_list, px
from mocca_robot.report.palette import FIXED, LIGHT
from mocca_robot.statics.cases import CaseVerdict

DENSITY = 1.5
"""Pixels of the picture per unit of the drawing."""
FINER = 2
"""Pixels a side that are averaged into one: smooth lines."""
MANY_GHOSTS = 24
"""With more moving parts than this only arrows are drawn: outlines would hide the picture."""


def camera(azimuth_rad: float = np.deg2rad(-60.0), elevation_rad: float = np.deg2rad(24.0)) -> Array:
    """Return rows right, up, towards the eye (3, 3) of a camera that looks at the origin from an azimuth."""
    ca, sa, ce, se = np.cos(azimuth_rad), np.sin(azimuth_rad), np.cos(elevation_rad), np.sin(elevation_rad)
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


def solids_layer(assembly: Assembly, colours: Sequence[int], axes: Array, view: View, apart: float = 0.0) -> str:
    """Return the parts as the camera sees them, moved `apart` (see `exploded`), as one picture inside the drawing."""
    scale = DENSITY * FINER
    width, height = round(view.width * scale), round(view.height * scale)
    meshes = exploded(assembly, apart)
    seen = raster.look(meshes, axes, view.scale * scale, view.low, width, height)
    fills = [FIXED if c < 0 else LIGHT[c] for c in colours]
    pixels = raster.painted(seen, fills, [p.fixed for p in assembly.parts], FINER)
    size = f'width="{px(pixels.shape[1] / DENSITY)}" height="{px(pixels.shape[0] / DENSITY)}"'
    return f'<image class="solids" x="0" y="0" {size} href="{raster.data_uri(pixels)}"/>'


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
