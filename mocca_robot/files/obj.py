"""Wavefront OBJ, read in double precision: objects with polygons, and polylines."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.documents import decoded
from mocca_robot.geometry.polygon_cut import triangulated


@dataclass(frozen=True, eq=False)
class ObjObject:
    """One object of an OBJ file.

    Attributes:
        name: empty when the file names none.
        vertices: (V, 3), in the file's units; shared by all objects of the file.
        faces: vertex indices of each polygon, counter-clockwise from outside.
        lines: vertex indices of each polyline.
        normals: (V, 3), the last normal that a face gives each vertex, zero where none does.
        groups: the name of each polygon's group inside the object, '' where it has none.
        note: on the encoding of the names, or ''.
    """

    name: str
    vertices: Array
    normals: Array
    faces: list[list[int]] = field(default_factory=list)
    lines: list[list[int]] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)
    note: str = ""

    def triangles(self) -> tuple[IntArray, IntArray]:
        """Return (F, 3) vertex indices and (F,) each triangle's polygon; see `polygon_cut.triangulated`."""
        return triangulated(self.vertices, self.faces)


def read_obj(path: Path) -> list[ObjObject]:
    """Return the objects of an OBJ file that have faces or lines, in file order.

    'o' starts an object; 'g' does too in files without 'o'. Raises InputError naming the line it cannot read.
    """
    vertices: list[list[float]] = []
    given: list[list[float]] = []
    normal_of: dict[int, int] = {}
    text, note = decoded(Path(path).read_bytes())
    lines = text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines()
    starts = "o" if any(line.startswith("o ") for line in lines) else "g"
    found: dict[str, ObjObject] = {}
    name = inner = ""
    for number, line in enumerate(lines, 1):
        words = line.split("#", 1)[0].split() if "#" in line else line.split()
        if not words:
            continue
        kind = words[0]
        try:
            if kind == "v":
                point = [float(w) for w in words[1:4]]
                if len(point) < 3:
                    raise ValueError("fewer than three coordinates")
                if not all(abs(x) < fields.LARGEST for x in point):
                    raise ValueError(f"coordinates have to be finite and below {fields.LARGEST:g}")
                vertices.append(point)
            elif kind == "f" or kind == "l":
                kept = found.setdefault(name, ObjObject(name, np.zeros((0, 3)), np.zeros((0, 3)), note=note))
                corners = [_index(w, len(vertices)) for w in words[1:]]
                if "/" in line:
                    for corner, word in zip(corners, words[1:]):
                        if word.count("/") == 2 and not word.endswith("/"):
                            normal_of[corner] = _index(word.rsplit("/", 1)[1], len(given))
                if kind == "f":
                    kept.faces.append(corners)
                    kept.groups.append(inner)
                else:
                    kept.lines.append(corners)
            elif kind == "vn":
                given.append([float(w) for w in words[1:4]])
            elif kind == starts:
                name, inner = line.split(None, 1)[1].strip() if len(words) > 1 else "", ""
            elif kind == "g":
                inner = line.split(None, 1)[1].strip() if len(words) > 1 else ""
        except ValueError as error:
            raise InputError(f"{path}, line {number}: cannot read '{line.strip()[:200]}' ({error}).") from error
    if not found:
        raise InputError(f"{path} holds neither faces nor lines.")
    points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    normals = np.zeros_like(points)
    for corner, normal in normal_of.items():
        if 0 <= corner < len(points) and 0 <= normal < len(given):
            normals[corner] = given[normal][:3]
    for thing in found.values():
        for corners in (*thing.faces, *thing.lines):
            if max(corners, default=0) >= len(points) or min(corners, default=0) < 0:
                raise InputError(f"{path}: a face refers to a vertex that does not exist ({len(points)} vertices).")
    return [replace(thing, vertices=points, normals=normals) for thing in found.values()]


def _index(word: str, count: int) -> int:
    number = int(word.split("/", 1)[0] if "/" in word else word)
    if number == 0:
        raise ValueError("indices start at 1")
    return number - 1 if number > 0 else count + number
