"""`mocca-robot/assembly`: an assembly as JSON, and the same block inside other files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import DEFAULT_DENSITY, DEFAULT_THICKNESS, Assembly, Mesh, Part, Polygon, Shape
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.actions_data import (
    actions_from_data,
    actions_to_data,
    combinations_from_data,
    combinations_to_data,
)
from mocca_robot.files.documents import parse_json, read_text
from mocca_robot.files.goals import degrees, goals_from_data, goals_to_data
from mocca_robot.files.output import safe_file_names, write_json
from mocca_robot.files.rings import checked_polygon
from mocca_robot.files.versions import ASSEMBLY

MAX_PARTS = 5000

KEYS = (
    "format",
    "version",
    "units",
    "dimension",
    "name",
    "parts",
    "sequence",
    "goal",
    "alpha_deg",
    "gravity",
    "loads",
    "combinations",
)
PART_KEYS = ("name", "polygon", "holes", "thickness", "mesh", "density", "fixed", "material")


@dataclass(frozen=True, eq=False)
class AssemblyFile:
    """What an assembly file holds.

    Attributes:
        assembly: parts in the order of its sequence; possibly without a fixed part.
        unit: the file's unit.
        given: which of 'sequence', 'goal', 'alpha_deg', 'gravity', 'fixed' it states.
        notes: another version than the present one, repairs made while reading meshes.
    """

    assembly: Assembly
    unit: str
    given: frozenset[str]
    notes: tuple[str, ...] = ()


def read_assembly(path: Path) -> AssemblyFile:
    """Return the assembly in a `mocca-robot/assembly` JSON file; see `assembly_from_data` for the errors."""
    where = f"'{path}'"
    data = fields.mapping(parse_json(read_text(path), where), where)
    data, notes = ASSEMBLY.current(data, where)
    file = assembly_from_data(data, where, path.parent)
    return replace(file, notes=(*notes, *file.notes))


def assembly_from_data(data: Mapping[str, Any], where: str, folder: Path) -> AssemblyFile:
    """Return the assembly that a plain mapping describes; mesh paths are relative to `folder`.

    Raises InputError for unknown keys, missing units, unsound shapes, unknown names and parts left out of the
    sequence.
    """
    fields.mapping(data, where, KEYS)
    for key in ("units", "dimension", "parts"):
        if key not in data:
            example = {"units": '"mm"', "dimension": "2 for flat parts or 3 for solid ones", "parts": "[…]"}[key]
            raise InputError(f'{where} does not say its "{key}"; add "{key}": {example}.')
    unit = fields.choice(data["units"], tuple(fields.UNITS_M), f"{where}: units")
    dimension = fields.integer(data["dimension"], f"{where}: dimension", 2, 3)
    notes: list[str] = []
    parts = parts_from_data(data["parts"], where, unit, dimension, folder, notes)
    name = fields.part_name(data.get("name", "assembly"), f"{where}: name")
    given = {k for k in ("sequence", "goal", "alpha_deg", "gravity", "loads", "combinations") if k in data}
    given |= {"fixed"} if any(p.fixed for p in parts) else set()
    if "sequence" in data:
        parts = in_sequence(parts, fields.names(data["sequence"], f"{where}: sequence"), f"{where}: sequence")
    gravity = gravity_from_data(data["gravity"], dimension, f"{where}: gravity") if "gravity" in data else np.zeros(0)
    actions = actions_from_data(data.get("loads", []), parts, fields.UNITS_M[unit], f"{where}: loads")
    assembly = Assembly(
        name,
        parts,
        goals_from_data(data.get("goal", "equilibrium"), f"{where}: goal"),
        alpha_from_data(data.get("alpha_deg", 5.0), f"{where}: alpha_deg"),
        gravity,
        actions=actions,
        combinations=combinations_from_data(data.get("combinations"), actions, f"{where}: combinations"),
    )
    return AssemblyFile(assembly, unit, frozenset(given), tuple(notes))


def alpha_from_data(value: object, where: str) -> float | None:
    """Return α in radians from degrees, 0 ≤ α < 90; None stays None: assemblability is not asked for."""
    return None if value is None else float(np.deg2rad(fields.number(value, where, 0.0, below=90.0)))


def gravity_from_data(value: object, dimension: int, where: str) -> Array:
    """Return gravity (d,) in m/s² from a vector, or from a magnitude that points down."""
    if not isinstance(value, list):
        value = [0.0] * (dimension - 1) + [-fields.number(value, where, above=0.0)]
    gravity = fields.vector(value, where, (dimension,))
    if not 0.0 < float(np.abs(gravity).max()) < 1e6:
        raise InputError(f"{where} is {fields.shown(value)}; it needs a magnitude, for example 9.80665 m/s².")
    return gravity


def in_sequence(parts: tuple[Part, ...], sequence: tuple[str, ...], where: str) -> tuple[Part, ...]:
    """Return `parts` in the order of `sequence`; fixed parts may be left out of it, they come first anyway."""
    by_name = {p.name: p for p in parts}
    for name in sequence:
        fields.known_name(name, tuple(by_name), where)
    missing = [p.name for p in parts if p.name not in sequence and not p.fixed]
    if missing:
        listed = ", ".join(f"'{m}'" for m in missing[:8]) + (", …" if len(missing) > 8 else "")
        raise InputError(f"{where} leaves out {listed}; name every free part once, in the order of assembly.")
    first = tuple(p for p in parts if p.name not in sequence)
    return first + tuple(by_name[name] for name in sequence)


def parts_from_data(
    data: object, where: str, unit: str, dimension: int, folder: Path, notes: list[str]
) -> tuple[Part, ...]:
    """Return the parts of a list of plain mappings; repairs of meshes are appended to `notes`."""
    if not isinstance(data, list) or not data:
        raise InputError(f"{where}: parts must be a list with at least one part, not {fields.shown(data)}.")
    if len(data) > MAX_PARTS:
        raise InputError(f"{where} has {len(data)} parts; at most {MAX_PARTS} are read.")
    parts: list[Part] = []
    seen: set[str] = set()
    for index, entry in enumerate(data):
        place = f"{where}: parts[{index}]"
        fields.mapping(entry, place, PART_KEYS)
        if "name" not in entry:
            raise InputError(f"{place} has no name; add one.")
        name = fields.part_name(entry["name"], f"{place}.name")
        if name in seen:
            raise InputError(f"{where}: the name '{name}' is used by several parts; names must differ.")
        seen.add(name)
        spoken = f"{where}: part '{name}'"
        shape = _shape(entry, name, spoken, unit, dimension, folder, notes)
        density = fields.number(entry.get("density", DEFAULT_DENSITY), f"{spoken}: density", above=0.0, below=1e6)
        fixed = fields.boolean(entry.get("fixed", False), f"{spoken}: fixed")
        material = fields.part_name(entry["material"], f"{spoken}: material") if "material" in entry else ""
        parts.append(Part(name, shape, density, fixed, material))
    return tuple(parts)


def _shape(
    entry: Mapping[str, Any], name: str, spoken: str, unit: str, dimension: int, folder: Path, notes: list[str]
) -> Shape:
    needed, other = ("polygon", "mesh") if dimension == 2 else ("mesh", "polygon")
    if needed not in entry:
        raise InputError(f'{spoken} has no "{needed}"; a part of dimension {dimension} needs one.')
    unit_m = fields.UNITS_M[unit]
    foreign = [k for k in ((other, "holes", "thickness") if dimension == 3 else (other,)) if k in entry]
    if foreign:
        raise InputError(f'{spoken} has "{foreign[0]}", which does not belong to dimension {dimension}; remove it.')
    if dimension == 3:
        return _mesh(entry["mesh"], spoken, unit, folder, notes)
    holes = entry.get("holes", [])
    if not isinstance(holes, list):
        raise InputError(f"{spoken}: holes must be a list of rings, not {fields.shown(holes)}.")
    rings = [ring_from_data(entry["polygon"], f"{spoken}: polygon", unit_m)]
    rings += [ring_from_data(h, f"{spoken}: holes[{k}]", unit_m) for k, h in enumerate(holes)]
    thickness = fields.length(
        entry.get("thickness", DEFAULT_THICKNESS / unit_m), unit_m, f"{spoken}: thickness", None, above=0.0
    )
    if "thickness" not in entry:
        thickness = DEFAULT_THICKNESS

    def coordinates(point: Array) -> str:
        return f"({point[0] / unit_m:.6g}, {point[1] / unit_m:.6g}) {unit}"

    return checked_polygon(name, rings, thickness, coordinates)


def ring_from_data(data: object, where: str, unit_m: float) -> Array:
    """Return a list of [x, y] as an array (n, 2) in metres; metres stay bit for bit."""
    if not isinstance(data, list):
        raise InputError(f"{where} must be a list of [x, y] points, not {fields.shown(data)}.")
    points = np.empty((len(data), 2))
    limit = fields.LARGEST_M / unit_m
    for k, point in enumerate(data):
        if not isinstance(point, list) or len(point) != 2:
            raise InputError(f"{where}[{k}] must be a point [x, y], not {fields.shown(point)}.")
        for axis in (0, 1):
            points[k, axis] = fields.number(point[axis], f"{where}[{k}]", -limit, limit)
    return points * unit_m


def _mesh(data: object, spoken: str, unit: str, folder: Path, notes: list[str]) -> Mesh:
    from mocca_robot.files.meshes import read_mesh

    if not isinstance(data, str) or not data or not data.isprintable():
        raise InputError(f"{spoken}: mesh must be the path of a file, not {fields.shown(data)}.")
    try:
        named = read_mesh(folder / data, unit)
    except (OSError, UnicodeError, RecursionError) as error:
        raise InputError(f"{spoken}: the mesh '{data}' cannot be read: {error}.") from None
    notes.extend(f"{spoken}: {note}" for note in named.notes)
    return named.mesh


def assembly_to_data(assembly: Assembly, mesh_paths: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return `assembly` as plain data, in metres and with every bit; solids need their mesh paths by name."""
    return {
        "format": ASSEMBLY.name,
        "version": ASSEMBLY.version,
        "units": "m",
        "dimension": assembly.dimension,
        "name": assembly.name,
        "gravity": assembly.gravity.tolist(),
        "parts": parts_to_data(assembly, mesh_paths or {}),
        "sequence": list(assembly.sequence),
        "goal": goals_to_data(assembly.goals),
        "alpha_deg": None if assembly.alpha_rad is None else degrees(assembly.alpha_rad),
        **loads_to_data(assembly),
    }


