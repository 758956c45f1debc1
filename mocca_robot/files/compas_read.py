"""Assemblies of COMPAS, read without COMPAS itself: its files are plain JSON.

Read are compas_assembly's Assembly and compas_cra's CRA_Assembly (blocks with supports), models of compas_model and
compas_dem (blocks, plates, beams, columns), and lists of meshes, also inside lists. COMPAS 1 writes "value" where 2
writes "data". COMPAS knows no unit: `unit_m` says what its numbers are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import DEFAULT_DENSITY, Assembly, Part, StatedInterface, on_the_ground
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.mending import repaired
from mocca_robot.geometry.polygon_cut import triangulated

ASSEMBLIES = ("Assembly", "CRA_Assembly")
MODELS = ("Model", "BlockModel")
KNOWN = "an Assembly (compas_assembly, compas_cra), a Model (compas_model, compas_dem) or a list of Meshes"
MAX_PARTS = 5000
MAX_NESTED = 8
"""Lists inside lists."""


@dataclass(frozen=True)
class _Block:
    """A part as COMPAS describes it, its polygons not yet cut into triangles."""

    name: str
    vertices: Array
    faces: list[list[int]]
    fixed: bool = False
    density: float = DEFAULT_DENSITY


def is_compas(data: object) -> bool:
    """Return whether parsed JSON is something that COMPAS wrote: an object with a dtype, or a list of such."""
    for _ in range(MAX_NESTED):
        if isinstance(data, list) and data:
            data = data[0]
    return isinstance(data, dict) and "dtype" in data


def assembly_from_compas(data: object, name: str, where: str, unit_m: float) -> tuple[Assembly, tuple[str, ...]]:
    """Return the parts of a COMPAS file in the order of its nodes or elements, and notes on repairs.

    Names are those of the blocks where they are there and differ, else `block_000` by node. Supports are fixed.
    Raises InputError for other objects, elements without a shape and open meshes.
    """
    blocks = list(_blocks(data, where))
    if not blocks:
        raise InputError(f"{where} holds no block; add blocks before saving the assembly.")
    if len(blocks) > MAX_PARTS:
        raise InputError(f"{where} has {len(blocks)} blocks; at most {MAX_PARTS} are read.")
    named = [b.name for b in blocks]
    distinct = all(named) and len(set(named)) == len(named)
    parts, notes = [], []
    for k, block in enumerate(blocks):
        called = fields.part_name(block.name, f"{where}: block {k}: name") if distinct else f"block_{k:03d}"
        triangles, _ = triangulated(block.vertices, block.faces)
        try:
            mesh, repairs = repaired(called, block.vertices * unit_m, triangles)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        parts.append(Part(called, mesh, block.density, block.fixed))
        notes += [f"part '{called}': {note}" for note in repairs]
    if isinstance(data, list) and len(parts) > 1:
        ground = on_the_ground(parts)
        parts = [replace(p, fixed=p.name in ground) for p in parts]
        listed = ", ".join(ground[:6]) + (", …" if len(ground) > 6 else "")
        notes.append(f"{where}: a list of meshes has no supports; the lowest stand on the ground: fixed: [{listed}]")
    interfaces = _interfaces(data, [p.name for p in parts], where, unit_m)
    if interfaces:
        notes.append(
            f"{where}: the {sum(len(i.polygons) for i in interfaces)} interfaces that it stores are its contacts"
        )
    return Assembly(name, tuple(parts), interfaces=interfaces), tuple(notes)


def _interfaces(data: object, names: list[str], where: str, unit_m: float) -> tuple[StatedInterface, ...]:
    """Return the interfaces that an Assembly stores on the edges of its graph; `names` are those of its nodes."""
    if not isinstance(data, dict) or _kind(data, where) not in ASSEMBLIES:
        return ()
    graph = _inner(_key(_inner(data, where), "graph", where), f"{where}: graph")
    number = dict(zip(_node_order(fields.mapping(graph["node"], f"{where}: node")), names))
    found = []
    for u, others in fields.mapping(graph.get("edge") or {}, f"{where}: edge").items():
        for v, edge in fields.mapping(others or {}, f"{where}: edge {fields.shown(u)}").items():
            place = f"{where}: edge {fields.shown(u)}–{fields.shown(v)}"
            given = fields.mapping(edge or {}, place)
            listed = given.get("interfaces") or ([given["interface"]] if given.get("interface") else [])
            if not isinstance(listed, list):
                raise InputError(f"{place}: interfaces must be a list, not {fields.shown(listed)}.")
            if listed and (u not in number or v not in number):
                raise InputError(f"{place} joins a node that is not there; save the assembly again.")
            polygons = [
                p * unit_m for k, one in enumerate(listed) for p in _interface(one, f"{place}: interfaces[{k}]")
            ]
            if polygons:
                found.append(StatedInterface((number[u], number[v]), tuple(polygons)))
    return tuple(found)


def _interface(data: object, where: str) -> list[Array]:
    """Return the polygons of an interface: the faces of its mesh where it has one, else its outline."""
    inner = _inner(fields.mapping(data, where), where)
    if inner.get("mesh"):
        block = _mesh_block(inner["mesh"], f"{where}: mesh")
        return [block.vertices[face] for face in block.faces if len(set(face)) >= 3]
    points = inner.get("points") or []
    if not isinstance(points, list):
        raise InputError(f"{where}: points must be a list, not {fields.shown(points)}.")
    return [_points([_coordinates(p) for p in points], f"{where}: points")]


def _coordinates(point: object) -> object:
    """Return what a point is written as: a list, a Point that holds one, or a mapping of x, y, z."""
    if isinstance(point, dict):
        inside = point.get("data", point.get("value", point))
        return [inside.get(a) for a in "xyz"] if isinstance(inside, dict) else inside
    return point


def _node_order(nodes: Mapping[str, Any]) -> list[str]:
    return sorted(nodes, key=lambda k: (0, int(k), k) if k.isdecimal() and len(k) < 10 else (1, 0, k))


def _blocks(data: object, where: str, depth: int = 0) -> Iterator[_Block]:
    if isinstance(data, list):
        if depth >= MAX_NESTED:
            raise InputError(f"{where}: lists lie in lists more than {MAX_NESTED} deep; save a plain list of meshes.")
        for k, entry in enumerate(data):
            yield from _blocks(entry, f"{where}[{k}]", depth + 1)
        return
    top = fields.mapping(data, where)
    kind = _kind(top, where)
    if "data" not in top and "value" not in top:
        raise InputError(f'{where} has no "data"; the file is damaged. Save it again with COMPAS.')
    if kind in ASSEMBLIES:
        yield from _assembly_blocks(_inner(top, where), where)
    elif kind in MODELS:
        yield from _model_blocks(_inner(top, where), where)
    elif kind in ("Mesh", "Block"):
        yield _mesh_block(top, where)
    else:
        raise InputError(f"{where} is a COMPAS {fields.shown(top['dtype'])}; read are {KNOWN}. Save one of these.")


def _kind(data: Mapping[str, Any], where: str) -> str:
    dtype = data.get("dtype")
    if not isinstance(dtype, str):
        raise InputError(
            f'{where} has the "dtype" {fields.shown(dtype)}; it must be a text. Save it again with COMPAS.'
        )
    return dtype.rsplit("/", 1)[-1]


def _assembly_blocks(data: Mapping[str, Any], where: str) -> Iterator[_Block]:
    graph = _inner(_key(data, "graph", where), f"{where}: graph")
    nodes = fields.mapping(_key(graph, "node", f"{where}: graph"), f"{where}: node")
    for key in _node_order(nodes):
        place = f"{where}: node {fields.shown(key)}"
        node = fields.mapping(nodes[key], place)
        block = fields.mapping(_key(node, "block", place), f"{place}: block")
        yield _mesh_block(block, f"{place}: block", bool(node.get("is_support")))


def _model_blocks(data: Mapping[str, Any], where: str) -> Iterator[_Block]:
    elements = fields.mapping(_key(data, "elements", where), f"{where}: elements")
    placed = _placements(data, where)
    for guid in _in_graph_order(data, elements):
        place = f"{where}: element {fields.shown(guid)}"
        element = fields.mapping(elements[guid], place)
        kind = _kind(element, place)
        if kind == "Group":
            continue
        inner = _inner(element, place)
        vertices, faces, density = _shape(kind, inner, place)
        transform = placed.get(guid, np.eye(4)) @ _transformation(inner.get("transformation"), place)
        moved = vertices @ transform[:3, :3].T + transform[:3, 3]
        if np.linalg.det(transform[:3, :3]) < 0:
            faces = [face[::-1] for face in faces]
        name = inner.get("name") or element.get("name") or ""
        yield _Block(str(name), _within_reach(moved, place), faces, bool(inner.get("is_support")), density)


def _in_graph_order(data: Mapping[str, Any], elements: Mapping[str, Any]) -> list[str]:
    """Return the elements' guids in the order of the interaction graph; those it leaves out come last."""
    graph = data.get("graph")
    nodes = graph.get("node") if isinstance(graph, dict) else None
    listed = [n.get("element") for n in nodes.values() if isinstance(n, dict)] if isinstance(nodes, dict) else []
    known = [g for g in dict.fromkeys(map(str, listed)) if g in elements]
    return known + [g for g in elements if g not in known]


