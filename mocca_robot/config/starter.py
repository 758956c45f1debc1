"""A first configuration for somebody's own model, as commented YAML, and a drawing to start from when there is none."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.assembly import Assembly, Part
from mocca_robot.config.schema import KEYS
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.documents import existing_path, parse_json, read_text, yaml_text
from mocca_robot.files.mending import closes
from mocca_robot.files.meshes import FORMATS as MESH_FORMATS

DRAWING = """<?xml version="1.0" encoding="UTF-8"?>
<!-- One closed path per part; its id is the part's name. Parts that touch share an edge, straight or curved.
     Width and height say the real size. Draw on in Inkscape or any other editor. -->
<svg xmlns="http://www.w3.org/2000/svg" width="200mm" height="140mm" viewBox="0 0 200 140"
     fill="#eeeeee" stroke="#333333" stroke-width="0.5">
  <path id="foot_left" d="M 50 130 L 10 130 A 90 90 0 0 1 27.188 77.099 L 59.549 100.611 A 50 50 0 0 0 50 130 Z"/>
  <path id="haunch_left" d="M 59.549 100.611
        L 27.188 77.099 A 90 90 0 0 1 72.188 44.405 L 84.549 82.447 A 50 50 0 0 0 59.549 100.611 Z"/>
  <path id="key" d="M 84.549 82.447
        L 72.188 44.405 A 90 90 0 0 1 127.812 44.405 L 115.451 82.447 A 50 50 0 0 0 84.549 82.447 Z"/>
  <path id="haunch_right" d="M 115.451 82.447
        L 127.812 44.405 A 90 90 0 0 1 172.812 77.099 L 140.451 100.611 A 50 50 0 0 0 115.451 82.447 Z"/>
  <path id="foot_right" d="M 140.451 100.611
        L 172.812 77.099 A 90 90 0 0 1 190 130 L 150 130 A 50 50 0 0 0 140.451 100.611 Z"/>
</svg>
"""
"""An arch of five stones whose flat joints, without friction, do not hold."""

SHELL, FRAME, PARTS = "shell", "frame", "parts"
ALPHA_DEG = 5
"""The α of a new configuration, where the contacts leave as much."""
LISTED = (
    "name",
    "model",
    "generator",
    "units",
    "fixed",
    "sequence",
    "goal",
    "alpha_deg",
    "density",
    "thickness",
    "parts",
)
"""Keys that a new configuration writes or explains by itself."""


@dataclass(frozen=True)
class Source:
    """What a file can be the start of: 'parts', the surface of a 'shell' or the lines of a 'frame'.

    `measure` is the file's smallest extent (surface) or shortest rod (lines), in the file's unit.
    """

    kind: str
    path: Path
    measure: float = 0.0


def source_of(path: Path) -> Source:
    """Return what `path` is the start of. Raises InputError when it does not exist."""
    existing_path(path)
    suffix = path.suffix.lower()
    if suffix == ".obj":
        return _obj_source(path)
    if suffix == ".json":
        data = parse_json(read_text(path), f"'{path}'")
        if isinstance(data, dict) and {"nodes", "rods"} <= set(data):
            return Source(FRAME, path, _shortest_rod(path))
    return Source(PARTS, path)


def _obj_source(path: Path) -> Source:
    from mocca_robot.files.obj import read_obj

    groups = read_obj(path)
    if not any(g.faces for g in groups):
        return Source(FRAME, path, _shortest_rod(path))
    used = sorted({v for g in groups for face in g.faces for v in face})
    if not used or all(closes(g.vertices, g.triangles()[0]) for g in groups if g.faces):
        return Source(PARTS, path)
    return Source(SHELL, path, float(np.linalg.norm(np.ptp(groups[0].vertices[used], axis=0))))


def _shortest_rod(path: Path) -> float:
    from mocca_robot.generators.frame import read_lines

    nodes, rods, _ = read_lines(path)
    return min(float(np.linalg.norm(nodes[b] - nodes[a])) for a, b in rods)


def sizes_by_unit(path: Path) -> str:
    """Return how large a mesh file without a unit would be, for each unit it may be in."""
    from mocca_robot.files.meshes import LARGEST_M, SMALLEST_PART_M, read_parts

    bounds = np.array([p.mesh.bounds for p in read_parts(path, "m", any_size=True)])
    size = float(np.linalg.norm(bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)))
    smallest = float(np.linalg.norm(bounds[:, 1] - bounds[:, 0], axis=1).min())
    known = {u: fields.UNITS_M[u] for u in ("mm", "cm", "m", "in")}
    usable = [u for u, m in known.items() if smallest * m >= SMALLEST_PART_M and size * m <= LARGEST_M]
    return ", ".join(f"--units {u} ({size * known[u]:.3g} m across)" for u in usable or known)


def lacks_unit(path: Path) -> bool:
    """Return whether a model's files carry no unit: OBJ, STL and PLY, alone or in a folder."""
    silent = {f".{f}" for f in MESH_FORMATS} - {".3mf", ".glb"}
    if not path.is_dir():
        return path.suffix.lower() in silent
    return not (path / "design.json").is_file() and any(f.suffix.lower() in silent for f in path.iterdir())


