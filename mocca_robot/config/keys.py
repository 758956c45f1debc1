"""Tables of keys: what a YAML file may say, key by key. Reading, reference pages and JSON Schemas use the same rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from mocca_robot.contacts.friction import read_friction
from mocca_robot.errors import InputError
from mocca_robot.files import fields as checks
from mocca_robot.files.actions_data import FORCE, quantity
from mocca_robot.tolerances import MM


@dataclass(frozen=True)
class Key:
    """One key.

    Attributes:
        name: with its section: 'alpha_deg', 'joints.margin'; 'parts.NAME.density' stands for every part.
        kind: what a value looks like: number, integer, degrees, length, length_or_share, boolean, name, names, text,
            choice, choices, vector, box, height field, friction, entries, goals, mapping, loads,
            axis, force,
            values (of a study), places, turns (of a cell).
        default: as one would write it; None = not set.
        unit: of the written value; 'units' = the configuration's own.
        description: one sentence.
        low, high: smallest and largest value (included).
        above, below: limits that are not included.
        known: the texts that a choice knows; of degrees: 'max', which is read as infinite.
        size: how many numbers a vector has, or each corner of a box; 0 = told by the model.
        required: whether the section is incomplete without it.
        example: a value as one would write it, for a key without default that a new configuration shows.
    """

    name: str
    kind: str
    default: Any
    unit: str
    description: str
    low: float | None = None
    high: float | None = None
    above: float | None = None
    below: float | None = None
    known: tuple[str, ...] = ()
    size: int = 0
    required: bool = False
    example: Any = None

    def value(self, data: object, where: str, unit_m: float = 1.0) -> Any:
        """Return `data` as this key's value in SI units; raises InputError when it is none."""
        limits = {"low": self.low, "high": self.high, "above": self.above, "below": self.below}
        if self.kind == "number":
            return checks.number(data, where, **limits)
        if self.kind == "friction" and isinstance(data, Mapping):
            return read_friction(data, where, self.low or 0.0, 10.0 if self.high is None else self.high)
        if self.kind == "friction":
            return checks.number(data, where, **limits)
        if self.kind == "entries":
            if not isinstance(data, list):
                raise InputError(f"{where} must be a list, not {checks.shown(data)}.")
            return tuple(data)
        if self.kind == "force":
            return quantity(data, FORCE, where)
        if self.kind == "degrees" and self.known and isinstance(data, str):
            if data not in self.known:
                raise InputError(f"{where} is {checks.shown(data)}; give degrees, or {' or '.join(self.known)}.")
            return float(np.inf)
        if self.kind == "degrees":
            return None if data is None else float(np.deg2rad(checks.number(data, where, **limits)))
        if self.kind == "integer":
            return checks.integer(data, where, int(self.low or 0), int(self.high or 10**6))
        if self.kind == "length":
            metres = {"mm": MM}.get(self.unit, unit_m)
            return checks.length(data, metres, where, self.low, above=self.above)
        if self.kind == "length_or_share":
            return checks.length_or_share(data, unit_m, where)
        if self.kind == "boolean":
            return checks.boolean(data, where)
        if self.kind == "name":
            return checks.part_name(data, where)
        if self.kind == "text":
            return checks.text(data, where)
        if self.kind == "names":
            return checks.names(data, where)
        if self.kind == "choice":
            return checks.choice(data, self.known, where)
        if self.kind == "choices":
            listed = data if isinstance(data, list) else [data]
            if not listed:
                raise InputError(f"{where} is an empty list; name at least one of {', '.join(self.known)}.")
            return tuple(checks.choice(v, self.known, where) for v in listed)
        if self.kind == "mapping":
            return checks.mapping(data, where)
        if self.kind == "vector" and self.size:
            return checks.vector(data, where, (self.size,))
        if self.kind == "height field":
            return checks.height_field(data, where)
        if self.kind == "box":
            return checks.box(data, where, self.size)
        return data  # goals, loads, axis, gravity, values, places, turns: read where they are used


def section(keys: Sequence[Key], prefix: str) -> dict[str, Key]:
    """Return the keys of one section ('' = top level, 'joints', 'parts.NAME', …) by their last name."""
    start = f"{prefix}." if prefix else ""
    inside = [(k.name[len(start) :], k) for k in keys if k.name.startswith(start)]
    return {name: key for name, key in inside if "." not in name}


def read_section(keys: Sequence[Key], data: object, prefix: str, where: str, unit_m: float) -> dict[str, Any]:
    """Return the values of one section in SI units, only those that `data` gives.

    Raises InputError for an unknown key, with the nearest known one, and for every value outside its limits.
    """
    known = section(keys, prefix)
    single = prefix.endswith(".NAME")  # `where` names the part already
    given = checks.mapping(data, where if single or not prefix else f"{where}: {prefix}", known)
    return {
        name: known[name].value(value, f"{where}: {name if single else known[name].name}", unit_m)
        for name, value in given.items()
    }


def read_whole(keys: Sequence[Key], data: object, prefix: str, where: str, example: str) -> dict[str, Any]:
    """Return every value of one section in SI units: what `data` gives, the default for what it leaves out or empty.

    `where` names the section. Raises InputError as `read_section`, and for a required key that is missing; `example`
    is a file that has it.
    """
    known = section(keys, prefix)
    given = checks.mapping(data, where, known)
    if missing := [f"'{name}'" for name, key in known.items() if key.required and given.get(name) is None]:
        raise InputError(f"{where} has no {', '.join(missing)}; compare it with {example}.")
    found = {}
    for name, key in known.items():
        value = given.get(name)
        value = key.default if value is None else value
        found[name] = None if value is None else key.value(value, f"{where}.{name}" if prefix else f"{where}: {name}")
    return found


def options(kind: type[Any], values: Mapping[str, Any]) -> Any:
    """Return the options dataclass `kind` from a section's values; 'x_deg' fills the field 'x_rad'."""
    renamed = {name[:-4] + "_rad" if name.endswith("_deg") else name: value for name, value in values.items()}
    return kind(**{f.name: renamed[f.name] for f in fields(kind) if f.name in renamed})
