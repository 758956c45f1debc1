"""A graph of lines and a cross-section → rods that meet in planes at the nodes."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import DEFAULT_DENSITY, Assembly, Mesh, Part
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.generators.parameters import REQUIRED, GeneratorParameters
from mocca_robot.tolerances import EXACT, ROUNDING

ON_PLANE = 1e-8
"""Distance, relative to the size of what is cut, at which a corner counts as on the plane."""

LARGEST = 1e9
"""Coordinates beyond leave no digits for the rods' sections."""

UPRIGHT = 0.95
"""Rods whose direction rises more steeply than this (its z) have no way up; they face their neighbours instead."""

DEFAULTS: dict[str, Any] = {
    "lines": REQUIRED,
    "width": REQUIRED,
    "height": REQUIRED,
    "units": "m",
    "ground": 1e-3,
    "density": DEFAULT_DENSITY,
}


def frame(given: Mapping[str, Any], folder: Path) -> Assembly:
    """Return one rod per line of `lines`, an OBJ file with 'l' elements or a JSON file
    `{"nodes": [[x, y, z], …], "rods": [[a, b], …], "names": […]}`, in file order.

    Rods have a rectangular section, `width` sideways and `height` upwards (m); upright ones turn a face towards their
    neighbours. At a node every rod keeps the points
    that lie further along it than along any other rod there, so that two rods share the plane that bisects them.
    Rods with an end within `ground` × height of the lowest node are fixed and end level with it.
    """
    p = GeneratorParameters("frame", given, DEFAULTS)
    from mocca_robot.files.meshes import METRES_PER

    nodes, rods, names = read_lines(folder / p.text("lines"))
    nodes = nodes * METRES_PER[p.choice("units", tuple(METRES_PER))]
    width, height = p.number("width", 1e-5, 1e3), p.number("height", 1e-5, 1e3)
    density = p.number("density", 0.0, 1e5)
    low = float(nodes[:, 2].min())
    ground = nodes[:, 2] <= low + p.at_least("ground", 0.0, 0.5) * np.ptp(nodes[:, 2]) + EXACT
    at_node: dict[int, list[tuple[int, Array]]] = {}
    for r, (a, b) in enumerate(rods):
        along = nodes[b] - nodes[a]
        length = float(np.linalg.norm(along))
        if length <= max(width, height):
            raise InputError(
                f"Rod '{names[r]}' is {length:.4g} m long, less than its section of {width:g} × {height:g} m; "
                "make the section smaller or merge its nodes."
            )
        at_node.setdefault(a, []).append((r, along / length))
        at_node.setdefault(b, []).append((r, -along / length))
    parts = []
    for r, (a, b) in enumerate(rods):
        reach = float(np.linalg.norm(nodes[b] - nodes[a]))
        beside = [d for node in (a, b) for other, d in at_node[node] if other != r]
        planes = _section(nodes[a], nodes[b], width, height, beside)
        for node in (a, b):
            planes += _end(r, node, nodes, at_node[node], bool(ground[node]), 0.6 * max(width, height))
        try:
            mesh = convex_body(np.array(planes), 0.5 * (nodes[a] + nodes[b]), 2.0 * reach + width + height)
        except ValueError as error:
            raise InputError(
                f"Rod '{names[r]}' is cut away by its neighbours at an end ({error}); rods that meet at a small angle "
                "need a smaller section."
            ) from error
        parts.append(Part(names[r], mesh, density, fixed=bool(ground[a] or ground[b])))
    return Assembly("frame", tuple(parts))


def read_lines(path: Path) -> tuple[Array, list[tuple[int, int]], list[str]]:
    """Return nodes (V, 3), rods as node pairs, and their names, from an OBJ or JSON file."""
    if not path.is_file():
        raise InputError(f"frame.lines: '{path}' does not exist.")
    if path.suffix.lower() == ".obj":
        from mocca_robot.files.obj import read_obj

        groups = read_obj(path)
        nodes = groups[0].vertices
        rods = [(a, b) for g in groups for line in g.lines for a, b in pairwise(line)]
        names = [f"rod_{k + 1:03d}" for k in range(len(rods))]
    else:
        from mocca_robot.files.documents import parse_json, read_text

        data = parse_json(read_text(path), f"'{path}'")
        if not isinstance(data, dict) or not {"nodes", "rods"} <= set(data):
            raise InputError(f'\'{path}\' is no frame; expected {{"nodes": [[x, y, z], …], "rods": [[a, b], …]}}.')
        lists = [data["nodes"], data["rods"], data.get("names", [])]
        if not all(isinstance(v, list) for v in lists):
            raise InputError(f"'{path}': nodes, rods and names are lists; write them in brackets.")
        nodes = np.array([fields.vector(n, f"'{path}': nodes[{k}]", (3,)) for k, n in enumerate(lists[0])])
        rods = [_rod(r, f"'{path}': rods[{k}]") for k, r in enumerate(lists[1])]
        names = [fields.part_name(n, f"'{path}': names[{k}]") for k, n in enumerate(lists[2])]
        names = names or [f"rod_{k + 1:03d}" for k in range(len(rods))]
        if len(set(names)) < len(names):
            raise InputError(f"'{path}': two rods have the same name; names must differ.")
    if np.abs(nodes).max(initial=0.0) > LARGEST:
        raise InputError(f"'{path}': a node lies {np.abs(nodes).max():.3g} from the origin; check the model's scale.")
    if not rods or len(names) != len(rods):
        raise InputError(
            f"'{path}' has {len(rods)} rods and {len(names)} names; give at least one rod, a name for each."
        )
    for name, (a, b) in zip(names, rods):
        if not (0 <= a < len(nodes) and 0 <= b < len(nodes)) or a == b:
            raise InputError(f"'{path}': rod '{name}' joins nodes {a} and {b}; there are {len(nodes)} nodes.")
    if len({frozenset(r) for r in rods}) < len(rods):
        raise InputError(f"'{path}': two rods join the same nodes; remove one.")
    return nodes, rods, names