def by_height(parts: Sequence[Part], fixed: Sequence[str]) -> list[str]:
    """Return fixed parts first, then the others from the lowest centroid up."""
    return [p.name for p in sorted(parts, key=lambda p: (p.name not in fixed, float(p.centroid[-1])))]


def starter_yaml(name: str, parts_from: Mapping[str, Any], assembly: Assembly, chosen: Mapping[str, Any]) -> str:
    """Return a configuration with comments: where the parts come from, what was `chosen`, and every other key.

    `parts_from` holds 'model' or 'generator', and 'units' where needed; `chosen` may hold 'fixed', 'sequence' and
    'allowed_deg', the largest α that the contacts leave.
    """
    flat = assembly.dimension == 2
    key = next((p.name for p in reversed(assembly.parts) if not p.fixed), "NAME")
    file = _word(f"{name}.yaml")
    out = [f"# {len(assembly.parts)} parts, {assembly.size:.3g} m across. Look first: mocca-robot check {file}"]
    out += [f"name: {yaml_text(name)}"]
    generator = parts_from.get("generator")
    if generator:
        out += ["generator:", *(f"  {k}: {yaml_text(v)}" for k, v in generator.items())]
        if generator["kind"] == SHELL:
            out += [
                "  # bond: running      # shift every second row of quadrangles by half a block",
                "  # sequence: file     # the order of the polygons instead of from the lowest block up",
            ]
    else:
        out += [f"model: {yaml_text(parts_from['model'])}"]
    if "units" in parts_from:
        out += [f"units: {parts_from['units']}        # of the model's numbers, and of lengths below"]
    if "fixed" in chosen:
        out += [
            "",
            "# Parts that stand on the ground and never move; these are the lowest ones.",
            f"fixed: {yaml_text(chosen['fixed'])}",
        ]
    if "sequence" in chosen:
        out += [
            "",
            f"# The order of assembly; {chosen['why']}. Another one: mocca-robot sequence {file}",
        ]
        out += _sequence(chosen["sequence"])
    out += [
        "",
        "# What the finished structure has to do. One, or several as a list:",
        "#   {kind: equilibrium}                           stand under its own weight",
        "#   {kind: support_free}                          stand after every single step of the sequence",
        "#   {kind: lateral, angle_deg: 10}                stand when the ground tilts to any side",
        f"#   {f'{{kind: interlocking, key: {yaml_text(key)}}}':45} hold together while only the key is held",
        "goal: {kind: equilibrium}",
        "",
        "# Every part goes in from anywhere within this angle of its direction; null: not asked for.",
        *_alpha(chosen),
        "",
        "density: 1200         # kg/m³, about acrylic and PLA; plywood 600, brick 1800, concrete 2400",
    ]
    if flat:
        out += ["thickness: 20 mm      # of the sheet"]
    out += ["", "# Single parts may differ:", "# parts:", f"#   {yaml_text(key)}: {{density: 2700}}", ""]
    return "\n".join([*out, *_everything_else(flat)]) + "\n"


def _everything_else(flat: bool) -> list[str]:
    out = ["# Everything else: its default, or an example where it has none. Remove the # in front to change a value."]
    section = ""
    for key in KEYS:
        first, _, last = key.name.partition(".")
        if first in LISTED or key.kind in ("mapping", "entries") or "NAME" in key.name or (first == "cut" and not flat):
            continue
        written = key.example if key.default is None else key.default
        if written is None:  # only makes sense beside another key, as the grain of wood
            continue
        if last and first != section:
            section = first
            out.append(f"# {first}:")
        indent = "  " if last else ""
        unit = f" ({key.unit})" if key.unit not in ("", "units") else ""
        out.append(f"# {indent}{last or first}: {yaml_text(written):14}  # {key.description}{unit}")
    return out


def _alpha(chosen: Mapping[str, Any]) -> list[str]:
    """Return the line of α: its default, or all that the contacts allow where that is less."""
    allowed = chosen.get("allowed_deg")
    if allowed is None:
        return [f"alpha_deg: {ALPHA_DEG}"]
    alpha = min(float(ALPHA_DEG), np.floor(10.0 * allowed) / 10.0)
    return [f"alpha_deg: {alpha:g}        # the contacts allow up to {allowed:.1f}°, in this order"]


def _sequence(names: Sequence[str]) -> list[str]:
    line = f"sequence: {yaml_text(list(names))}"
    return [line] if len(line) <= 110 else ["sequence:", *(f"  - {yaml_text(n)}" for n in names)]


def _word(file: str) -> str:
    """Return a file's name as a shell takes it."""
    return file if re.fullmatch(r"[\w.-]+", file) else f'"{file}"'


def require_name(name: str) -> str:
    """Return `name` if files can be called so. Raises InputError for paths and names that systems reserve."""
    fields.part_name(name, "NAME")
    if any(c in name for c in '/\\:*?"<>|') or name.startswith((".", "-")) or name.endswith((".", " ")):
        raise InputError(f"'{name}' cannot be the name of a file; give a plain name, and a folder with -o DIR.")
    if name.lower().endswith((".yaml", ".yml")):
        raise InputError(f"'{name}' would become '{name}.yaml'; leave the ending out.")
    return name
