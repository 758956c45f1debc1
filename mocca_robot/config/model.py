"""Whatever holds parts → an Assembly: one place that knows which file format is which."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh, Part, Polygon, Shape
from mocca_robot.config.schema import GENERATORS, MODEL_FILES
from mocca_robot.errors import InputError, nearest
from mocca_robot.files import assembly_json, compas_read, design_json, fields
from mocca_robot.files.documents import existing_path, parse_json, read_text
from mocca_robot.files.versions import ASSEMBLY, DESIGN


@dataclass(frozen=True, eq=False, kw_only=True)
class Model:
    """Parts as they came, before a configuration adds what it knows.

    Attributes:
        assembly: in metres; possibly without a fixed part.
        unit_m: metres per unit of the model's numbers: the default unit of lengths in the configuration.
        unit: its name.
        given: which of 'sequence', 'goal', 'alpha_deg', 'gravity', 'fixed' the model itself states.
        insertion: insertion directions that the model states, by part.
        notes: what was repaired or left out.
        bodies: names in the file that hold several parts → these parts.
        friction: Coulomb coefficient that a design counts on; 0 for none.
    """

    assembly: Assembly
    unit_m: float
    unit: str
    given: frozenset[str] = frozenset()
    insertion: Mapping[str, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    bodies: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    friction: float = 0.0


_SOLID = "export the parts as OBJ, one object each"
OTHER_PROGRAMS = {
    "skp": f"in SketchUp, make every part a solid group and {_SOLID} (File, Export, 3D Model), or as GLB",
    "gh": "in Grasshopper, bake the parts to Rhino and export them as OBJ, one object each",
    "ghx": "in Grasshopper, bake the parts to Rhino and export them as OBJ, one object each",
    "blend": f"in Blender, {_SOLID} (File, Export, Wavefront), or as GLB",
    "iges": f"in your CAD program (FreeCAD will do), {_SOLID}, or as STEP",
    "igs": f"in your CAD program (FreeCAD will do), {_SOLID}, or as STEP",
    "ifc": f"in BlenderBIM or FreeCAD, {_SOLID}",
    "fcstd": "in FreeCAD, export the parts as 3MF or OBJ (File, Export)",
    "f3d": "in Fusion, export the bodies as 3MF (File, 3D Print, or Export)",
    "sldprt": "in SOLIDWORKS, save the assembly as 3MF",
    "sldasm": "in SOLIDWORKS, save the assembly as 3MF",
    "dwg": "in AutoCAD, save the drawing as DXF (R2010), or convert it with the ODA File Converter",
    "dae": f"in Blender, import it and {_SOLID}, or as GLB",
    "fbx": f"in Blender, import it and {_SOLID}, or as GLB",
    "rvt": "in Revit, export the parts as STEP or IFC and convert them in FreeCAD",
    "3ds": f"in Blender, import it and {_SOLID}, or as GLB",
    "gltf": "export it as one binary file (.glb)",
    "pdf": "in Inkscape, open the page and save it as SVG",
    "ai": "in Illustrator, save a copy as SVG",
    "eps": "in Inkscape, open it and save it as SVG",
    "png": "draw its outlines as paths (in Inkscape: Path, Trace Bitmap) and save them as SVG",
    "jpg": "draw its outlines as paths (in Inkscape: Path, Trace Bitmap) and save them as SVG",
}
"""Formats that are not read → what to export in the program that they come from."""


def read_model(path: Path, units: str | None, scale: float | None, rigid: Collection[str] = ()) -> Model:
    """Return the parts in a drawing, an assembly or design file, a mesh file or a folder of meshes.

    What a mesh file calls by a name in `rigid` is one part, however many bodies it has.

    `units` is required where the file says none, and has to agree where it does. Meshes of a size that looks like a
    wrong unit are refused unless somebody gave a `scale`, 1 included. Raises InputError.
    """
    existing_path(path)
    meant = scale is not None
    scale = 1.0 if scale is None else scale
    suffix = path.suffix.lower().lstrip(".")
    if path.is_dir():
        design = path / "design.json"
        return _from_json(design, units, scale) if design.is_file() else _from_meshes(path, units, scale, meant, rigid)
    if suffix in ("svg", "dxf"):
        return _from_drawing(path, units, scale)
    if suffix == "json":
        return _from_json(path, units, scale)
    if suffix in MODEL_FILES:
        return _from_meshes(path, units, scale, meant, rigid)
    if suffix in OTHER_PROGRAMS:
        raise InputError(f"'{path}' is not read here: {OTHER_PROGRAMS[suffix]}.")
    known = ", ".join(f".{m}" for m in MODEL_FILES)
    raise InputError(f"'{path}' ends in '.{suffix}', which is no model; use one of {known}, or a folder of meshes.")


def generated(data: Mapping[str, Any], folder: Path, scale: float, where: str) -> Model:
    """Return the assembly that a generator makes from `data`: its 'kind' and its parameters, in metres."""
    if "kind" not in data:
        raise InputError(f"{where} has no 'kind'; it is one of {', '.join(GENERATORS)}.")
    kind = fields.choice(data["kind"], GENERATORS, f"{where}.kind")
    try:
        from mocca_robot.generators import generate
    except ImportError as error:
        raise InputError(f"{where}: the generators cannot be loaded ({error}); install mocca-robot again.") from None
    parameters = {k: v for k, v in data.items() if k != "kind"}
    try:
        assembly = generate(kind, parameters, folder)
    except (OSError, ArithmeticError, UnicodeError, TypeError, ValueError) as error:
        raise InputError(f"{where}: '{kind}' cannot be made from these parameters: {error}.") from None
    return Model(assembly=scaled(assembly, scale), unit_m=1.0, unit="m", given=frozenset({"sequence", "fixed"}))


def turned_upright(model: Model) -> Model:
    """Return a model of solids whose y points up with z up: (x, y, z) becomes (x, −z, y), bit for bit."""

    def turned(vectors: Array) -> Array:
        return np.stack([vectors[..., 0], 0.0 - vectors[..., 2], vectors[..., 1]], axis=-1)

    shapes = [Mesh(turned(p.shape.vertices), p.shape.faces) for p in model.assembly.parts if isinstance(p.shape, Mesh)]
    interfaces = [replace(i, polygons=tuple(map(turned, i.polygons))) for i in model.assembly.interfaces]
    assembly = replace(
        model.assembly.with_shapes(shapes), gravity=turned(model.assembly.gravity), interfaces=tuple(interfaces)
    )
    if "gravity" not in model.given:
        assembly = replace(assembly, gravity=model.assembly.gravity)
    insertion = {name: turned(way) for name, way in model.insertion.items()}
    return replace(model, assembly=assembly, insertion=insertion)


def scaled(assembly: Assembly, factor: float) -> Assembly:
    """Return `assembly` with every coordinate times `factor`; thicknesses stay."""
    if factor == 1.0:
        return assembly
    interfaces = [replace(i, polygons=tuple(p * factor for p in i.polygons)) for i in assembly.interfaces]
    shapes = [_scaled(p.shape, factor) for p in assembly.parts]
    return replace(assembly.with_shapes(shapes), interfaces=tuple(interfaces))


def _scaled(shape: Shape, factor: float) -> Shape:
    if isinstance(shape, Polygon):
        return Polygon(shape.exterior * factor, tuple(h * factor for h in shape.holes), shape.thickness)
    return Mesh(shape.vertices * factor, shape.faces)


def _from_drawing(path: Path, units: str | None, scale: float) -> Model:
    from mocca_robot.files.dxf import read_dxf
    from mocca_robot.files.svg import read_svg

    drawing = (read_dxf if path.suffix.lower() == ".dxf" else read_svg)(path, units, scale)
    parts = tuple(Part(name, polygon) for name, polygon in drawing.parts)
    # Lengths in a configuration are real ones: a drawing that scales freely speaks millimetres.
    unit = drawing.unit if drawing.unit in fields.UNITS_M else "mm"
    return Model(assembly=Assembly(path.stem, parts), unit_m=fields.UNITS_M[unit], unit=unit, notes=drawing.notes)


def _from_json(path: Path, units: str | None, scale: float) -> Model:
    where = f"'{path}'"
    content = parse_json(read_text(path), where)
    if compas_read.is_compas(content):
        return _from_compas(content, path, units, scale)
    data = fields.mapping(content, where)
    found = data.get("format")
    if found == DESIGN.name:
        design = design_json.read_design(path)
        _require_same_unit(where, str(data["units"]), units)
        given = {"sequence", "gravity", "fixed", "alpha_deg"} | ({"goal"} if design.source else set())
        insertion = {i.part: i.direction for i in design.insertion}
        return Model(
            assembly=scaled(design.assembly, scale),
            unit_m=1.0,
            unit="m",
            given=frozenset(given),
            insertion=insertion,
            notes=design.notes,
            friction=0.0 if design.friction is None else design.friction.declared,
        )
    if found == ASSEMBLY.name:
        file = assembly_json.read_assembly(path)
        _require_same_unit(where, file.unit, units)
        return Model(
            assembly=scaled(file.assembly, scale),
            unit_m=fields.UNITS_M[file.unit],
            unit=file.unit,
            given=file.given,
            notes=file.notes,
        )
    if found is None:
        raise InputError(
            f'{where} has no "format"; an assembly begins with "format": "{ASSEMBLY.name}" (or, written by '
            'COMPAS, has a "dtype").'
        )
    raise InputError(
        f'{where} has "format": {fields.shown(found)}, which holds no parts; '
        f"{nearest(str(found)[:60], (ASSEMBLY.name, DESIGN.name))}"
    )


def _from_compas(content: object, path: Path, units: str | None, scale: float) -> Model:
    unit = units or "m"
    where = f"'{path}'"
    assembly, notes = compas_read.assembly_from_compas(content, path.stem, where, fields.UNITS_M[unit])
    if units is None:
        notes = (*notes, f"{where}: COMPAS files carry no unit; read as metres ('units' says otherwise)")
    given = {"sequence"} | ({"fixed"} if any(p.fixed for p in assembly.parts) else set())
    return Model(
        assembly=scaled(assembly, scale), unit_m=fields.UNITS_M[unit], unit=unit, given=frozenset(given), notes=notes
    )


def _require_same_unit(where: str, unit: str, declared: str | None) -> None:
    if declared is not None and declared != unit:
        raise InputError(f"{where} is in {unit}, but the configuration says units: {declared}; remove one of the two.")


def _from_meshes(path: Path, units: str | None, scale: float, any_size: bool, rigid: Collection[str]) -> Model:
    from mocca_robot.files.meshes import read_parts

    try:
        meshes = read_parts(path, units, any_size=any_size, rigid=rigid)
    except (OSError, UnicodeError, RecursionError, MemoryError, np.linalg.LinAlgError) as error:
        raise InputError(f"'{path}' cannot be read: {error}; export it again.") from None
    parts = tuple(Part(m.name, m.mesh) for m in meshes)
    if not parts:
        raise InputError(f"'{path}' holds no part; export one object per part.")
    unit = units or "m"
    notes = tuple(f"part '{m.name}': {note}" for m in meshes for note in m.notes)
    model = scaled(Assembly(path.stem, parts), scale)
    bodies: dict[str, tuple[str, ...]] = {}
    for m in meshes:
        bodies[m.object] = (*bodies.get(m.object, ()), m.name)
    several = {name: mine for name, mine in bodies.items() if len(mine) > 1}
    unit_m = fields.UNITS_M.get(unit, 1.0)
    return Model(assembly=model, unit_m=unit_m, unit=unit, notes=notes, bodies=several)
