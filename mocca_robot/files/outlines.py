"""Lines and closed curves of a drawing → outlines of parts: joined end to end, with holes, named by text or group."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.files.curves import elevated, flattened
from mocca_robot.files.drawing import Shape, Subpath, add_chain
from mocca_robot.tolerances import ROUNDING

JOIN = 1e-5
"""Ends of lines that are closer than this share of what is drawn together meet."""


@dataclass(eq=False)
class Group:
    """What is drawn together: on one layer, or inside one block reference; `notes` tell what was assumed about it."""

    name: str
    closed: list[Subpath] = field(default_factory=list)
    loose: list[Array] = field(default_factory=list)
    is_block: bool = False
    notes: list[str] = field(default_factory=list)


def shapes_of(group: Group, texts: Sequence[tuple[str, tuple[float, float]]], where: str, unit: str) -> Iterator[Shape]:
    """Yield the parts of one group: the outlines that lie in no other one, each with those inside it."""
    rings = [*group.closed, *_joined(group, where, unit)]
    areas = [shapely.Polygon(r.curves[:, 0]) if len(r.curves) > 2 else _polyline(r) for r in rings]
    sound = [a if a.is_valid else a.buffer(0) for a in areas]
    order = sorted(range(len(rings)), key=lambda k: -sound[k].area)
    parents: dict[int, int] = {}
    tree = shapely.STRtree(sound)
    for k in order:
        around = [int(j) for j in tree.query(sound[k].representative_point(), predicate="within") if j != k]
        larger = [j for j in around if sound[j].area > sound[k].area * (1 + ROUNDING)]
        if larger:
            parents[k] = min(larger, key=lambda j: sound[j].area)

    def depth(k: int) -> int:
        count = 0
        while k in parents:
            k, count = parents[k], count + 1
        return count

    depths = {k: depth(k) for k in order}
    for k in range(len(rings)):
        if depths[k] % 2 == 0:
            holes = [j for j in range(len(rings)) if parents.get(j) == k and depths[j] == depths[k] + 1]
            inside = [t for t, at in texts if not group.is_block and sound[k].contains(shapely.Point(at))]
            name = inside[0] if len(inside) == 1 else group.name
            yield Shape(name, (rings[k], *(rings[j] for j in holes)))


def _polyline(ring: Subpath) -> shapely.Polygon:
    """Return the area of a ring of one or two curves."""
    t = np.linspace(0.0, 1.0, 9)[:-1, None, None]
    c = ring.curves[None]
    points = (1 - t) ** 3 * c[..., 0, :] + 3 * (1 - t) ** 2 * t * c[..., 1, :]
    points = points + 3 * (1 - t) * t**2 * c[..., 2, :] + t**3 * c[..., 3, :]
    return shapely.Polygon(points.transpose(1, 0, 2).reshape(-1, 2))


def _joined(group: Group, where: str, unit: str) -> list[Subpath]:
    """Return the outlines that open lines and arcs of a group form: end to end, or around the areas of a network."""
    if not group.loose:
        return []
    ends = np.array([[c[0, 0], c[-1, 3]] for c in group.loose])
    size = float(np.linalg.norm(np.ptp(ends.reshape(-1, 2), axis=0))) or 1.0
    spot = _spots(ends.reshape(-1, 2), JOIN * size).reshape(-1, 2)
    meeting: dict[int, list[tuple[int, int]]] = {}
    for k, pair in enumerate(spot):
        for end in (0, 1):
            meeting.setdefault(int(pair[end]), []).append((k, end))
    if any(len(met) != 2 for met in meeting.values()):
        return _network(group, ends, spot, size, where, unit)
    found: list[Subpath] = []
    left = set(range(len(group.loose)))
    while left:
        k, end = min(left), 0
        chain: list[Array] = []
        while k in left:
            left.remove(k)
            curves = group.loose[k]
            chain.extend(curves if end == 0 else curves[::-1, ::-1])
            at = int(spot[k, 1 - end])
            k, end = next(m for m in meeting[at] if m != (k, 1 - end))
        add_chain(found, chain, True)
    return found


def _not_closed(group: Group, at: Array, where: str, unit: str) -> InputError:
    return InputError(
        f"{where}: the outline on layer or in block '{group.name[:60]}' is not closed at ({at[0]:.6g}, {at[1]:.6g}) "
        f"{unit}, it ends there; join the lines in the drawing (in AutoCAD: PEDIT, Join; in Rhino: Join; in Inkscape: "
        "Path, Combine, then join the end nodes)."
    )


def _network(group: Group, ends: Array, spot: Array, size: float, where: str, unit: str) -> list[Subpath]:
    """Return the outlines of the areas between lines that share ends, curves in straight pieces."""
    places = np.zeros((int(spot.max()) + 1, 2))
    places[spot.reshape(-1)] = ends.reshape(-1, 2)
    flat = iter(flattened(np.concatenate(group.loose), size))
    lines = []
    for curves, (first, last) in zip(group.loose, spot):
        points = np.concatenate([next(flat)[:-1] for _ in curves] + [curves[-1, 3:]])
        points[0], points[-1] = places[first], places[last]
        lines.append(shapely.LineString(points))
    lines = _with_ends_of_others(lines, places, JOIN * size)
    areas, cuts, dangles, _ = shapely.polygonize_full([shapely.unary_union(lines)])
    for left_over in (*shapely.get_parts(dangles), *shapely.get_parts(cuts)):
        raise _not_closed(group, np.asarray(left_over.coords[0]), where, unit)
    found: list[Subpath] = []
    for area in shapely.get_parts(areas):
        points = np.asarray(area.exterior.coords)
        add_chain(found, [elevated([tuple(a), tuple(b)]) for a, b in pairwise(points.tolist())], True)
    group.notes.append(f"the lines of '{group.name[:60]}' meet in a network, read as its {len(found)} areas")
    return found


def _with_ends_of_others(lines: list[shapely.LineString], places: Array, slack: float) -> list[shapely.LineString]:
    """Return lines with the `places` (m, 2) closer than `slack` as corners of theirs."""
    found = list(lines)
    tree = shapely.STRtree(shapely.points(places))
    for k, line in enumerate(lines):
        near = places[tree.query(line, predicate="dwithin", distance=slack)]
        own = np.asarray(line.coords)
        new = near[np.linalg.norm(near[:, None] - own[None], axis=2).min(axis=1, initial=np.inf) > slack]
        if len(new):
            at = [line.project(shapely.Point(p)) for p in (*own, *new)]
            at[len(own) - 1] = line.length
            points = np.concatenate([own, new])[np.argsort(at, kind="stable")]
            found[k] = shapely.LineString(points)
    return found


def _spots(points: Array, slack: float) -> Array:
    """Return the number of each point's place (n,): points closer than `slack` are in one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    pairs = KDTree(points).query_pairs(slack, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    return np.asarray(connected_components(graph, directed=False)[1])


def numbered(shapes: list[Shape]) -> tuple[list[Shape], tuple[str, ...]]:
    """Return the shapes with '_1', '_2', … after names that several have, and a note for each such name."""
    count = Counter(s.name for s in shapes)
    used: Counter[str] = Counter()
    taken = {n for n, c in count.items() if c == 1}
    found = []
    for shape in shapes:
        name = shape.name
        while count[shape.name] > 1 and (name == shape.name or name in taken):
            used[shape.name] += 1
            name = f"{shape.name}_{used[shape.name]}"
        taken.add(name)
        found.append(Shape(name, shape.subpaths))
    several = (f"{c} parts are called '{n}', read as '{n}_1', '{n}_2', …" for n, c in count.items() if c > 1)
    return found, tuple(several)
