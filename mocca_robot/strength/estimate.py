"""The fast estimate: cuts through a part as beams, with factors for notches and for what spreads under a pressure.

It needs no mesh inside the part and no package beyond the core. Against the elements on random parts it is hardly ever
on the unsafe side; how far is on the page about strength.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Part, Polygon
from mocca_robot.strength.cases import PartLoads
from mocca_robot.strength.cuts2d import beyond2d, cuts2d
from mocca_robot.strength.cuts3d import Touched, beyond3d, cuts3d
from mocca_robot.strength.options import MadeOf
from mocca_robot.strength.sections import Sections
from mocca_robot.strength.uses import Use, allowed

NOTCH = {2: 2.5, 3: 5.0}
"""By dimension: stress in a corner over that of the cut through it, tension and compression; a beam's shear has 1.5."""
SPLIT = {2: 0.35, 3: 0.8}
"""By dimension: tension beside and below a pressed patch over its pressure: splitting, and the rim of a stiff stamp."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Cuts:
    """A part with its cuts; `points` (S, d) are the contact samples that they know."""

    part: Part
    points: Array
    sections: Sections

    @classmethod
    def of(cls, part: Part, loads: PartLoads) -> Cuts:
        """Return the cuts of a part from its contacts with all neighbours, see `cases.untouched`."""
        if isinstance(part.shape, Polygon):
            return cls(part=part, points=loads.points, sections=cuts2d(part.shape, loads.points))
        touched = []
        for other in np.unique(loads.beside):
            mine = np.flatnonzero(loads.beside == other)
            mean = (loads.areas[mine, None] * loads.normals[mine]).sum(axis=0)
            size = float(np.linalg.norm(mean))
            if size > 0.3 * float(loads.areas[mine].sum()):
                touched.append(Touched(samples=mine, normal=mean / size))
        return cls(part=part, points=loads.points, sections=cuts3d(part.shape, loads.points, touched))


def estimated(cuts: Cuts, made: MadeOf, loads: PartLoads) -> list[Use]:
    """Return the worst uses of a part's strength in one load case."""
    sections, part = cuts.sections, cuts.part
    points, forces = loads.points, loads.forces
    if len(points) < len(cuts.points):  # some neighbours are not there yet
        sections = _only(sections, cuts.points, points)
    where = loads.further[0]
    if isinstance(part.shape, Polygon):
        there = beyond2d(sections, part.shape, where) if len(where) else np.zeros((len(sections.areas), 0), dtype=bool)
    else:
        levels = np.einsum("pd,pd->p", sections.normals, sections.centres)
        there = beyond3d(sections.normals, levels, where)
    body = part.density * loads.gravity
    found = sections.stresses(points, forces, body, (*loads.further, there))
    notch = NOTCH[part.shape.dimension]
    stresses = (notch * np.maximum(found[:, 0], 0.0), notch * np.maximum(-found[:, 1], 0.0), found[:, 2])
    uses = []
    for kind, stress in zip(("tension", "compression", "shear"), stresses):
        limit = allowed(made, sections.normals, kind)
        worst = int((stress / limit).argmax())
        uses.append(_use(kind, stress[worst], limit[worst], sections.centres[worst], loads.case))
    return uses + pressing(made, loads)


def pressing(made: MadeOf, loads: PartLoads) -> list[Use]:
    """Return the use of bearing strength, and the tension that a pressure brings with it."""
    if not len(loads.points):
        return []
    pressure = np.maximum(loads.pressure, 0.0)
    bearing = np.full(len(pressure), made.material.bearing)
    if made.axis is not None:
        bearing = np.minimum(bearing, allowed(made, loads.normals, "compression"))
    worst = int((pressure / bearing).argmax())
    most = int(pressure.argmax())
    pulled = min(made.strength.tension, np.inf if made.along is None else made.along.tension)
    return [
        _use("bearing", pressure[worst], bearing[worst], loads.points[worst], loads.case),
        _use("tension", SPLIT[loads.points.shape[1]] * pressure[most], pulled, loads.points[most], loads.case),
    ]


def _use(kind: str, stress: float, strength: float, place: Array, case: str) -> Use:
    share = float(stress) / float(strength)
    return Use(kind=kind, share=share, stress=float(stress), strength=float(strength), place=place, case=case)


def _only(sections: Sections, known: Array, points: Array) -> Sections:
    """Return sections with only those samples that are among `points`, in their order."""
    index = {tuple(p): k for k, p in enumerate(known)}
    return replace(sections, beyond=sections.beyond[:, [index[tuple(p)] for p in points]])


def thinnest(cuts: Cuts) -> tuple[float, Array] | None:
    """Return the width (metres) and the middle (d,) of the narrowest cut of a flat part; None for solids."""
    shape = cuts.part.shape
    if not isinstance(shape, Polygon) or not len(cuts.sections.areas):
        return None
    # Cuts that only shave off a corner are no necks: both sides hold at least a hundredth of the part.
    share = cuts.sections.volumes / shape.volume
    neck = np.where((share > 0.01) & (share < 0.99), cuts.sections.areas, np.inf)
    worst = int(neck.argmin())
    return (float(neck[worst]) / shape.thickness, cuts.sections.centres[worst]) if np.isfinite(neck[worst]) else None
