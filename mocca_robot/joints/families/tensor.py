"""Height fields on a grid of control heights: how they are cut into triangles, and what follows from their heights.

Along each axis of a rectangle stand knots with control heights; the rim is at zero. Between two knots heights follow a
cubic with zero slope at both, so that a surface never overshoots its control heights and joins the flat rim smoothly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.bumps import Rectangles, lean_of
from mocca_robot.joints.families.family import Patch
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.patch import joint_with_patch
from mocca_robot.joints.rectangle import Rectangle, rectangle_parameters


@dataclass(frozen=True)
class KnotAxis:
    """One axis of the grid: where its knots stand, 0 and 1 included, and which control height each knot has.

    Attributes:
        knots: in the unit interval, ascending.
        control: per knot, the number of its control height; −1 stands for zero.
    """

    knots: tuple[float, ...]
    control: tuple[int, ...]

    @classmethod
    def even(cls, count: int) -> KnotAxis:
        """Return `count` control heights, evenly spread."""
        knots = tuple(k / (count + 1) for k in range(count + 2))
        return cls(knots, (-1, *range(count), -1))

    @property
    def count(self) -> int:
        """Return the number of control heights."""
        return max(self.control) + 1

    def sampled(self, pieces: int) -> tuple[Array, Array, IntArray]:
        """Return places (n,), weights of the control heights there (n, C), and the cell (n − 1,) of each step.

        Cells whose two ends have one height are flat along the axis, and one step.
        """
        places, weights, cells = [0.0], [np.zeros(self.count)], []
        for cell in range(len(self.knots) - 1):
            first, second = self.control[cell], self.control[cell + 1]
            steps = 1 if first == second else pieces
            for step in range(1, steps + 1):
                t = step / steps
                rise = t * t * (3.0 - 2.0 * t) if pieces > 1 else t
                weight = np.zeros(self.count)
                if first >= 0:
                    weight[first] += 1.0 - rise
                if second >= 0:
                    weight[second] += rise
                places.append(self.knots[cell] + t * (self.knots[cell + 1] - self.knots[cell]))
                weights.append(weight)
                cells.append(cell)
        return np.array(places), np.array(weights), np.array(cells)


@dataclass(frozen=True)
class Grid:
    """The grid of two axes, with `pieces` straight pieces between knots; control heights row by row along x."""

    x: KnotAxis
    y: KnotAxis
    pieces: int

    @property
    def count(self) -> int:
        """Return the number of control heights."""
        return self.x.count * self.y.count

    @cached_property
    def xy(self) -> Array:
        """Return (K, 2) positions of the vertices in the unit square."""
        x, y = self.x.sampled(self.pieces)[0], self.y.sampled(self.pieces)[0]
        return read_only(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))

    @cached_property
    def basis(self) -> Array:
        """Return (K, C): the heights of the vertices by control height."""
        x, y = self.x.sampled(self.pieces)[1], self.y.sampled(self.pieces)[1]
        return read_only(np.einsum("yb,xa->yxba", y, x).reshape(len(self.xy), -1))

    @cached_property
    def patch(self) -> Patch:
        """Return the tessellation; the steepest step of each cell tells of it, along either axis."""
        return _patch(self)

    def surface(self, rectangle: Rectangle, heights: Sequence[float], u: Array, xy: Array | None = None) -> Array:
        """Return the vertices (K, 3) for control heights in metres along u (3,), unit."""
        at = self.xy if xy is None else xy
        flat = (
            rectangle.origin + at[:, :1] * rectangle.l1 * rectangle.axis_x + at[:, 1:] * rectangle.l2 * rectangle.axis_y
        )
        return np.asarray(flat + (self.basis @ np.asarray(heights))[:, None] * u)

    def steepest_rises(self, heights: Array) -> tuple[Array, Array]:
        """Return (E, cells) the largest change of height along x and along y in each cell, for heights (E, C)."""
        table = heights.reshape(len(heights), self.y.count, self.x.count)
        padded = np.pad(table, ((0, 0), (0, 1), (0, 1)))  # the last row and column, index −1, are the rim
        full = padded[:, list(self.y.control)][:, :, list(self.x.control)]
        along_x, along_y = np.abs(np.diff(full, axis=2)).max(axis=1), np.abs(np.diff(full, axis=1)).max(axis=2)
        return along_x, along_y


@cache
def _patch(grid: Grid) -> Patch:
    x, _, cell_x = grid.x.sampled(grid.pieces)
    y, _, cell_y = grid.y.sampled(grid.pieces)
    columns, rows = len(x), len(y)
    index = np.arange(columns * rows).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, 1:].ravel(), index[1:, :-1].ravel()
    middle_x, middle_y = 0.5 * (x[1:] + x[:-1]) - 0.5, 0.5 * (y[1:] + y[:-1]) - 0.5
    main = (middle_y[:, None] * middle_x[None]).ravel() >= 0
    first = np.where(main[:, None], np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    second = np.where(main[:, None], np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1))
    triangles = np.stack([first, second], axis=1).reshape(-1, 3)
    rim = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    steep_x, steep_y = _steep(grid.x, cell_x, grid.pieces), _steep(grid.y, cell_y, grid.pieces)
    inner_x, inner_y = _inner(steep_x), _inner(steep_y)
    square = (steep_x[None] & inner_y[:, None]) | (inner_x[None] & steep_y[:, None])
    telling = np.flatnonzero(np.repeat(square.ravel(), 2))
    return Patch(triangles=triangles, rim=rim, telling=telling, at=triangles[telling])


def _steep(axis: KnotAxis, cells: IntArray, pieces: int) -> BoolArray:
    """Return (steps,) the middle step of every cell whose height changes."""
    steep: BoolArray = np.zeros(len(cells), dtype=np.bool_)
    for cell in np.unique(cells):
        mine = np.flatnonzero(cells == cell)
        if axis.control[cell] != axis.control[cell + 1]:
            steep[mine[len(mine) // 2]] = True
    return steep


def _inner(steep: BoolArray) -> BoolArray:
    """Return (steps,) all steps between the outermost steep ones."""
    some = np.flatnonzero(steep)
    inner: BoolArray = np.zeros(len(steep), dtype=np.bool_)
    inner[some[0] : some[-1] + 1] = True
    return inner


def grid_joint(
    contact: Contact,
    kind: str,
    rectangle: Rectangle,
    u: Array,
    grid: Grid,
    heights: Sequence[float],
    further: Mapping[str, float] | None = None,
    xy: Array | None = None,
) -> Joint:
    """Return the joint of a grid of control heights (m, along u (3,)) over a rectangle.

    `xy` (K, 2) moves the grid's vertices within the rectangle; `further` are numbers that are stored with the joint.
    Raises ValueError where u leans more than a height field may.
    """
    u = np.asarray(u, dtype=np.float64)
    u = u / np.linalg.norm(u)
    lean_of(Rectangles.of([rectangle]), u[None])
    numbers = rectangle_parameters(rectangle) | height_parameters(heights)
    numbers |= {"flank_segments": float(grid.pieces)} | dict(further or {})
    patch = (grid.surface(rectangle, heights, u, xy), grid.patch.triangles)
    return joint_with_patch(contact, kind, u, patch, grid.patch.rim, numbers)


def height_parameters(heights: Sequence[float]) -> dict[str, float]:
    """Return control heights (m) as numbers of a joint, and the one of the largest size among them as its height."""
    named = {f"height_{k}_m": float(h) for k, h in enumerate(heights)}
    return {"height_m": max(named.values(), key=abs)} | named


def heights_from(parameters: Mapping[str, float]) -> list[float]:
    """Return the control heights (m) among a joint's numbers. Raises KeyError without any."""
    count = sum(name.startswith("height_") and name != "height_m" for name in parameters)
    return [parameters[f"height_{k}_m"] for k in range(max(count, 1))]
