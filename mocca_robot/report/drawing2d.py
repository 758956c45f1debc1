"""Flat assemblies as SVG layers: parts, joints, contact forces, collapse motion, motion cones. y is up."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.contacts.contact import Contact
from mocca_robot.design import Insertion
from mocca_robot.geometry.frames import tangents
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.joints.joint import Joint, contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report.markup import degrees, esc, point_list, px
from mocca_robot.report.palette import fills
from mocca_robot.statics.cases import CaseVerdict
from mocca_robot.tolerances import ROUNDING, TINY, VISIBLE

GHOST_REACH = 0.10
"""The collapse motion is drawn so large that its fastest point moves by this share of the assembly's size."""
FORCE_REACH = 0.12
"""Length of the largest force arrow, as a share of the assembly's size."""
WEDGE = 0.075
"""Radius of a few motion cones, as a share of the assembly's size."""


@dataclass(frozen=True, eq=False)
class View:
    """World metres to pixels: `scale` px/m, `low` the world point at the lower left, y turned upside down."""

    low: Array
    scale: float
    width: float
    height: float

    def __call__(self, points: Array) -> Array:
        """Return (n, 2) pixels of (n, 2) world points."""
        moved = (np.atleast_2d(points) - self.low) * self.scale
        return np.stack([moved[:, 0], self.height - moved[:, 1]], axis=1)

    def svg(self, body: str, label: str, cls: str = "drawing", style: str = "") -> str:
        """Return an SVG element around `body`; `label` is its text for readers who cannot see it."""
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" class="{cls}" role="img" aria-label="{esc(label)}" '
            f'viewBox="0 0 {px(self.width)} {px(self.height)}" width="{px(self.width)}" height="{px(self.height)}">'
            f"{style}<title>{esc(label)}</title>\n{body}</svg>"
        )


def view_of(points: Array, size_px: float = 460.0, margin: float = 0.09) -> View:
    """Return the view that shows world `points` (n, 2) in at most `size_px` a side, with a relative margin."""
    low, high = points.min(axis=0), points.max(axis=0)
    pad = margin * float(np.linalg.norm(high - low))
    low, extent = low - pad, high - low + 2 * pad
    scale = size_px / float(extent.max())
    return View(low, scale, float(extent[0]) * scale, float(extent[1]) * scale)


def corners(assembly: Assembly) -> Array:
    """Return all corners of all parts, (n, d)."""
    return np.concatenate(
        [p.shape.exterior if isinstance(p.shape, Polygon) else p.shape.vertices for p in assembly.parts]
    )


def path_of(polygon: Polygon, view: View) -> str:
    """Return SVG path data of a polygon with its holes."""
    return " ".join(f"M{point_list(view(ring))}Z" for ring in polygon.rings)


def parts_layer(assembly: Assembly, colours: Sequence[int], view: View) -> str:
    """Return every part's outline, coloured; fixed ones hatched."""
    classes = fills()
    drawn = []
    for k, part in enumerate(assembly.parts):
        assert isinstance(part.shape, Polygon)
        kind = " (fixed)" if part.fixed else ""
        drawn.append(
            f'<path class="part {classes[colours[k]]}" data-part="{k}" d="{path_of(part.shape, view)}">'
            f"<title>{esc(part.name)}{kind}</title></path>"
        )
    return "\n".join(drawn)


def label_place(part: Polygon) -> tuple[Array, float, float]:
    """Return where a part's name goes, and half the height and half the width that are free there.

    The centroid where it lies well inside; otherwise the centre of the largest inscribed circle.
    """
    shape = to_shapely(part)
    tolerance = 0.02 * float(np.sqrt(shapely.area(shape)))
    circle = shapely.maximum_inscribed_circle(shape, tolerance=tolerance)
    place, radius = np.array(circle.coords[0]), float(shapely.length(circle))
    centroid = shapely.Point(part.centroid)
    clear = float(shapely.distance(centroid, shapely.boundary(shape))) if shapely.contains(shape, centroid) else 0.0
    if clear >= 0.6 * radius:
        place, radius = np.asarray(part.centroid), clear
    (low, _), (high, _) = part.bounds
    chord = shapely.intersection(shape, shapely.LineString([(low - 1.0, place[1]), (high + 1.0, place[1])]))
    mine = min(shapely.get_parts(chord), key=lambda piece: float(shapely.distance(piece, shapely.Point(place))))
    x0, _, x1, _ = shapely.bounds(mine)
    return place, radius, float(max(min(place[0] - x0, x1 - place[0]), radius))


