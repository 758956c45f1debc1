"""Writes the solid models of this folder as OBJ: `python configs/models/solids.py [FOLDER]`. Metres, z up."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import manifold3d
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from mocca_robot.generators.dome import ring_surface, running_bond
from mocca_robot.generators.surface import Surface

Array = NDArray[np.float64]
Solid = tuple[Array, NDArray[np.int64]]
"""Vertices and triangles, closed and outward."""
Outline = Sequence[tuple[float, float]]
DIGITS = 9
"""Coordinates are rounded to nanometres, so that neighbours agree to the last digit."""


def main(folder: Path) -> None:
    """Write every model into `folder`."""
    for name, parts in (("sphere", sphere()), ("horse", horse())):
        write_obj(folder / f"{name}.obj", parts)
    (folder / "pavilion.json").write_text(json.dumps(pavilion(), indent=1) + "\n")
    write_surface(folder / "lilium_tower.obj", *lilium_tower())


def write_obj(path: Path, parts: dict[str, Solid]) -> None:
    """Write one object per part."""
    lines = [f"# {path.stem}: {len(parts)} parts, metres, z up"]
    first = 1
    for name, (vertices, triangles) in parts.items():
        lines.append(f"o {name}")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in (np.round(vertices, DIGITS) + 0.0).tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (triangles + first).tolist()]
        first += len(vertices)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


# --- sphere ----------------------------------------------------------------------------------------------------


def sphere(radius: float = 0.05, steps: int = 12) -> dict[str, Solid]:
    """Return a ball in six pieces, one per side of a cube: each meets its four neighbours in planes through the
    middle. Bottom first, the key on top last.
    """
    frames = {
        "bottom": ((0, 1, 0), (1, 0, 0)),
        "east": ((0, 1, 0), (0, 0, 1)),
        "north": ((0, 0, 1), (1, 0, 0)),
        "west": ((0, 0, 1), (0, 1, 0)),
        "south": ((1, 0, 0), (0, 0, 1)),
        "key": ((1, 0, 0), (0, 1, 0)),
    }
    return {name: _cap(np.array(u, float), np.array(v, float), radius, steps) for name, (u, v) in frames.items()}


def _cap(u: Array, v: Array, radius: float, steps: int) -> Solid:
    """Return the piece about u × v: a patch of the ball and the fans from its rim to the middle."""
    # Equal angles rather than equal lengths keep the patch's quadrangles alike.
    t = np.tan(np.linspace(-np.pi / 4, np.pi / 4, steps + 1))
    t[0], t[-1] = -1.0, 1.0
    grid = np.cross(u, v) + t[:, None, None] * u + t[None, :, None] * v
    points = (radius * grid / np.linalg.norm(grid, axis=2)[..., None]).reshape(-1, 3)
    n = steps + 1
    at = np.arange(n * n).reshape(n, n)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    rim = np.concatenate([at[:-1, 0], at[-1, :-1], at[:0:-1, -1], at[0, :0:-1]])
    fan = np.stack([np.full(len(rim), n * n), np.roll(rim, -1), rim], axis=1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], fan])
    return np.concatenate([points, np.zeros((1, 3))]), triangles


# --- pavilion --------------------------------------------------------------------------------------------------


def pavilion(sides: int = 7, radius: float = 1.5, eave: float = 1.8, splay_deg: float = 24.0) -> dict[str, object]:
    """Return nodes and rods of a garden pavilion: splayed posts, an eave and rafters that meet at the top.

    The pitch is such that the four rods at an eave corner meet in one line: posts and rafters touch the eave's
    rods, but neither each other nor one eave rod the next. The eave's front side is one piece.
    """
    splay = np.deg2rad(splay_deg)
    pitch = brentq(lambda q: np.cos(q + splay) / (np.cos(splay) + np.sin(q)) - np.sin(np.pi / sides), 0.0, 1.4)
    top = np.array([0.0, 0.0, eave + radius * np.tan(pitch)])
    nodes: list[Array] = [top]
    rods: list[tuple[int, int]] = []
    names: list[str] = []

    def chain(name: str, ends: tuple[int, int], cuts: Sequence[float], labels: Sequence[str]) -> None:
        start, end = nodes[ends[0]], nodes[ends[1]]
        row = [ends[0]]
        for cut in cuts:
            nodes.append(start + cut * (end - start))
            row.append(len(nodes) - 1)
        row.append(ends[1])
        rods.extend(pairwise(row))
        names.extend(f"{label}_{name}" for label in labels)

    turns = -np.pi / 2 + (np.arange(sides) + 0.5) * 2 * np.pi / sides
    corners, feet = [], []
    for t in turns:
        out = np.array([np.cos(t), np.sin(t), 0.0])
        feet.append(len(nodes))
        nodes.append((radius + eave * np.tan(splay)) * out)
        corners.append(len(nodes))
        nodes.append(radius * out + np.array([0.0, 0.0, eave]))
    for k in range(sides):
        chain(str(k + 1), (feet[k], corners[k]), (0.15, 0.57), ("foot", "shin", "post"))
    for k in range(sides):
        front = k == sides - 1
        chain(
            str(k + 1),
            (corners[k], corners[(k + 1) % sides]),
            () if front else (0.5,),
            ("lintel",) if front else ("eave_a", "eave_b"),
        )
    for k in range(sides):
        chain(str(k + 1), (corners[k], 0), (0.5,), ("rafter", "spar"))
    order = sorted(range(len(names)), key=lambda r: ORDER.index(names[r].rsplit("_", 1)[0]))
    return {
        "nodes": [np.round(n, DIGITS).tolist() for n in nodes],
        "rods": [list(rods[r]) for r in order],
        "names": [names[r] for r in order],
    }


ORDER = ("foot", "shin", "post", "eave_a", "eave_b", "lintel", "rafter", "spar")

# --- lilium tower ----------------------------------------------------------------------------------------------

LILIUM_PROFILE = (
    (1.2, 0.0), (1.12, 0.36), (1.03, 0.72), (0.95, 1.08), (0.87, 1.42), (0.79, 1.76), (0.72, 2.06), (0.73, 2.3),
    (0.58, 2.42), (0.41, 2.38), (0.25, 2.3),
)  # fmt: skip
"""Radius and height of the beds, metres: a tapering wall, a lip, and the inverted bump inside it."""
LILIUM_LEAN_DEG = (0, 4, 8, 10, 12, 14, 20, 30, 44, 50, 54)
"""How far the beds rise outwards: square to the wall, whose inward thrust then answers the bump's outward one; in the
bump they lean out more, so that blocks go in from above."""
LILIUM_BLOCKS = [18, 18, 17, 17, 14, 14, 13, 12, 9, 6]
LILIUM_LOBES = 3


def lilium_tower(lobe: float = 0.05, snap: float = 0.3, shift: float = 0.5) -> tuple[Surface, list[str], Array]:
    """Return the surface, block names and directions of a three-lobed tower with an inverted bump on top."""
    profile = np.array(LILIUM_PROFILE)
    rings = running_bond(LILIUM_BLOCKS, profile, shift=shift, snap=snap, lean=np.deg2rad(18.0))
    surface, names = ring_surface(rings, profile, cap=True)
    points = surface.points
    turn = np.arctan2(points[:, 1], points[:, 0])
    height = points[:, 2]
    inside = np.hypot(points[:, 0], points[:, 1]) < 0.6
    swell = np.where(inside, 1.0, np.sin(np.pi * np.clip(height / 2.42, 0.0, 1.0)))
    stretch = 1.0 + lobe * np.where(inside, 0.0, swell) * np.cos(LILIUM_LOBES * turn)
    points = np.column_stack([points[:, 0] * stretch, points[:, 1] * stretch, height])
    bed = np.abs(height[:, None] - profile[None, :, 1]).argmin(axis=1)
    lean = np.deg2rad(np.array(LILIUM_LEAN_DEG, float))[bed]
    directions = np.column_stack([np.cos(lean) * np.cos(turn), np.cos(lean) * np.sin(turn), np.sin(lean)])
    return Surface(points, surface.faces), [name for name, _ in names], directions


def write_surface(path: Path, surface: Surface, names: list[str], directions: Array) -> None:
    """Write polygons, one object each, with the directions in which they are to be thickened as vertex normals."""
    lines = [f"# {path.stem}: a surface of {len(names)} polygons, metres, z up; normals say where the outside is"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in (np.round(surface.points, DIGITS) + 0.0).tolist()]
    lines += [f"vn {x!r} {y!r} {z!r}" for x, y, z in (np.round(directions, DIGITS) + 0.0).tolist()]
    for name, face in zip(names, surface.faces):
        lines += [f"o {name}", "f " + " ".join(f"{v + 1}//{v + 1}" for v in face)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


# --- horse -----------------------------------------------------------------------------------------------------

RUMP: Outline = (
    (-0.118, 0.11), (-0.062, 0.11), (0.008, 0.12), (-0.008, 0.181), (-0.052, 0.186), (-0.105, 0.195),
    (-0.142, 0.184), (-0.166, 0.152), (-0.172, 0.085), (-0.156, 0.08), (-0.15, 0.135), (-0.138, 0.13),
)  # fmt: skip
CHEST: Outline = (
    (0.008, 0.12), (0.06, 0.11), (0.112, 0.11), (0.138, 0.124), (0.146, 0.146), (0.056, 0.204), (0.042, 0.188),
    (-0.008, 0.181),
)  # fmt: skip
SADDLE: Outline = (
    (-0.052, 0.186), (-0.008, 0.181), (0.042, 0.188), (0.045, 0.206), (0.03, 0.203), (0.0, 0.191), (-0.035, 0.198),
    (-0.06, 0.214),
)  # fmt: skip
NECK: Outline = (
    (0.146, 0.146), (0.152, 0.18), (0.174, 0.21), (0.094, 0.27), (0.062, 0.244), (0.056, 0.204),
)  # fmt: skip
HEAD: Outline = (
    (0.174, 0.21), (0.184, 0.203), (0.202, 0.184), (0.218, 0.188), (0.22, 0.207), (0.182, 0.246), (0.15, 0.276),
    (0.137, 0.303), (0.122, 0.286), (0.094, 0.27),
)  # fmt: skip
HIND_LEG: Outline = (
    (-0.11, 0.02), (-0.082, 0.02), (-0.086, 0.062), (-0.066, 0.11), (-0.116, 0.11), (-0.11, 0.062),
)  # fmt: skip
HIND_HOOF: Outline = ((-0.116, 0.0), (-0.074, 0.0), (-0.082, 0.02), (-0.11, 0.02))
FORE_LEG: Outline = ((0.07, 0.02), (0.096, 0.02), (0.094, 0.065), (0.11, 0.11), (0.064, 0.11), (0.07, 0.065))
FORE_HOOF: Outline = ((0.064, 0.0), (0.104, 0.0), (0.096, 0.02), (0.07, 0.02))

BODY_FRONT = ((0.038, 0.11), (0.05, 0.15), (0.028, 0.2))
NECK_FRONT = ((0.036, 0.15), (0.024, 0.25), (0.02, 0.28))


def horse() -> dict[str, Solid]:
    """Return a horse in 13 parts; head and neck slide off their slanted seats while the contacts are planar."""
    parts: dict[str, Solid] = {}
    for side, y in (("left", (0.008, 0.036)), ("right", (-0.036, -0.008))):
        for end, hoof, leg in (("hind", HIND_HOOF, HIND_LEG), ("fore", FORE_HOOF, FORE_LEG)):
            parts[f"{end}_hoof_{side}"] = _mesh(_extruded(hoof, *y))
            parts[f"{end}_leg_{side}"] = _mesh(_extruded(leg, *y))
    for name, outline, front in (
        ("rump", RUMP, BODY_FRONT),
        ("chest", CHEST, BODY_FRONT),
        ("saddle", SADDLE, ((0.034, 0.18), (0.03, 0.2))),
        ("neck", NECK, NECK_FRONT),
        ("head", HEAD, ((0.03, 0.19), (0.022, 0.262), (0.009, 0.31))),
    ):
        parts[name] = _mesh(_narrowed(_extruded(outline, -0.06, 0.06), front))
    return parts


def _extruded(outline: Outline, y0: float, y1: float) -> manifold3d.Manifold:
    """Return the solid between y0 and y1 with this outline seen from the side (x to the right, z up)."""
    flat = manifold3d.CrossSection([[(x, z) for x, z in outline]])
    upright = np.array([[1.0, 0, 0, 0], [0, 0, -1, y1], [0, 1, 0, 0]])
    return manifold3d.Manifold.extrude(flat, y1 - y0).transform(upright)


def _narrowed(solid: manifold3d.Manifold, front: Sequence[tuple[float, float]]) -> manifold3d.Manifold:
    """Return `solid` cut to a convex shape seen from the front: half widths at heights, extended at both ends."""
    for (w0, z0), (w1, z1) in pairwise(front):
        normal = np.array([0.0, z0 - z1, w1 - w0])
        normal /= np.linalg.norm(normal)
        offset = float(normal @ [0.0, w0, z0])
        for mirror in (1.0, -1.0):
            solid = solid.trim_by_plane((0.0, float(mirror * normal[1]), float(normal[2])), offset)
    return solid


def _mesh(solid: manifold3d.Manifold) -> Solid:
    mesh = solid.simplify(1e-6).to_mesh64()
    vertices = np.round(np.asarray(mesh.vert_properties)[:, :3], DIGITS) + 0.0
    return vertices, np.asarray(mesh.tri_verts, dtype=np.int64)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
