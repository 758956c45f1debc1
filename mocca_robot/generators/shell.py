"""A polygon surface from an OBJ file, thickened into blocks with planar contacts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import DEFAULT_DENSITY, Assembly, Part
from mocca_robot.errors import InputError
from mocca_robot.generators.bond import running_bond_quads
from mocca_robot.generators.parameters import REQUIRED, GeneratorParameters
from mocca_robot.generators.surface import Surface, planar_directions, thicken
from mocca_robot.tolerances import COARSE, EXACT, ROUNDING

DEFAULTS: dict[str, Any] = {
    "surface": REQUIRED,
    "thickness": REQUIRED,
    "units": "m",
    "bond": "stack",
    "sequence": "height",
    "ground": 0.02,
    "flatness": 1e-7,
    "density": DEFAULT_DENSITY,
}


def shell(given: Mapping[str, Any], folder: Path) -> Assembly:
    """Return one block per polygon of an OBJ `surface`, `thickness` (m) towards the surface's outside.

    Polygons with an edge on the ground (within `ground` × height of the lowest point) are fixed. Blocks come by
    `sequence`: "height" of their centroid, or "file", the order of the polygons. Corners that lie on a neighbour's
    edge (T-junctions) are joined to it. With `bond: running` the quadrangles of every second row are shifted by
    half a block. Vertex normals in the file are the directions of the thickness to start from. Raises InputError
    when a wall between two blocks cannot be made flat within `flatness` × the surface's size: where, by how much.
    """
    p = GeneratorParameters("shell", given, DEFAULTS)
    from mocca_robot.files.meshes import METRES_PER
    from mocca_robot.files.obj import read_obj

    path = folder / p.text("surface")
    if not path.is_file():
        raise InputError(f"shell.surface: '{path}' does not exist.")
    factor = METRES_PER[p.choice("units", tuple(METRES_PER))]
    faces: list[tuple[int, ...]] = []
    names: list[str] = []
    normals, points = np.zeros((0, 3)), np.zeros((0, 3))
    for group in read_obj(path):
        points, normals = group.vertices * factor, group.normals
        for k, face in enumerate(group.faces):
            if len(set(face)) < 3:
                raise InputError(f"shell.surface: a face of '{path}' has {len(set(face))} corners; remove it.")
            faces.append(tuple(face))
            single = group.name and len(group.faces) == 1
            names.append(group.name if single else f"{group.name or 'block'}_{k + 1:03d}")
    if not faces:
        raise InputError(f"shell.surface: '{path}' has no faces; export the surface with its polygons.")
    surface, normals = _used(Surface(points, tuple(faces)), normals)
    surface = joined(surface)
    if p.choice("bond", ("stack", "running")) == "running":
        surface = running_bond_quads(surface)
        names = [f"block_{k + 1:03d}" for k in range(len(surface.faces))]
        normals = np.zeros_like(surface.points)
    thickness = p.number("thickness", 1e-5, 1e3)
    directions, deviation = planar_directions(surface, thickness, start=normals)
    _require_flat(surface, deviation, p.number("flatness", 0.0, 1e-2))
    meshes = thicken(surface, directions, thickness)

    height = surface.points[:, 2]
    level = height.min() + p.at_least("ground", 0.0, 0.5) * np.ptp(height)
    density = p.number("density", 0.0, 1e5)
    parts = []
    for loop, mesh, name in zip(surface.faces, meshes, names):
        low = height[list(loop)] <= level + EXACT
        parts.append(Part(name, mesh, density, fixed=bool((low & np.roll(low, 1)).any())))
    if not any(part.fixed for part in parts):
        raise InputError(f"shell.surface: no polygon of '{path}' has an edge on the ground; raise shell.ground.")
    if p.choice("sequence", ("height", "file")) == "file":
        return Assembly(path.stem, tuple(parts))
    order = sorted(range(len(parts)), key=lambda k: (round(float(parts[k].centroid[2] / np.ptp(height)), 3), k))
    return Assembly(path.stem, tuple(parts[k] for k in order))


def _used(surface: Surface, normals: Array) -> tuple[Surface, Array]:
    """Return the surface and its normals without points that no polygon has: files of cut meshes are full of them."""
    used, index = np.unique(np.concatenate([np.array(f) for f in surface.faces]), return_inverse=True)
    ends = np.cumsum([len(f) for f in surface.faces])[:-1]
    faces = tuple(tuple(int(v) for v in f) for f in np.split(index, ends))
    return Surface(surface.points[used], faces), normals[used] if len(normals) == len(surface.points) else normals


def joined(surface: Surface) -> Surface:
    """Return `surface` with every corner that lies on an edge of another polygon inserted into that polygon."""
    import shapely

    points = surface.points
    used = np.unique(np.concatenate([np.array(f) for f in surface.faces]))
    size = float(np.linalg.norm(np.ptp(points[used], axis=0)))
    tree = shapely.STRtree(shapely.points(points[used, :2]))
    faces: list[list[int]] = []
    for face in surface.faces:
        loop: list[int] = []
        for a, b in zip(face, (*face[1:], face[0])):
            loop.append(a)
            span = points[b] - points[a]
            length = float(np.linalg.norm(span))
            if length <= ROUNDING * size:
                where = ", ".join(f"{x:.4g}" for x in points[a])
                raise InputError(f"A polygon has an edge without length near ({where}); merge the two corners.")
            near = used[tree.query(shapely.linestrings([points[a, :2], points[b, :2]]).buffer(COARSE * size))]
            along = (points[near] - points[a]) @ span / length
            off = np.linalg.norm(points[near] - points[a] - along[:, None] * span / length, axis=1)
            inside = (off <= COARSE * size) & (along > COARSE * size) & (along < length - COARSE * size)
            loop += [int(near[k]) for k in np.flatnonzero(inside)[np.argsort(along[inside])]]
        faces.append(loop)
    return Surface(points, tuple(tuple(f) for f in faces))


def _require_flat(surface: Surface, deviation: Array, flatness: float) -> None:
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    if len(deviation) == 0 or deviation.max() <= flatness * size:
        return
    inner = [e for e, owners in surface.edges().items() if len(owners) == 2]
    worst = int(np.argmax(deviation))
    where = ", ".join(f"{x:.4g}" for x in surface.points[list(inner[worst])].mean(axis=0))
    count = int((deviation > flatness * size).sum())
    raise InputError(
        f"This surface cannot be cut into blocks with planar contacts: the wall near ({where}) is "
        f"{deviation[worst]:.3g} m away from flat, the limit is {flatness * size:.3g} m ({count} of {len(deviation)} "
        "walls exceed it). Use a planar-quad mesh with conical or circular quadrangles, a surface of revolution, or "
        "running bond."
    )
