"""Contact polygon → the large rectangle inside it on which a joint is built (Fig. 9a)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from mocca_robot.arrays import Array, read_only
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.frames import tangents
from mocca_robot.tolerances import COARSE, EXACT, ROUNDING, TINY

SAME_TURN_RAD = 1e-4
"""Orientations that differ by less are tried once."""
AREA = 1e-5
"""Share of the largest area that orientations may lack and still count as equally good."""

TURNS = 8
"""Orientations tried between 0° and 90° besides those of the polygon's own edges."""
NEWTON_STEPS = 3
"""Newton steps for each tenfold drop of the barrier's weight; four times as many change the area by less than 1e-6."""
RASTER = 32
"""Grid lines per side on which a rectangle inside a non-convex contact is searched before it is grown exactly."""


@dataclass(frozen=True, eq=False)
class Rectangle:
    """A rectangle in a contact's plane.

    Attributes:
        origin: (3,) one corner, metres.
        axis_x, axis_y: (3,) unit axes; axis_x × axis_y is the contact normal.
        l1, l2: lengths along the axes, metres, l1 ≥ l2.
    """

    origin: Array
    axis_x: Array
    axis_y: Array
    l1: float
    l2: float

    @property
    def area(self) -> float:
        """Return the area, m²."""
        return self.l1 * self.l2

    @property
    def normal(self) -> Array:
        """Return (3,) axis_x × axis_y."""
        return np.cross(self.axis_x, self.axis_y)

    @cached_property
    def corners(self) -> Array:
        """Return (4, 3) corners, counter-clockwise seen against the normal, from the origin."""
        x, y = self.l1 * self.axis_x, self.l2 * self.axis_y
        return read_only([self.origin, self.origin + x, self.origin + x + y, self.origin + y])

    def part(self, low: tuple[float, float], high: tuple[float, float]) -> Rectangle:
        """Return the sub-rectangle between two corners given as fractions of l1 and l2."""
        origin = self.origin + low[0] * self.l1 * self.axis_x + low[1] * self.l2 * self.axis_y
        l1, l2 = (high[0] - low[0]) * self.l1, (high[1] - low[1]) * self.l2
        return Rectangle(read_only(origin), self.axis_x, self.axis_y, l1, l2)


def rectangle_parameters(rectangle: Rectangle) -> dict[str, float]:
    """Return a rectangle as named numbers, for a joint's parameters."""
    values = {"l1_m": rectangle.l1, "l2_m": rectangle.l2}
    for name, vector in (("origin", rectangle.origin), ("axis_x", rectangle.axis_x), ("axis_y", rectangle.axis_y)):
        values |= {f"{name}_{k}": float(value) for k, value in zip("xyz", vector)}
    return values


def largest_rectangle(contact: Contact, margin: float = 0.0) -> Rectangle | None:
    """Return a rectangle of nearly the largest area inside `contact`, at least `margin` (m) from its boundary.

    Any orientation is allowed. For a convex contact each orientation tried is a small concave program, solved
    to 1e-5 of the area; with holes or notches the rectangle comes from a raster and is then grown until it
    touches. None when nothing fits. Deterministic; about 3 ms for a convex contact.
    """
    axes = -tangents(contact.normal)  # half a turn on: it decides which way a rectangle's x axis points
    origin = contact.polygon[0]
    rings = [(ring - origin) @ axes.T for ring in (contact.polygon, *contact.holes)]
    found = _in_convex(rings[0], margin) if len(rings) == 1 and _is_convex(rings[0]) else None
    if found is None and (len(rings) > 1 or not _is_convex(rings[0])):
        found = _in_polygon(shapely.Polygon(rings[0], rings[1:]), margin)
    if found is None:
        return None
    turn, centre, half = found
    x = np.array([np.cos(turn), np.sin(turn)])
    if half[1] > half[0] * (1 + COARSE):
        x, half = np.array([-x[1], x[0]]), half[::-1]
    y = np.array([-x[1], x[0]])
    corner = centre - half[0] * x - half[1] * y
    return Rectangle(
        read_only(origin + corner @ axes),
        read_only(x @ axes),
        read_only(y @ axes),
        2 * float(half[0]),
        2 * float(half[1]),
    )