def label(part_name: str, part: Polygon, view: View) -> str:
    """Return a part's name as large as fits inside the part, and never unreadably small."""
    place, height, width = label_place(part)
    x, y = view(place)[0]
    fits = min(1.3 * height * view.scale, 1.7 * width * view.scale / (0.62 * max(len(part_name), 1)))
    size = float(np.clip(fits, 7.0, 13.0))
    return f'<text class="name" x="{px(x)}" y="{px(y)}" font-size="{px(size)}" dy="0.35em">{esc(part_name)}</text>'


def names_layer(assembly: Assembly, view: View) -> str:
    """Return the parts' names, each inside its part."""
    drawn = []
    for part in assembly.parts:
        assert isinstance(part.shape, Polygon)
        drawn.append(label(part.name, part.shape, view))
    return f'<g class="layer names">{"".join(drawn)}</g>'


def joints_layer(assembly: Assembly, joints: Iterable[Joint], view: View) -> str:
    """Return the joints' curves; planar ones thin."""
    drawn = []
    for joint in joints:
        kind = "planar" if joint.is_planar else "curved"
        i, j = (assembly.parts[p].name for p in joint.contact.parts)
        drawn.append(
            f'<polyline class="joint {kind}" points="{point_list(view(joint.vertices))}">'
            f"<title>{esc(i)} – {esc(j)}: {esc(joint.kind)}</title></polyline>"
        )
    return f'<g class="layer joints">{"".join(drawn)}</g>'


def arrow(start: Array, end: Array, cls: str, title: str = "") -> str:
    """Return an arrow between two pixel points; shorter than 1.5 px it is left out."""
    along = end - start
    length = float(np.linalg.norm(along))
    if length < 1.5:
        return ""
    unit = along / length
    (side,) = tangents(unit)
    head = min(7.0, 0.5 * length)
    base = end - head * unit
    tip = np.array([end, base + 0.42 * head * side, base - 0.42 * head * side])
    body = f"<title>{esc(title)}</title>" if title else ""
    return (
        f'<g class="{cls}"><line x1="{px(start[0])}" y1="{px(start[1])}" x2="{px(base[0])}" y2="{px(base[1])}"/>'
        f'<polygon points="{point_list(tip)}"/>{body}</g>'
    )


def merged_forces(contacts: Sequence[Contact], forces: Array) -> tuple[IntArray, Array, Array]:
    """Return pairs (m, 2), points (m, d) and force vectors on the later part (m, d), one per place and pair.

    Facets of a curved joint share corners: what acts on the same pair at the same point is one force.
    """
    pairs, points, normals = contact_rays(contacts)
    vectors = normals * forces[:, None] if forces.ndim == 1 else forces
    scale = max(float(np.abs(points).max()), TINY)
    key = np.column_stack([pairs, np.round(points / (ROUNDING * scale))])
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    summed = np.zeros((len(first), points.shape[1]))
    np.add.at(summed, inverse.ravel(), vectors)
    return pairs[first], points[first], summed


def forces_layer(graph: PartsGraph, verdict: CaseVerdict, view: View) -> str:
    """Return the contact forces on the later part of each pair, arrow length ∝ √force; below 0.1 % left out."""
    assembly = graph.assembly
    pairs, points, vectors = merged_forces(graph.contacts, np.nan_to_num(verdict.result.forces))
    sizes = np.linalg.norm(vectors, axis=1)
    largest = float(sizes.max(initial=0.0))
    drawn = []
    for (i, j), point, vector, size in zip(pairs, points, vectors, sizes):
        if size <= VISIBLE * largest:
            continue
        length = FORCE_REACH * assembly.size * np.sqrt(size / largest)
        start, end = view(np.array([point, point + vector / size * length]))
        title = f"{size:.3g} N on {assembly.parts[j].name} from {assembly.parts[i].name}"
        drawn.append(arrow(start, end, "force", title))
    return f'<g class="layer forces">{"".join(drawn)}</g>'


