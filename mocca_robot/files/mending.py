"""Triangles as files hold them → closed, outward bodies, with a note per repair; or an error that says where and what.

Mended is what leaves no choice of shape: corners that are equal but for rounding, triangles without area or said twice,
walls inside, corners on a neighbour's edge, holes in a plane, triangles and bodies turned the wrong way. Sound surfaces
stay bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Mesh
from mocca_robot.errors import InputError
from mocca_robot.files.nesting import owners
from mocca_robot.geometry import surfaces
from mocca_robot.geometry.facets import distinct_rows
from mocca_robot.geometry.gaps import cut_at_corners, filled
from mocca_robot.geometry.surfaces import Edges
from mocca_robot.tolerances import ROUNDING

WELD = (1e-8, 1e-7, 1e-6, 1e-5)
"""Corners closer than these shares of the part's size are welded, the least that closes the surface: text files of six
digits and single precision leave 1e-7 to 1e-6."""
THIN = 1e-6
"""A surface whose volume is a smaller share of its area times its size is a sheet."""
REMEDY = (
    "close the surface and export it again (in Rhino: ShowEdges, then Join or Cap; in Blender: Select Non Manifold, "
    "Fill; in SketchUp: make it one solid group)"
)


class NotClosed(InputError):
    """The surface has an edge that does not join two triangles."""


@dataclass(frozen=True, eq=False)
class Mended:
    """The bodies of a part.

    Attributes:
        bodies: each closed and outward, cavities included, in the order of their first triangles.
        first: the first triangle of each, among those handed in.
        notes: one per kind of repair.
    """

    bodies: tuple[Mesh, ...]
    first: tuple[int, ...]
    notes: tuple[str, ...]

    @property
    def whole(self) -> Mesh:
        """Return all bodies as one mesh."""
        if len(self.bodies) == 1:
            return self.bodies[0]
        offset = np.cumsum([0] + [len(b.vertices) for b in self.bodies])
        faces = np.concatenate([b.faces + o for b, o in zip(self.bodies, offset)])
        return Mesh(np.concatenate([b.vertices for b in self.bodies]), faces)


def mended(name: str, vertices: Array, faces: IntArray) -> Mended:
    """Return the bodies that triangles (F, 3) over `vertices` (V, 3) bound.

    Raises InputError for broken input, one-sided surfaces and what encloses no volume, and NotClosed with the number of
    open edges and a place where the surface does not close.
    """
    vertices, faces = _used(*_usable(name, vertices, faces))
    origin = np.arange(len(faces))
    notes: list[str] = []
    places, same = distinct_rows(vertices)
    if len(places) < len(vertices) and _closed_as_indexed(faces, same[faces]):
        # Corners that the file keeps apart belong to bodies that touch there: welding would only mix them up.
        return _split_into_bodies(name, vertices, faces, surfaces.bodies(faces), notes)
    vertices, faces = places, same[faces]
    proper = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    if not proper.all():
        faces, origin = faces[proper], origin[proper]
        notes.append(f"{_triangles(int((~proper).sum()))} with two equal corners removed")
        if len(faces) == 0:
            raise InputError(f"Part '{name}' has no triangle with three corners of its own; export it again.")
    vertices, faces = _used(vertices, faces)
    if not Edges(faces).sound:
        vertices, faces = _close(name, vertices, faces, notes)
        vertices, faces, body = surfaces.separated(vertices, faces)
    else:
        body = surfaces.bodies(faces)
    return _split_into_bodies(name, vertices, faces, body, notes)


def _closed_as_indexed(faces: IntArray, places: IntArray) -> bool:
    """Return whether every edge joins two triangles that agree, by the file's own numbers, and none is said twice."""
    if not Edges(faces).sound or (places == np.roll(places, 1, axis=1)).any():
        return False
    least = places.argmin(axis=1)[:, None]
    turned = np.take_along_axis(places, (least + np.arange(3)) % 3, axis=1)
    return len(np.unique(turned, axis=0)) == len(turned)


