"""What share of its strength is used: of a stress in a place, of a part, of a joint, of a whole assembly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.strength.options import MadeOf
from mocca_robot.strength.settings import ROUNDING

KINDS = ("tension", "compression", "shear", "bearing")
Method = Literal["estimate", "elements"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Use:
    """How much of one strength is used at one place.

    Attributes:
        kind: 'tension', 'compression', 'shear' or 'bearing'.
        share: stress over strength.
        stress, strength: Pa.
        place: (d,) metres, in the assembly.
        case: the load case.
        method: 'estimate' or 'elements'.
    """

    kind: str
    share: float
    stress: float
    strength: float
    place: Array
    case: str
    method: Method = "estimate"


@dataclass(frozen=True, eq=False, kw_only=True)
class PartStrength:
    """One part: the worst use of every kind.

    Attributes:
        material: its name.
        uses: one per kind that is used at all, the worst first.
        method: how stresses were found.
        neck: thinnest wall or neck (metres) and its place (d,); None where none was looked for.
        why: why the elements say nothing about it, where they were asked.
    """

    part: str
    material: str
    uses: tuple[Use, ...]
    method: Method = "estimate"
    neck: tuple[float, Array] | None = None
    why: str = ""

    @property
    def worst(self) -> Use | None:
        """Return the use with the largest share; None where nothing acts."""
        return self.uses[0] if self.uses else None

    @property
    def reached(self) -> float:
        """Return how many times its loads it bears; infinite where nothing acts."""
        return 1.0 / self.uses[0].share if self.uses and self.uses[0].share > 0.0 else np.inf


@dataclass(frozen=True, eq=False, kw_only=True)
class JointStrength:
    """What two parts press on each other with: the worst bearing pressure on either."""

    parts: tuple[str, str]
    use: Use


@dataclass(frozen=True, eq=False, kw_only=True)
class AssemblyStrength:
    """Everything that is said about the strength of an assembly.

    Attributes:
        safety: asked for.
        parts: one per free part, in assembly order.
        joints: one per pair of parts that press on each other.
        cases: names of all load cases that were looked at.
        left_out: states and insertions that are not in equilibrium, so that no strength can be told.
        notes: what had to be assumed.
        largest_scale: how many times as large it may be built in these materials; None where it was not asked.
        shades: by part (n, d + 1), places on its outside with the share used there, where elements found them.
    """

    safety: float
    parts: tuple[PartStrength, ...]
    joints: tuple[JointStrength, ...]
    cases: tuple[str, ...]
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    largest_scale: float | None = None
    shades: Mapping[str, Array] = field(default_factory=dict)

    def __repr__(self) -> str:
        verdict = "holds" if self.holds else "breaks"
        weakest = "" if self.weakest is None else f", weakest {self.weakest.part!r}"
        bears = f"bears {self.reached:.3g} times its loads (asked {self.safety:g})"
        return f"<AssemblyStrength: {len(self.parts)} parts, {verdict}, {bears}{weakest}>"

    @property
    def weakest(self) -> PartStrength | None:
        """Return the part that breaks first; None where nothing acts on any."""
        used = [p for p in self.parts if p.uses]
        return min(used, key=lambda p: p.reached) if used else None

    @property
    def reached(self) -> float:
        """Return how many times its loads the assembly bears."""
        return min((p.reached for p in self.parts), default=np.inf)

    @property
    def holds(self) -> bool:
        """Return whether every part bears its loads as many times as asked."""
        return self.reached >= self.safety

    @property
    def broken(self) -> tuple[PartStrength, ...]:
        """Return the parts that bear less than asked, the weakest first."""
        return tuple(sorted((p for p in self.parts if p.reached < self.safety), key=lambda p: p.reached))


def worst_of(uses: list[Use]) -> tuple[Use, ...]:
    """Return the worst use of every kind, the worst of all first; what is used for less than `ROUNDING` is left out."""
    found = [max((u for u in uses if u.kind == kind), key=lambda u: u.share, default=None) for kind in KINDS]
    kept = [u for u in found if u is not None and u.share > ROUNDING]
    return tuple(sorted(kept, key=lambda u: -u.share))


ACROSS_GRAIN, ACROSS_LAYERS = np.cos(np.deg2rad(70.0)), np.cos(np.deg2rad(45.0))
"""|normal · axis| of a cut: below the first it splits wood along its grain, above the second it parts layers."""


def allowed(made: MadeOf, normals: Array, kind: str) -> Array:
    """Return (P,) pascals of one kind on cuts with unit `normals` (P, d).

    A beam's stress on a slanting cut says nothing about what acts along and across a grain, so cuts count as either.
    """
    across = getattr(made.strength, kind)
    if made.axis is None or made.along is None:
        return np.full(len(normals), across)
    limit = ACROSS_GRAIN if made.material.direction == "grain" else ACROSS_LAYERS
    return np.asarray(np.where(np.abs(normals @ made.axis) >= limit, getattr(made.along, kind), across))


def shares(made: MadeOf, stress: Array) -> tuple[Array, Array]:
    """Return (m, 3) used shares of tension, compression and shear under stress tensors (m, d, d); and strengths, Pa.

    The same in every direction: largest principal tension and compression, and what of the state is pure shear. With
    an axis: along it, across it, and sliding along it, each against its own strength.
    """
    if made.axis is None or made.along is None:
        principal = np.linalg.eigvalsh(stress)
        pulled, pushed = np.maximum(principal[:, -1], 0.0), np.maximum(-principal[:, 0], 0.0)
        s = made.strength
        acting = np.stack([pulled, pushed, np.minimum(pulled, pushed)], axis=1)
        limits = np.broadcast_to([s.tension, s.compression, s.shear], acting.shape)
        return acting / limits, limits
    a = made.axis
    on_axis = stress @ a
    along = on_axis @ a
    sideways = np.linalg.norm(on_axis - along[:, None] * a, axis=1)
    flat = np.eye(len(a)) - np.outer(a, a)
    principal = np.linalg.eigvalsh(flat @ stress @ flat)
    used, bounds = [], []
    for kind, with_axis, across in (
        ("tension", np.maximum(along, 0.0), np.maximum(principal[:, -1], 0.0)),
        ("compression", np.maximum(-along, 0.0), np.maximum(-principal[:, 0], 0.0)),
    ):
        outer, inner = getattr(made.along, kind), getattr(made.strength, kind)
        first = with_axis / outer >= across / inner
        used.append(np.where(first, with_axis / outer, across / inner))
        bounds.append(np.where(first, outer, inner))
    shear = min(made.strength.shear, made.along.shear)
    return (
        np.stack([*used, sideways / shear], axis=1),
        np.stack([*bounds, np.full(len(sideways), shear)], axis=1),
    )