def displaced(assembly: Assembly, motions: Array, reach: float = GHOST_REACH) -> Array:
    """Return (N, 3) finite displacements [x, y, angle] along `motions` (N, 3), the fastest corner moving by
    `reach` times the assembly's size (turning by at most half a radian)."""
    fastest = 0.0
    for part, motion in zip(assembly.parts, motions):
        assert isinstance(part.shape, Polygon)
        arm = part.shape.exterior - part.centroid
        velocity = motion[:2] + motion[2] * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        fastest = max(fastest, float(np.linalg.norm(velocity, axis=1).max()))
    if fastest <= 0.0:
        return np.zeros_like(motions)
    spin = float(np.abs(motions[:, 2]).max())
    return np.asarray(motions * min(reach * assembly.size / fastest, 0.5 / spin if spin > 0 else np.inf))


def collapse_layer(assembly: Assembly, verdict: CaseVerdict, view: View) -> str:
    """Return dashed outlines of the parts where the collapse motion takes them, with arrows from their centroids."""
    steps = displaced(assembly, verdict.result.motions)
    drawn = []
    for k, (part, step) in enumerate(zip(assembly.parts, steps)):
        if part.name not in verdict.moving:
            continue
        assert isinstance(part.shape, Polygon)
        start, end = view(np.array([part.centroid, part.centroid + step[:2]]))
        shift, turn = end - start, -np.rad2deg(step[2])
        place = f"translate({px(shift[0])} {px(shift[1])}) rotate({px(turn)} {px(start[0])} {px(start[1])})"
        drawn.append(f'<path class="ghost" data-part="{k}" transform="{place}" d="{path_of(part.shape, view)}"/>')
        drawn.append(arrow(start, end, "moves", f"{part.name} moves this way"))
    return f'<g class="layer collapse">{"".join(drawn)}</g>'


def free_interval(normals: Array, axis: Array) -> tuple[float, float] | None:
    """Return the angles (lowest, highest) about unit `axis` (2,) of the directions x with normals·x ≥ 0, or None."""
    if len(normals) == 0:
        return -np.pi, np.pi
    (side,) = tangents(axis)
    angles = np.arctan2(normals @ side, normals @ axis)
    low, high = float(angles.max() - np.pi / 2), float(angles.min() + np.pi / 2)
    return (low, high) if low <= 0.0 <= high else None


def wedge_reach(count: int) -> float:
    """Return the radius of `count` motion cones as a share of the assembly's size: smaller where there are many."""
    return float(np.clip(WEDGE * np.sqrt(6.0 / max(count, 1)), 0.45 * WEDGE, WEDGE))


def wedge(centre: Array, axis: Array, low: float, high: float, radius: float, cls: str, title: str) -> str:
    """Return a filled wedge in pixels between two angles about a world `axis` (y up)."""
    steps = np.linspace(low, high, max(3, int(np.ceil((high - low) / 0.15)) + 1))
    base = np.arctan2(axis[1], axis[0])
    rim = centre + radius * np.stack([np.cos(base + steps), -np.sin(base + steps)], axis=1)
    full = high - low >= 2 * np.pi - ROUNDING
    outline = rim if full else np.vstack([centre, rim])
    return f'<polygon class="{cls}" points="{point_list(outline)}"><title>{esc(title)}</title></polygon>'


def cones_layer(graph: PartsGraph, insertions: Sequence[Insertion], view: View) -> str:
    """Return each part's motion cone V_j at its centroid, the required K(−d, α) in it, and the way in as an arrow."""
    assembly = graph.assembly
    alpha = assembly.alpha_rad or 0.0
    radius = wedge_reach(len(insertions)) * assembly.size * view.scale
    drawn = []
    for insertion in insertions:
        part = assembly.index(insertion.part)
        axis = -np.asarray(insertion.direction)
        centre = view(assembly.parts[part].centroid)[0]
        free = free_interval(graph.motion(part).normals, axis)
        name = insertion.part
        if free is not None:
            drawn.append(wedge(centre, axis, *free, radius, "cone", f"{name} can leave within this cone"))
        if alpha > 0:
            title = f"{name}: asked for ±{degrees(alpha)} about its insertion direction"
            drawn.append(wedge(centre, axis, -alpha, alpha, radius, "alpha", title))
        far = centre + 1.25 * radius * np.array([axis[0], -axis[1]])
        drawn.append(arrow(far, centre, "way-in" if free else "way-in blocked", f"{name} goes in this way"))
    return f'<g class="layer cones">{"".join(drawn)}</g>'
