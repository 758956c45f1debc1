"""Stacks, walls and arches by parameters."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import DEFAULT_DENSITY, Assembly, Mesh, Part
from mocca_robot.errors import InputError
from mocca_robot.generators.parameters import GeneratorParameters

STACK: dict[str, Any] = {
    "count": 5,
    "size": [0.1, 0.1, 0.1],
    "shift": 0.0,
    "tilt_deg": 0.0,
    "density": DEFAULT_DENSITY,
}
WALL: dict[str, Any] = {
    "courses": 6,
    "columns": 5,
    "size": [0.2, 0.1, 0.1],
    "tilt_deg": 0.0,
    "density": DEFAULT_DENSITY,
}
ARCH: dict[str, Any] = {
    "voussoirs": 15,
    "radius": 1.0,
    "thickness": 0.15,
    "width": 0.3,
    "span_deg": 180.0,
    "density": DEFAULT_DENSITY,
}

BOX_FACES = np.array(
    [
        *([0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]),
        *([2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]),
    ]
)
"""Triangles over the corners of a hexahedron, numbered x fastest, then y, then z."""


def stack(given: Mapping[str, Any], _folder: Path) -> Assembly:
    """Return `count` equal blocks of `size` [x, y, z] (m), each shifted in x by `shift` of its length against the
    one below, the whole tilted about y by `tilt_deg`. The lowest block is fixed.
    """
    p = GeneratorParameters("stack", given, STACK)
    x, y, z = _size(p)
    step = p.at_least("shift", -1.0, 1.0) * x
    turn = _tilt(p)
    parts = []
    for k in range(p.count("count", 2)):
        mesh = hexahedron(_grid([k * step, k * step + x], [0.0, y], [k * z, (k + 1) * z]) @ turn.T)
        parts.append(Part(f"block_{k + 1:02d}", mesh, p.number("density", 0.0, 1e5), fixed=k == 0))
    return Assembly("stack", tuple(parts))


def wall(given: Mapping[str, Any], _folder: Path) -> Assembly:
    """Return a wall in running bond: `courses` × `columns` bricks of `size` [x, y, z] (m), half bricks at the ends
    of every second course, the whole tilted about x by `tilt_deg`. The lowest course is fixed.
    """
    p = GeneratorParameters("wall", given, WALL)
    x, y, z = _size(p)
    columns = p.count("columns", 1, 500)
    turn = _tilt(p, about_x=True)
    courses = p.count("courses", 2, 500)
    p.require_few(courses * (columns + 1))
    parts = []
    for course in range(courses):
        even = course % 2 == 0
        # Multiples of half a brick, so that joints of different courses agree to the last digit.
        halves = list(range(0, 2 * columns + 1, 2)) if even else [0, *range(1, 2 * columns, 2), 2 * columns]
        for k, (a, b) in enumerate(pairwise(halves)):
            mesh = hexahedron(_grid([a * 0.5 * x, b * 0.5 * x], [0.0, y], [course * z, (course + 1) * z]) @ turn.T)
            name = f"brick_{course + 1:02d}_{k + 1:02d}"
            parts.append(Part(name, mesh, p.number("density", 0.0, 1e5), fixed=course == 0))
    return Assembly("wall", tuple(parts))


def arch(given: Mapping[str, Any], _folder: Path) -> Assembly:
    """Return a circular arch in the x–z plane: `voussoirs` equal blocks between radial planes, over `span_deg`
    about the top. `radius` is that of the centre line, `thickness` radial, `width` along y (m). The springers, the
    first and the last voussoir, are fixed; the others come from both sides, the keystone last.
    """
    p = GeneratorParameters("arch", given, ARCH)
    count = p.count("voussoirs", 3, 1000)
    radius, thickness = p.number("radius", 1e-4, 1e3), p.number("thickness", 1e-5, 1e3)
    width, span = p.number("width", 1e-5, 1e3), np.deg2rad(p.number("span_deg", 1.0, 350.0))
    if thickness >= 2 * radius:
        raise InputError(f"arch.thickness is {thickness:g} m; it must be less than twice the radius, {2 * radius:g} m.")
    angle = np.pi / 2 + span * (0.5 - np.arange(count + 1) / count)
    ray = np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    inner, outer = (radius - thickness / 2) * ray, (radius + thickness / 2) * ray
    depth = np.array([0.0, width, 0.0])
    parts = []
    order = [k for pair in zip(range(count), range(count - 1, -1, -1), strict=True) for k in pair][:count]
    for k in order:
        low, high = inner[k : k + 2], outer[k : k + 2]
        corners = np.stack(
            [low[0], low[1], low[0] + depth, low[1] + depth, high[0], high[1], high[0] + depth, high[1] + depth]
        )
        fixed = k in (0, count - 1)
        parts.append(Part(f"voussoir_{k + 1:02d}", hexahedron(corners), p.number("density", 0.0, 1e5), fixed=fixed))
    return Assembly("arch", tuple(parts))


def hexahedron(corners: Array) -> Mesh:
    """Return the closed, outward mesh over eight corners (8, 3), numbered x fastest, then y, then z."""
    mesh = Mesh(corners, BOX_FACES)
    return mesh if mesh.volume > 0 else Mesh(corners, BOX_FACES[:, ::-1])


def _grid(x: list[float], y: list[float], z: list[float]) -> Array:
    return np.array([[a, b, c] for c in z for b in y for a in x])


def _size(p: GeneratorParameters) -> list[float]:
    size = p.vector("size", 3)
    if min(size) <= 0:
        raise InputError(f"{p.kind}.size is {size}; all three lengths must be greater than zero.")
    return size


def _tilt(p: GeneratorParameters, about_x: bool = False) -> Array:
    angle = np.deg2rad(p.at_least("tilt_deg", -80.0, 80.0))
    c, s = np.cos(angle), np.sin(angle)
    turn = [[1, 0, 0], [0, c, -s], [0, s, c]] if about_x else [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    return np.array(turn, dtype=np.float64)
