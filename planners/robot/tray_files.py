"""What the workshop makes of a tray: a drawing at full size for the laser cutter, nests to print for solid parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Mesh
from mocca_robot.fabrication.cut import dxf_text, svg_text
from mocca_robot.fabrication.sheet import CutPart, Sheet
from mocca_robot.files.mesh_write import write_part
from mocca_robot.files.output import write_atomic
from planners.robot.cell import RobotCell
from planners.robot.site import Site
from planners.robot.tray import Tray

FIT_M = 3e-4
"""Holes and nests are larger than their parts by this on every side."""
RIM_M = 0.005
"""How far up a part its nest reaches: fingers come down to it from above."""
WALL_M = 0.003
BOARD = "board"


def write_tray(plan: Path, site: Site, cell: RobotCell, tray: Tray) -> list[Path]:
    """Return the files written beside `plan`: tray.svg and tray.dxf, and nests/PART.stl for solid parts.

    Those of a plan that is not called plan.json begin with its name: several plans lie in one folder.
    """
    sheet, folder = tray_sheet(site, cell, tray), plan.parent
    mine = "" if plan.stem == "plan" else f"{plan.stem}."
    out = [
        write_atomic(folder / f"{mine}tray.svg", svg_text(sheet, True)),
        write_atomic(folder / f"{mine}tray.dxf", dxf_text(sheet, True)),
    ]
    if site.assembly.dimension == 3:
        nests = folder / f"{mine}nests"
        nests.mkdir(parents=True, exist_ok=True)
        for name in tray.motions:
            out.append(write_part(nest(site, cell, tray, name), nests / f"{name}.stl", units="mm"))
    return out


def tray_sheet(site: Site, cell: RobotCell, tray: Tray) -> Sheet:
    """Return the tray from above in millimetres: the board, and each part's outline with its name.

    x of the drawing is −y of the robot's base, its y is x: as somebody sees it who stands behind the robot. The corner
    of the board at the drawing's origin is the base frame's (tray low x, tray high y).
    """
    low, high = cell.tray_m
    size = 1e3 * np.array([high[1] - low[1], high[0] - low[0]])
    board = np.array([[0, 0], [size[0], 0], size, [0, size[1]]])
    parts = [CutPart(BOARD, (board,), np.array([0.5 * size[0], 8.0]), 5.0)]
    for body in site.bodies:
        if body.name not in tray.motions:
            continue
        motion = tray.motions[body.name]
        seen = [shapely.MultiPoint((p @ motion[:3, :3].T + motion[:3, 3])[:, :2]).convex_hull for p in body.pieces]
        outline = shapely.union_all(seen).buffer(FIT_M, join_style="mitre").simplify(0.2 * FIT_M)
        outlines = shapely.get_parts(outline)
        rings = [_seen(np.asarray(g.exterior.coords)[:-1], cell) for g in outlines]
        middle = _seen(np.asarray(outline.representative_point().coords), cell)[0]
        height = float(np.clip(0.25 * np.ptp(rings[0], axis=0).min(), 2.0, 6.0))
        parts.append(CutPart(body.name, tuple(rings), middle, height))
    return Sheet(float(size[0]), float(size[1]), tuple(parts))


def _seen(points: Array, cell: RobotCell) -> Array:
    low, high = cell.tray_m
    return np.stack([1e3 * (high[1] - points[:, 1]), 1e3 * (points[:, 0] - low[0])], axis=1)


def nest(site: Site, cell: RobotCell, tray: Tray, name: str) -> Mesh:
    """Return the block that holds one part in the tray as planned, base frame, standing on the table: solid below the
    part, its pocket the part's lowest stretch swept straight up, so that the part lifts out.
    """
    import manifold3d

    motion = tray.motions[name]
    pieces = next(b.pieces for b in site.bodies if b.name == name)
    corners = np.concatenate([p @ motion[:3, :3].T + motion[:3, 3] for p in pieces])
    low, high = corners.min(axis=0), corners.max(axis=0)
    table = float(cell.table_m[1, 2])
    top = float(low[2]) + min(RIM_M, 0.3 * float(high[2] - low[2]))
    base = np.array([low[0] - WALL_M - FIT_M, low[1] - WALL_M - FIT_M, table])
    size = np.array([high[0] + WALL_M + FIT_M, high[1] + WALL_M + FIT_M, top]) - base
    block = manifold3d.Manifold.cube(size.tolist()).translate(base.tolist())
    up = np.array([0.0, 0.0, float(high[2]) - table + 0.1])
    for piece in pieces:
        placed = piece @ motion[:3, :3].T + motion[:3, 3]
        around = (placed[None] + FIT_M * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])[:, None]).reshape(
            -1, 3
        )
        block -= manifold3d.Manifold.hull_points(np.concatenate([around, around + up]))
    out = block.to_mesh64()
    return Mesh(np.asarray(out.vert_properties, dtype=np.float64)[:, :3], np.asarray(out.tri_verts, dtype=np.int64))