def _rod(data: object, where: str) -> tuple[int, int]:
    if not isinstance(data, list) or len(data) != 2:
        raise InputError(f"{where} must be two numbers of nodes [a, b], not {fields.shown(data)}.")
    return fields.integer(data[0], where, -1, 10**9), fields.integer(data[1], where, -1, 10**9)


def _section(a: Array, b: Array, width: float, height: float, beside: list[Array]) -> list[Array]:
    """Return the four side planes of a rod as rows [n, −n·x]: inside where n·x ≤ n·x₀; `beside` are its neighbours."""
    along = (b - a) / np.linalg.norm(b - a)
    up = np.array([0.0, 0.0, 1.0])
    if abs(along[2]) > UPRIGHT:
        turn = _facing(beside)
        up = np.array([np.cos(turn), np.sin(turn), 0.0])
    side = np.cross(along, up)
    side /= np.linalg.norm(side)
    high = np.cross(side, along)
    planes = []
    for axis, size in ((side, width), (high, height)):
        for sign in (1.0, -1.0):
            planes.append(np.r_[sign * axis, -(sign * axis @ a) - 0.5 * size])
    return planes


def _facing(beside: list[Array]) -> float:
    """Return the heading (rad) of an upright rod whose faces look at its neighbours best: max Σ |h| cos 4(φ − φ_h)
    over their horizontal parts h, since a section looks the same after a quarter turn; 0 where nobody is beside it."""
    level = np.array([d[0] + 1j * d[1] for d in beside])
    pull = complex((np.abs(level) * np.exp(4j * np.angle(level))).sum()) if len(level) else 0j
    return float(np.angle(pull)) / 4.0 if abs(pull) > ROUNDING else 0.0


def _end(
    rod: int, node: int, nodes: Array, meeting: list[tuple[int, Array]], ground: bool, reach: float
) -> list[Array]:
    """Return the planes that end a rod at a node."""
    at = nodes[node]
    mine = next(d for r, d in meeting if r == rod)
    if ground:
        return [np.array([0.0, 0.0, -1.0, at[2]])]
    if len(meeting) == 1:
        return [np.r_[-mine, mine @ at]]
    planes = [np.r_[-mine, mine @ at - reach]]
    for other, direction in meeting:
        if other != rod:
            # The same numbers with opposite signs for both rods, so that they share the plane exactly.
            n = direction - mine if other > rod else -(mine - direction)
            n = n / np.linalg.norm(n)
            planes.append(np.r_[n, -(n @ at)])
    return planes


def convex_body(planes: Array, inside: Array, reach: float) -> Mesh:
    """Return the closed mesh of {x : n·x + c ≤ 0 for all rows [n, c]} within the cube of half-width `reach` around
    the point `inside`. Raises ValueError when the point is not inside.

    The cube is cut by one plane after the other; corners within 1e-8 of its size of a plane count as on it.
    """
    if (planes[:, :3] @ inside + planes[:, 3]).max() >= 0:
        raise ValueError("its middle lies outside its own section")
    points = [inside + reach * np.array([x, y, z]) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    for row in planes:
        faces = _cut(points, faces, row, ON_PLANE * reach)
    triangles = [[f[0], f[k], f[k + 1]] for f in faces for k in range(1, len(f) - 1)]
    used, local = np.unique(np.array(triangles), return_inverse=True)
    return Mesh(np.array(points)[used], local.reshape(-1, 3))


def _cut(points: list[Array], faces: list[list[int]], plane: Array, tolerance: float) -> list[list[int]]:
    """Return the faces of a convex body cut by a plane, and append the new corners to `points`."""
    rise = {v: float(plane[:3] @ points[v] + plane[3]) for f in faces for v in f}
    if max(rise.values()) <= tolerance:
        return faces
    crossings: dict[tuple[int, int], int] = {}
    kept, rim = [], set()
    for face in faces:
        loop: list[int] = []
        for a, b in zip(face, face[1:] + face[:1]):
            if rise[a] <= tolerance:
                loop.append(a)
                if rise[a] >= -tolerance:
                    rim.add(a)
            if (rise[a] < -tolerance and rise[b] > tolerance) or (rise[a] > tolerance and rise[b] < -tolerance):
                key = (min(a, b), max(a, b))
                if key not in crossings:
                    low, high = (key[0], key[1]) if rise[key[0]] < rise[key[1]] else (key[1], key[0])
                    share = rise[low] / (rise[low] - rise[high])
                    points.append(points[low] + share * (points[high] - points[low]))
                    crossings[key] = len(points) - 1
                loop.append(crossings[key])
                rim.add(crossings[key])
        if len(loop) >= 3 and not set(loop) <= rim:
            kept.append(loop)
    corner = np.array(sorted(rim))
    space = np.array([points[v] for v in corner])
    relative = space - space.mean(axis=0)
    first = relative[0] / np.linalg.norm(relative[0])
    angle = np.arctan2(relative @ np.cross(plane[:3], first), relative @ first)
    return [*kept, corner[np.argsort(angle)].tolist()]
