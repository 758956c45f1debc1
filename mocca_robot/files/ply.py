"""PLY, in ASCII and binary of either order: polygons and coordinates in single or double precision."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Mesh
from mocca_robot.errors import InputError
from mocca_robot.files.documents import decoded
from mocca_robot.files.fields import LARGEST
from mocca_robot.geometry.polygon_cut import triangulated

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
}
_TYPES |= {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4"}
_TYPES |= {"float64": "f8"}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LISTS = ("vertex_indices", "vertex_index")
MAX_ROWS = 20_000_000

Property = tuple[str, str, str]
"""A name, its type, and for a list the type of its length, else ''."""
Element = tuple[str, int, list[Property]]


def read_ply(path: Path) -> tuple[Array, IntArray, IntArray]:
    """Return vertices (V, 3) in the file's unit, triangles (F, 3), and each one's polygon (F,). Raises InputError."""
    content = path.read_bytes()
    try:
        return _read(content)
    except (ArithmeticError, LookupError, TypeError, UnicodeError, ValueError) as error:
        raise InputError(f"{path} cannot be read as PLY: {error}. Export it again.") from None


def ply_bytes(mesh: Mesh) -> bytes:
    """Return a mesh as binary PLY in double precision."""
    faces = np.zeros(len(mesh.faces), dtype=[("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, mesh.faces
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(mesh.vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return header.encode("ascii") + np.asarray(mesh.vertices, dtype="<f8").tobytes() + faces.tobytes()


def _read(content: bytes) -> tuple[Array, IntArray, IntArray]:
    if not content.startswith(b"ply"):
        raise ValueError("it does not begin with 'ply'")
    end = content.find(b"end_header")
    start = content.find(b"\n", end) + 1
    if end < 0 or start == 0:
        raise ValueError("its header does not end")
    order, elements = _header(decoded(content[:end])[0])
    rows = _words(content[start:], elements) if order == "" else _binary(content, start, order, elements)
    vertices, polygons = np.zeros((0, 3)), []
    for (name, _, properties), columns in zip(elements, rows):
        names = [p[0] for p in properties]
        if name == "vertex":
            vertices = np.stack([np.asarray(columns[names.index(axis)], dtype=np.float64) for axis in "xyz"], axis=1)
        elif name == "face":
            polygons = [list(map(int, corners)) for corners in columns[_corner_list(names)]]
    if not polygons:
        raise ValueError("it holds no faces")
    if not (np.abs(vertices) < LARGEST).all():
        raise ValueError(f"a coordinate is no number below {LARGEST:g}")
    least, most = min(min(p, default=0) for p in polygons), max(max(p, default=0) for p in polygons)
    if least < 0 or most >= len(vertices):
        raise ValueError(
            f"it has a face with vertex {most if least >= 0 else least}, but only {len(vertices)} vertices"
        )
    triangles, polygon = triangulated(vertices, polygons)
    return vertices, triangles, polygon


def _corner_list(names: list[str]) -> int:
    """Return which property of faces lists their corners."""
    for name in _LISTS:
        if name in names:
            return names.index(name)
    raise ValueError(f"its faces have no {_LISTS[0]}")


def _header(text: str) -> tuple[str, list[Element]]:
    order, elements = "", []
    for line in text.splitlines()[1:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format":
            order = _ORDERS[words[1]]
        elif words[0] == "element":
            count = int(words[2])
            if not 0 <= count <= MAX_ROWS:
                raise ValueError(f"it announces {count} rows")
            elements.append((words[1], count, list[Property]()))
        elif words[0] == "property" and words[1] == "list":
            elements[-1][2].append((words[4], _TYPES[words[3]], _TYPES[words[2]]))
        elif words[0] == "property":
            elements[-1][2].append((words[2], _TYPES[words[1]], ""))
    return order, elements


def _words(body: bytes, elements: list[Element]) -> Iterator[list[list[Any]]]:
    """Yield each element's columns, from text."""
    words = iter(body.split())

    def word() -> float:
        found = next(words, None)
        if found is None:
            raise ValueError("it ends before its faces do")
        return float(found)

    for _, count, properties in elements:
        columns: list[list[Any]] = [[] for _ in properties]
        for _ in range(count):
            for column, (_, _, listed) in zip(columns, properties):
                column.append([int(word()) for _ in range(int(word()))] if listed else word())
        yield columns


def _binary(content: bytes, at: int, order: str, elements: list[Element]) -> Iterator[list[list[Any]]]:
    """Yield each element's columns, from bytes; elements without lists at once, as are faces of one size."""
    for _, count, properties in elements:
        sizes = [_list_size(content, at, order, properties, k) for k in range(len(properties))]
        fields: list[tuple[str, str] | tuple[str, str, int]] = []
        for k, ((_, kind, listed), size) in enumerate(zip(properties, sizes)):
            fields += (
                [(f"n{k}", order + listed), (f"v{k}", order + kind, size)] if listed else [(f"v{k}", order + kind)]
            )
        layout = np.dtype(fields)
        rows = None
        if layout.itemsize * count <= len(content) - at:
            rows = np.frombuffer(content, layout, count, at)
            if any((rows[f"n{k}"] != size).any() for k, size in enumerate(sizes) if properties[k][2]):
                rows = None
        if rows is not None:
            yield [list(rows[f"v{k}"]) for k in range(len(properties))]
            at += layout.itemsize * count
            continue
        columns: list[list[Any]] = [[] for _ in properties]
        for _ in range(count):
            for column, (_, kind, listed) in zip(columns, properties):
                number = 1
                if listed:
                    number = int(np.frombuffer(content, order + listed, 1, at)[0])
                    at += np.dtype(listed).itemsize
                values = np.frombuffer(content, order + kind, max(number, 0), at)
                at += values.nbytes
                column.append(values.tolist() if listed else values[0])
        yield columns


def _list_size(content: bytes, at: int, order: str, properties: list[Property], number: int) -> int:
    """Return the length of a list in the first row, where every list before it has one that is known."""
    for k, (_, kind, listed) in enumerate(properties):
        size = 1
        if listed:
            if at + np.dtype(listed).itemsize > len(content):
                return 0
            size = int(np.frombuffer(content, order + listed, 1, at)[0])
            at += np.dtype(listed).itemsize
        if k == number:
            return max(size, 0) if listed else 1
        at += max(size, 0) * np.dtype(kind).itemsize
    return 0