def _is_convex(ring: Array) -> bool:
    edges = np.roll(ring, -1, axis=0) - ring
    edges = edges[np.linalg.norm(edges, axis=1) > EXACT * np.ptp(ring, axis=0).max()]
    following = np.roll(edges, -1, axis=0)
    turn = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    turn /= np.linalg.norm(edges, axis=1) * np.linalg.norm(following, axis=1)
    return bool((turn > -ROUNDING).all() or (turn < ROUNDING).all())


def _turns(ring: Array, extra: int) -> Array:
    """Return orientations in [0, π/2) to try: those of the edges, longest first, then `extra` even ones."""
    edges = np.roll(ring, -1, axis=0) - ring
    order = np.argsort(-np.linalg.norm(edges, axis=1), kind="stable")[:8]
    own = np.arctan2(edges[order, 1], edges[order, 0]) % (np.pi / 2)
    even = np.arange(extra) * np.pi / 2 / max(extra, 1)
    kept: list[float] = []
    for turn in (*own, *even):
        if all(min(abs(turn - k), np.pi / 2 - abs(turn - k)) > SAME_TURN_RAD for k in kept):
            kept.append(float(turn))
    return np.array(kept)


def _in_convex(ring: Array, margin: float) -> tuple[float, Array, Array] | None:
    """Return (orientation, centre, half sizes), or None when nothing fits.

    For a fixed orientation the rectangle with centre c and half sizes s is inside {a·p ≤ b} exactly when
    a·c + |a|·s ≤ b, and log s1 + log s2 is concave: a barrier method, all orientations side by side.
    """
    edges = np.roll(ring, -1, axis=0) - ring
    length = np.linalg.norm(edges, axis=1)
    edges, starts = edges[length > 0], ring[length > 0]
    outward = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / length[length > 0, None]
    if ((ring.mean(axis=0) - starts) * outward).sum() > 0:
        outward = -outward
    limit = (outward * starts).sum(axis=1) - margin
    start = ring.mean(axis=0)
    slack = float((limit - outward @ start).min())
    inside = (start, slack) if slack > 0.1 * float(np.sqrt(np.ptp(ring, axis=0).prod())) else _chebyshev(outward, limit)
    if inside is None:
        return None
    middle, radius = inside
    turns = _turns(ring, TURNS)
    c, s = np.cos(turns), np.sin(turns)
    a = np.stack([outward @ np.stack([c, s]), outward @ np.stack([-s, c])], axis=-1).transpose(1, 0, 2)
    rows = np.concatenate([a, np.abs(a)], axis=-1)  # (T, m, 4)
    centre = np.stack([c * middle[0] + s * middle[1], -s * middle[0] + c * middle[1]], axis=-1)
    z = np.concatenate([centre, np.full((len(turns), 2), 0.5 * radius)], axis=-1)
    for weight in 0.1 ** np.arange(0, 7):
        for _ in range(NEWTON_STEPS):
            z = _barrier_step(z, rows, limit, weight)
    sizes = z[:, 2:]
    area = sizes.prod(axis=1)
    best = int(np.flatnonzero(area >= area.max() * (1 - AREA))[0])
    p = z[best, :2]
    world = np.array([c[best] * p[0] - s[best] * p[1], s[best] * p[0] + c[best] * p[1]])
    return float(turns[best]), world, sizes[best]


def _chebyshev(outward: Array, limit: Array) -> tuple[Array, float] | None:
    from scipy.optimize import linprog

    rows = np.c_[outward, np.ones(len(limit))]
    result = linprog([0, 0, -1.0], A_ub=rows, b_ub=limit, bounds=[(None, None)] * 2 + [(0, None)], method="highs")
    solution = np.asarray(result.x if result.success else np.zeros(3))
    if solution[2] <= ROUNDING * max(float(np.abs(limit).max()), TINY):
        return None
    return solution[:2], float(solution[2])


