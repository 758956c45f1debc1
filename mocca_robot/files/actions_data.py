"""Loads as data: `{"name": "person", "kind": "force", "part": "plank", "force": "800 N"}` ↔ `PointForce`.

Every magnitude is a text with its unit. Places are in the unit of the file that names them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mocca_robot.actions import (
    Action,
    AddedMass,
    BodyAcceleration,
    Combination,
    LineForce,
    PointForce,
    Pressure,
    SupportMove,
    Wind,
    Worker,
)
from mocca_robot.arrays import Array, read_only
from mocca_robot.assembly import STANDARD_GRAVITY, Assembly, Mesh, Part
from mocca_robot.errors import InputError, nearest
from mocca_robot.files import fields
from mocca_robot.files.nesting import inside
from mocca_robot.geometry.polygons import to_shapely

FORCE = {"N": 1.0, "kN": 1e3, "MN": 1e6, "kgf": STANDARD_GRAVITY, "lbf": 4.4482216152605}
LINE = {"N/m": 1.0, "kN/m": 1e3, "N/mm": 1e3}
PRESSURE = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "N/m²": 1.0, "N/m2": 1.0, "kN/m²": 1e3, "kN/m2": 1e3, "N/mm²": 1e6}
MASS = {"kg": 1.0, "g": 1e-3, "t": 1e3, "lb": 0.45359237}
LENGTH = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
ANGLE = {"°": float(np.deg2rad(1.0)), "deg": float(np.deg2rad(1.0)), "rad": 1.0}
ACCELERATION = {"m/s²": 1.0, "m/s2": 1.0, "g": STANDARD_GRAVITY}
AMOUNT = re.compile(r"(?P<number>[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|nan|inf)\s*(?P<unit>.*)")
LARGEST = 1e15
SURE_M = 1e-6
"""Places may lie outside their part by this share of the part's size: written numbers are rounded."""

KINDS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "force": (("part", "force"), ("direction", "at")),
    "line": (("part", "force", "start", "end"), ("direction",)),
    "pressure": (("pressure",), ("facing", "parts", "within")),
    "wind": (("pressure", "towards"), ()),
    "mass": (("part", "mass"), ("at",)),
    "worker": (("mass",), ()),
    "acceleration": (("acceleration", "direction"), ()),
    "support": (("part",), ("shift", "direction", "turn", "about")),
}
"""Kind → the keys that it needs, and those that it may have."""


def quantity(value: object, units: Mapping[str, float], where: str) -> float:
    """Return a positive magnitude in SI units from a text such as '800 N'."""
    example = f"'800 {next(iter(units))}'"
    found = None if not isinstance(value, str) else AMOUNT.fullmatch(value.strip())
    if found is None and isinstance(value, str):
        raise InputError(f"{where} is {fields.shown(value)}; write a number and a unit, as {example}.")
    if found is None or not found["unit"]:
        raise InputError(f"{where} is {fields.shown(value)}, without a unit; write {example} (or {', '.join(units)}).")
    if found["unit"] not in units:
        raise InputError(f"{where} is {fields.shown(value)}; {nearest(found['unit'], tuple(units))}")
    return fields.number(float(found["number"]), where, above=0.0, high=LARGEST) * units[found["unit"]]


def direction(value: object, where: str, dimension: int) -> Array:
    """Return a unit vector (d,) from a vector or one of 'down', 'up', '+x', '-x', '+y', …"""
    axes = dict(zip("xyz", np.eye(dimension)))
    named = {f"{sign}{x}": size * axis for x, axis in axes.items() for sign, size in (("+", 1.0), ("-", -1.0))}
    named |= {"up": np.eye(dimension)[-1], "down": -np.eye(dimension)[-1]}
    if isinstance(value, str):
        return read_only(named[fields.choice(value, tuple(named), where)] + 0.0)
    return fields.direction(value, where, (dimension,))


