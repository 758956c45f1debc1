"""Seeded random assemblies of the kinds people build: stacks, leaning walls, arches, Voronoi cuts, and stacks whose
beds have tongues or ridges; solids: stacks on slanted planes or on peaks, and the flat ones as plates.

Without friction the plain ones mostly fall upright; those with tongues, ridges and peaks stand, and fall at some tilt.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Equilibrium, Goal, Mesh, Part, Polygon, SupportFree
from mocca_robot.generators.blocks import hexahedron
from mocca_robot.geometry.extrusion import surface

KINDS = ("stack", "wall", "arch", "voronoi")
LOCKED_KINDS = ("notched", "ridged")
SOLID_KINDS = ("blocks", "peaks", *(f"solid_{kind}" for kind in (*KINDS, "notched")))


def random_assembly(kind: str, seed: int, support_free: bool = False) -> Assembly:
    """Return a flat assembly of `kind`, different for every seed, about 0.3 m across, α = 5°."""
    rng = np.random.default_rng(seed)
    makers = {
        "stack": _stack,
        "wall": _wall,
        "arch": _arch,
        "voronoi": _voronoi,
        "notched": _notched,
        "ridged": _ridged,
    }
    parts = makers[kind](rng)
    goals: tuple[Goal, ...] = (SupportFree() if support_free else Equilibrium(),)
    return Assembly(f"{kind}_{seed}", tuple(parts), goals=goals)


def random_solid(kind: str, seed: int) -> Assembly:
    """Return a solid assembly of one of `SOLID_KINDS`, different for every seed, turned about the vertical."""
    rng = np.random.default_rng(seed)
    if kind in ("blocks", "peaks"):
        parts = {"blocks": _blocks, "peaks": _peaks}[kind](rng)
    else:
        flat = random_assembly(kind.removeprefix("solid_"), seed)
        plates = (replace(p.shape, thickness=0.06) for p in flat.parts if isinstance(p.shape, Polygon))
        parts = [Part(p.name, surface(replace(p, shape=s)), fixed=p.fixed) for p, s in zip(flat.parts, plates)]
    angle = rng.uniform(0.0, 2.0 * np.pi)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turned = [replace(p, shape=Mesh(p.shape.vertices @ turn.T, p.shape.faces)) for p in parts if _is_mesh(p)]
    return Assembly(f"{kind}_{seed}", tuple(turned))


def _is_mesh(part: Part) -> bool:
    return isinstance(part.shape, Mesh)


def _blocks(rng: np.random.Generator) -> list[Part]:
    """Blocks between planes slanted both ways, each a little off the one below."""
    count = int(rng.integers(2, 6))
    slopes = rng.uniform(-0.25, 0.25, size=(count + 1, 2))
    offset = np.zeros(2)
    parts = []
    for k in range(-1, count):
        top = np.array([*slopes[k + 1], 0.05 * (k + 1)])
        bottom = np.array([*slopes[k], 0.05 * k]) if k >= 0 else np.array([0.0, 0.0, -0.08])
        if k >= 0:
            offset = offset + rng.uniform(-0.012, 0.012, size=2)
        plan = np.array([[x, y] for y in (-0.04, 0.04) for x in (-0.04, 0.04)]) + offset
        corners = [[x, y, a * x + b * y + c] for a, b, c in (bottom, top) for x, y in plan]
        parts.append(Part(f"b{k}" if k >= 0 else "base", hexahedron(np.array(corners)), fixed=k < 0))
    return parts


def _peaks(rng: np.random.Generator) -> list[Part]:
    """Blocks whose beds rise or sink to a point somewhere inside, each a little off the one below."""
    count = int(rng.integers(2, 6))
    width, height = 0.08, rng.uniform(0.04, 0.08)

    def bed(level: float) -> Array:
        """Return four corners, counter-clockwise from above, and the point between them."""
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]]) * width / 2 + rng.uniform(-0.004, 0.004, size=(4, 2))
        point = rng.uniform(-0.2, 0.2, size=2) * width
        rise = rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.35) * width
        plan = np.concatenate([corners, [point]])
        return np.column_stack([plan, level + np.array([0.0, 0.0, 0.0, 0.0, rise])])

    beds = [bed(k * height) for k in range(count + 1)]
    floor = np.column_stack([beds[0][:, :2], np.full(5, -0.08)])
    parts = [Part("base", _between(floor, beds[0]), fixed=True)]
    return parts + [Part(f"b{k}", _between(beds[k], beds[k + 1])) for k in range(count)]


def _between(low: Array, high: Array) -> Mesh:
    """Return the solid between two beds of four corners and a point each."""
    ring = [(k, (k + 1) % 4) for k in range(4)]
    faces = [(b, a, 4) for a, b in ring] + [(a + 5, b + 5, 9) for a, b in ring]
    faces += [face for a, b in ring for face in ((a, b, b + 5), (a, b + 5, a + 5))]
    return Mesh(np.concatenate([low, high]), np.array(faces))


def _notched(rng: np.random.Generator) -> list[Part]:
    """Blocks with a tongue on top that sits in a groove of the next, the whole stack leaning; most flanks slant."""
    count, width, height = int(rng.integers(2, 6)), rng.uniform(0.04, 0.06), rng.uniform(0.025, 0.06)
    lean = rng.uniform(-0.25, 0.25)
    c, s = np.cos(lean), np.sin(lean)
    shares = [
        (rng.uniform(0.25, 0.5), rng.uniform(0.004, 0.012), *rng.uniform(0.0, 0.006, 2)) for _ in range(count + 1)
    ]
    upright = rng.random() < 0.25

    def edge(k: int) -> list[list[float]]:
        (share, rise, left, right), y = shares[k], k * height
        start, end = share * width, share * width + 0.015
        if upright:
            left = right = 0.0
        return [[0.0, y], [start, y], [start + left, y + rise], [end - right, y + rise], [end, y], [width, y]]

    turn = np.array([[c, s], [-s, c]])
    parts = [Part("base", Polygon(np.array([[0.0, -0.05], [width, -0.05], *reversed(edge(0))]) @ turn.T), fixed=True)]
    for k in range(count):
        ring = np.array([*edge(k), *reversed(edge(k + 1))])
        parts.append(Part(f"n{k}", Polygon(ring @ turn.T)))
    return parts


def _ridged(rng: np.random.Generator) -> list[Part]:
    """Blocks whose beds have a ridge or a valley each, somewhere between their ends."""
    count, width, height = int(rng.integers(2, 7)), 0.06, rng.uniform(0.025, 0.06)

    def bed(k: int) -> Array:
        shift = rng.uniform(-0.006, 0.006)
        ridge = rng.uniform(0.3, 0.7), rng.choice([-1.0, 1.0]) * rng.uniform(0.08, 0.3)
        ends = rng.uniform(-0.08, 0.08)
        xs, ys = np.array([0.0, ridge[0], 1.0]), np.array([-ends, ridge[1], ends])
        return np.column_stack([shift + width * xs, k * height + width * ys])

    beds = [bed(k) for k in range(count + 1)]
    floor = np.array([[0.0, -0.05], [width, -0.05]])
    parts = [Part("base", Polygon(np.concatenate([floor, beds[0][::-1]])), fixed=True)]
    for k in range(count):
        parts.append(Part(f"r{k}", Polygon(np.concatenate([beds[k], beds[k + 1][::-1]]))))
    return parts


def _stack(rng: np.random.Generator) -> list[Part]:
    """Blocks on slanted beds, each a little off the one below."""
    count = int(rng.integers(2, 7))
    width, height = 0.06, 0.04
    left, right = np.array([0.0, 0.0]), np.array([width, 0.0])
    slope = rng.uniform(-0.3, 0.3)
    right[1] = slope * width
    base = np.array([[0.0, -0.06], [width, -0.06], right, left])
    parts = [Part("base", Polygon(base), fixed=True)]
    for k in range(count):
        shift = rng.uniform(-0.012, 0.012) * np.array([1.0, 0.0])
        slope = rng.uniform(-0.3, 0.3)
        top_left = left + shift + np.array([0.0, height])
        top_right = right + shift + np.array([0.0, height])
        middle = 0.5 * (top_left[1] + top_right[1])
        top_left[1], top_right[1] = middle - slope * width / 2, middle + slope * width / 2
        parts.append(Part(f"b{k}", Polygon(np.array([left, right, top_right, top_left]))))
        left, right = top_left, top_right
    return parts


def _wall(rng: np.random.Generator) -> list[Part]:
    tilt, courses = rng.uniform(0.0, 0.45), int(rng.integers(2, 5))
    c, s = np.cos(tilt), np.sin(tilt)
    turn = np.array([[c, s], [-s, c]])
    width, height = 0.1, rng.uniform(0.035, 0.06)
    left, right = np.array([0.0, 0.0]) @ turn.T, np.array([2 * width, 0.0]) @ turn.T
    low = min(left[1], right[1]) - 0.05
    parts = [Part("base", Polygon(np.array([[left[0], low], [right[0], low], right, left])), fixed=True)]
    for k in range(courses):
        cuts = [0.0, width, 2 * width] if k % 2 == 0 else [0.0, width / 2, 1.5 * width, 2 * width]
        for x0, x1 in itertools.pairwise(cuts):
            y0, y1 = k * height, (k + 1) * height
            corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
            parts.append(Part(f"p{len(parts)}", Polygon(corners @ turn.T)))
    return parts


def _arch(rng: np.random.Generator) -> list[Part]:
    """Voussoirs on two springers, from both sides to the keystone."""
    count = int(rng.integers(2, 5)) * 2 + 1
    inner, outer = 0.1, 0.1 * (1.0 + rng.uniform(0.25, 0.5))
    angles = np.linspace(0.0, np.pi, count + 1)

    def wedge(a: float, b: float) -> Array:
        turns = np.array([a, b])
        ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        return np.array([inner * ring[0], outer * ring[0], outer * ring[1], inner * ring[1]])

    def foot(sign: float) -> Array:
        return np.array([[sign * inner, 0.0], [sign * outer, 0.0], [sign * outer, -0.03], [sign * inner, -0.03]])

    parts = [Part("right", Polygon(foot(1.0)), fixed=True), Part("left", Polygon(foot(-1.0)), fixed=True)]
    order = [k for pair in zip(range(count // 2), range(count - 1, count // 2, -1), strict=True) for k in pair]
    return parts + [Part(f"v{k}", Polygon(wedge(angles[k], angles[k + 1]))) for k in [*order, count // 2]]


def _voronoi(rng: np.random.Generator) -> list[Part]:
    """A square cut into Voronoi cells; those that reach the ground are fixed, the rest go in from below up."""
    count = int(rng.integers(5, 9))
    sites = rng.uniform(0.02, 0.18, size=(count, 2))
    square = shapely.box(0.0, 0.0, 0.2, 0.2)
    cells = [shapely.intersection(c, square) for c in shapely.get_parts(_cells(sites))]
    cells = [c for c in cells if shapely.area(c) > 1e-5]
    cells.sort(key=lambda c: c.centroid.y)
    parts = []
    for k, cell in enumerate(cells):
        corners = np.asarray(cell.exterior.coords)[:-1]
        parts.append(Part(f"c{k}", Polygon(corners), fixed=bool(corners[:, 1].min() < 1e-9)))
    return parts


def _cells(sites: Array) -> shapely.Geometry:
    return shapely.voronoi_polygons(shapely.multipoints(sites), extend_to=shapely.box(-1, -1, 1.2, 1.2))
