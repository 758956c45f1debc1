"""The tray: where each part waits, as it will stand or turned so that the tool can take it, in rows or as given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError, nearest
from mocca_robot.plan.pose import rotation_matrix, rotation_vector
from mocca_robot.tolerances import ROUNDING
from planners.robot.cell import RobotCell, TrayPlace
from planners.robot.site import Body, Site
from planners.robot.tool import ParallelGripper


@dataclass(frozen=True, eq=False)
class Tray:
    """Where parts wait: `motions` by part name, (4, 4), from their place in the structure to that in the tray."""

    motions: Mapping[str, Array]


def tray_layout(site: Site, cell: RobotCell, turns: Mapping[str, Array] | None = None) -> Tray:
    """Return the layout that the cell gives, or rows along y, in the order of building, the first parts nearest the
    structure, each part turned by `turns` (3, 3) if it has one there.

    InputError when the tray is too small, naming the first part that has no place; when a given layout lacks a part or
    names an unknown one.
    """
    if cell.tray_places:
        return _given(site, cell)
    turns = turns or {}
    low, high = cell.tray_m
    gap = _gap(site, cell)
    x, y, depth = float(low[0]), float(high[1]), 0.0
    motions = {}
    for body in site.bodies:
        if body.fixed:
            continue
        turn = np.asarray(turns.get(body.name, np.eye(3)))
        bottom, top = _bounds(body, turn)
        size = top - bottom
        if y - size[1] < low[1] and y < high[1]:
            x, y, depth = x + depth + float(gap[0]), float(high[1]), 0.0
        if x + size[0] > high[0] + ROUNDING or y - size[1] < low[1] - ROUNDING:
            raise InputError(
                f"The tray of cell '{cell.name}', {np.round(high - low, 3).tolist()} m, has no room for part "
                f"'{body.name}', {np.round(size[:2], 3).tolist()} m. Make the tray larger, or size_m or gap_m smaller."
            )
        motions[body.name] = _motion(body, turn, np.array([x + 0.5 * size[0], y - 0.5 * size[1]]), cell)
        y -= float(size[1] + gap[1])
        depth = max(depth, float(size[0]))
    return Tray(motions)


def with_layout(cell: RobotCell, site: Site, tray: Tray) -> RobotCell:
    """Return the cell with `tray` as its given layout: what a plan records."""
    places = {}
    for body in site.bodies:
        if body.name in tray.motions:
            turn = tray.motions[body.name][:3, :3]
            bottom, top = _bounds(body, turn)
            middle = 0.5 * (bottom + top) + tray.motions[body.name][:3, 3]
            places[body.name] = TrayPlace(middle[:2], rotation_vector(turn))
    return replace(cell, tray_places=places)


def _given(site: Site, cell: RobotCell) -> Tray:
    motions = {}
    names = [b.name for b in site.bodies if not b.fixed]
    for name in cell.tray_places:
        if name not in names:
            raise InputError(f"The tray of cell '{cell.name}' names '{name}', no free part; {nearest(name, names)}")
    for body in site.bodies:
        if body.fixed:
            continue
        if body.name not in cell.tray_places:
            raise InputError(
                f"The tray of cell '{cell.name}' has no place for part '{body.name}'. Add it to tray.parts, or give no "
                "parts at all to have a layout made."
            )
        place = cell.tray_places[body.name]
        motions[body.name] = _motion(body, rotation_matrix(place.turn_rad), place.at_m, cell)
    return Tray(motions)


def _gap(site: Site, cell: RobotCell) -> Array:
    gap = np.full(2, cell.gap_m)
    if site.assembly.dimension == 2 and isinstance(cell.gripper, ParallelGripper):
        # The hand is widest across a flat part: it must pass between two rows.
        across = np.abs(np.cross(site.turn[:, 0], site.turn[:, 1]))[:2]
        gap = np.maximum(gap, across * (cell.gripper.palm_m[1, 1] + 0.005))
    return gap


def _bounds(body: Body, turn: Array) -> tuple[Array, Array]:
    corners = np.concatenate(body.pieces) @ turn.T
    return corners.min(axis=0), corners.max(axis=0)


def _motion(body: Body, turn: Array, at_m: Array, cell: RobotCell) -> Array:
    """Return the motion that turns a part and puts the middle of its footprint to `at_m`, on its nest."""
    bottom, top = _bounds(body, turn)
    out = np.eye(4)
    out[:3, :3] = turn
    out[:2, 3] = at_m - 0.5 * (bottom + top)[:2]
    out[2, 3] = cell.table_m[1, 2] + cell.nest_m - bottom[2]
    return out
