"""Solid parts as pixels: what an orthographic camera sees of them, found with a depth buffer, shaded and outlined."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Mesh
from mocca_robot.tolerances import ROUNDING, TINY

Pixels: TypeAlias = NDArray[np.uint8]

LIGHT = np.array([-0.35, 0.55, 0.76]) / np.linalg.norm([-0.35, 0.55, 0.76])
"""Towards the light in camera axes (right, up, towards the eye)."""
CREASE = np.cos(np.deg2rad(25.0))
"""Neighbouring pixels of one part whose faces turn by more are parted by a line."""
MOST_PIXELS = 2_000_000
"""Pixels in the boxes of the triangles drawn at once: bounds the memory, changes nothing in the picture."""
INK = np.array([43.0, 54.0, 67.0], dtype=np.float32)
"""Colour of the lines."""
COARSE = 6
"""Steps of a colour channel that count as one when a picture's palette is chosen."""
JUMP = 6.0
"""Pixels by which one face must lie behind the other for a line between them."""
HATCHED = np.float32(0.78)
"""Brightness of the hatching's stripes."""
HATCH_PX = 7
"""Distance of the hatching of fixed parts, in pixels of the finished picture."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What the camera sees, top row first.

    Attributes:
        face: (height, width) the triangle at each pixel, −1 for nothing.
        depth: (height, width) how near it is to the eye, pixels.
        owner: (F,) the part of each triangle.
        normals: (F, 3) their unit normals in camera axes.
    """

    face: IntArray
    depth: Array
    owner: IntArray
    normals: Array

    @cached_property
    def part(self) -> IntArray:
        """Return (height, width) the part at each pixel, −1 for nothing."""
        return np.where(self.face >= 0, self.owner[self.face], -1)


def look(meshes: Sequence[Mesh], axes: Array, scale: float, low: Array, width: int, height: int) -> Seen:
    """Return what a camera with rows right, up, towards the eye (3, 3) sees of `meshes` (metres).

    `scale` is in pixels per metre; `low` (2,) is the lower left corner of the picture in the camera's plane.
    """
    corners = np.concatenate([m.vertices[m.faces] for m in meshes]) @ axes.T
    owner = np.repeat(np.arange(len(meshes)), [len(m.faces) for m in meshes])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    front = normals[:, 2] > ROUNDING * np.maximum(lengths, TINY)
    corners, owner, normals = corners[front], owner[front], normals[front] / lengths[front][:, None]
    corners = (corners - [low[0], low[1], 0.0]) * scale
    corners[..., 1] = height - corners[..., 1]
    depth = np.full(width * height, -np.inf)
    face = np.full(width * height, -1)
    rows = np.ceil(corners[..., 1].min(axis=1) - 0.5), np.ceil(corners[..., 1].max(axis=1) - 0.5)
    first, last = (np.clip(r, 0, height).astype(np.int64) for r in rows)
    breadth = np.ceil(np.ptp(corners[..., 0], axis=1)).clip(1, width)
    for some in _in_turn(last - first, breadth):
        pixel, z, triangle = _fragments(corners[some], normals[some], first[some], last[some], width)
        np.maximum.at(depth, pixel, z)
        nearest = z == depth[pixel]
        face[pixel[nearest]] = some[triangle[nearest]]
    shape = (height, width)
    return Seen(face=face.reshape(shape), depth=depth.reshape(shape), owner=owner, normals=normals)


def _in_turn(rows: IntArray, breadth: Array) -> list[IntArray]:
    """Return the triangles that cover any row, in groups whose boxes hold at most about `MOST_PIXELS`."""
    kept = np.flatnonzero(rows > 0)
    group = np.cumsum(rows[kept] * breadth[kept]) // MOST_PIXELS
    return [kept[group == g] for g in np.unique(group)]


def _fragments(
    corners: Array, normals: Array, first: IntArray, last: IntArray, width: int
) -> tuple[IntArray, Array, IntArray]:
    """Return (pixel, depth, triangle) of every pixel centre that a triangle covers."""
    triangle = np.repeat(np.arange(len(corners)), last - first)
    row = np.arange(len(triangle)) - np.repeat(np.cumsum(last - first) - last, last - first)
    y = row + 0.5
    a, b = corners[triangle], np.roll(corners, -1, axis=1)[triangle]
    rise = b[..., 1] - a[..., 1]
    share = (y[:, None] - a[..., 1]) / np.where(rise == 0.0, 1.0, rise)
    crossed = (rise != 0.0) & (share >= 0.0) & (share <= 1.0)
    x = a[..., 0] + share * (b[..., 0] - a[..., 0])
    left = np.ceil(np.where(crossed, x, np.inf).min(axis=1) - 0.5).clip(0, width)
    right = np.ceil(np.where(crossed, x, -np.inf).max(axis=1) - 0.5).clip(0, width)
    count = np.maximum(right - left, 0).astype(np.int64)
    span = np.repeat(np.arange(len(count)), count)
    column = np.arange(len(span)) - np.repeat(np.cumsum(count) - count, count) + left.astype(np.int64)[span]
    mine = triangle[span]
    n, anchor = normals[mine], corners[mine, 0]
    lift = n[:, 0] * (column + 0.5 - anchor[:, 0]) - n[:, 1] * (y[span] - anchor[:, 1])
    return row[span] * width + column, anchor[:, 2] - lift / n[:, 2], mine


