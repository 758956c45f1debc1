"""Seeded random flat assemblies of the kinds people build: stacks, leaning walls, arches, Voronoi cuts."""

from __future__ import annotations

import itertools

import numpy as np
import shapely

from mocca_robot.assembly import Array, Assembly, Equilibrium, Goal, Part, Polygon, SupportFree

KINDS = ("stack", "wall", "arch", "voronoi")


def random_assembly(kind: str, seed: int, support_free: bool = False) -> Assembly:
    """Return a flat assembly of `kind`, different for every seed, about 0.3 m across, α = 5°."""
    rng = np.random.default_rng(seed)
    parts = {"stack": _stack, "wall": _wall, "arch": _arch, "voronoi": _voronoi}[kind](rng)
    goals: tuple[Goal, ...] = (SupportFree() if support_free else Equilibrium(),)
    return Assembly(f"{kind}_{seed}", tuple(parts), goals=goals)


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
