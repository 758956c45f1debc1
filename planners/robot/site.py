"""The design as it will stand in the cell: scaled, upright, in the robot's base frame, as convex pieces to avoid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array, read_only
from mocca_robot.assembly import Assembly, Mesh, Polygon
from mocca_robot.tolerances import COARSE
from planners.robot.cell import RobotCell
from planners.robot.convex_cover import convex_cover

STANDS_M = 2e-3
"""A part whose lowest point is no higher than this above the plinth stands on it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Body:
    """A part where it belongs, in the base frame.

    Attributes:
        pieces: (V, 3) corners of convex pieces that together cover the part.
        centroid: (3,).
        low, high: (3,) corners of its bounding box.
    """

    name: str
    pieces: tuple[Array, ...]
    centroid: Array
    mass_kg: float
    fixed: bool
    low: Array
    high: Array


@dataclass(frozen=True, eq=False)
class Site:
    """The assembly in the cell.

    Attributes:
        assembly: scaled; its own frame.
        turn: (3, d); base-frame direction = turn @ design direction.
        shift: (3,); base-frame point = turn @ point + shift.
        bodies: one per part, in assembly order.
        plinth: (2, 3) corners of what carries the fixed parts above the table; None when they stand on it.
    """

    assembly: Assembly
    turn: Array
    shift: Array
    bodies: tuple[Body, ...]
    plinth: Array | None

    def point(self, design: Array) -> Array:
        """Return points (…, d) of the scaled design in the base frame."""
        return np.asarray(design @ self.turn.T + self.shift)


def site(assembly: Assembly, cell: RobotCell) -> Site:
    """Return `assembly` scaled and placed as `cell` says: flat designs stand upright, their y axis up."""
    bounds = np.array([p.shape.bounds for p in assembly.parts])
    size = float((bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)).max())
    scale = 1.0 if cell.build_size_m is None else cell.build_size_m / size
    scaled = assembly.with_shapes([_scaled(p.shape, scale, cell.thickness_m) for p in assembly.parts])
    turn, shift = _standing(scaled, cell)
    across = np.cross(turn[:, 0], turn[:, 1])
    bodies = []
    for part in scaled.parts:
        shape = part.shape
        pieces = [p @ turn.T + shift for p in convex_cover(shape)]
        if isinstance(shape, Polygon):
            half = across * 0.5 * shape.thickness
            pieces = [np.concatenate([p + half, p - half]) for p in pieces]
        bodies.append(_body(part.name, pieces, turn @ part.centroid + shift, part.mass, part.fixed))
    return Site(scaled, read_only(turn), read_only(shift), tuple(bodies), _plinth(bodies, cell))


def moved(where: Site, cell: RobotCell) -> Site:
    """Return the same structure where `cell` wants it; the size stays."""
    turn, shift = _standing(where.assembly, cell)
    motion = motion_between(where, turn, shift)
    bodies = [
        _body(
            b.name,
            [p @ motion[:3, :3].T + motion[:3, 3] for p in b.pieces],
            motion[:3, :3] @ b.centroid + motion[:3, 3],
            b.mass_kg,
            b.fixed,
        )
        for b in where.bodies
    ]
    return Site(where.assembly, read_only(turn), read_only(shift), tuple(bodies), _plinth(bodies, cell))


def motion_between(where: Site, turn: Array, shift: Array) -> Array:
    """Return the (4, 4) motion that takes the structure to where `turn` and `shift` put it."""
    out = np.eye(4)
    out[:3, :3] = _axes(turn) @ _axes(where.turn).T
    out[:3, 3] = shift - out[:3, :3] @ where.shift
    return out


def _axes(turn: Array) -> Array:
    """Return three axes: those of a flat design and the one across."""
    return turn if turn.shape[1] == 3 else np.column_stack([turn, np.cross(turn[:, 0], turn[:, 1])])


def _standing(scaled: Assembly, cell: RobotCell) -> tuple[Array, Array]:
    """Return turn (3, d) and shift (3,) that put the middle of the structure's foot where the cell wants it."""
    c, s = np.cos(cell.build_yaw_rad), np.sin(cell.build_yaw_rad)
    yaw = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turn = yaw[:, [0, 2]] if scaled.dimension == 2 else yaw
    bounds = np.array([p.shape.bounds for p in scaled.parts])
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    foot = 0.5 * (low + high)
    foot[-1] = low[-1]
    return turn, cell.build_origin_m - turn @ foot


def _body(name: str, pieces: Sequence[Array], centroid: Array, mass_kg: float, fixed: bool) -> Body:
    corners = np.concatenate(pieces)
    return Body(
        name=name,
        pieces=tuple(read_only(p) for p in pieces),
        centroid=read_only(centroid),
        mass_kg=mass_kg,
        fixed=fixed,
        low=read_only(corners.min(axis=0)),
        high=read_only(corners.max(axis=0)),
    )


def _plinth(bodies: Sequence[Body], cell: RobotCell) -> Array | None:
    top, table = float(cell.build_origin_m[2]), float(cell.table_m[1, 2])
    if top <= table + COARSE:
        return None
    standing = [b for b in bodies if b.low[2] < top + STANDS_M] or list(bodies)
    low, high = np.min([b.low for b in standing], axis=0), np.max([b.high for b in standing], axis=0)
    return read_only([[low[0], low[1], table], [high[0], high[1], top]])


def _scaled(shape: Polygon | Mesh, scale: float, thickness_m: float | None) -> Polygon | Mesh:
    if isinstance(shape, Polygon):
        thickness = shape.thickness * scale if thickness_m is None else thickness_m
        return Polygon(shape.exterior * scale, tuple(h * scale for h in shape.holes), thickness)
    return replace(shape, vertices=shape.vertices * scale)
