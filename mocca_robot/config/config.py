"""A configuration, or any file that holds parts → Config: everything a run needs, checked, in SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import DEFAULT_DENSITY, Assembly, Interlocking, Part, Polygon
from mocca_robot.config import schema
from mocca_robot.config.keys import options, read_section, section
from mocca_robot.config.model import Model, generated, read_model, turned_upright
from mocca_robot.config.schema import SimulationOptions
from mocca_robot.contacts.find import largest_tolerance
from mocca_robot.contacts.friction import Friction, require_materials, sprung, tangential_ratio
from mocca_robot.errors import InputError
from mocca_robot.fabrication.options import CutOptions
from mocca_robot.files import fields
from mocca_robot.files.actions_data import actions_from_data, combinations_from_data
from mocca_robot.files.assembly_json import gravity_from_data, in_sequence
from mocca_robot.files.documents import MAX_YAML_BYTES, existing_path, parse_yaml, read_text, yaml_key_lines
from mocca_robot.files.goals import goals_from_data
from mocca_robot.files.versions import CONFIG
from mocca_robot.joints.options import FLAT_KINDS, SOLID_KINDS, JointOptions
from mocca_robot.strength.materials import KNOWN, Material, material_named, materials_from_data
from mocca_robot.strength.options import StrengthOptions, axes_from_data
from mocca_robot.tolerances import ON_GROUND

SMALLEST_M = 1e-6
"""Nothing smaller is built; it is a unit mistake."""
THINNEST_M = 1e-4
"""Thinner parts are more often a unit mistake than meant."""

__all__ = ["Config", "CutOptions", "EffectiveValue", "JointOptions", "SimulationOptions", "load"]

AUTO = "auto"
"""In the place of a sequence: one is found."""
PLAUSIBLE_SIZE_M = (0.005, 500.0)
"""Assemblies outside are more often a wrong unit than a real structure; they get a note."""


@dataclass(frozen=True)
class EffectiveValue:
    """A key, the value as it was written (or its default), and who says so.

    `origin` is 'argument', 'configuration', 'model' or 'default'; `line` that of the configuration, from 1. Keys of
    single parts are there where somebody set them: 'parts.NAME.density'.
    """

    key: str
    value: Any
    origin: str
    line: int | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Config:
    """Everything a run needs.

    Attributes:
        assembly: parts in assembly order, goals, α and gravity. From a design.json: the built geometry.
        source: the file that was loaded.
        unit: unit in which to speak to the user about lengths.
        unit_m: metres per `unit`.
        friction: Coulomb coefficient for analysis.
        insertion: insertion directions (d,), unit, by part: the user's, or a design's.
        joints: bounds for the designer.
        simulate: settings of the physics.
        cut: settings of the cutting drawings.
        strength: what is asked of the strength of parts.
        finds_order: whether the order of assembly is to be found together with the joints.
        notes: what a user should know about the input: repairs, elements left out, an implausible size.
        values: every key with its effective value and origin.
    """

    assembly: Assembly
    source: Path
    unit: str
    unit_m: float
    friction: float
    insertion: Mapping[str, Array]
    joints: JointOptions
    simulate: SimulationOptions
    cut: CutOptions
    strength: StrengthOptions
    finds_order: bool = False
    notes: tuple[str, ...]
    values: tuple[EffectiveValue, ...]

    @property
    def asks_strength(self) -> bool:
        """Return whether the configuration says anything about strength: a key of that section."""
        return any(self.given(v.key) for v in self.values if v.key.startswith("strength."))

    def given(self, key: str) -> bool:
        """Return whether somebody set `key`, as an argument or in the configuration, rather than its default."""
        return any(v.key == key and v.origin in ("argument", "configuration") for v in self.values)


def load(path: str | Path, arguments: Mapping[str, Any] | None = None) -> Config:
    """Return the configuration in a YAML file, or the defaults for any file that holds parts.

    `path` is a .yaml configuration, an assembly or design .json, an .svg, a mesh file, or a folder of meshes or
    of a design. `arguments` are further keys of the configuration that win over the file's, such as
    `{"alpha_deg": 10}`.

    Raises InputError for everything that cannot be used, naming file, key or part, value, limit and remedy.
    """
    path = Path(path)
    where = f"'{path}'"
    if path.suffix.lower() not in (".yaml", ".yml"):
        existing_path(path)
        return configured({"model": path.name or "."}, path, path.parent if path.name else path, arguments=arguments)
    text = read_text(path, MAX_YAML_BYTES)
    content = parse_yaml(text, where)
    if content is None:
        raise InputError(f"{where} holds nothing but comments; it needs at least 'model: FILE'.")
    data, said = CONFIG.current(fields.mapping(content, where), where)
    return configured(data, path, path.parent, arguments=arguments, lines=yaml_key_lines(text), notes=said)


def configured(
    data: Mapping[str, Any],
    source: Path,
    folder: Path,
    *,
    arguments: Mapping[str, Any] | None = None,
    lines: Mapping[tuple[str, ...], int] | None = None,
    notes: tuple[str, ...] = (),
) -> Config:
    """Return the configuration that the plain mapping `data` is, as a file `source` would hold it.

    Args:
        data: keys as one writes them.
        source: what messages and reports call it.
        folder: where its paths begin.
        arguments: further keys that win over those of `data`.
        lines: where in the file every path of keys stands, from 1.
        notes: what is to be said about the file itself.

    Raises InputError as `load` does.
    """
    where = f"'{source}'"
    written = {**data, **(arguments or {})}
    for key, value in (arguments or {}).items():
        if isinstance(value, Mapping) and isinstance(data.get(key), Mapping):
            written[key] = {**data[key], **value}  # one key of a section leaves the others alone
    given = _top_level(written, where, 1.0)
    model = _model(given, written, folder, where)
    unit = given.get("units") or model.unit
    unit_m = fields.UNITS_M[unit] if "units" in given else model.unit_m
    given = _top_level(written, where, unit_m)
    own = materials_from_data(given.get("materials", {}), f"{where}: materials")
    assembly = _assembly(model, given, own, where, unit_m)
    simulate = read_section(schema.KEYS, given.get("simulate", {}), "simulate", where, unit_m)
    joints = read_section(schema.KEYS, given.get("joints", {}), "joints", where, unit_m)
    friction = _friction(given, assembly, where, joints.get("friction", model.friction))
    ratio = given.get("stiffness_ratio", tangential_ratio(model.friction))
    friction, simulate["friction"] = sprung(friction, ratio), sprung(simulate.get("friction", friction), ratio)
    if "friction" in joints:
        joints["friction"] = sprung(joints["friction"], ratio)
    cut = read_section(schema.KEYS, given.get("cut", {}), "cut", where, unit_m)
    _require_carried(joints, assembly.dimension, f"{where}: joints")
    return Config(
        assembly=assembly,
        source=source,
        unit=unit,
        unit_m=unit_m,
        friction=friction,
        insertion=_insertion(model, given.get("insertion", {}), assembly, f"{where}: insertion"),
        joints=options(JointOptions, joints),
        simulate=options(SimulationOptions, simulate),
        cut=options(CutOptions, cut),
        strength=_strength(given, assembly, own, where, unit_m),
        finds_order=_finds_order(given, model.assembly),
        notes=notes + model.notes + _suspicions(assembly),
        values=_effective(data, lines or {}, arguments or {}, model),
    )


def _require_carried(joints: Mapping[str, Any], dimension: int, where: str) -> None:
    """Raise InputError for families that only parts of the other dimension have."""
    if dimension == 2 and joints.get("profile"):
        raise InputError(f"{where}.profile belongs to solid parts, but these are flat; remove it.")
    mine, other = (FLAT_KINDS, "solid") if dimension == 2 else (SOLID_KINDS, "flat")
    named = joints.get("kinds", mine)
    if not set(named) & set(mine):
        parts = "flat" if dimension == 2 else "solid"
        raise InputError(
            f"{where}.kinds is [{', '.join(named)}], which only {other} parts have, but these are {parts}; "
            f"name at least one of {', '.join(mine)}."
        )
    if dimension == 3 and "n" not in named and not joints.get("profile"):
        raise InputError(
            f"{where}.kinds is [{', '.join(named)}], without n: solid parts begin with plain bumps, and take other "
            f"families where those do not hold. Write {where}.kinds: [{', '.join(('n', *named))}]."
        )


def _friction(given: Mapping[str, Any], assembly: Assembly, where: str, default: float) -> float:
    """Return the coefficient, with its table of materials and the declared clamping where there are any."""
    friction: float = given.get("friction", default)
    require_materials(friction, assembly.parts, f"{where}: friction")
    if "clamping" not in given:
        return friction
    clamping = []
    for k, entry in enumerate(given["clamping"]):
        place = f"{where}: clamping[{k}]"
        found = fields.mapping(entry, place, ("parts", "force_n"))
        names = fields.names(found.get("parts"), f"{place}.parts")
        if len(names) != 2:
            raise InputError(f"{place}.parts names {len(names)} parts; name the two that are clamped together.")
        for name in names:
            fields.known_name(name, assembly.sequence, f"{place}.parts")
        clamping.append(((names[0], names[1]), fields.number(found.get("force_n"), f"{place}.force_n", 0.0)))
    return Friction(friction, friction.table if isinstance(friction, Friction) else (), clamping)


def _strength(
    given: Mapping[str, Any], assembly: Assembly, own: Mapping[str, Material], where: str, unit_m: float
) -> StrengthOptions:
    """Return what is asked of the strength. Raises InputError for materials of which nothing is known, if it is."""
    asked = read_section(schema.KEYS, given.get("strength", {}), "strength", where, unit_m)
    if "strength" in given:
        for part in (p for p in assembly.parts if p.material):
            material_named(part.material, own, f"{where}: the material of part '{part.name}'")
    found: StrengthOptions = options(StrengthOptions, asked)
    return replace(found, own=own, axes=axes_from_data(given, assembly, own, where))


def _top_level(written: Mapping[str, Any], where: str, unit_m: float) -> dict[str, Any]:
    """Return the top-level values; a key that is there but empty counts as absent, except alpha_deg: null."""
    return read_section(
        schema.KEYS,
        {k: v for k, v in written.items() if v is not None or k == "alpha_deg" or k not in section(schema.KEYS, "")},
        "",
        where,
        unit_m,
    )


def _model(given: Mapping[str, Any], written: Mapping[str, Any], folder: Path, where: str) -> Model:
    units, scale = given.get("units"), given.get("scale")
    if "model" in given and "generator" in given:
        raise InputError(f"{where} has both 'model' and 'generator'; keep the one that makes the parts.")
    if "generator" in given:
        if units not in (None, "m"):
            raise InputError(f"{where}: generators work in metres, but units is '{units}'; remove 'units'.")
        return generated(given["generator"], folder, 1.0 if scale is None else scale, f"{where}: generator")
    if "model" not in given:
        raise InputError(f"{where} names no parts; add 'model: FILE' or 'generator: {{kind: …}}'.")
    target = folder / given["model"]
    if target.suffix.lower() in (".yaml", ".yml"):
        raise InputError(f"{where}: model is the configuration '{written['model']}'; name a file that holds parts.")
    rigid = given.get("rigid", ())
    model = read_model(target, units, scale, rigid)
    for name in rigid:
        fields.known_name(name, model.assembly.sequence, f"{where}: rigid")
    if given.get("up") != "y":
        return model
    if model.assembly.dimension == 2:
        raise InputError(f"{where}: up belongs to solid parts; in flat ones y is up anyway. Remove it.")
    if target.suffix.lower() == ".glb":
        raise InputError(f"{where}: GLB files have y up by definition and are turned already; remove 'up'.")
    return turned_upright(model)


def _assembly(
    model: Model, given: Mapping[str, Any], own: Mapping[str, Material], where: str, unit_m: float
) -> Assembly:
    assembly = model.assembly
    given = {**given, **{k: _bodies_of(model, given[k]) for k in ("fixed", "sequence") if k in given}}
    parts = _parts(assembly.parts, given, {**KNOWN, **own}, where, unit_m)
    if "sequence" in given and not _finds_order(given, model.assembly):
        parts = in_sequence(parts, given["sequence"], f"{where}: sequence")
    _require_fixed(parts, where)
    _require_usable_size(parts, where)
    changes: dict[str, Any] = {"parts": parts}
    if "name" in given:
        changes["name"] = given["name"]
    if "goal" in given:
        changes["goals"] = goals_from_data(given["goal"], f"{where}: goal")
    if "alpha_deg" in given:
        changes["alpha_rad"] = given["alpha_deg"]
    if "gravity" in given:
        changes["gravity"] = gravity_from_data(given["gravity"], assembly.dimension, f"{where}: gravity")
    if "loads" in given or "combinations" in given:
        actions = assembly.actions
        if "loads" in given:
            actions = actions_from_data(given["loads"], parts, unit_m, f"{where}: loads")
        changes["actions"] = actions
        changes["combinations"] = combinations_from_data(given.get("combinations"), actions, f"{where}: combinations")
    if "tolerance" in given:
        changes["tolerance_m"] = _tolerance(given["tolerance"], replace(assembly, parts=parts), f"{where}: tolerance")
    for goal in changes.get("goals", assembly.goals):
        if isinstance(goal, Interlocking):
            fields.known_name(goal.key, [p.name for p in parts], f"{where}: goal: key")
    return replace(assembly, **changes)


def _tolerance(value: float, assembly: Assembly, where: str) -> float:
    """Return the tolerance in metres; one that cannot tell the faces of a thin part apart is an InputError."""
    metres = value * assembly.size if isinstance(value, fields.Share) else value
    largest, thinnest = largest_tolerance(assembly)
    if metres > largest:
        raise InputError(
            f"{where} is {metres * 1e3:.3g} mm, but '{thinnest}' is {largest * 1e4:.3g} mm thin; give at most a "
            f"tenth of that, {largest * 1e3:.3g} mm."
        )
    return metres


def _finds_order(given: Mapping[str, Any], assembly: Assembly) -> bool:
    """Return whether an order is to be found: `sequence: auto`, unless a part is called so."""
    return given.get("sequence") == (AUTO,) and AUTO not in assembly.sequence


def _bodies_of(model: Model, names: Sequence[str]) -> tuple[str, ...]:
    """Return `names` with the parts that a name of the file stands for in its place."""
    return tuple(dict.fromkeys(part for name in names for part in model.bodies.get(name, (name,))))


def _parts(
    parts: tuple[Part, ...], given: Mapping[str, Any], known_of: Mapping[str, Material], where: str, unit_m: float
) -> tuple[Part, ...]:
    """Return `parts` with what the configuration says about all of them and about single ones."""
    known = [p.name for p in parts]
    for name in given.get("fixed", ()):
        fields.known_name(name, known, f"{where}: fixed")
    single: dict[str, dict[str, Any]] = {}
    for key, data in given.get("parts", {}).items():
        name = fields.known_name(fields.part_name(key, f"{where}: parts"), known, f"{where}: parts")
        single[name] = read_section(schema.KEYS, data, "parts.NAME", f"{where}: part '{name}'", unit_m)
    found = []
    for part in parts:
        mine = single.get(part.name, {})
        fixed = part.name in given["fixed"] if "fixed" in given else part.fixed
        shape = part.shape
        thickness = mine.get("thickness", given.get("thickness"))
        if thickness is not None:
            if not isinstance(shape, Polygon):
                raise InputError(f"{where}: thickness belongs to flat parts, but '{part.name}' is solid; remove it.")
            shape = Polygon(shape.exterior, shape.holes, thickness)
        material = mine.get("material", given.get("material", part.material))
        density = part.density
        if density == DEFAULT_DENSITY and material in known_of:
            density = known_of[material].density
        density = mine.get("density", given.get("density", density))
        found.append(Part(part.name, shape, density, mine.get("fixed", fixed), material))
    return tuple(found)


def _require_fixed(parts: tuple[Part, ...], where: str) -> None:
    if all(p.fixed for p in parts):
        raise InputError(
            f"{where}: every part is fixed; leave at least one free to be assembled "
            "(`fixed: [NAME, …]` says which stand on the ground; rods of a frame that reach its lowest nodes do)."
        )
    if any(p.fixed for p in parts):
        return
    lowest = np.array([p.shape.bounds[0, -1] for p in parts])
    highest = max(float(p.shape.bounds[1, -1]) for p in parts)
    ground = lowest.min()
    down = [p.name for p, low in zip(parts, lowest) if low <= ground + ON_GROUND * (highest - ground)][:8]
    raise InputError(
        f"{where}: no part is fixed; say which ones stand on the ground. The lowest: fixed: [{', '.join(down)}]."
    )


def _require_usable_size(parts: tuple[Part, ...], where: str) -> None:
    bounds = np.array([p.shape.bounds for p in parts])
    size = float(np.linalg.norm(bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)))
    if not SMALLEST_M < size < 1e6 or np.abs(bounds).max() > 1e4 * size:
        raise InputError(
            f"{where}: the assembly is {size:.3g} m in size, {np.abs(bounds).max():.3g} m from the origin; it must be "
            "between a micrometre and 1000 km, and no further away than 10000 times its size. Check units and scale."
        )


def _suspicions(assembly: Assembly) -> tuple[str, ...]:
    """Return notes on numbers that are more often a mistake than meant."""
    low, high = PLAUSIBLE_SIZE_M
    found = []
    if not low <= assembly.size <= high:
        found.append(f"The assembly is {assembly.size:.3g} m in size; is its unit right? ('units', 'scale')")
    for part in assembly.parts:
        if isinstance(part.shape, Polygon) and not THINNEST_M <= part.shape.thickness <= 10.0:
            found.append(
                f"Part '{part.name}' is {part.shape.thickness:.3g} m thick; is that meant? (thickness is in 'units')"
            )
            break
    return tuple(found)


def _insertion(model: Model, data: Mapping[str, Any], assembly: Assembly, where: str) -> dict[str, Array]:
    """Return unit insertion directions by part: the model's, replaced by those of the configuration."""
    found = dict(model.insertion)
    for key, value in data.items():
        name = fields.known_name(fields.part_name(key, where), assembly.sequence, where)
        if assembly.parts[assembly.index(name)].fixed:
            raise InputError(f"{where} has a direction for '{name}', which is fixed and never inserted; remove it.")
        found[name] = fields.direction(value, f"{where}.{name}", (assembly.dimension,))
    return found


