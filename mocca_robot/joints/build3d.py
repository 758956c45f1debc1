"""Solid parts with joints cut in: both neighbours get the same triangles, and every mesh closes by construction.

Corners of parts and contacts are welded to one coordinate each, and every edge is split at the welded corners
that lie on it. The flat rest of a part's face is then what its boundary chain leaves when the chains of its
contacts are taken away; that is integer arithmetic on edges, so nothing depends on how a boolean operation
rounds. Each rest is triangulated with all its boundary vertices.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.errors import InputError
from mocca_robot.geometry.frames import tangents
from mocca_robot.geometry.surfaces import separated
from mocca_robot.geometry.triangulation import (
    boundary_chain,
    cancelled,
    chain_loops,
    split_facets,
    triangulate_loops,
)
from mocca_robot.joints.joint import Joint
from mocca_robot.tolerances import TINY, TOLERANCES, Tolerances


def build_parts_3d(assembly: Assembly, joints: Sequence[Joint], tolerances: Tolerances = TOLERANCES) -> Assembly:
    """Return `assembly` with every joint's surface in place of its contact, the same triangles in both parts.

    Joints outside `joints` leave no trace; contacts passed as planar joints become facets of both parts. Corners
    closer than the contact tolerance are welded, also where the input was not exact. Planar joints of a part that would
    not close with them leave no trace either: its faces are flat there without them. Raises NotBuilt when a joint's
    contact does not lie on a face of its part, or a part does not close.
    """
    kept = list(joints)
    while True:
        pieces = _Pieces.of(assembly, kept, 2.0 * tolerances.contact_gap * assembly.size)
        try:
            shapes = [_built(assembly, pieces, part, kept, tolerances) for part in range(len(assembly.parts))]
        except NotBuilt as error:
            flat = [j for j in kept if j.kind == "planar" and error.part in j.contact.parts]
            for joint in flat:
                _require_on_faces(assembly, joint, tolerances)
            if not flat:
                raise
            kept = [j for j in kept if j not in flat]
        else:
            return assembly.with_shapes(shapes)


def _require_on_faces(assembly: Assembly, joint: Joint, tolerances: Tolerances) -> None:
    """Raise NotBuilt when the parts of a joint cannot even be built with it alone."""
    pieces = _Pieces.of(assembly, [joint], 2.0 * tolerances.contact_gap * assembly.size)
    for part in joint.contact.parts:
        _built(assembly, pieces, part, [joint], tolerances)


class NotBuilt(InputError):
    """The part with the index `part` cannot be built with the joints that were asked for."""

    def __init__(self, message: str, part: int) -> None:
        super().__init__(message)
        self.part = part


@lru_cache(maxsize=4)
def joints_to_cut(assembly: Assembly, joints: tuple[Joint, ...]) -> BoolArray:
    """Return (E,) which of `joints` can be cut into the parts of an assembly of solids: all, nearly always.

    Where a part would not close with all of its own, as contacts that overlap each other leave it, the larger ones are
    taken first. What a joint is cut into is the outline of its contact, so its shape makes no difference.
    """
    usable = np.ones(len(joints), dtype=np.bool_)
    gap = 2.0 * TOLERANCES.contact_gap * assembly.size

    def failing(parts: Iterable[int]) -> int | None:
        kept = [j for j, good in zip(joints, usable) if good]
        pieces = _Pieces.of(assembly, kept, gap)
        for part in parts:
            try:
                _built(assembly, pieces, part, kept, TOLERANCES)
            except NotBuilt:
                return part
        return None

    while usable.any() and (part := failing(range(len(assembly.parts)))) is not None:
        mine = [e for e in np.flatnonzero(usable).tolist() if part in joints[e].contact.parts]
        usable[mine] = False
        for e in sorted(mine, key=lambda e: -joints[e].contact.measure):
            usable[e] = True
            usable[e] = failing([part]) is None
    return read_only(usable, np.bool_)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Welded, split surfaces: triangles over one list of points shared by all parts.

    Attributes:
        points: (V, 3).
        parts: per part, the triangles of its input mesh and the input face of each.
        joints: per joint, triangles from P_i into P_j.
        gap: distance below which points are one, m.
    """

    points: Array
    parts: list[tuple[IntArray, IntArray]]
    joints: list[IntArray]
    gap: float

    @classmethod
    def of(cls, assembly: Assembly, joints: Sequence[Joint], gap: float) -> _Pieces:
        """Return the surfaces of all parts and joints, welded, and split where corners lie on edges."""
        meshes = [_mesh(p.shape) for p in assembly.parts]
        rims = [np.unique(boundary_chain(j.facets, len(j.vertices))) for j in joints]
        corners = np.concatenate([*(m.vertices for m in meshes), *(j.vertices[r] for j, r in zip(joints, rims))])
        welded = _weld(corners, gap)
        seen, points = 0, [corners]
        parts = []
        for mesh in meshes:
            parts.append(welded[mesh.faces + seen])
            seen += len(mesh.vertices)
        surfaces, count = [], len(corners)
        for joint, rim in zip(joints, rims):
            index = np.arange(len(joint.vertices)) + count
            index[rim] = welded[seen + np.arange(len(rim))]
            surfaces.append(index[joint.facets])
            points.append(joint.vertices)
            seen += len(rim)
            count += len(joint.vertices)
        everything = np.concatenate(points)
        edges = np.concatenate([*(_edges(f) for f in parts), *(boundary_chain(f, count) for f in surfaces)])
        on_edges = _corners_on_edges(everything, edges, np.unique(welded), gap)
        return cls(
            everything,
            [split_facets(f, on_edges) for f in parts],
            [split_facets(f, on_edges)[0] for f in surfaces],
            gap,
        )


