"""Materials by name, every figure with its source, and what is weaker across a grain or layers; strengths in pascals.

Figures are characteristic or minimum values where a standard has them, means of data sheets otherwise; `safety` has to
cover the rest. Stone, plaster and brick are told by their modulus of rupture, which is what bends in a thin neck.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from mocca_robot.errors import InputError, nearest
from mocca_robot.files import fields
from mocca_robot.files.actions_data import quantity

STRESS = {"MPa": 1e6, "Pa": 1.0, "kPa": 1e3, "GPa": 1e9, "N/mm²": 1e6, "N/mm2": 1e6, "kN/m²": 1e3, "psi": 6894.757}
DENSITY = {"kg/m³": 1.0, "kg/m3": 1.0, "g/cm³": 1e3, "g/cm3": 1e3, "t/m³": 1e3}
FIGURES = ("density", "stiffness", "poisson", "tension", "compression", "shear", "bearing", "friction")
NEEDED = ("density", "stiffness", "poisson", "tension", "compression")
ACROSS = ("tension", "compression", "shear")
STRONGEST = 0.2
"""A strength above this share of the stiffness is a wrong unit: whiskers without any flaw reach a tenth."""


@dataclass(frozen=True, kw_only=True)
class Strength:
    """What a material bears in pascals: pulled, pressed and sheared."""

    tension: float
    compression: float
    shear: float


@dataclass(frozen=True, kw_only=True)
class Material:
    """A material.

    Attributes:
        density: kg/m³.
        stiffness: Young's modulus, Pa; only how much parts give depends on it, no stress does.
        poisson: Poisson's ratio.
        strength: along the grain, within layers, or in every direction.
        bearing: what a contact bears, Pa.
        friction: Coulomb coefficient on itself, dry; told, not used by itself.
        direction: 'grain' or 'layers' where the strength depends on the direction, else empty.
        across: across the grain, or across layers; None where no direction matters.
        sources: where each figure comes from, by its name.
    """

    name: str
    density: float
    stiffness: float
    poisson: float
    strength: Strength
    bearing: float
    friction: float
    direction: Literal["", "grain", "layers"] = ""
    across: Strength | None = None
    sources: Mapping[str, str] = field(default_factory=dict)

    @property
    def weakest(self) -> Strength:
        """Return the smaller strength of both directions, for a part whose direction nobody told."""
        if self.across is None:
            return self.strength
        least = {k: min(getattr(self.strength, k), getattr(self.across, k)) for k in ACROSS}
        return Strength(**least)


def _made(
    name: str,
    figures: tuple[float, float, float, float, float, float, float, float],
    source: str,
    direction: Literal["", "grain", "layers"] = "",
    across: tuple[float, float, float] | None = None,
    **others: str,
) -> Material:
    """Return a material from density, GPa, ratio, then MPa: tension, compression, shear, bearing; and friction.

    `source` is that of every figure which `others` does not name.
    """
    density, stiffness, poisson, tension, compression, shear, bearing, friction = figures
    return Material(
        name=name,
        density=density,
        stiffness=stiffness * 1e9,
        poisson=poisson,
        strength=Strength(tension=tension * 1e6, compression=compression * 1e6, shear=shear * 1e6),
        bearing=bearing * 1e6,
        friction=friction,
        direction=direction,
        across=None if across is None else Strength(**{k: v * 1e6 for k, v in zip(ACROSS, across)}),
        sources={f: others.get(f, source) for f in FIGURES}
        | ({"across": others.get("across_from", source)} if across else {}),
    )


_RUPTURE = "taken as the modulus of rupture (tension)"
_STONE = "bearing as compression; friction 0.6 of dry stone after Byerlee (1978) at low pressure, rounded down"
_GERCEK = "Gercek (2007), Poisson's ratio values for rocks, Int. J. Rock Mech. Min. Sci. 44"
_CRC = "order of magnitude, Carmichael (ed.), Practical Handbook of Physical Properties of Rocks and Minerals"
_TRESCA = "0.577 of tension (von Mises)"
_PLASTICS = "dry, order of magnitude; measure your own"

TABLE: tuple[Material, ...] = (
    _made("pla", (1240, 2.3, 0.35, 50, 60, 29, 60, 0.3), "Prusa Polymers, data sheet of Prusament PLA, rounded",
          "layers", (17, 50, 10), compression="Song et al. (2017), Materials & Design 123: more than tension",
          poisson="Song et al. (2017)", shear=_TRESCA, bearing="as compression", friction=_PLASTICS,
          across_from="interlayer adhesion 17 MPa, the same data sheet; shear 0.577 of it"),
    _made("petg", (1270, 1.5, 0.38, 45, 45, 26, 45, 0.3), "Prusa Polymers, data sheet of Prusament PETG, rounded down",
          "layers", (15, 40, 9), poisson="that of PET, Brandrup, Polymer Handbook", compression="as tension",
          shear=_TRESCA, bearing="as compression", friction=_PLASTICS,
          across_from="a third of tension, as PLA; shear 0.577 of it"),
    _made("resin", (1150, 2.8, 0.38, 65, 65, 37, 65, 0.3), "Formlabs, data sheet of Clear Resin V4, post-cured",
          density="data sheets of acrylate resins, cured", poisson="that of acrylates", compression="as tension",
          shear=_TRESCA, bearing="as compression", friction=_PLASTICS),
    _made("plaster", (1100, 4.0, 0.2, 2.0, 6.0, 2.0, 6.0, 0.6), "EN 13279-1, class B7: bending, compression",
          density="USG, data sheet of No. 1 Pottery Plaster, dry", friction="as stone, rounded",
          stiffness="Coquard and Boistelle (1994), dry set plaster", poisson="Coquard and Boistelle (1994)",
          shear="as tension", bearing="as compression"),
    _made("concrete", (2400, 31, 0.2, 1.8, 25, 1.8, 25, 0.5), "EN 1992-1-1, table 3.1, C25/30: fctk,0.05, fck, Ecm",
          density="EN 1991-1-1, table A.1", poisson="EN 1992-1-1, 3.1.3(4)", shear="as tension (12.6.3)",
          bearing="fck; 6.7 allows more where the face is larger", friction="EN 1992-1-1, 6.2.5, very smooth"),
    _made("uhpc", (2500, 50, 0.2, 7.0, 150, 7.0, 150, 0.5), "AFGC, recommendations on UHPFRC (2013)",
          shear="as tension", bearing="as compression", friction="as concrete"),
    _made("brick", (1800, 8.0, 0.2, 1.0, 20, 1.0, 20, 0.6), "EN 771-1, solid clay units of class 20",
          stiffness="order of magnitude, CUR report 171 (1994)", poisson="CUR report 171 (1994)",
          tension="0.05 of compression, CUR report 171 (1994): 1.5 MPa and more", shear="as tension",
          friction="EN 1996-1-1, 3.6.2 (0.4) and dry tests (0.6 to 0.7)"),
    _made("sandstone", (2000, 15, 0.2, 2.4, 27.6, 2.4, 27.6, 0.6), f"ASTM C616, class I, minima; {_RUPTURE}",
          stiffness=_CRC, poisson=_GERCEK, shear="as tension", bearing=_STONE, friction=_STONE),
    _made("limestone", (2160, 25, 0.25, 3.4, 28, 3.4, 28, 0.6), f"ASTM C568, class II, minima; {_RUPTURE}",
          stiffness=_CRC, poisson=_GERCEK, shear="as tension", bearing=_STONE, friction=_STONE),
    _made("marble", (2590, 50, 0.25, 7.0, 52, 7.0, 52, 0.6), f"ASTM C503, minima; {_RUPTURE}",
          stiffness=_CRC, poisson=_GERCEK, shear="as tension", bearing=_STONE, friction=_STONE),
    _made("plywood", (680, 8.0, 0.1, 30, 24, 9.5, 24, 0.4), "Handbook of Finnish Plywood, birch, weaker direction in "
          "the plane of the plate, rounded down", poisson="plates of crossed layers, order of magnitude",
          bearing="as compression", friction="EN 1995-2, wood on wood, dry"),
    _made("pine", (420, 11.0, 0.35, 14.5, 21, 4.0, 21, 0.4), "EN 338 (2016), class C24", "grain", (0.4, 2.5, 4.0),
          poisson="Wood Handbook (Forest Products Laboratory), LR of pines", bearing="as compression along the grain",
          friction="EN 1995-2, wood on wood, dry"),
    _made("oak", (640, 11.0, 0.35, 18, 24, 3.9, 24, 0.4), "EN 338 (2016), class D30", "grain", (0.6, 5.3, 3.9),
          poisson="Wood Handbook (Forest Products Laboratory), LR of oaks", bearing="as compression along the grain",
          friction="EN 1995-2, wood on wood, dry"),
    _made("acrylic", (1190, 3.3, 0.37, 70, 100, 40, 100, 0.4), "Röhm, data sheet of Plexiglas XT, rounded down",
          shear=_TRESCA, bearing="as compression", friction=_PLASTICS),
    _made("aluminium", (2700, 70, 0.3, 250, 250, 144, 250, 0.4), "EN 1999-1-1, EN AW-6082 T6, proof stress",
          shear=_TRESCA, bearing="as compression", friction="dry, order of magnitude"),
)  # fmt: skip
"""Fifteen materials that people print, cast, saw and quarry."""

KNOWN: Mapping[str, Material] = {m.name: m for m in TABLE}


def materials_from_data(data: object, where: str) -> dict[str, Material]:
    """Return the own materials of a configuration, {NAME: {density: 1100 kg/m³, …}}, by name.

    Raises InputError for unknown keys, figures without a unit or out of range, a strength beyond its stiffness, and
    `across` without `direction` or the other way round.
    """
    found = {}
    for key, entry in fields.mapping(data, where).items():
        name = fields.part_name(key, where)
        found[name] = _from_data(name, entry, f"{where}: '{name}'")
    return found


def _from_data(name: str, entry: object, where: str) -> Material:
    given = fields.mapping(entry, where, (*FIGURES, "direction", "across", "source"))
    for key in NEEDED:
        if key not in given:
            raise InputError(f"{where} has no '{key}'; a material needs {', '.join(NEEDED)}, such as tension: 30 MPa.")
    stiffness = quantity(given["stiffness"], STRESS, f"{where}: stiffness")
    strength = _strengths(given, where, stiffness)
    poisson = fields.number(given["poisson"], f"{where}: poisson", above=-1.0, below=0.5)
    direction = fields.choice(given.get("direction", ""), ("", "grain", "layers"), f"{where}: direction")
    if bool(direction) != ("across" in given):
        lacking = ("'across'", "the strength across it") if direction else ("'direction'", "grain or layers")
        raise InputError(f"{where} has no {lacking[0]} beside its other half; add {lacking[1]}, or remove both.")
    across = None
    if direction:
        inner = fields.mapping(given["across"], f"{where}: across", ACROSS)
        for key in ("tension", "compression"):
            if key not in inner:
                raise InputError(
                    f"{where}: across has no '{key}'; write across: {{tension: 1 MPa, compression: 3 MPa}}."
                )
        across = _strengths(inner, f"{where}: across", stiffness)
    source = fields.text(given["source"], f"{where}: source") if "source" in given else "the configuration"
    return Material(
        name=name,
        density=quantity(given["density"], DENSITY, f"{where}: density"),
        stiffness=stiffness,
        poisson=poisson,
        strength=strength,
        bearing=quantity(given["bearing"], STRESS, f"{where}: bearing") if "bearing" in given else strength.compression,
        friction=fields.number(given.get("friction", 0.0), f"{where}: friction", 0.0, 10.0),
        direction=direction,  # type: ignore[arg-type]
        across=across,
        sources=dict.fromkeys(given, source),
    )


def _strengths(given: Mapping[str, object], where: str, stiffness: float) -> Strength:
    found = {k: quantity(given[k], STRESS, f"{where}: {k}") for k in ACROSS if k in given}
    for key, value in found.items():
        if value > STRONGEST * stiffness:
            raise InputError(
                f"{where}: {key} is {value / 1e6:g} MPa, but its stiffness only {stiffness / 1e6:g} MPa; a unit is "
                "mixed up. Strengths are mostly in MPa, stiffnesses in GPa."
            )
    return Strength(**{**found, "shear": found.get("shear", found["tension"])})


def material_named(name: str, own: Mapping[str, Material], where: str) -> Material:
    """Return a material of the table or of `own`, which goes first. Raises InputError with the nearest name."""
    known = {**KNOWN, **own}
    if name not in known:
        raise InputError(f"{where} is '{name}', of which no strength is known; {nearest(name, known)}")
    return known[name]
