"""3MF: objects and components, also those that slicers keep in files of their own (production extension)."""

from __future__ import annotations

import posixpath
import re
import xml.etree.ElementTree as ET
import zipfile
import zlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.errors import InputError

UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "inch": "in", "foot": "ft", "meter": "m"}
MAX_DEPTH, MAX_PIECES = 10, 5000
"""Components inside components; meshes that all of them come to."""
_PATH = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}path"

UNREADABLE = (ArithmeticError, EOFError, LookupError, NotImplementedError, OSError, RuntimeError, ValueError)
"""What a damaged package can raise."""

Piece = tuple[str, Array, IntArray]
"""A name, vertices (V, 3) in the file's unit, triangles (F, 3)."""


@dataclass
class _Package:
    archive: zipfile.ZipFile
    where: str
    documents: dict[str, ET.Element] = field(default_factory=dict)
    pieces: int = 0

    def document(self, path: str) -> ET.Element:
        path = posixpath.normpath(path.lstrip("/"))
        if path not in self.documents:
            try:
                content = self.archive.read(path)
            except (*UNREADABLE, zipfile.BadZipFile, zlib.error) as error:
                raise self.damaged(f"its part '{path}' cannot be read ({error})") from None
            if b"<!ENTITY" in content or b"<!DOCTYPE" in content:
                raise self.damaged(f"'{path}' declares XML entities")
            try:
                self.documents[path] = ET.fromstring(content)
            except (ET.ParseError, ValueError, LookupError) as error:
                raise self.damaged(f"'{path}' is no XML ({error})") from None
        return self.documents[path]

    def damaged(self, what: str) -> InputError:
        return InputError(f"{self.where} cannot be read as 3MF: {what}. Export it again.")

    def objects(self, path: str) -> dict[str, ET.Element]:
        return {e.get("id", ""): e for e in self.document(path).iter() if _tag(e) == "object"}

    def meshes(self, path: str, number: str, matrix: Array, depth: int) -> list[tuple[Array, IntArray]]:
        """Return vertices and triangles of everything that an object consists of."""
        thing = self.objects(path).get(number)
        self.pieces += 1
        if thing is None:
            raise self.damaged(f"object {number[:20]!r} of '{path}' is missing")
        if depth > MAX_DEPTH or self.pieces > MAX_PIECES:
            raise self.damaged(f"more than {MAX_PIECES} components, or deeper than {MAX_DEPTH}")
        found: list[tuple[Array, IntArray]] = []
        for child in thing:
            if _tag(child) == "mesh":
                found.append(self.mesh(child, matrix))
            for part in child if _tag(child) == "components" else ():
                inner = matrix @ self.transform(part)
                found += self.meshes(part.get(_PATH, path), part.get("objectid", ""), inner, depth + 1)
        return found

    def mesh(self, mesh: ET.Element, matrix: Array) -> tuple[Array, IntArray]:
        try:
            rows = [[float(v.attrib[a]) for a in "xyz"] for v in mesh.iter() if _tag(v) == "vertex"]
            faces = [[int(t.attrib[a]) for a in ("v1", "v2", "v3")] for t in mesh.iter() if _tag(t) == "triangle"]
            vertices, triangles = np.array(rows).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3)
        except (KeyError, ValueError, OverflowError) as error:
            raise self.damaged(f"a vertex or triangle is broken ({error})") from None
        if len(triangles) and not (triangles.min() >= 0 and triangles.max() < len(vertices)):
            raise self.damaged("a triangle names a vertex that does not exist")
        if np.linalg.det(matrix[:3, :3]) < 0:
            triangles = triangles[:, ::-1]
        return vertices @ matrix[:3, :3].T + matrix[:3, 3], triangles

    def transform(self, element: ET.Element) -> Array:
        text = element.get("transform")
        matrix = np.eye(4)
        if text:
            try:
                matrix[:3] = np.array(text.split(), dtype=np.float64).reshape(4, 3).T
            except ValueError:
                raise self.damaged(f"a transform is {text[:40]!r}, not twelve numbers") from None
        return matrix

    def given_names(self) -> dict[str, str]:
        """Return the names that slicers keep beside the model, by object."""
        if "Metadata/model_settings.config" not in self.archive.namelist():
            return {}
        found = {}
        for thing in self.document("Metadata/model_settings.config"):
            for entry in thing if _tag(thing) == "object" else ():
                if _tag(entry) == "metadata" and entry.get("key") == "name" and entry.get("value"):
                    found[thing.get("id", "")] = entry.get("value", "")
        return found


def read_threemf(path: Path) -> tuple[list[Piece], str]:
    """Return the pieces of the items to build, each named by its object, and the unit of their numbers.

    Raises InputError for broken archives and models, missing objects and components nested without end.
    """
    try:
        archive = zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read as 3MF: {error}. Export it again.") from None
    with archive:
        reader = _Package(archive, str(path))
        start = _model_path(reader)
        root = reader.document(start)
        unit = UNITS.get(root.get("unit", "millimeter"))
        if unit is None:
            raise reader.damaged(f"its unit is {root.get('unit')!r}, none of {', '.join(UNITS)}")
        names = reader.given_names()
        items = [e for e in root.iter() if _tag(e) == "item"]
        wanted = [(e.get(_PATH, start), e.get("objectid", ""), reader.transform(e)) for e in items]
        wanted = wanted or [(start, number, np.eye(4)) for number in reader.objects(start)]
        found: list[Piece] = []
        for where, number, matrix in wanted:
            thing = reader.objects(where).get(number)
            if thing is not None and thing.get("type", "model") not in ("model", "solidsupport"):
                continue
            label = thing.get("name", "") if thing is not None else ""
            name = label or names.get(number, "") or path.stem
            found += [(name, v, f) for v, f in reader.meshes(where, number, matrix, 0) if len(f)]
    if not found:
        raise InputError(f"{path} holds no triangles.")
    return found, unit


def _model_path(reader: _Package) -> str:
    """Return the main model: the one that the package's relationships name, else the usual one."""
    listed = reader.archive.namelist()
    if "_rels/.rels" in listed:
        for entry in reader.document("_rels/.rels"):
            if re.search(r"/3dmodel$", entry.get("Type", "")) and entry.get("Target"):
                return posixpath.normpath(entry.get("Target", "").lstrip("/"))
    return next((n for n in listed if n.lower().endswith(".model")), "3D/3dmodel.model")


def _tag(element: ET.Element) -> str:
    return element.tag.rsplit("}", 1)[-1] if isinstance(element.tag, str) else ""