def _barrier_step(z: Array, rows: Array, limit: Array, weight: float) -> Array:
    """Return `z` (T, 4) after one damped Newton step on −log s1 − log s2 − weight · Σ log slack."""
    slack = limit - np.einsum("tmk,tk->tm", rows, z)
    scaled = rows / slack[..., None]
    gradient = weight * scaled.sum(axis=1)
    gradient[:, 2:] -= 1.0 / z[:, 2:]
    hessian = weight * np.einsum("tmk,tml->tkl", scaled, scaled)
    hessian[:, [2, 3], [2, 3]] += 1.0 / z[:, 2:] ** 2
    step = -np.linalg.solve(hessian, gradient[..., None])[..., 0]
    towards = np.concatenate([np.einsum("tmk,tk->tm", scaled, step), -step[:, 2:] / z[:, 2:]], axis=1)
    longest = 0.9 / np.maximum(towards.max(axis=1), 0.9)
    decrement = np.sqrt(np.maximum(-(gradient * step).sum(axis=1), 0.0) / weight)
    damped = np.where(decrement > 0.5, 1.0 / (1.0 + decrement), 1.0) if weight >= 1 else np.ones(len(z))
    return np.asarray(z + np.minimum(longest, damped)[:, None] * step)


def _in_polygon(polygon: shapely.Polygon, margin: float) -> tuple[float, Array, Array] | None:
    inset = polygon.buffer(-margin, join_style="mitre") if margin > 0 else polygon
    best: tuple[float, Array, Array] | None = None
    for piece in shapely.get_parts(inset):
        if piece.is_empty or piece.geom_type != "Polygon":
            continue
        for turn in _turns(np.asarray(piece.exterior.coords)[:-1], 2):
            found = _on_raster(piece, turn)
            if found is not None and (best is None or found[2].prod() > best[2].prod() * (1 + COARSE)):
                best = found
    return best


def _on_raster(polygon: shapely.Polygon, turn: float) -> tuple[float, Array, Array] | None:
    c, s = np.cos(turn), np.sin(turn)
    upright = shapely.transform(polygon, lambda p: p @ np.array([[c, -s], [s, c]]))
    low_x, low_y, high_x, high_y = upright.bounds
    corners = shapely.get_coordinates(upright)
    x = _lines(corners[:, 0], low_x, high_x)
    y = _lines(corners[:, 1], low_y, high_y)
    grown = upright.buffer(ROUNDING * max(high_x - low_x, high_y - low_y))
    shapely.prepare(grown)
    cells = shapely.box(x[None, :-1], y[:-1, None], x[None, 1:], y[1:, None])
    inside = shapely.contains(grown, cells)
    best, box = 0.0, None
    columns = np.arange(len(x) - 1)
    for row in range(len(y) - 1):
        free = np.logical_and.accumulate(inside[row:], axis=0)
        begin = np.maximum.accumulate(np.where(free, -1, columns), axis=1) + 1
        area = np.where(free, x[columns + 1] - x[begin], 0.0) * (y[row + 1 :] - y[row])[:, None]
        k = int(area.argmax())
        if area.flat[k] > best:
            top, right = divmod(k, len(columns))
            best = float(area.flat[k])
            box = np.array([x[begin[top, right]], y[row], x[right + 1], y[row + 1 + top]])
    if box is None:
        return None
    box = _grown(grown, box, np.array([low_x, low_y, high_x, high_y]))
    half = 0.5 * (box[2:] - box[:2])
    middle = 0.5 * (box[2:] + box[:2])
    return turn, np.array([c * middle[0] - s * middle[1], s * middle[0] + c * middle[1]]), half


def _lines(corners: Array, low: float, high: float) -> Array:
    lines = np.concatenate([np.linspace(low, high, RASTER), corners if len(corners) <= RASTER else corners[:0]])
    lines = np.unique(lines)
    return np.asarray(lines[np.r_[True, np.diff(lines) > COARSE * (high - low)]])


def _grown(polygon: shapely.Polygon, box: Array, bounds: Array) -> Array:
    """Return `box` with each side moved outwards as far as the polygon allows, sides in turn."""
    box = box.copy()
    for side in range(4):
        inner, outer = box[side], bounds[side]
        for _ in range(16):
            middle = 0.5 * (inner + outer)
            trial = box.copy()
            trial[side] = middle
            inner, outer = (middle, outer) if polygon.contains(shapely.box(*trial)) else (inner, middle)
        box[side] = inner
    return box