def actions_from_data(data: object, parts: Sequence[Part], unit_m: float, where: str) -> tuple[Action, ...]:
    """Return the loads of a list of mappings, for an assembly of `parts`; places in units of `unit_m` metres.

    Raises InputError for unknown keys, kinds and parts, magnitudes without a unit, names used twice, loads on fixed
    parts and places outside their part.
    """
    if not isinstance(data, list):
        raise InputError(f"{where} must be a list of loads, not {fields.shown(data)}.")
    found: list[Action] = []
    for k, entry in enumerate(data):
        action = _action(entry, parts, unit_m, f"{where}[{k}]")
        if action.name in [a.name for a in found]:
            raise InputError(f"{where}: two loads are called '{action.name}'; give each its own name.")
        found.append(action)
    return tuple(found)


def _action(entry: object, parts: Sequence[Part], unit_m: float, where: str) -> Action:
    data = fields.mapping(entry, where)
    for key in ("name", "kind"):
        if key not in data:
            raise InputError(f"{where} has no '{key}'; a load needs a name and a kind ({', '.join(KINDS)}).")
    name = fields.part_name(data["name"], f"{where}.name")
    where = f"{where[: where.rindex('[')]}: load '{name}'"
    kind = fields.choice(data["kind"], tuple(KINDS), f"{where}: kind")
    needed, further = KINDS[kind]
    fields.mapping(data, where, ("name", "kind", *needed, *further))
    for key in needed:
        if key not in data:
            raise InputError(f"{where} has no '{key}'; a load of kind {kind} needs {', '.join(needed)}.")
    d = parts[0].shape.dimension

    def place(key: str, part: Part) -> Array | None:
        return None if key not in data else _inside(data[key], part, unit_m, f"{where}: {key}")

    if kind == "worker":
        return Worker(name=name, mass_kg=quantity(data["mass"], MASS, f"{where}: mass"))
    if kind == "acceleration":
        size = quantity(data["acceleration"], ACCELERATION, f"{where}: acceleration")
        return BodyAcceleration(
            name=name, acceleration=read_only(size * direction(data["direction"], f"{where}: direction", d))
        )
    if kind == "wind":
        pressure = quantity(data["pressure"], PRESSURE, f"{where}: pressure")
        return Wind(name=name, pressure_pa=pressure, towards=direction(data["towards"], f"{where}: towards", d))
    if kind == "pressure":
        return _pressure(data, name, parts, unit_m, where)
    if kind == "support":
        return _support(data, name, parts, unit_m, where)
    part = _loaded(data["part"], parts, where)
    if kind == "mass":
        return AddedMass(
            name=name, part=part.name, mass_kg=quantity(data["mass"], MASS, f"{where}: mass"), at=place("at", part)
        )
    way = direction(data.get("direction", "down"), f"{where}: direction", d)
    size = quantity(data["force"], FORCE if kind == "force" else LINE, f"{where}: force")
    if kind == "force":
        return PointForce(name=name, part=part.name, force=read_only(size * way), at=place("at", part))
    start, end = place("start", part), place("end", part)
    assert start is not None and end is not None  # both are needed keys
    if np.array_equal(start, end):
        raise InputError(f"{where}: start and end are the same place; for a load at one place use kind: force.")
    return LineForce(name=name, part=part.name, start=start, end=end, force=read_only(size * way))


def _support(data: Mapping[str, Any], name: str, parts: Sequence[Part], unit_m: float, where: str) -> SupportMove:
    d = parts[0].shape.dimension
    known = fields.part_name(data["part"], f"{where}: part")
    part = next(p for p in parts if p.name == fields.known_name(known, [p.name for p in parts], f"{where}: part"))
    if not part.fixed:
        fixed = [p.name for p in parts if p.fixed]
        raise InputError(f"{where} moves '{part.name}', which is no support: it is not fixed; {nearest(known, fixed)}")
    if d == 3:
        raise InputError(f"{where} moves a support; only flat structures are followed so far. Leave it out.")
    if "shift" not in data and "turn" not in data:
        raise InputError(f"{where} says no move; give shift: 10 mm with a direction, or turn: 1 deg, or both.")
    size = quantity(data["shift"], LENGTH, f"{where}: shift") if "shift" in data else 0.0
    if "direction" in data and "shift" not in data:
        raise InputError(f"{where} has a direction and no shift; give shift: 10 mm, or leave the direction out.")
    turn = 0.0
    if "turn" in data:
        text = data["turn"]
        back = isinstance(text, str) and text.strip().startswith("-")
        turn = quantity(text.strip()[1:] if back else text, ANGLE, f"{where}: turn") * (-1.0 if back else 1.0)
    about = None if "about" not in data else read_only(fields.vector(data["about"], f"{where}: about", (d,)) * unit_m)
    shift = read_only(size * direction(data.get("direction", "down"), f"{where}: direction", d))
    return SupportMove(name=name, part=part.name, shift=shift, turn_rad=turn, about=about)


