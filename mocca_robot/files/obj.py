"""Wavefront OBJ, read in double precision: objects with polygons, and polylines."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.geometry.frames import tangents


@dataclass(frozen=True, eq=False)
class ObjObject:
    """One object of an OBJ file.

    Attributes:
        name: empty when the file names none.
        vertices: (V, 3), in the file's units; shared by all objects of the file.
        faces: vertex indices of each polygon, counter-clockwise from outside.
        lines: vertex indices of each polyline.
        normals: (V, 3), the last normal that a face gives each vertex, zero where none does.
    """

    name: str
    vertices: Array
    normals: Array
    faces: list[list[int]] = field(default_factory=list)
    lines: list[list[int]] = field(default_factory=list)

    def triangles(self) -> IntArray:
        """Return (F, 3) vertex indices; polygons are cut by ears in their mean plane."""
        found = [t for face in self.faces for t in triangulate(self.vertices, face)]
        return np.array(found, dtype=np.int64).reshape(-1, 3)


def read_obj(path: Path) -> list[ObjObject]:
    """Return the objects of an OBJ file that have faces or lines, in file order.

    'o' starts an object; 'g' does too in files without 'o'. Raises InputError naming the line it cannot read.
    """
    vertices: list[list[float]] = []
    given: list[list[float]] = []
    normal_of: dict[int, int] = {}
    groups: list[tuple[str, list[list[int]], list[list[int]]]] = [("", [], [])]
    text = Path(path).read_text(errors="replace").replace("\\\n", " ")
    lines = text.splitlines()
    starts = "o" if any(line.startswith("o ") for line in lines) else "g"
    for number, line in enumerate(lines, 1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        try:
            if words[0] == "v":
                vertices.append([float(w) for w in words[1:4]])
                if len(vertices[-1]) < 3:
                    raise ValueError("fewer than three coordinates")
                if not all(abs(x) < fields.LARGEST for x in vertices[-1]):
                    raise ValueError(f"coordinates have to be finite and below {fields.LARGEST:g}")
            elif words[0] == "vn":
                given.append([float(w) for w in words[1:4]])
            elif words[0] == starts:
                groups.append((" ".join(words[1:]), [], []))
            elif words[0] in ("f", "l"):
                corners = [_index(w, len(vertices)) for w in words[1:]]
                for corner, word in zip(corners, words[1:]):
                    if word.count("/") == 2 and not word.endswith("/"):
                        normal_of[corner] = _index(word.rsplit("/", 1)[1], len(given))
                (groups[-1][1] if words[0] == "f" else groups[-1][2]).append(corners)
        except ValueError as error:
            raise InputError(f"{path}, line {number}: cannot read '{line.strip()}' ({error}).") from error
    points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    normals = np.zeros_like(points)
    for corner, normal in normal_of.items():
        if 0 <= corner < len(points) and 0 <= normal < len(given):
            normals[corner] = given[normal][:3]
    merged: dict[str, ObjObject] = {}
    for name, faces, polylines in groups:
        for corners in faces + polylines:
            if max(corners, default=0) >= len(points) or min(corners, default=0) < 0:
                raise InputError(f"{path}: a face refers to a vertex that does not exist ({len(points)} vertices).")
        if faces or polylines:
            kept = merged.setdefault(name, ObjObject(name, points, normals))
            kept.faces.extend(faces)
            kept.lines.extend(polylines)
    if not merged:
        raise InputError(f"{path} holds neither faces nor lines.")
    return list(merged.values())


def _index(word: str, count: int) -> int:
    number = int(word.split("/", 1)[0])
    if number == 0:
        raise ValueError("indices start at 1")
    return number - 1 if number > 0 else count + number


def triangulate(vertices: Array, face: list[int]) -> list[list[int]]:
    """Return triangles (vertex indices) that fill a polygon of `vertices` (V, 3): a fan, or ears where it bends in."""
    if len(face) <= 3:
        return [face] if len(face) == 3 else []
    points = vertices[face]
    relative = points - points.mean(axis=0)
    normal = np.cross(relative, np.roll(relative, -1, axis=0)).sum(axis=0)
    following = np.roll(points, -1, axis=0) - points
    turns = np.cross(np.roll(following, 1, axis=0), following) @ normal
    if (turns >= 0).all():
        return [[face[0], face[k], face[k + 1]] for k in range(1, len(face) - 1)]
    import mapbox_earcut

    flat = relative @ tangents(normal / np.linalg.norm(normal)).T
    cut = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], dtype=np.uint32)).reshape(-1, 3)
    corners = flat[cut]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    cut = np.where((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0)[:, None], cut[:, ::-1], cut)
    return [[face[k] for k in triangle] for triangle in cut.tolist()]