def _mesh(shape: object) -> Mesh:
    assert isinstance(shape, Mesh)
    return shape


def _edges(faces: IntArray) -> IntArray:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _weld(points: Array, gap: float) -> IntArray:
    """Return (V,) the lowest index of each point's cluster."""
    pairs = KDTree(points).query_pairs(gap, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    _, label = connected_components(links, directed=False)
    _, first = np.unique(label, return_index=True)
    return np.asarray(first[label])


def _corners_on_edges(
    points: Array, edges: IntArray, corners: IntArray, gap: float
) -> dict[tuple[int, int], list[int]]:
    """Return, for each undirected edge that `corners` lie on, those corners in order from its lower end."""
    edges = np.unique(np.sort(edges[edges[:, 0] != edges[:, 1]], axis=1), axis=0)
    start, along = points[edges[:, 0]], points[edges[:, 1]] - points[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    near = KDTree(points[corners]).query_ball_point(start + 0.5 * along, 0.5 * length + gap)
    edge = np.repeat(np.arange(len(edges)), [len(n) for n in near])
    corner = corners[np.concatenate([np.asarray(n, dtype=np.int64) for n in near])]
    offset = points[corner] - start[edge]
    t = np.einsum("nd,nd->n", offset, along[edge]) / length[edge] ** 2
    away = np.linalg.norm(offset - t[:, None] * along[edge], axis=1)
    between = (t > 0) & (t < 1) & (away <= gap) & (corner != edges[edge, 0]) & (corner != edges[edge, 1])
    found: dict[tuple[int, int], list[int]] = {}
    order = np.flatnonzero(between)
    for n in order[np.lexsort((t[order], edge[order]))]:
        low, high = edges[edge[n]].tolist()
        found.setdefault((low, high), []).append(int(corner[n]))
    return found


def _built(assembly: Assembly, pieces: _Pieces, part: int, joints: Sequence[Joint], tolerances: Tolerances) -> Mesh:
    mesh = _mesh(assembly.parts[part].shape)
    faces, origin = pieces.parts[part]
    mine = [e for e, j in enumerate(joints) if part in j.contact.parts]
    outward = {e: 1.0 if joints[e].contact.parts[0] == part else -1.0 for e in mine}
    surfaces = {e: pieces.joints[e] if outward[e] > 0 else pieces.joints[e][:, ::-1] for e in mine}
    replaced = np.zeros(len(mesh.faces), dtype=np.bool_)
    built = []
    for group, region in _groups(mesh, joints, outward, pieces.gap, tolerances.contact_angle_rad):
        replaced |= region
        normal = outward[group[0]] * joints[group[0]].contact.normal
        rest = [
            _edges(faces[region[origin]]),
            *(boundary_chain(surfaces[e], len(pieces.points))[:, ::-1] for e in group),
        ]
        flat, smallest = _rest(pieces.points, np.concatenate(rest), normal)
        if smallest < -pieces.gap * assembly.size:
            names = " and ".join(assembly.parts[p].name for p in joints[group[0]].contact.parts)
            raise NotBuilt(
                f"The contact between {names} does not lie on a face of part '{assembly.parts[part].name}' "
                f"({-smallest:.3g} m² outside); find contacts from this very geometry before building joints.",
                part,
            )
        built.append(flat)
    kept = faces[~replaced[origin]]
    triangles = np.concatenate([kept, *built, *surfaces.values()])
    touching = _doubled(faces)
    if not _closes(triangles, touching):
        raise NotBuilt(
            f"Part '{assembly.parts[part].name}' would not close with its joints. Its contacts overlap each other, or "
            "the mesh is not closed; check the contacts of this part.",
            part,
        )
    used, compact = np.unique(triangles, return_inverse=True)
    points, triangles = pieces.points[used], compact.reshape(-1, 3)
    if touching:
        points, triangles, _ = separated(points, triangles)
    return Mesh(points, triangles)


def _doubled(faces: IntArray) -> bool:
    """Return whether bodies of a part touch along edges or faces: then more than two triangles meet in an edge."""
    edges = _edges(faces)
    return len(np.unique(edges, axis=0)) < len(edges)


def _groups(
    mesh: Mesh, joints: Sequence[Joint], outward: Mapping[int, float], gap: float, angle: float
) -> list[tuple[list[int], BoolArray]]:
    """Return joints that share a face of the part, with the (F,) mask of the input triangles of that face."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), TINY)[:, None]
    groups: list[tuple[list[int], BoolArray]] = []
    for e, sign in outward.items():
        contact = joints[e].contact
        off = np.abs((corners - contact.centre) @ contact.normal).max(axis=1)
        region = np.asarray((sign * (normals @ contact.normal) > np.cos(angle)) & (off <= gap))
        members = [e]
        for other in [g for g in groups if (g[1] & region).any()]:
            groups.remove(other)
            members = other[0] + members
            region = region | other[1]
        groups.append((members, region))
    return groups


def _rest(points: Array, edges: IntArray, normal: Array) -> tuple[IntArray, float]:
    """Return triangles of the flat region bounded by the chain of `edges`, and its smallest signed area."""
    chain = cancelled(edges, len(points))
    if len(chain) == 0:
        return np.zeros((0, 3), dtype=np.int64), 0.0
    used, compact = np.unique(chain, return_inverse=True)
    flat = (points[used] - points[used[0]]) @ tangents(normal).T
    loops = chain_loops(compact.reshape(-1, 2), dict(enumerate(flat)))
    triangles = triangulate_loops(flat, loops)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    ab, ac = b - a, c - a
    return used[triangles], float(0.5 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]).min(initial=0.0))


def _closes(triangles: IntArray, touching: bool) -> bool:
    """Return whether every edge has one neighbour, or where bodies are `touching` as many as triangles."""
    if len(triangles) == 0:
        return False
    edges = _edges(triangles)
    n = int(triangles.max()) + 1
    forward, backward = np.sort(edges[:, 0] * n + edges[:, 1]), np.sort(edges[:, 1] * n + edges[:, 0])
    return np.array_equal(forward, backward) and (touching or bool((forward[1:] != forward[:-1]).all()))