def _placements(data: Mapping[str, Any], where: str) -> dict[str, Array]:
    """Return for each element's guid the transformation (4, 4) that the model and its groups give it."""
    elements = data["elements"]
    root = _transformation(data.get("transformation"), where)
    tree = data.get("tree")
    found: dict[str, Array] = {}
    waiting = [(tree.get("root"), root)] if isinstance(tree, dict) else []
    while waiting:
        node, transform = waiting.pop()
        children = node.get("children") if isinstance(node, dict) else None
        for child in children if isinstance(children, list) else []:
            guid = child.get("element") if isinstance(child, dict) else None
            if not isinstance(guid, str) or guid not in elements or guid in found:
                continue
            found[guid] = transform
            own = elements[guid].get("data") if isinstance(elements[guid], dict) else None
            inside = own.get("transformation") if isinstance(own, dict) else None
            waiting.append((child, transform @ _transformation(inside, f"{where}: element {fields.shown(guid)}")))
    return {g: found.get(g, root) for g in elements}


def _shape(kind: str, data: Mapping[str, Any], where: str) -> tuple[Array, list[list[int]], float]:
    """Return vertices (V, 3) and polygons of an element in its own frame, and its density."""
    if kind == "PlateElement":
        polygon = _inner(_key(data, "polygon", where), f"{where}: polygon")
        points = _points(_key(polygon, "points", where), f"{where}: polygon")
        normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
        length = float(np.linalg.norm(normal))
        if length == 0.0:
            raise InputError(f"{where}: its polygon encloses no area; draw it again.")
        thickness = fields.number(_key(data, "thickness", where), f"{where}: thickness", above=0.0)
        n = len(points)
        below = points - normal / length * thickness
        around = [[k, n + k, n + (k + 1) % n, (k + 1) % n] for k in range(n)]
        return (
            np.concatenate([points, below]),
            [list(range(n)), list(range(2 * n - 1, n - 1, -1)), *around],
            DEFAULT_DENSITY,
        )
    if kind in ("BeamElement", "ColumnElement"):
        along = "length" if kind == "BeamElement" else "height"
        size = [fields.number(_key(data, k, where), f"{where}: {k}", above=0.0) for k in ("width", "depth", along)]
        unit = np.array(
            [[x, y, z] for z in (0.0, 1.0) for x, y in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))]
        )
        sides = [[k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k] for k in range(4)]
        return unit * np.array(size), [[3, 2, 1, 0], [4, 5, 6, 7], *sides], DEFAULT_DENSITY
    if data.get("geometry") is None:
        raise InputError(
            f"{where} is a {kind} without a shape: compas_model does not save it. Use compas_dem's Block, or save an "
            "Assembly of compas_assembly."
        )
    geometry = fields.mapping(data["geometry"], f"{where}: geometry")
    if _kind(geometry, f"{where}: geometry") != "Mesh":
        raise InputError(f"{where} has a {fields.shown(geometry['dtype'])} as its shape; convert it to a Mesh first.")
    block = _mesh_block(geometry, f"{where}: geometry")
    return block.vertices, block.faces, block.density


