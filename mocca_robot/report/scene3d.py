"""A solid assembly as numbers for the WebGL viewer: meshes on a 16-bit grid, edges, cones, forces, motions."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.frames import tangents
from mocca_robot.report.cone_plots import free_reach, tangent_axes
from mocca_robot.report.data import ReportData
from mocca_robot.report.drawing2d import FORCE_REACH, merged_forces, wedge_reach
from mocca_robot.report.drawing3d import displaced_3d
from mocca_robot.report.findings import State
from mocca_robot.report.palette import part_colours
from mocca_robot.statics.cases import CaseVerdict
from mocca_robot.tolerances import EXACT, TINY, VISIBLE

SHARP = np.deg2rad(25.0)
"""Edges between faces that turn by more are drawn as lines."""


def scene(data: ReportData, found: Sequence[State], approach: float) -> dict[str, Any]:
    """Return what the viewer needs, as plain JSON values; arrays are base64 (see `packed`)."""
    source, built = data.design.source, data.design.assembly
    bounds = np.array([p.shape.bounds for p in built.parts])
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    order = {s.part: k for k, s in enumerate(found)}
    ways = {i.part: np.asarray(i.direction) for i in data.design.insertion}
    colours = part_colours(data.after.graph)
    parts = []
    for k, part in enumerate(built.parts):
        way = ways.get(part.name, np.array([0.0, 0.0, -1.0]))
        parts.append(
            {
                "name": part.name,
                "colour": colours[k],
                "step": order.get(part.name, -1),
                "centroid": _list(part.centroid),
                "travel": _list(-approach * built.size * way),
                "result": packed(part.shape),
                "input": packed(source.parts[k].shape),
            }
        )
    fallen = [c for c in data.after.cases if c.moving]
    before = [c for c in data.before.cases if c.moving]
    standing = [c for c in data.after.cases if c.result.stands]
    return {
        "centre": _list((low + high) / 2),
        "size": built.size,
        "parts": parts,
        "cones": {"asked": _lines(_cones(data, asked=True)), "free": _lines(_cones(data, asked=False))},
        "forces": _lines(_forces(built, data.after.contacts, standing[0])) if standing else _lines(np.zeros((0, 2, 3))),
        "collapse": {
            "result": _motions(built, fallen[0]) if fallen else None,
            "input": _motions(source, before[0]) if before else None,
        },
        "states": {
            str(k + 1): _motions(built, s.verdict) for k, s in enumerate(found) if s.verdict and s.verdict.moving
        },
    }


def packed(shape: object) -> dict[str, Any]:
    """Return a mesh as {low, step, vertices (u16), faces, edges, wide}: position = low + step × vertex.

    Indices are u16, or u32 where `wide`. 1/65535 of the part's own box is finer than any screen.
    """
    assert isinstance(shape, Mesh)
    low, high = shape.bounds
    step = np.maximum(high - low, EXACT) / 65535.0
    grid = np.round((shape.vertices - low) / step).astype("<u2")
    wide = len(grid) > 65535
    kind = "<u4" if wide else "<u2"
    return {
        "low": _list(low),
        "step": _list(step),
        "vertices": _base64(grid),
        "faces": _base64(shape.faces.astype(kind)),
        "edges": _base64(sharp_edges(shape).astype(kind)),
        "wide": wide,
    }


def sharp_edges(mesh: Mesh) -> NDArray[np.int64]:
    """Return (E, 2) vertex pairs of edges whose two faces turn by more than `SHARP`."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), TINY)[:, None]
    edges = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
    face = np.tile(np.arange(len(mesh.faces)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, face = edges[order], face[order]
    same = (edges[1:] == edges[:-1]).all(axis=1)
    first = np.flatnonzero(same)
    turn = np.einsum("ij,ij->i", normals[face[first]], normals[face[first + 1]])
    return np.asarray(edges[first[turn < np.cos(SHARP)]])


def _cones(data: ReportData, asked: bool) -> Array:
    """Return line segments (m, 2, 3): at each centroid, apex to rim and around the rim of the cone."""
    assembly = data.design.assembly
    azimuths = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    lines = []
    for item in data.design.insertion:
        part = assembly.index(item.part)
        out, apex = -np.asarray(item.direction), assembly.parts[part].centroid
        axes = tangent_axes(out)
        normals = data.after.graph.motion(part).normals
        lean = np.full(24, assembly.alpha_rad or 0.0) if asked else free_reach(normals, out, axes, azimuths)
        around = np.cos(azimuths)[:, None] * axes[0] + np.sin(azimuths)[:, None] * axes[1]
        length = assembly.size * wedge_reach(len(data.design.insertion)) * (1.4 if asked else 1.0)
        rim = apex + length * (np.cos(lean)[:, None] * out + np.sin(lean)[:, None] * around)
        spokes = np.stack([np.broadcast_to(apex, rim.shape), rim], axis=1)[:: 3 if asked else 2]
        lines.append(np.concatenate([spokes, np.stack([rim, np.roll(rim, -1, axis=0)], axis=1)]))
    return np.concatenate(lines) if lines else np.zeros((0, 2, 3))


def _forces(assembly: Assembly, contacts: Sequence[Contact], verdict: CaseVerdict) -> Array:
    """Return an arrow (three segments) per pair of parts: the resultant at its centre, length ∝ √force."""
    pairs, points, vectors = merged_forces(contacts, np.nan_to_num(verdict.result.forces))
    _, owner = np.unique(pairs, axis=0, return_inverse=True)
    owner = owner.ravel()
    weight = np.linalg.norm(vectors, axis=1)
    total = np.bincount(owner, weights=weight)
    resultant = np.stack([np.bincount(owner, weights=vectors[:, k]) for k in range(3)], axis=1)
    centre = np.stack([np.bincount(owner, weights=weight * points[:, k]) for k in range(3)], axis=1)
    size = np.linalg.norm(resultant, axis=1)
    kept = size > VISIBLE * size.max(initial=0.0)
    centre, resultant, size = centre[kept] / total[kept][:, None], resultant[kept], size[kept]
    length = FORCE_REACH * assembly.size * np.sqrt(size / size.max(initial=TINY))
    along = resultant / size[:, None]
    side = tangents(along)[:, 0]
    tip = centre + along * length[:, None]
    barbs = [tip - (0.2 * along + sign * 0.1 * side) * length[:, None] for sign in (1.0, -1.0)]
    return np.concatenate([np.stack([other, tip], axis=1) for other in (centre, *barbs)])


def _motions(assembly: Assembly, verdict: CaseVerdict) -> list[list[float]]:
    return [_list(m) for m in displaced_3d(assembly, verdict.result.motions)]


def _lines(segments: Array) -> str:
    return _base64(segments.astype("<f4"))


def _base64(array: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")


def _list(values: Array) -> list[float]:
    return [float(f"{v:.9g}") for v in values]
