"""`mocca-robot/design`: what a run leaves behind, written whole and read back bit for bit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Equilibrium, Interlocking
from mocca_robot.contacts.friction import TANGENTIAL_RATIO
from mocca_robot.design import CaseResult, CountedFriction, Design, Insertion
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.assembly_json import (
    assembly_from_data,
    assembly_to_data,
    gravity_from_data,
    in_sequence,
    parts_from_data,
    parts_to_data,
    write_meshes,
)
from mocca_robot.files.documents import parse_json, read_text
from mocca_robot.files.goals import degrees
from mocca_robot.files.output import make_folder, write_json
from mocca_robot.files.versions import ASSEMBLY, DESIGN

KEYS = (
    *("format", "version", "units", "dimension", "name", "gravity", "parts", "sequence", "insertion", "joints"),
    *("load_cases", "features", "seconds", "notes", "friction", "source"),
)


@dataclass(frozen=True, eq=False)
class StoredJoint:
    """A joint as the file describes it; its surface is part of the parts' geometry.

    Attributes:
        parts: names, the earlier part first.
        kind: 'planar', 'n', 'z', 'bicubic', …
        direction: principal direction u, unit, (d,).
        parameters: the numbers that generated the surface; metres and radians.
    """

    parts: tuple[str, str]
    kind: str
    direction: Array
    parameters: Mapping[str, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class StoredDesign:
    """A design read back from its files.

    Attributes:
        path: the design.json.
        assembly: the built geometry, with the goals and α it was designed for.
        source: the assembly as it was handed in; None in files of other programs.
        insertion: one per free part.
        joints: one per contact of the source.
        load_cases: infeasibility before and after.
        features: kinds of the goals.
        seconds: wall time by stage.
        notes: what a reader should know.
        friction: what it counts on; None for none.
    """

    path: Path
    assembly: Assembly
    source: Assembly | None
    insertion: tuple[Insertion, ...]
    joints: tuple[StoredJoint, ...]
    load_cases: tuple[CaseResult, ...]
    features: tuple[str, ...]
    seconds: Mapping[str, float]
    notes: tuple[str, ...]
    friction: CountedFriction | None = None

    def __repr__(self) -> str:
        return f"<StoredDesign {self.assembly.name!r}: {self.assembly.said}, {len(self.joints)} joints, {self.path}>"


def write_design(design: Design, folder: str | Path) -> Path:
    """Return the path of design.json after writing `design` into `folder` (created).

    Solids go to parts/NAME.obj and, as handed in, to source/NAME.obj; design.json is written last, so that it
    never names a file that is not there. Raises EnvironmentNeeded when the folder cannot be written.
    """
    target = make_folder(folder)
    built = write_meshes(design.assembly, target, "parts")
    source = write_meshes(design.source, target, "source")
    return write_json(target / "design.json", design_to_data(design, built, source))


def design_to_data(design: Design, built: Mapping[str, str], source: Mapping[str, str]) -> dict[str, Any]:
    """Return the content of design.json; `built` and `source` are the mesh paths of solids by part name."""
    assembly = design.assembly
    return {
        "format": DESIGN.name,
        "version": DESIGN.version,
        "units": "m",
        "dimension": assembly.dimension,
        "name": assembly.name,
        "gravity": assembly.gravity.tolist(),
        "parts": parts_to_data(assembly, built),
        "sequence": list(assembly.sequence),
        "insertion": [
            {"part": i.part, "direction": np.asarray(i.direction).tolist(), "alpha_deg": degrees(i.alpha_rad)}
            for i in design.insertion
        ],
        "joints": [
            {
                "parts": [assembly.parts[p].name for p in joint.contact.parts],
                "type": joint.kind,
                "principal_direction": np.asarray(joint.direction).tolist(),
                "parameters": {key: float(value) for key, value in joint.parameters.items()},
            }
            for joint in design.joints
        ],
        "load_cases": [
            {
                "name": case.name,
                "infeasibility_before": float(case.infeasibility_before),
                "infeasibility_after": float(case.infeasibility_after),
            }
            for case in design.load_cases
        ],
        "features": list(features(design.source)),
        "seconds": {key: float(value) for key, value in design.seconds.items()},
        "notes": list(design.notes),
        **({} if design.friction is None else {"friction": design.friction.data()}),
        "source": assembly_to_data(design.source, source),
    }


def features(assembly: Assembly) -> tuple[str, ...]:
    """Return the kinds of the goals, with the gravity equilibrium that all but interlocking include."""
    kinds = [g.kind for g in assembly.goals]
    if any(not isinstance(g, Interlocking) for g in assembly.goals):
        kinds.insert(0, Equilibrium.kind)
    return tuple(dict.fromkeys(kinds))


def read_design(path: str | Path) -> StoredDesign:
    """Return the design in a design.json file, or in a folder that holds one.

    Raises InputError for another format, a newer version, missing mesh files and everything an assembly can
    have wrong.
    """
    file = Path(path)
    file = file / "design.json" if file.is_dir() else file
    where = f"'{file}'"
    data = fields.mapping(parse_json(read_text(file), where), where)
    data, said = DESIGN.current(data, where)
    fields.mapping(data, where, KEYS)
    for key in ("units", "dimension", "name", "parts", "sequence"):
        if key not in data:
            raise InputError(f'{where} has no "{key}"; it is incomplete. Run the design again.')
    dimension = fields.integer(data["dimension"], f"{where}: dimension", 2, 3)
    unit = fields.choice(data["units"], tuple(fields.UNITS_M), f"{where}: units")
    notes = [*said, *_texts(data.get("notes", []), f"{where}: notes")]
    parts = parts_from_data(data["parts"], where, unit, dimension, file.parent, notes)
    parts = in_sequence(parts, fields.names(data["sequence"], f"{where}: sequence"), f"{where}: sequence")
    source = None
    if data.get("source") is not None:
        block = fields.mapping(data["source"], f"{where}: source")
        block, said = ASSEMBLY.current({"format": ASSEMBLY.name, **block}, f"{where}: source")
        notes.extend(said)
        source = assembly_from_data(block, f"{where}: source", file.parent).assembly
    insertion = _insertions(data.get("insertion", []), dimension, [p.name for p in parts], f"{where}: insertion")
    gravity = gravity_from_data(data["gravity"], dimension, f"{where}: gravity") if "gravity" in data else np.zeros(0)
    assembly = Assembly(
        fields.part_name(data["name"], f"{where}: name"),
        parts,
        source.goals if source else (Equilibrium(),),
        source.alpha_rad if source else _asked_alpha(insertion),
        gravity,
        actions=source.actions if source else (),
        combinations=source.combinations if source else (),
    )
    return StoredDesign(
        path=file,
        assembly=assembly,
        source=source,
        insertion=insertion,
        joints=_joints(data.get("joints", []), dimension, assembly.sequence, f"{where}: joints"),
        load_cases=_cases(data.get("load_cases", []), f"{where}: load_cases"),
        features=_texts(data.get("features", []), f"{where}: features"),
        seconds={
            k: fields.number(v, f"{where}: seconds.{k}", 0.0)
            for k, v in fields.mapping(data.get("seconds", {}), f"{where}: seconds").items()
        },
        notes=tuple(notes),
        friction=_friction(data["friction"], f"{where}: friction") if data.get("friction") is not None else None,
    )


def _entries(data: object, where: str, keys: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return a list of mappings that have all of `keys` and no others."""
    if not isinstance(data, list):
        raise InputError(f"{where} must be a list, not {fields.shown(data)}.")
    for k, entry in enumerate(data):
        fields.mapping(entry, f"{where}[{k}]", keys)
        for key in keys:
            if key not in entry:
                raise InputError(f'{where}[{k}] has no "{key}"; the file is incomplete. Run the design again.')
    return data


