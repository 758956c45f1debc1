"""What is asked of the strength of an assembly, and of what every part is made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, read_only
from mocca_robot.assembly import Assembly, Part
from mocca_robot.errors import InputError, quoted
from mocca_robot.files.actions_data import direction
from mocca_robot.strength.materials import KNOWN, Material, Strength, material_named

IN_PLANE = "flat"
"""Layers of a flat part that lie in its plane: it was printed lying down."""

OTHER_WEIGHT = 0.1
"""Share by which a given density may differ from the material's before a note says so: stone and wood vary by that."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StrengthOptions:
    """What is asked of the strength.

    Attributes:
        safety: how many times the loads nothing may break.
        insertion_force: N with which every part is pushed in; 0 = not asked.
        grip_force: N with which every part is gripped; 0 = not asked.
        elements: largest size of an element, as a share of its part's size.
        own: materials of the configuration, by name.
        axes: (d,) unit grain, or normal of the layers, by part; zero for layers in the plane of a flat part.
    """

    safety: float = 3.0
    insertion_force: float = 0.0
    grip_force: float = 0.0
    elements: float = 1.0 / 16.0
    own: Mapping[str, Material] = field(default_factory=dict)
    axes: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, kw_only=True)
class MadeOf:
    """What one part is made of.

    Attributes:
        axis: (d,) unit: the grain, or the normal of layers; None = the same in every direction that counts.
        along: what it bears along the axis; `strength` is that across it.
        note: what had to be assumed; empty where nothing was.
    """

    material: Material
    strength: Strength
    axis: Array | None = None
    along: Strength | None = None
    note: str = ""


def axis_from_data(value: object, where: str, kind: str, dimension: int) -> Array:
    """Return a grain or a normal of layers (d,), unit; zero for the word 'flat', layers in the plane of a flat part."""
    if value == IN_PLANE and kind == "layers" and dimension == 2:
        return read_only(np.zeros(2))
    if value in ("", None, [], {}):
        raise InputError(f"{where} has no direction; write {kind}: {'[1, 0]' if dimension == 2 else '[1, 0, 0]'}.")
    return direction(value, where, dimension)


def made_of(assembly: Assembly, options: StrengthOptions) -> tuple[MadeOf, ...]:
    """Return what every part is made of.

    Raises InputError for a part without material, an unknown one, and wood whose grain nobody told.
    """
    bare = [p.name for p in assembly.parts if not p.material and not p.fixed]
    if bare:
        raise InputError(
            f"Part '{bare[0]}' has no material, so nothing can be said about its strength; add material: pla, or "
            f"another of {', '.join(sorted({*KNOWN, *options.own}))}, or parts: {{{bare[0]}: {{material: pla}}}}, "
            "or on the command line --material pla."
        )
    return tuple(_made_of(p, options) for p in assembly.parts)


def _made_of(part: Part, options: StrengthOptions) -> MadeOf:
    if not part.material:  # a fixed part: nobody asks whether the ground breaks
        return MadeOf(material=_GROUND, strength=_GROUND.strength)
    material = material_named(part.material, options.own, f"The material of part '{part.name}'")
    axis = options.axes.get(part.name)
    if material.across is None:
        return MadeOf(material=material, strength=material.strength)
    if axis is None and material.direction == "grain":
        if part.fixed:
            return MadeOf(material=material, strength=material.weakest)
        plain = "[1, 0]" if part.shape.dimension == 2 else "[1, 0, 0]"
        times = material.strength.tension / material.across.tension
        raise InputError(
            f"Part '{part.name}' is of {material.name}, {times:.0f} times as strong along its grain as across, but its "
            f"grain has no direction; add grain: {plain}, or parts: {{{part.name}: {{grain: {plain}}}}}, or on the "
            f"command line --set 'grain={plain}'."
        )
    if axis is None:
        note = f"'{part.name}' is of {material.name}; nobody says how its layers lie, so it counts as weak in every way"
        return MadeOf(material=material, strength=material.weakest, note=note)
    if not axis.any():
        return MadeOf(material=material, strength=material.strength)
    if material.direction == "grain":
        return MadeOf(material=material, strength=material.across, axis=axis, along=material.strength)
    return MadeOf(material=material, strength=material.strength, axis=axis, along=material.across)


def other_weights(assembly: Assembly, made: Sequence[MadeOf]) -> tuple[str, ...]:
    """Return one sentence per material of which free parts weigh more or less by `OTHER_WEIGHT` than the material."""
    off: dict[str, list[Part]] = {}
    for part, of in zip(assembly.parts, made, strict=True):
        if not part.fixed and abs(part.density / of.material.density - 1.0) > OTHER_WEIGHT:
            off.setdefault(of.material.name, []).append(part)
    return tuple(
        f"{quoted([p.name for p in parts], 3)} of {name}: counted with the given {parts[0].density:g} kg/m³, though "
        f"{name} has {made[assembly.index(parts[0].name)].material.density:g}; for that, --set "
        f"density={made[assembly.index(parts[0].name)].material.density:g}"
        for name, parts in off.items()
    )


_ENDLESS = Strength(tension=np.inf, compression=np.inf, shear=np.inf)
_GROUND = Material(
    name="ground", density=1.0, stiffness=1e9, poisson=0.2, strength=_ENDLESS, bearing=np.inf, friction=0.0
)


def axes_from_data(
    given: Mapping[str, Any], assembly: Assembly, own: Mapping[str, Material], where: str
) -> dict[str, Array]:
    """Return (d,) axes by part from the keys `grain` and `layers` of a configuration, for all parts and single ones.

    Raises InputError for no direction, and for a grain of what has layers, or layers of what has a grain or neither.
    """
    known, found, used = {**KNOWN, **own}, {}, set()
    for part in assembly.parts:
        mine = given.get("parts", {}).get(part.name, {})
        kind = known[part.material].direction if part.material in known else ""
        for wrong in {"grain", "layers"} - {kind}:
            if wrong in mine and part.material:
                has = f"has {kind}" if kind else "is the same in every direction, as far as is known"
                raise InputError(f"{where}: part '{part.name}' has {wrong}, but {part.material} {has}; remove {wrong}.")
        for said in (given, mine):
            if kind in said:
                used.add(kind)
                place = f"{where}: {kind} of part '{part.name}'"
                found[part.name] = axis_from_data(said[kind], place, kind, assembly.dimension)
    for kind in ("grain", "layers"):
        if kind in given and kind not in used:
            raise InputError(
                f"{where} has {kind}, but no part is of a material with {kind}; add material, or remove it."
            )
    return found