def loads_to_data(assembly: Assembly) -> dict[str, Any]:
    """Return the keys of loads and their combinations, where there are any."""
    if not assembly.actions:
        return {}
    return {"loads": actions_to_data(assembly.actions), "combinations": combinations_to_data(assembly)}


def parts_to_data(assembly: Assembly, mesh_paths: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return one mapping per part, in assembly order."""
    found = []
    for part in assembly.parts:
        entry: dict[str, Any] = {"name": part.name, "fixed": bool(part.fixed), "density": float(part.density)}
        if part.material:
            entry["material"] = part.material
        if isinstance(part.shape, Polygon):
            entry["polygon"] = part.shape.exterior.tolist()
            if part.shape.holes:
                entry["holes"] = [h.tolist() for h in part.shape.holes]
            entry["thickness"] = float(part.shape.thickness)
        else:
            entry["mesh"] = mesh_paths[part.name]
        found.append(entry)
    return found


def write_assembly(assembly: Assembly, path: Path) -> Path:
    """Return `path` after writing `assembly` there; meshes of solids go into a folder `<stem>_parts` beside it."""
    paths = write_meshes(assembly, path.parent, f"{safe_file_names([path.stem])[path.stem]}_parts")
    return write_json(path, assembly_to_data(assembly, paths))


def write_meshes(assembly: Assembly, folder: Path, inside: str) -> dict[str, str]:
    """Return the relative path of each solid part's OBJ file after writing it into `folder`/`inside`.

    Flat parts need none. File names are derived from part names and never leave the folder.
    """
    if assembly.dimension == 2:
        return {}
    from mocca_robot.files.mesh_write import write_part
    from mocca_robot.files.output import move_into_place

    stems = safe_file_names(assembly.sequence)
    with move_into_place(folder / inside) as temporary:
        for part in assembly.parts:
            assert isinstance(part.shape, Mesh)
            write_part(part.shape, temporary / f"{stems[part.name]}.obj")
    return {name: f"{inside}/{stem}.obj" for name, stem in stems.items()}
