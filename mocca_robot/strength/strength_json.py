"""What is said about strength as `strength.json` and back: pascals, metres and shares, for other programs to read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import read_only
from mocca_robot.files import fields
from mocca_robot.files.documents import parse_json, read_text
from mocca_robot.files.output import write_json
from mocca_robot.files.versions import STRENGTH
from mocca_robot.strength.uses import KINDS, AssemblyStrength, JointStrength, PartStrength, Use


def write_strength(found: AssemblyStrength, path: str | Path, name: str) -> Path:
    """Return `path` after writing the strength of the assembly `name` there."""
    return write_json(Path(path), strength_to_data(found, name))


def read_strength(path: str | Path) -> AssemblyStrength:
    """Return the strength that a file holds. Raises InputError when it holds none, or values that cannot be used."""
    return strength_from_data(parse_json(read_text(Path(path)), f"'{path}'"), f"'{path}'")


def strength_to_data(found: AssemblyStrength, name: str) -> dict[str, Any]:
    """Return plain JSON values; infinite factors, where nothing acts, are null."""
    return {
        "format": STRENGTH.name,
        "version": STRENGTH.version,
        "name": name,
        "safety_asked": found.safety,
        "safety_reached": _finite(found.reached),
        "holds": found.holds,
        "weakest": None if found.weakest is None else found.weakest.part,
        "largest_scale": None if found.largest_scale is None else _finite(found.largest_scale),
        "cases": list(found.cases),
        "left_out": list(found.left_out),
        "notes": list(found.notes),
        "parts": [_part(p) for p in found.parts],
        "joints": [{"parts": list(j.parts), **_use(j.use)} for j in found.joints],
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _use(use: Use) -> dict[str, Any]:
    return {
        "kind": use.kind,
        "share": use.share,
        "stress_pa": use.stress,
        "strength_pa": use.strength,
        "place": [float(x) for x in use.place],
        "case": use.case,
        "method": use.method,
    }


def _part(part: PartStrength) -> dict[str, Any]:
    return {
        "part": part.part,
        "material": part.material,
        "safety_reached": _finite(part.reached),
        "method": part.method,
        "why_no_elements": part.why,
        "neck": None if part.neck is None else {"width_m": part.neck[0], "place": [float(x) for x in part.neck[1]]},
        "uses": [_use(u) for u in part.uses],
    }


def strength_from_data(data: object, where: str) -> AssemblyStrength:
    """Return the strength of a document, of this version; `where` names it in messages.

    Raises InputError for another format or version, and for missing or impossible values.
    """
    document, notes = STRENGTH.current(fields.mapping(data, where), where)

    def listed(key: str) -> list[Any]:
        value = document.get(key, [])
        return value if isinstance(value, list) else [value]

    scale = document.get("largest_scale")
    return AssemblyStrength(
        safety=fields.number(document.get("safety_asked"), f"{where}: safety_asked", above=0.0),
        parts=tuple(_read_part(p, f"{where}: parts[{k}]") for k, p in enumerate(listed("parts"))),
        joints=tuple(_read_joint(j, f"{where}: joints[{k}]") for k, j in enumerate(listed("joints"))),
        cases=tuple(fields.part_name(c, f"{where}: cases") for c in listed("cases")),
        left_out=tuple(fields.part_name(c, f"{where}: left_out") for c in listed("left_out")),
        notes=(*notes, *(fields.text(n, f"{where}: notes") for n in listed("notes"))),
        largest_scale=None if scale is None else fields.number(scale, f"{where}: largest_scale", above=0.0),
    )


def _read_use(data: Mapping[str, Any], where: str) -> Use:
    return Use(
        kind=fields.choice(data.get("kind"), KINDS, f"{where}: kind"),
        share=fields.number(data.get("share"), f"{where}: share", 0.0),
        stress=fields.number(data.get("stress_pa"), f"{where}: stress_pa", 0.0),
        strength=fields.number(data.get("strength_pa"), f"{where}: strength_pa", above=0.0),
        place=read_only(fields.vector(data.get("place"), f"{where}: place")),
        case=fields.part_name(data.get("case"), f"{where}: case"),
        method=fields.choice(data.get("method"), ("estimate", "elements"), f"{where}: method"),  # type: ignore[arg-type]
    )


def _read_part(data: object, where: str) -> PartStrength:
    entry = fields.mapping(data, where)
    neck = entry.get("neck")
    if neck is not None:
        neck = fields.mapping(neck, f"{where}: neck")
        width = fields.number(neck.get("width_m"), f"{where}: neck: width_m", above=0.0)
        neck = (width, read_only(fields.vector(neck.get("place"), f"{where}: neck: place")))
    uses = entry.get("uses", [])
    return PartStrength(
        part=fields.part_name(entry.get("part"), f"{where}: part"),
        material=fields.part_name(entry.get("material"), f"{where}: material"),
        uses=tuple(_read_use(fields.mapping(u, where), f"{where}: uses[{k}]") for k, u in enumerate(uses)),
        method=fields.choice(entry.get("method"), ("estimate", "elements"), f"{where}: method"),  # type: ignore[arg-type]
        neck=neck,
        why=str(entry.get("why_no_elements", "")),
    )


def _read_joint(data: object, where: str) -> JointStrength:
    entry = fields.mapping(data, where)
    first, second = fields.names(entry.get("parts"), f"{where}: parts")[:2]
    return JointStrength(parts=(first, second), use=_read_use(entry, where))
