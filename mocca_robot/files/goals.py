"""Goals as data: `{"kind": "lateral", "angle_deg": 20}` ↔ `Lateral(angle_rad)`."""

from __future__ import annotations

from typing import Any

import numpy as np

from mocca_robot.assembly import Equilibrium, Goal, Interlocking, Lateral, SupportFree
from mocca_robot.errors import InputError
from mocca_robot.files import fields

LAST_DIGIT = 4e-16
"""Two units in the last place: an angle in degrees and the same in radians differ by as much."""

KINDS: dict[str, tuple[str, ...]] = {
    "equilibrium": (),
    "support_free": (),
    "lateral": ("angle_deg", "azimuths"),
    "interlocking": ("key",),
}
"""Kind → its further keys."""


def goals_from_data(data: object, where: str) -> tuple[Goal, ...]:
    """Return the goals of one entry (a kind's name or a mapping) or of a list of them, without repeats."""
    listed = data if isinstance(data, list) else [data]
    if not listed:
        raise InputError(f"{where} is an empty list; leave it out for equilibrium, or name a goal.")
    goals: list[Goal] = []
    for index, entry in enumerate(listed):
        goal = _goal(entry, f"{where}[{index}]" if isinstance(data, list) else where)
        if goal not in goals:
            goals.append(goal)
    return tuple(goals)


def goals_to_data(goals: tuple[Goal, ...]) -> list[dict[str, Any]]:
    """Return the goals as a list of plain mappings; `goals_from_data` reads it back."""
    return [_data(goal) for goal in goals]


def _goal(entry: object, where: str) -> Goal:
    if isinstance(entry, str):
        entry = {"kind": entry}
    data = fields.mapping(entry, where)
    if "kind" not in data:
        raise InputError(f"{where} has no 'kind'; it is one of {', '.join(KINDS)}.")
    kind = fields.choice(data["kind"], tuple(KINDS), f"{where}.kind")
    fields.mapping(data, where, ("kind", *KINDS[kind]))
    if kind == "equilibrium":
        return Equilibrium()
    if kind == "support_free":
        return SupportFree()
    if kind == "interlocking":
        if "key" not in data:
            raise InputError(f"{where} asks for interlocking; name the key part that is held: key: NAME.")
        return Interlocking(fields.part_name(data["key"], f"{where}.key"))
    if "angle_deg" not in data:
        raise InputError(f"{where} asks for lateral stability; say up to which tilt: angle_deg: 20.")
    angle = fields.number(data["angle_deg"], f"{where}.angle_deg", above=0.0, below=90.0)
    return Lateral(float(np.deg2rad(angle)), fields.integer(data.get("azimuths", 8), f"{where}.azimuths", 1, 360))


def _data(goal: Goal) -> dict[str, Any]:
    if isinstance(goal, Lateral):
        return {"kind": goal.kind, "angle_deg": degrees(goal.angle_rad), "azimuths": goal.azimuths}
    if isinstance(goal, Interlocking):
        return {"kind": goal.kind, "key": goal.key}
    return {"kind": goal.kind}


def degrees(angle_rad: float) -> float:
    """Return an angle in degrees, rounded to the number a person wrote where that is the same angle."""
    exact = float(np.rad2deg(angle_rad))
    short = round(exact, 9)
    return short if abs(float(np.deg2rad(short)) - angle_rad) <= LAST_DIGIT * max(1.0, abs(angle_rad)) else exact
