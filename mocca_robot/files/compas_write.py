"""Assemblies for COMPAS, written without COMPAS itself: compas_assembly's Assembly and compas_dem's BlockModel."""

from __future__ import annotations

import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Part
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.surface import triangulated
from mocca_robot.files.output import write_json
from mocca_robot.geometry.extrusion import standing, surface
from mocca_robot.geometry.facets import facets
from mocca_robot.tolerances import ROUNDING


def write_compas(assembly: Assembly, path: Path, contacts: Sequence[Contact] = (), kind: str = "assembly") -> Path:
    """Return `path` after writing `assembly` for COMPAS, in metres.

    `kind` 'assembly' is compas_assembly's Assembly: a node per part in assembly order, fixed parts as supports,
    the `contacts` of solids as interfaces. 'model' is compas_dem's BlockModel. Flat parts become plates that stand
    in the x–z plane; their contacts are left to COMPAS. Flat regions of a mesh are written as polygons where they have
    one outline.
    """
    data = _assembly_data(assembly, contacts) if kind == "assembly" else _model_data(assembly)
    return write_json(path, data)


def _assembly_data(assembly: Assembly, contacts: Sequence[Contact]) -> dict[str, Any]:
    nodes = {}
    for k, part in enumerate(assembly.parts):
        block = _object("compas_assembly.datastructures/Block", _mesh_data(part), f"{assembly.name}/{part.name}")
        block["inheritance"] = ["compas.datastructures/Mesh"]
        x, y, z = standing(part.centroid).tolist()
        nodes[str(k)] = {
            "x": x,
            "y": y,
            "z": z,
            "block": {**block, "name": part.name},
            "is_support": bool(part.fixed),
        }
    edges: dict[str, dict[str, Any]] = {k: {} for k in nodes}
    for contact in contacts if assembly.dimension == 3 else ():
        i, j = contact.parts
        edge = edges[str(i)].setdefault(str(j), {"interfaces": []})
        edge["interfaces"].append(_interface(contact, f"{assembly.name}/{i}/{j}/{contact.k}"))
    graph = _object(
        "compas.datastructures/Graph",
        {
            "attributes": {},
            "default_node_attributes": {
                "x": 0.0,
                "y": 0.0,
                "z": 0.0,
                "block": None,
                "is_support": False,
                "displacement": [0, 0, 0, 0, 0, 0],
            },
            "default_edge_attributes": {"interfaces": None},
            "node": nodes,
            "edge": edges,
            "max_node": len(nodes) - 1,
        },
        f"{assembly.name}/graph",
    )
    data = {"attributes": {"name": assembly.name}, "graph": graph}
    return _object("compas_assembly.datastructures/Assembly", data, assembly.name)


def _model_data(assembly: Assembly) -> dict[str, Any]:
    elements = {}
    for part in assembly.parts:
        seed = f"{assembly.name}/{part.name}"
        element = _object(
            "compas_dem.elements/Block",
            {
                "transformation": None,
                "features": [],
                "name": part.name,
                "material": None,
                "geometry": _object("compas.datastructures/Mesh", _mesh_data(part), f"{seed}/mesh"),
                "is_support": bool(part.fixed),
            },
            seed,
        )
        inheritance = ["compas_model.elements/Element"]
        elements[element["guid"]] = {**element, "inheritance": inheritance, "name": part.name}
    children = [{"name": "ElementNode", "element": guid} for guid in elements]
    nodes = {str(k): {"element": guid} for k, guid in enumerate(elements)}
    data = {
        "transformation": None,
        "elements": elements,
        "materials": {},
        "tree": {"attributes": {}, "root": {"name": "root", "children": children}},
        "graph": {
            "attributes": {},
            "default_node_attributes": {"x": 0.0, "y": 0.0, "z": 0.0, "element": None},
            "default_edge_attributes": {"modifiers": None, "contacts": None},
            "node": nodes,
            "edge": {k: {} for k in nodes},
            "max_node": len(nodes) - 1,
        },
    }
    model = _object("compas_dem.models/BlockModel", data, assembly.name)
    return {**model, "inheritance": ["compas_model.models/Model"], "name": assembly.name}


def _mesh_data(part: Part) -> dict[str, Any]:
    vertices, faces = _polygons(part)
    return {
        "attributes": {"name": part.name, "density": float(part.density)},
        "default_vertex_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
        "default_edge_attributes": {},
        "default_face_attributes": {},
        "vertex": {str(k): dict(zip("xyz", p)) for k, p in enumerate(vertices.tolist())},
        "face": {str(k): face for k, face in enumerate(faces)},
        "facedata": {str(k): {} for k in range(len(faces))},
        "edgedata": {},
        "max_vertex": len(vertices) - 1,
        "max_face": len(faces) - 1,
    }


def _polygons(part: Part) -> tuple[Array, list[list[int]]]:
    """Return vertices and faces, flat regions as one polygon each where they have no hole."""
    mesh = surface(part)
    found = facets([mesh], ROUNDING * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))))
    faces: list[list[int]] = []
    for facet in range(len(found.count)):
        loops = found.loops(facet)
        if len(loops) == 1 and len(set(loops[0].tolist())) == len(loops[0]):
            faces.append([int(v) for v in loops[0]])
        else:
            faces += [[int(v) for v in t] for t in found.triangles_of(facet)]
    used, index = np.unique(np.concatenate([np.array(f) for f in faces]), return_inverse=True)
    renumbered = iter(index.tolist())
    return found.vertices[used], [[next(renumbered) for _ in face] for face in faces]


def _interface(contact: Contact, seed: str) -> dict[str, Any]:
    along = contact.polygon[1] - contact.polygon[0]
    along = along / np.linalg.norm(along)
    frame = {
        "point": contact.centre.tolist(),
        "xaxis": along.tolist(),
        "yaxis": np.cross(contact.normal, along).tolist(),
    }
    points = [_object("compas.geometry/Point", p, f"{seed}/{k}") for k, p in enumerate(contact.polygon.tolist())]
    return _object(
        "compas_assembly.datastructures/Interface",
        {
            "points": points,
            "size": contact.measure,
            "frame": _object("compas.geometry/Frame", frame, f"{seed}/frame"),
            "forces": None,
            "mesh": _surface(contact, f"{seed}/mesh") if contact.holes else None,
        },
        seed,
    )


def _surface(contact: Contact, seed: str) -> dict[str, Any]:
    """Return a contact with holes, which an outline alone would close, as a Mesh."""
    vertices, faces = triangulated(contact)
    data = {
        "attributes": {},
        "vertex": {str(k): dict(zip("xyz", p)) for k, p in enumerate(vertices.tolist())},
        "face": {str(k): face for k, face in enumerate(faces.tolist())},
        "facedata": {},
        "edgedata": {},
        "max_vertex": len(vertices) - 1,
        "max_face": len(faces) - 1,
    }
    return _object("compas.datastructures/Mesh", data, seed)


def _object(dtype: str, data: Any, seed: str) -> dict[str, Any]:
    """Return a COMPAS object; its guid follows from `seed`, so that the same assembly gives the same file."""
    return {"dtype": dtype, "data": data, "guid": str(uuid.uuid5(uuid.NAMESPACE_URL, f"mocca-robot/{seed}/{dtype}"))}