def _effective(
    data: Mapping[str, Any], lines: Mapping[tuple[str, ...], int], arguments: Mapping[str, Any], model: Model
) -> tuple[EffectiveValue, ...]:
    found = []
    written = (("argument", arguments), ("configuration", data))
    for key in schema.KEYS:
        path = tuple(key.name.split("."))
        if "NAME" in path or (key.kind == "mapping" and any(k.name.startswith(f"{key.name}.") for k in schema.KEYS)):
            continue
        for origin, values in written:
            inside = values.get(path[0]) if len(path) > 1 else values
            if isinstance(inside, Mapping) and path[-1] in inside:
                line = lines.get(path) if origin == "configuration" else None
                found.append(EffectiveValue(key.name, inside[path[-1]], origin, line))
                break
        else:
            found.append(EffectiveValue(key.name, key.default, "model" if key.name in model.given else "default"))
    for origin, values in written:
        single = values.get("parts")
        replaced = arguments.get("parts", {}) if origin == "configuration" else {}
        for name, settings in single.items() if isinstance(single, Mapping) else ():
            for last, value in settings.items() if name not in replaced else ():
                line = lines.get(("parts", str(name), last)) if origin == "configuration" else None
                found.append(EffectiveValue(f"parts.{name}.{last}", value, origin, line))
    return tuple(found)
