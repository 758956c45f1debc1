"""GLB (glTF 2.0 in one file): meshes of any number of primitives, where the nodes of the scene put them."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.errors import InputError

MAX_NODES, MAX_DEPTH, MAX_CORNERS = 20_000, 100, 20_000_000
COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6

Piece = tuple[str, Array, IntArray]
"""A name, vertices (V, 3) in metres, y up, and triangles (F, 3)."""


def read_glb(content: bytes, where: str) -> list[Piece]:
    """Return one piece per node with a mesh, in the order of the scene: named by the node, else by its mesh, else ''.

    All primitives of a mesh are one piece. Raises InputError for what is damaged, compressed or holds no triangles.
    """
    try:
        return _File.of(content, where).pieces()
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError, struct.error) as error:
        raise InputError(f"{where} cannot be read as GLB: {error or type(error).__name__}. Export it again.") from None


@dataclass(frozen=True, eq=False)
class _File:
    data: Mapping[str, Any]
    binary: bytes
    where: str

    @classmethod
    def of(cls, content: bytes, where: str) -> _File:
        if len(content) < 20 or content[:4] != b"glTF":
            raise InputError(f"{where} cannot be read as GLB: it does not begin with 'glTF'. Export it again.")
        chunks: dict[int, bytes] = {}
        at = 12
        while at + 8 <= len(content):
            length, kind = struct.unpack_from("<II", content, at)
            chunks.setdefault(kind, content[at + 8 : at + 8 + length])
            at += 8 + length
        data = json.loads(chunks[_JSON].decode("utf-8"))
        for used in (*data.get("extensionsRequired", ()), *data.get("extensionsUsed", ())):
            if used in COMPRESSED:
                raise InputError(f"{where} is compressed ({used}); export it again without compression.")
        return cls(data, chunks.get(_BINARY, b""), where)

    def pieces(self) -> list[Piece]:
        meshes: dict[int, tuple[Array, IntArray]] = {}
        found: list[Piece] = []
        corners = 0
        for node, matrix in self._placed():
            number = node["mesh"]
            if number not in meshes:
                meshes[number] = self._mesh(self.data["meshes"][number])
            vertices, faces = meshes[number]
            corners += len(vertices)
            if corners > MAX_CORNERS:
                raise InputError(f"{self.where} places more than {MAX_CORNERS:,} corners; simplify its meshes.")
            if len(faces):
                mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
                name = str(node.get("name") or self.data["meshes"][number].get("name") or "")
                placed = vertices @ matrix[:3, :3].T + matrix[:3, 3]
                found.append((name, placed, faces[:, ::-1] if mirrored else faces))
        if not found:
            raise InputError(f"{self.where} holds no triangles; export the parts as meshes.")
        return found

    def _placed(self) -> Iterator[tuple[Mapping[str, Any], Array]]:
        """Yield every node that has a mesh, with the matrix (4, 4) that places it."""
        nodes = self.data.get("nodes", [])
        scenes = self.data.get("scenes", [])
        roots = scenes[self.data.get("scene", 0)].get("nodes", []) if scenes else _without_parent(nodes)
        waiting = [(root, np.eye(4), 0) for root in reversed(roots)]
        seen = 0
        while waiting:
            number, above, depth = waiting.pop()
            seen += 1
            if seen > MAX_NODES or depth > MAX_DEPTH:
                raise InputError(f"{self.where} has more than {MAX_NODES} nodes, or deeper than {MAX_DEPTH}.")
            node = nodes[number]
            matrix = above @ _matrix(node)
            if "mesh" in node:
                yield node, matrix
            waiting += [(child, matrix, depth + 1) for child in reversed(node.get("children", []))]

    def _mesh(self, mesh: Mapping[str, Any]) -> tuple[Array, IntArray]:
        """Return all triangles of a mesh."""
        vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP, _FAN):
                continue  # points and lines
            points = self._numbers(primitive["attributes"]["POSITION"]).astype(np.float64)
            if points.shape[1] != 3 or not np.isfinite(points).all():
                raise InputError(f"{self.where} holds coordinates that are not three numbers each; export it again.")
            order = (
                self._numbers(primitive["indices"])[:, 0].astype(np.int64)
                if "indices" in primitive
                else np.arange(len(points))
            )
            if len(order) and int(order.max()) >= len(points):
                raise InputError(f"{self.where}: a face refers to a vertex that does not exist ({len(points)}).")
            vertices.append(points)
            faces.append(_triangles(order, mode) + count)
            count += len(points)
        return np.concatenate(vertices), np.concatenate(faces)

    def _numbers(self, number: int) -> Array:
        """Return an accessor's numbers (n, width)."""
        accessor = self.data["accessors"][number]
        count, width, kind = (
            int(accessor["count"]),
            _WIDTHS[accessor["type"]],
            np.dtype(_TYPES[accessor["componentType"]]),
        )
        if "sparse" in accessor or not 0 <= count <= MAX_CORNERS:
            raise InputError(f"{self.where} has sparse or endless lists of numbers; export it again.")
        if "bufferView" not in accessor:
            return np.zeros((count, width))
        view = self.data["bufferViews"][accessor["bufferView"]]
        if view["buffer"] != 0 or "uri" in self.data["buffers"][0]:
            raise InputError(f"{self.where} keeps its meshes in other files; export one binary file (.glb).")
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride") or width * kind.itemsize
        if (
            start < 0
            or stride < width * kind.itemsize
            or (count and start + (count - 1) * stride + width * kind.itemsize > len(self.binary))
        ):
            raise InputError(f"{self.where} ends before its meshes do; export it again.")
        shape = np.ndarray((count, width), kind, self.binary, start, (stride, kind.itemsize))
        if not accessor.get("normalized") or kind.kind == "f":
            return np.asarray(shape)
        return np.maximum(shape / float(np.iinfo(kind).max), -1.0)


def _without_parent(nodes: list[Any]) -> list[int]:
    inside = {child for node in nodes for child in node.get("children", [])}
    return [k for k in range(len(nodes)) if k not in inside]


def _triangles(order: IntArray, mode: int) -> IntArray:
    if mode == _TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    k = np.arange(max(len(order) - 2, 0))
    if mode == _FAN:
        return np.stack([order[k * 0], order[k + 1], order[k + 2]], axis=1)
    return np.stack([order[k], order[k + 1 + k % 2], order[k + 2 - k % 2]], axis=1)


def _matrix(node: Mapping[str, Any]) -> Array:
    """Return where a node puts what is in it, (4, 4)."""
    matrix = np.eye(4)
    if "matrix" in node:
        matrix = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    else:
        x, y, z, w = (float(v) for v in node.get("rotation", (0, 0, 0, 1)))
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        matrix[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
        matrix[:3, 3] = node.get("translation", (0, 0, 0))
    if not np.isfinite(matrix).all():
        raise ValueError("a node's transformation is not made of numbers")
    return matrix