def _mesh_block(data: object, where: str, fixed: bool = False) -> _Block:
    given = fields.mapping(data, where)
    _kind(given, where)
    inner = _inner(given, where)
    vertex = fields.mapping(_key(inner, "vertex", where), f"{where}: vertex")
    face = fields.mapping(_key(inner, "face", where), f"{where}: face")
    index = {key: k for k, key in enumerate(vertex)}
    points = np.zeros((len(vertex), 3))
    for key, k in index.items():
        entry = fields.mapping(vertex[key], f"{where}: vertex {fields.shown(key)}")
        points[k] = [
            fields.number(entry.get(a, 0.0), f"{where}: vertex {fields.shown(key)}.{a}", -1e12, 1e12) for a in "xyz"
        ]
    faces = []
    for key, corners in face.items():
        if not isinstance(corners, list) or not all(str(c) in index for c in corners):
            raise InputError(
                f"{where}: face {fields.shown(key)} is {fields.shown(corners)}; it must list vertices of the mesh."
            )
        faces.append([index[str(c)] for c in corners])
    attributes = fields.mapping(inner.get("attributes") or {}, f"{where}: attributes")
    name = given.get("name") or attributes.get("name") or ""
    return _Block(str(name), _within_reach(points, where), faces, fixed, _density(attributes, where))