def _pressure(data: Mapping[str, Any], name: str, parts: Sequence[Part], unit_m: float, where: str) -> Pressure:
    d = parts[0].shape.dimension
    names = () if "parts" not in data else fields.names(data["parts"], f"{where}: parts")
    for part in names:
        _loaded(part, parts, where)
    pressed = [p for p in parts if (p.name in names if names else not p.fixed)]
    return Pressure(
        name=name,
        pressure_pa=quantity(data["pressure"], PRESSURE, f"{where}: pressure"),
        facing=None if "facing" not in data else direction(data["facing"], f"{where}: facing", d),
        parts=names,
        within=None if "within" not in data else _box(data["within"], pressed, d, unit_m, f"{where}: within"),
    )


def _box(value: object, parts: Sequence[Part], d: int, unit_m: float, where: str) -> Array:
    """Return a box (2, d) in metres, low and high corner, that one of the parts at least reaches into."""
    box = fields.box(value, where, d) * unit_m
    bounds = np.array([p.shape.bounds for p in parts]).reshape(-1, 2, d)
    slack = SURE_M * np.ptp(bounds, axis=(0, 1)).max() if parts else 0.0
    reached = ((bounds[:, 0] <= box[1] + slack) & (bounds[:, 1] >= box[0] - slack)).all(axis=1)
    if parts and not reached.any():
        around = _corners(bounds[:, 0].min(axis=0) / unit_m, bounds[:, 1].max(axis=0) / unit_m)
        raise InputError(f"{where} is {value}, where none of its parts is; these lie within {around}.")
    return read_only(box)


def _loaded(value: object, parts: Sequence[Part], where: str) -> Part:
    name = fields.known_name(fields.part_name(value, f"{where}: part"), [p.name for p in parts], f"{where}: part")
    part = next(p for p in parts if p.name == name)
    if part.fixed:
        raise InputError(f"{where} acts on '{name}', which is fixed: the ground carries it. Name a part that can move.")
    return part


def _inside(value: object, part: Part, unit_m: float, where: str) -> Array:
    """Return a place (d,) in metres, in or on its part."""
    point = fields.vector(value, where, (part.shape.dimension,)) * unit_m
    size = float(np.linalg.norm(part.shape.bounds[1] - part.shape.bounds[0]))
    if isinstance(part.shape, Mesh):
        outside = 0.0 if inside(part.shape, point) else _from_surface(part.shape, point)
    else:
        import shapely

        outside = float(to_shapely(part.shape).distance(shapely.Point(point)))
    up = "y" if part.shape.dimension == 2 else "z"
    otherwise = ", or leave it out for the centre of mass" if where.endswith(": at") else ""
    if outside > SURE_M * size:
        raise InputError(
            f"{where} is {outside / unit_m:.4g} away from part '{part.name}', which lies within "
            f"{_corners(*part.shape.bounds / unit_m)}, {up} up; give a place in or on it{otherwise}."
        )
    return read_only(point)


def _corners(low: Array, high: Array) -> str:
    """Return a box in words that can be typed: [[0, 0], [4, 1.1]]."""
    return str([[int(x) if x == int(x) else x for x in np.round(corner, 6).tolist()] for corner in (low, high)])


def _from_surface(mesh: Mesh, point: Array) -> float:
    """Return how far a point (3,) is from the nearest face. The search trees of trimesh would need rtree."""
    from trimesh import triangles

    nearest_points = triangles.closest_point(mesh.vertices[mesh.faces], np.tile(point, (len(mesh.faces), 1)))
    return float(np.linalg.norm(nearest_points - point, axis=1).min())


def actions_to_data(actions: Sequence[Action]) -> list[dict[str, Any]]:
    """Return loads as plain mappings in metres; `actions_from_data` reads them back."""
    return [_data(action) for action in actions]