def repaired(name: str, vertices: Array, faces: IntArray) -> tuple[Mesh, tuple[str, ...]]:
    """Return all that `mended` finds as one mesh, and its notes; several bodies are said."""
    found = mended(name, vertices, faces)
    several = () if len(found.bodies) == 1 else (f"its {len(found.bodies)} separate bodies are one rigid part",)
    return found.whole, (*found.notes, *several)


def closes(vertices: Array, faces: IntArray) -> bool:
    """Return whether a surface is closed once corners that are equal but for rounding are welded."""
    if len(faces) == 0:
        return False
    vertices, same = distinct_rows(vertices)
    kept = surfaces.with_three_corners(same[faces])
    if len(kept) == 0:
        return False
    vertices, kept = _used(vertices, kept)
    found = _weld(vertices, kept, float(np.linalg.norm(np.ptp(vertices, axis=0))), [])[1]
    return not Edges(surfaces.without_copies(found)[0]).odd.any()


def _usable(name: str, vertices: Array, faces: IntArray) -> tuple[Array, IntArray]:
    if len(faces) == 0 or not np.isfinite(vertices).all():
        raise InputError(f"Part '{name}' has no faces or has coordinates that are not numbers; export it again.")
    if np.min(faces) < 0 or np.max(faces) >= len(vertices):
        raise InputError(
            f"Part '{name}' has a face with vertex {int(np.max(faces))}, but only {len(vertices)} vertices; "
            "the file is damaged. Export it again."
        )
    return np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64)


def _used(vertices: Array, faces: IntArray) -> tuple[Array, IntArray]:
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


def _triangles(count: int) -> str:
    return f"{count} triangle{'' if count == 1 else 's'}"


def _close(name: str, vertices: Array, faces: IntArray, notes: list[str]) -> tuple[Array, IntArray]:
    """Return a surface whose edges all join an even number of triangles that agree; repairs are added to `notes`."""
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    vertices, faces = _weld(vertices, faces, size, notes)
    faces, copies = surfaces.without_copies(faces)
    if copies:
        notes.append(f"{_triangles(copies)} that say another one again removed")
    if Edges(faces).odd.any():
        faces, cuts = cut_at_corners(vertices, faces, WELD[-2] * size)
        if cuts:
            notes.append(f"{cuts} edge{'' if cuts == 1 else 's'} cut at corners of their neighbours")
    if Edges(faces).odd.any():
        faces, walls = surfaces.without_membranes(vertices, faces)
        if walls:
            notes.append(f"{_triangles(walls)} of walls inside removed")
    if Edges(faces).odd.any():
        faces = _close_holes(name, vertices, faces, size, notes)
    vertices, faces = _used(vertices, faces)
    found = surfaces.oriented(vertices, faces)
    if found is None:
        raise InputError(
            f"Part '{name}' is a one-sided surface (like a Möbius strip); it encloses no volume. "
            "Model it with a thickness and export it again."
        )
    if found[1]:
        notes.append(f"{_triangles(found[1])} turned so that neighbours agree")
    return vertices, found[0]


def _weld(vertices: Array, faces: IntArray, size: float, notes: list[str]) -> tuple[Array, IntArray]:
    """Return the surface with corners welded that rounding keeps apart, by the least tolerance that helps."""
    best, fewest = (vertices, faces, 0.0), int(Edges(faces).odd.sum())
    for share in WELD if fewest else ():
        places, place, moved = surfaces.welded(vertices, share * size)
        kept = surfaces.with_three_corners(place[faces])
        if len(kept) == 0:
            break
        left = int(Edges(surfaces.without_copies(kept)[0]).odd.sum())
        if left < fewest:
            best, fewest = (places, kept, moved), left
        if left == 0:
            break
    places, kept, moved = best
    if moved:
        gone = len(vertices) - len(np.unique(kept))
        notes.append(f"{gone} corners welded to others, by at most {moved * 1e3:.2g} mm")
    return places, kept