def _density(attributes: Mapping[str, Any], where: str) -> float:
    value = attributes.get("density")
    return DEFAULT_DENSITY if value is None else fields.number(value, f"{where}: density", above=0.0, below=1e6)


def _transformation(data: object, where: str) -> Array:
    if data is None:
        return np.eye(4)
    inner = _inner(fields.mapping(data, f"{where}: transformation"), f"{where}: transformation")
    rows = inner.get("matrix")
    if not isinstance(rows, list) or len(rows) != 4:
        raise InputError(f"{where}: its transformation has no matrix of 4 × 4; save it again with COMPAS.")
    return np.array([fields.vector(r, f"{where}: transformation", (4,)) for r in rows])


def _points(data: object, where: str) -> Array:
    if not isinstance(data, list) or len(data) < 3:
        raise InputError(f"{where} must be a list of at least three points, not {fields.shown(data)}.")
    return _within_reach(np.array([fields.vector(p, f"{where}[{k}]", (3,)) for k, p in enumerate(data)]), where)


def _within_reach(points: Array, where: str) -> Array:
    if len(points) and np.abs(points).max() > 1e9:
        raise InputError(f"{where}: a coordinate is {np.abs(points).max():.3g}; check the model's scale.")
    return points


def _inner(data: object, where: str) -> dict[str, Any]:
    """Return what lies in an object's "data", or "value" with COMPAS 1 (Graphs may stand without)."""
    given = fields.mapping(data, where)
    key = next((k for k in ("data", "value") if k in given), None)
    return given if key is None else fields.mapping(given[key], f"{where}: {key}")


def _key(data: Mapping[str, Any], key: str, where: str) -> Any:
    if key not in data:
        raise InputError(f'{where} has no "{key}"; the file is damaged. Save it again with COMPAS.')
    return data[key]