def _data(action: Action) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": action.name, "kind": action.kind}
    if isinstance(action, SupportMove):
        entry["part"] = action.part
        if action.shift.any():
            size, way = _split(action.shift)
            entry |= {"shift": f"{size!r} m", "direction": way}
        if action.turn_rad:
            entry["turn"] = f"{action.turn_rad!r} rad"
        return entry if action.about is None else {**entry, "about": action.about.tolist()}
    if isinstance(action, Worker):
        return {**entry, "mass": f"{action.mass_kg!r} kg"}
    if isinstance(action, BodyAcceleration):
        size, way = _split(action.acceleration)
        return {**entry, "acceleration": f"{size!r} m/s²", "direction": way}
    if isinstance(action, Wind):
        return {**entry, "pressure": f"{action.pressure_pa!r} Pa", "towards": action.towards.tolist()}
    if isinstance(action, Pressure):
        entry["pressure"] = f"{action.pressure_pa!r} Pa"
        optional = {"facing": action.facing, "within": action.within}
        entry |= {key: value.tolist() for key, value in optional.items() if value is not None}
        return {**entry, "parts": list(action.parts)} if action.parts else entry
    entry["part"] = action.part
    if isinstance(action, LineForce):
        size, way = _split(action.force)
        ends = {"start": action.start.tolist(), "end": action.end.tolist()}
        return {**entry, "force": f"{size!r} N/m", "direction": way, **ends}
    if isinstance(action, PointForce):
        size, way = _split(action.force)
        entry |= {"force": f"{size!r} N", "direction": way}
    else:
        entry["mass"] = f"{action.mass_kg!r} kg"
    return entry if action.at is None else {**entry, "at": action.at.tolist()}


def _split(vector: Array) -> tuple[float, list[float]]:
    size = float(np.linalg.norm(vector))
    return size, [float(x) for x in vector / size]


def combinations_from_data(data: object, actions: Sequence[Action], where: str) -> tuple[Combination, ...]:
    """Return combinations of loads; where none is given each load acts alone beside gravity.

    Raises InputError for loads that do not exist and for factors that are not above zero.
    """
    if data is None or data == []:
        return tuple(
            Combination(name=a.name, factors={a.name: 1.0}, states=_states(a))
            for a in actions
            if not isinstance(a, SupportMove)
        )
    if not isinstance(data, list):
        raise InputError(f"{where} must be a list of combinations, not {fields.shown(data)}.")
    known = [a.name for a in actions]
    found: list[Combination] = []
    for k, entry in enumerate(data):
        place = f"{where}[{k}]"
        mapping = fields.mapping(entry, place, ("name", "gravity", "factors", "states"))
        for key in ("name", "factors"):
            if key not in mapping:
                example = "{name: use, gravity: 1.35, factors: {person: 1.5}}"
                raise InputError(f"{place} has no '{key}'; for example {example}.")
        name = fields.part_name(mapping["name"], f"{place}.name")
        if name in [c.name for c in found]:
            raise InputError(f"{where}: two combinations are called '{name}'; give each its own name.")
        factors = {}
        for load, factor in fields.mapping(mapping["factors"], f"{place}.factors").items():
            if load not in known:
                raise InputError(f"{place} names the load {fields.shown(load)}; {nearest(str(load), known)}")
            if isinstance(actions[known.index(load)], SupportMove):
                raise InputError(f"{place} names '{load}', a support that moves: it is no force, and acts alone.")
            factors[str(load)] = fields.number(factor, f"{place}.factors.{load}", above=0.0, high=1e6)
        gravity = fields.number(mapping.get("gravity", 1.0), f"{place}.gravity", above=0.0, high=1e6)
        states = fields.choice(mapping.get("states", "finished"), ("finished", "all"), f"{place}.states")
        found.append(Combination(name=name, factors=factors, gravity=gravity, states=states))  # type: ignore[arg-type]
    return tuple(found)


def _states(action: Action) -> Any:
    """Return when a load acts that nobody combined: a worker is there in every state, all else when it is finished."""
    return "all" if isinstance(action, Worker) else "finished"


def combinations_to_data(assembly: Assembly) -> list[dict[str, Any]]:
    """Return the combinations as plain mappings; `combinations_from_data` reads them back."""
    return [
        {"name": c.name, "gravity": c.gravity, "factors": dict(c.factors), "states": c.states}
        for c in assembly.combinations
    ]