def outlines(seen: Seen) -> NDArray[np.bool_]:
    """Return the pixels on a line: where parts meet, where one face hides another, and along sharp edges."""
    line = np.zeros(seen.face.shape, dtype=np.bool_)
    slope = -seen.normals[:, :2] / np.maximum(seen.normals[:, 2:], ROUNDING) * [1.0, -1.0]
    for axis, here, there in ((0, np.s_[:, :-1], np.s_[:, 1:]), (1, np.s_[:-1], np.s_[1:])):
        # Within a face nothing turns and nothing hides.
        between = seen.face[here] != seen.face[there]
        a, b = seen.face[here][between], seen.face[there][between]
        differs = seen.part[here][between] != seen.part[there][between]
        solid = (a >= 0) & (b >= 0)
        sharp = np.einsum("ik,ik->i", seen.normals[a], seen.normals[b]) < CREASE
        with np.errstate(invalid="ignore"):
            step = seen.depth[there][between] - seen.depth[here][between]
            jump = np.minimum(np.abs(step - slope[a, axis]), np.abs(step - slope[b, axis])) > JUMP
        between[between] = differs | (solid & (sharp | jump))
        line[here] |= between
        line[there] |= between
    return line


def painted(seen: Seen, fills: Sequence[str], fixed: Sequence[bool], finer: int) -> Pixels:
    """Return RGBA pixels (height/finer, width/finer, 4): shaded faces, dark lines, hatched fixed parts, clear ground.

    `fills` holds '#rrggbb' per part; `finer` pixels of `seen` a side make one of the picture.
    """
    hatched = np.append(np.asarray(fixed)[seen.owner], False)
    colours = np.array([[int(f[k : k + 2], 16) for k in (1, 3, 5)] for f in fills], dtype=np.float32)
    light = 0.60 + 0.30 * np.maximum(seen.normals @ LIGHT, 0.0) + 0.14 * seen.normals[:, 2]
    # One row more, for no face at all: index −1.
    shades = np.append(colours[seen.owner] * np.minimum(light, 1.02)[:, None], np.zeros((1, 3)), axis=0)
    shades = shades.astype(np.float32)
    height, width = (n // finer for n in seen.face.shape)
    total, cover = np.zeros((height, width, 3), dtype=np.float32), np.zeros((height, width), dtype=np.float32)
    line = outlines(seen)
    y, x = np.indices((height, width), dtype=np.int32)
    for down in range(finer):
        for across in range(finer):
            mine = np.s_[down : height * finer : finer, across : width * finer : finer]
            face, drawn = seen.face[mine], line[mine]
            colour = shades[face]
            stripe = hatched[face] & ((finer * (x + y) + down + across) % (HATCH_PX * finer) < finer)
            colour[stripe] *= HATCHED
            colour[drawn] = INK
            total += colour
            cover += (face >= 0) | drawn
    mixed = total / np.maximum(cover, 1.0)[..., None]
    return np.dstack([mixed.round().clip(0, 255), (255 / finer**2 * cover).round()]).astype(np.uint8)


def indexed(pixels: Pixels) -> tuple[Pixels, Pixels]:
    """Return RGBA pixels (h, w, 4) as at most 256 colours (k, 4), the frequent ones, and each pixel's index (h, w)."""
    coarse = np.where(pixels == 255, pixels, pixels // COARSE * COARSE + COARSE // 2).astype(np.uint8)
    coarse[pixels[..., 3] == 0] = 0
    keys = np.ascontiguousarray(coarse).view(np.uint32)[..., 0]
    found, inverse, counts = np.unique(keys, return_inverse=True, return_counts=True)
    colours = found.view(np.uint8).reshape(-1, 4)
    kept = np.sort(np.argsort(-counts, kind="stable")[:256])
    nearest = np.asarray(cKDTree(colours[kept].astype(np.float64)).query(colours.astype(np.float64))[1], dtype=np.uint8)
    return colours[kept], np.asarray(nearest[inverse.reshape(keys.shape)])


def png(pixels: Pixels) -> bytes:
    """Return RGBA pixels (h, w, 4) as a PNG file with a palette: a quarter of the size of one without."""
    colours, index = indexed(pixels)
    height, width = index.shape
    rows = np.column_stack([np.zeros(height, dtype=np.uint8), index])

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)
    palette = chunk(b"PLTE", colours[:, :3].tobytes()) + chunk(b"tRNS", colours[:, 3].tobytes())
    packed = zlib.compress(rows.tobytes(), 9)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + palette + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


def data_uri(pixels: Pixels) -> str:
    """Return RGBA pixels as an address that holds the picture itself."""
    return "data:image/png;base64," + base64.b64encode(png(pixels)).decode("ascii")
