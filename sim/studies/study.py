"""A study's file → Study: which configuration, what varies over which values, what is asked of every point."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.config.config import Config, load
from mocca_robot.config.keys import Key
from mocca_robot.config.keys import section as keys_of
from mocca_robot.config.schema import KEYS
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.files.documents import MAX_YAML_BYTES, existing_path, parse_yaml, read_text
from mocca_robot.files.versions import STUDY_FILE

COMBINE = ("grid", "list")
STAGES = ("design", "tilt", "simulate")
"""What can be asked of a point besides its verdicts: joints first; the critical tilt by statics; MuJoCo."""
MAX_POINTS = 100_000
STUDY_KEYS: tuple[Key, ...] = (
    Key("version", "integer", 1, "", "Version of the file's format; 1 need not be written.", low=1),
    Key("name", "name", None, "", "Of the output folder and the page; default: the file's name."),
    Key(
        "base",
        "text",
        None,
        "",
        "The configuration that varies, or any file that holds parts; relative to the study.",
        required=True,
    ),
    Key(
        "vary",
        "values",
        None,
        "",
        "Key → list of values, or a range `{from, to, count, spacing}`, both ends included; keys of a section are "
        "written with a point: `joints.margin`.",
        required=True,
    ),
    Key("set", "mapping", None, "", "Key → its value at every point."),
    Key(
        "combine",
        "choice",
        "grid",
        "",
        "`grid`: every value with every other; `list`: the first values of all keys together, then the second, ….",
        known=COMBINE,
    ),
    Key("stages", "choices", ["design"], "", "What is asked of every point.", known=STAGES),
)
FREE_SECTIONS = ("generator", "parts", "insertion")
"""Sections of a configuration whose keys depend on the model: checked where a point is used."""


@dataclass(frozen=True)
class Point:
    """One combination of values.

    Attributes:
        index: its place in the study, from 0.
        values: key of the configuration → the value here, as it was written.
    """

    index: int
    values: Mapping[str, Any]

    @property
    def label(self) -> str:
        """Return 'alpha_deg=5, friction=0.2'."""
        return ", ".join(f"{key}={fields.shown(value)}" for key, value in self.values.items())


@dataclass(frozen=True, kw_only=True)
class Study:
    """What a study asks.

    Attributes:
        name: for files and pages.
        base: the configuration, or any file that holds parts.
        vary: key → its values, in order.
        fixed: keys that are set at every point.
        combine: 'grid', every value with every other; 'list', the first values together, then the second, …
        stages: which of `STAGES` are asked.
    """

    name: str
    base: Path
    vary: Mapping[str, tuple[Any, ...]]
    fixed: Mapping[str, Any]
    combine: str
    stages: tuple[str, ...]

    @property
    def points(self) -> tuple[Point, ...]:
        """Return every combination of values, the last key running fastest."""
        rows = itertools.product(*self.vary.values()) if self.combine == "grid" else zip(*self.vary.values())
        return tuple(Point(k, dict(zip(self.vary, row))) for k, row in enumerate(rows))

    def config(self, point: Point) -> Config:
        """Return the configuration of a point. Raises InputError when these values cannot be used."""
        return load(self.base, nested({**self.fixed, **point.values}))


def read_study(path: str | Path, further: Mapping[str, Any] | None = None) -> Study:
    """Return the study in a YAML file; `further` are keys that are set at every point, such as {'friction': 0.2}.

    Raises InputError for everything that cannot be used, naming key, value, limit and remedy.
    """
    path = Path(path)
    where = f"'{path}'"
    data, _ = STUDY_FILE.current(fields.mapping(parse_yaml(read_text(path, MAX_YAML_BYTES), where), where), where)
    known = keys_of(STUDY_KEYS, "")
    given = {k: v for k, v in fields.mapping(data, where, known).items() if v is not None}
    if "base" not in given:
        raise InputError(f"{where} has no 'base'; name the configuration that it varies: 'base: ../tower.yaml'.")
    base = Path(os.path.normpath(path.parent / known["base"].value(given["base"], f"{where}: base")))
    existing_path(base)
    if not given.get("vary"):
        raise InputError(f"{where} varies nothing; add 'vary: {{alpha_deg: [0, 5, 10]}}'.")
    varied = fields.mapping(given["vary"], f"{where}: vary")
    vary = {_key(k, f"{where}: vary"): _values(v, f"{where}: vary.{k}") for k, v in varied.items()}
    fixed = {_key(k, f"{where}: set"): v for k, v in fields.mapping(given.get("set", {}), f"{where}: set").items()}
    fixed.update(further or {})
    if both := sorted(set(vary) & set(fixed)):
        raise InputError(f"{where}: '{both[0]}' is varied and set as well; keep one of the two.")
    combine = known["combine"].value(given.get("combine", known["combine"].default), f"{where}: combine")
    counts = {k: len(v) for k, v in vary.items()}
    if combine == "list" and len(set(counts.values())) > 1:
        told = ", ".join(f"{k} has {n}" for k, n in counts.items())
        raise InputError(f"{where}: combine: list needs as many values of every key, but {told}; or use combine: grid.")
    total = math.prod(counts.values()) if combine == "grid" else next(iter(counts.values()))
    if total > MAX_POINTS:
        raise InputError(f"{where} has {total} points; at most {MAX_POINTS} are run. Split it.")
    chosen = known["stages"].value(given.get("stages", known["stages"].default), f"{where}: stages")
    name = known["name"].value(given["name"], f"{where}: name") if "name" in given else path.stem
    return Study(
        name=name, base=base, vary=vary, fixed=fixed, combine=combine, stages=tuple(s for s in STAGES if s in chosen)
    )


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return keys like 'joints.margin' as sections: {'joints': {'margin': …}}."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        *sections, last = key.split(".")
        inside = found
        for section in sections:
            inside = inside.setdefault(section, {})
            if not isinstance(inside, dict):
                raise InputError(f"'{section}' is set as a whole and so is '{key}'; keep one of the two.")
        if isinstance(inside.get(last), dict):
            raise InputError(f"'{key}' is set as a whole and so is a key inside it; keep one of the two.")
        inside[last] = value
    return found


def plain_keys() -> list[str]:
    """Return the keys of a configuration that a study may vary or set, those of `FREE_SECTIONS` aside."""
    return sorted(k.name for k in KEYS if "NAME" not in k.name and k.name != "version")


def _key(key: object, where: str) -> str:
    """Return a key of the configuration; those of a generator, of parts and insertion are checked on use."""
    text = fields.part_name(key, where)
    if text.split(".")[0] not in FREE_SECTIONS:
        fields.choice(text, plain_keys(), f"{where}: key")
    return text


def _values(data: object, where: str) -> tuple[Any, ...]:
    """Return the values of a list, or of a range {from, to, count, spacing}, both ends included."""
    if isinstance(data, dict):
        known = ("from", "to", "count", "spacing")
        given = fields.mapping(data, where, known)
        missing = [k for k in ("from", "to", "count") if k not in given]
        if missing:
            raise InputError(f"{where} has no '{missing[0]}'; a range is {{from: 0, to: 10, count: 5}}.")
        spacing = fields.choice(given.get("spacing", "linear"), ("linear", "log"), f"{where}.spacing")
        count = fields.integer(given["count"], f"{where}.count", 2, MAX_POINTS)
        above = 0.0 if spacing == "log" else None
        low = fields.number(given["from"], f"{where}.from", above=above)
        high = fields.number(given["to"], f"{where}.to", above=above)
        values = np.geomspace(low, high, count) if spacing == "log" else np.linspace(low, high, count)
        return tuple(float(f"{v:.12g}") for v in values)
    if not isinstance(data, list) or not data:
        raise InputError(f"{where} must be a list of values, or a range {{from: 0, to: 10, count: 5}}.")
    for k, value in enumerate(data):
        if isinstance(value, int | float) and not isinstance(value, bool):
            fields.number(value, f"{where}[{k}]")
    return tuple(data)