def _friction(data: object, where: str) -> CountedFriction:
    entry = fields.mapping(data, where, ("coefficient", "counted", "tangential_ratio"))
    for key in ("coefficient", "counted"):
        if key not in entry:
            raise InputError(f'{where} has no "{key}"; the file is incomplete. Run the design again.')
    coefficient = fields.number(entry["coefficient"], f"{where}.coefficient", 0.0, 10.0)
    counted = fields.number(entry["counted"], f"{where}.counted", 0.0, coefficient)
    ratio = fields.number(entry.get("tangential_ratio", TANGENTIAL_RATIO), f"{where}.tangential_ratio", above=0.0)
    return CountedFriction(coefficient, counted, ratio)


def _texts(data: object, where: str) -> tuple[str, ...]:
    if not isinstance(data, list) or not all(isinstance(v, str) for v in data):
        raise InputError(f"{where} must be a list of texts, not {fields.shown(data)}.")
    return tuple(data)


def _insertions(data: object, dimension: int, known: list[str], where: str) -> tuple[Insertion, ...]:
    found = []
    for k, entry in enumerate(_entries(data, where, ("part", "direction", "alpha_deg"))):
        place = f"{where}[{k}]"
        part = fields.known_name(fields.part_name(entry["part"], f"{place}.part"), known, place)
        direction = fields.direction(entry["direction"], f"{place}.direction", (dimension,))
        found.append(Insertion(part, direction, _found_alpha(entry["alpha_deg"], f"{place}.alpha_deg")))
    return tuple(found)


def _asked_alpha(insertion: tuple[Insertion, ...]) -> float | None:
    """Return the α that a file without its source must have been asked for: its narrowest cone, if that is one."""
    narrowest = min((i.alpha_rad for i in insertion), default=-1.0)
    return narrowest if 0.0 <= narrowest < np.pi / 2 else None


def _found_alpha(data: object, where: str) -> float:
    """Return the half-angle of a cone that was found, radians: 90° on a single flat contact, below 0 when blocked."""
    return 0.0 if data is None else float(np.deg2rad(fields.number(data, where, -90.0, 90.0)))


def _joints(data: object, dimension: int, known: tuple[str, ...], where: str) -> tuple[StoredJoint, ...]:
    found = []
    for k, entry in enumerate(_entries(data, where, ("parts", "type", "principal_direction", "parameters"))):
        place = f"{where}[{k}]"
        pair = fields.names(entry["parts"], f"{place}.parts")
        if len(pair) != 2:
            raise InputError(f"{place}.parts must name two parts, not {fields.shown(entry['parts'])}.")
        for name in pair:
            fields.known_name(name, known, f"{place}.parts")
        parameters = {
            key: fields.number(value, f"{place}.parameters.{key}")
            for key, value in fields.mapping(entry["parameters"], f"{place}.parameters").items()
        }
        direction = fields.direction(entry["principal_direction"], f"{place}.principal_direction", (dimension,))
        kind = fields.part_name(entry["type"], f"{place}.type")
        found.append(StoredJoint((pair[0], pair[1]), kind, direction, parameters))
    return tuple(found)


def _cases(data: object, where: str) -> tuple[CaseResult, ...]:
    keys = ("name", "infeasibility_before", "infeasibility_after")
    return tuple(
        CaseResult(
            fields.part_name(entry["name"], f"{where}[{k}].name"),
            fields.number(entry[keys[1]], f"{where}[{k}].{keys[1]}"),
            fields.number(entry[keys[2]], f"{where}[{k}].{keys[2]}"),
        )
        for k, entry in enumerate(_entries(data, where, keys))
    )