def _close_holes(name: str, vertices: Array, faces: IntArray, size: float, notes: list[str]) -> IntArray:
    """Return the surface with its holes filled. Raises NotClosed when others are left, or it would become a sheet."""
    closed, count = filled(vertices, faces, size)
    edges = Edges(closed)
    agreed = surfaces.oriented(vertices, closed)
    if edges.odd.any() or agreed is None:
        raise _open(name, vertices, faces)
    a, b = edges.pairs()
    _, sheet = surfaces.components(len(closed), a // 3, b // 3)
    for k in np.unique(sheet[len(faces) :]):
        mine = agreed[0][sheet == k]
        if abs(Mesh(vertices, mine).volume) <= THIN * _area(vertices, mine) * size:
            raise _open(name, vertices, faces)
    before, after = _area(vertices, faces), _area(vertices, closed)
    notes.append(
        f"{'a hole' if count == 1 else f'{count} holes'} closed by {_triangles(len(closed) - len(faces))}: area "
        f"{before:.4g} → {after:.4g} m², volume {abs(Mesh(vertices, agreed[0]).volume):.4g} m³"
    )
    return closed


def _open(name: str, vertices: Array, faces: IntArray) -> NotClosed:
    edges = Edges(faces)
    place = vertices[edges.ends[edges.odd][0]].mean(axis=0)
    where = ", ".join(f"{x:.4g}" for x in place)
    return NotClosed(
        f"Part '{name}' is not closed: {int(edges.odd.sum())} of its edges do not join exactly two triangles, one "
        f"near ({where}) m. Only holes of three corners, or four in a plane, are closed without guessing; {REMEDY}."
    )


def _area(vertices: Array, faces: IntArray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def _split_into_bodies(name: str, vertices: Array, faces: IntArray, body: IntArray, notes: list[str]) -> Mended:
    """Return the bodies with volume, outward, cavities joined to what they are in."""
    numbers, first = np.unique(body, return_index=True)
    meshes = [Mesh(*_used(vertices, faces[body == n])) for n in numbers[np.argsort(first)]]
    first = np.sort(first)
    if len(meshes) == 1:
        meshes = [Mesh(vertices, faces)]
    solid = [k for k, m in enumerate(meshes) if not _is_sheet(m)]
    if not solid:
        area = sum(_area(m.vertices, m.faces) for m in meshes)
        raise InputError(
            f"Part '{name}' encloses no volume: it is flat or folded onto itself (area {area:.4g} m²). "
            "Give it a thickness where it was modelled, and export it again."
        )
    if len(solid) < len(meshes):
        notes.append(f"{len(meshes) - len(solid)} sheets without volume removed")
    meshes, first = [meshes[k] for k in solid], first[solid]
    owner = owners(meshes)
    turned = 0
    for k, mesh in enumerate(meshes):
        if mesh.volume < 0 and owner[k] == k:
            meshes[k] = Mesh(mesh.vertices, mesh.faces[:, ::-1])
            turned += 1
    if turned:
        notes.append("turned right side out" if len(meshes) == 1 else f"{turned} bodies turned right side out")
    joined = []
    for k in np.unique(owner):
        inside = Mended(tuple(meshes[j] for j in np.flatnonzero(owner == k)), (), ())
        joined.append(inside.whole)
    if slivers := sum(map(_slivers, joined)):
        notes.append(f"{_triangles(slivers)} without area kept (removing them would open the surface)")
    return Mended(tuple(joined), tuple(int(first[k]) for k in np.unique(owner)), tuple(notes))


def _is_sheet(mesh: Mesh) -> bool:
    size = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    return abs(mesh.volume) <= ROUNDING * _area(mesh.vertices, mesh.faces) * size


def _slivers(mesh: Mesh) -> int:
    corners = mesh.vertices[mesh.faces]
    twice = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return int((twice <= ROUNDING * longest**2).sum())
