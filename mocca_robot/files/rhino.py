"""Rhino's 3DM, read and written by `rhino3dm`: meshes, and solids with the meshes that Rhino saves beside them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Mesh
from mocca_robot.errors import EnvironmentNeeded, InputError
from mocca_robot.files.bodies import MeshObject
from mocca_robot.files.native import Piece, packed, read_apart, require_package, unpacked
from mocca_robot.geometry.polygon_cut import triangulated

MAX_DEPTH, MAX_PIECES = 20, 20_000
UNITS = {
    "Microns": 1e-6,
    "Millimeters": 1e-3,
    "Centimeters": 1e-2,
    "Decimeters": 0.1,
    "Meters": 1.0,
    "Inches": 0.0254,
    "Feet": 0.3048,
    "Yards": 0.9144,
    "Kilometers": 1e3,
}


def read_3dm(path: Path) -> tuple[list[MeshObject], float | None]:
    """Return the objects of a 3DM file in its own unit, and metres per unit, None where it says none.

    Objects are named as in Rhino, else by their block, else by their layer. Hidden objects and layers are left out.
    Raises EnvironmentNeeded without rhino3dm, InputError for files and objects that hold no mesh.
    """
    require_package("rhino3dm", "rhino", path, "OBJ, one object per part")
    pieces, unit, notes = unpacked(read_apart("3dm", path, __name__))
    return [MeshObject(*p, (), tuple(notes) if k == 0 else ()) for k, p in enumerate(pieces)], unit


def converted(path: Path) -> bytes:
    """Return what `pieces_of` reads, packed."""
    return packed(*pieces_of(path))


def pieces_of(path: Path) -> tuple[list[Piece], float | None, list[str]]:
    """Return names, vertices and triangles of what `read_3dm` reads, metres per unit, and notes; a damaged file can end
    the process, or keep it busy for ever: call it in one of its own.
    """
    import rhino3dm

    rhino: Any = rhino3dm
    file = rhino.File3dm.Read(str(path))
    if file is None:
        raise InputError(f"'{path}' cannot be read as 3DM; open it in Rhino and save it again (Rhino 5 or later).")
    definitions = {str(d.Id): d for d in file.InstanceDefinitions}
    placed = {i for d in definitions.values() for i in map(str, d.GetObjectIds())}
    by_id = {str(o.Attributes.Id): o for o in file.Objects}
    found: list[Piece] = []
    dropped: list[str] = []

    def walk(thing: Any, transform: Array, name: str, depth: int) -> None:
        geometry, own = thing.Geometry, thing.Attributes.Name or name
        if depth > MAX_DEPTH or len(found) > MAX_PIECES:
            raise InputError(f"'{path}' has blocks in blocks beyond {MAX_DEPTH}, or more than {MAX_PIECES} objects.")
        if type(geometry).__name__ == "InstanceReference":
            block = definitions.get(str(geometry.ParentIdefId))
            inner = transform @ _matrix(geometry.Xform)
            for number in map(str, block.GetObjectIds()) if block is not None else ():
                if number in by_id:
                    walk(by_id[number], inner, own or (block.Name if block is not None else ""), depth + 1)
            return
        pieces = list(_meshes(rhino, geometry))
        if not pieces:
            dropped.append(f"'{own}' ({type(geometry).__name__})" if own else type(geometry).__name__)
            return
        for points, polygons in pieces:
            vertices = points @ transform[:3, :3].T + transform[:3, 3]
            triangles, _ = triangulated(vertices, polygons)
            mirrored = np.linalg.det(transform[:3, :3]) < 0.0
            found.append((own, vertices, triangles[:, ::-1] if mirrored else triangles))

    hidden = 0
    for thing in file.Objects:
        if str(thing.Attributes.Id) in placed or thing.Attributes.IsInstanceDefinitionObject:
            continue
        layer = file.Layers[thing.Attributes.LayerIndex] if len(file.Layers) else None
        if not thing.Attributes.Visible or (layer is not None and not layer.Visible):
            hidden += 1
            continue
        walk(thing, np.eye(4), thing.Attributes.Name or (layer.Name if layer is not None else ""), 0)
    if not found:
        what = f": {', '.join(dropped[:6])} hold no mesh" if dropped else ""
        raise InputError(
            f"'{path}' holds no mesh{what}. In Rhino, shade the model once and save it with render meshes (without "
            "'Save Small'), or run the command Mesh on the solids."
        )
    notes = [f"{hidden} hidden objects left out"] if hidden else []
    if dropped:
        more = f" and {len(dropped) - 6} more" if len(dropped) > 6 else ""
        notes.append(f"left out, as they hold no mesh: {', '.join(dropped[:6])}{more}")
    return found, UNITS.get(file.Settings.ModelUnitSystem.name), notes


def write_3dm(names: Sequence[str], meshes: Sequence[Mesh], path: Path) -> Path:
    """Return `path` after writing the parts there, in metres and double precision, by name."""
    require_package("rhino3dm", "rhino", path, "OBJ")
    import rhino3dm

    rhino: Any = rhino3dm
    file = rhino.File3dm()
    file.Settings.ModelUnitSystem = rhino.UnitSystem.Meters
    for name, mesh in zip(names, meshes, strict=True):
        made = rhino.Mesh()
        for x, y, z in mesh.vertices.tolist():
            made.Vertices.Add(x, y, z)
        made.Vertices.UseDoublePrecisionVertices = True
        for k, (x, y, z) in enumerate(mesh.vertices.tolist()):
            made.Vertices.SetPoint3dAt(k, rhino.Point3d(x, y, z))
        for a, b, c in mesh.faces.tolist():
            made.Faces.AddFace(a, b, c)
        made.Normals.ComputeNormals()
        attributes = rhino.ObjectAttributes()
        attributes.Name = name
        file.Objects.AddMesh(made, attributes)
    if not file.Write(str(path), 7):
        raise EnvironmentNeeded(f"'{path}' cannot be written; name another folder.")
    return path


def _meshes(rhino: Any, geometry: Any) -> Iterator[tuple[Array, list[list[int]]]]:
    """Yield vertices and polygons of what an object shows: one mesh, or all faces of a solid together."""
    kind = type(geometry).__name__
    if kind == "Mesh":
        yield _mesh(geometry)
    elif kind == "Extrusion":
        mesh = geometry.GetMesh(rhino.MeshType.Any)
        if mesh is not None:
            yield _mesh(mesh)
    elif kind == "Brep":
        points, polygons, count = [], [], 0
        for face in geometry.Faces:
            mesh = face.GetMesh(rhino.MeshType.Any)
            if mesh is None:
                return
            own, corners = _mesh(mesh)
            points.append(own)
            polygons += [[c + count for c in polygon] for polygon in corners]
            count += len(own)
        if points:
            yield np.concatenate(points), polygons


def _mesh(mesh: Any) -> tuple[Array, list[list[int]]]:
    points = np.array(
        [(p.X, p.Y, p.Z) for p in (mesh.Vertices.Point3dAt(k) for k in range(len(mesh.Vertices)))], dtype=np.float64
    ).reshape(-1, 3)
    faces = [list(mesh.Faces[k]) for k in range(len(mesh.Faces))]
    return points, [f[:3] if f[2] == f[3] else f for f in faces]


def _matrix(xform: Any) -> Array:
    return np.array([[getattr(xform, f"M{r}{c}") for c in range(4)] for r in range(4)], dtype=np.float64)
