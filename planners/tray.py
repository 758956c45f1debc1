"""The tray: where each part waits, upright and turned as it will stand, and a drawing of it at full size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mocca_robot.assembly import Array
from mocca_robot.errors import InputError
from planners.cell import RobotCell
from planners.site import Site


@dataclass(frozen=True, eq=False)
class Tray:
    """Where parts wait: `offsets` by part name, (3,) metres, from their place in the structure to that in the tray."""

    offsets: Mapping[str, Array]


def tray_layout(site: Site, cell: RobotCell) -> Tray:
    """Return a layout in rows along y, in the order of building, the first parts nearest the structure.

    InputError when the tray is too small, naming the first part that has no place.
    """
    low, high = cell.tray_m
    gap = np.full(2, cell.gap_m)
    if site.assembly.dimension == 2:
        # The hand is widest across a flat part: it must pass between two rows.
        across = np.abs(np.cross(site.turn[:, 0], site.turn[:, 1]))[:2]
        gap = np.maximum(gap, across * (cell.gripper.palm_m[1, 1] + 0.005))
    x, y, depth = float(low[0]), float(high[1]), 0.0
    offsets = {}
    for body in site.bodies:
        if body.fixed:
            continue
        size = body.high - body.low
        if y - size[1] < low[1] and y < high[1]:
            x, y, depth = x + depth + float(gap[0]), float(high[1]), 0.0
        if x + size[0] > high[0] or y - size[1] < low[1]:
            raise InputError(
                f"The tray of cell '{cell.name}', {np.round(high - low, 3).tolist()} m, has no room for part "
                f"'{body.name}', {np.round(size[:2], 3).tolist()} m. Make the tray larger, or size_m or gap_m smaller."
            )
        corner = np.array([x, y - size[1], cell.table_m[1, 2] + cell.nest_m])
        offsets[body.name] = corner - body.low
        y -= float(size[1] + gap[1])
        depth = max(depth, float(size[0]))
    return Tray(offsets)


def tray_svg(site: Site, cell: RobotCell, tray: Tray) -> str:
    """Return the tray from above as an SVG drawing at full size (mm): the board, and each part's outline with its name.

    x of the drawing is −y of the robot's base, its y is −x: as somebody sees it who stands behind the robot.
    """
    from xml.sax.saxutils import escape

    import shapely

    low, high = cell.tray_m
    width, height = 1e3 * (high[1] - low[1]), 1e3 * (high[0] - low[0])
    board = f"base frame x {low[0]:g} to {high[0]:g} m, y {low[1]:g} to {high[1]:g} m"
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.2f}mm" height="{height:.2f}mm" '
        f'viewBox="0 0 {width:.2f} {height:.2f}">',
        f"<title>Tray of {escape(cell.name)} for {escape(site.assembly.name)}: {board}</title>",
        f'<rect x="0" y="0" width="{width:.2f}" height="{height:.2f}" fill="none" stroke="red" stroke-width="0.1"/>',
    ]
    for body in site.bodies:
        if body.name not in tray.offsets:
            continue
        shifted = [p[:, :2] + tray.offsets[body.name][:2] for p in body.pieces]
        outline = shapely.union_all([shapely.MultiPoint(p).convex_hull for p in shifted]).convex_hull
        ring = np.asarray(outline.exterior.coords)[:-1]
        drawn = np.stack([1e3 * (high[1] - ring[:, 1]), 1e3 * (high[0] - ring[:, 0])], axis=1)
        points = " ".join(f"{a:.3f},{b:.3f}" for a, b in drawn)
        middle = drawn.mean(axis=0)
        lines.append(f'<polygon points="{points}" fill="none" stroke="black" stroke-width="0.1"/>')
        lines.append(
            f'<text x="{middle[0]:.2f}" y="{middle[1]:.2f}" font-size="6" text-anchor="middle" '
            f'dominant-baseline="middle" fill="blue">{escape(body.name)}</text>'
        )
    return "\n".join([*lines, "</svg>"]) + "\n"
