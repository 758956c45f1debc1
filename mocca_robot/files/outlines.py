"""Lines and closed curves of a drawing → outlines of parts: joined end to end, with holes, named by text or group."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError
from mocca_robot.files.drawing import CLOSED, Shape, Subpath, add_chain


@dataclass(eq=False)
class Group:
    """What is drawn together: on one layer, or inside one block reference."""

    name: str
    closed: list[Subpath] = field(default_factory=list)
    loose: list[Array] = field(default_factory=list)
    is_block: bool = False


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
        larger = [j for j in around if sound[j].area > sound[k].area * (1 + 1e-9)]
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
    """Return the outlines that the open lines and arcs of a group form, end to end."""
    if not group.loose:
        return []
    ends = np.array([[c[0, 0], c[-1, 3]] for c in group.loose])
    size = float(np.linalg.norm(np.ptp(ends.reshape(-1, 2), axis=0))) or 1.0
    spot = _spots(ends.reshape(-1, 2), CLOSED * size * 10).reshape(-1, 2)
    meeting: dict[int, list[tuple[int, int]]] = {}
    for k, pair in enumerate(spot):
        for end in (0, 1):
            meeting.setdefault(int(pair[end]), []).append((k, end))
    for met in meeting.values():
        if len(met) != 2:
            x, y = ends[met[0][0], met[0][1]]
            said = "ends there" if len(met) == 1 else f"branches there: {len(met)} lines meet"
            raise InputError(
                f"{where}: the outline on layer or in block '{group.name[:60]}' is not closed at ({x:.6g}, {y:.6g}) "
                f"{unit}, it {said}; draw every part as one closed polyline, or on a layer of its own."
            )
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


def _spots(points: Array, slack: float) -> Array:
    """Return the number of each point's place (n,): points closer than `slack` are in one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    pairs = KDTree(points).query_pairs(slack, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    return np.asarray(connected_components(graph, directed=False)[1])


def numbered(shapes: list[Shape]) -> list[Shape]:
    """Return the shapes with '_1', '_2', … after names that several have; layer 0 is called 'part'."""
    named = [Shape("part" if s.name == "0" else s.name, s.subpaths) for s in shapes]
    count = Counter(s.name for s in named)
    used: Counter[str] = Counter()
    taken = {n for n, c in count.items() if c == 1}
    found = []
    for shape in named:
        name = shape.name
        while count[shape.name] > 1 and (name == shape.name or name in taken):
            used[shape.name] += 1
            name = f"{shape.name}_{used[shape.name]}"
        taken.add(name)
        found.append(Shape(name, shape.subpaths))
    return found
