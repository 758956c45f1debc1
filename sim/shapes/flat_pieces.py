"""What collides while a flat part travels into its seat: all its prisms against all prisms of the earlier parts.

The earlier parts carry each other where they share a contact, as when they are left alone: prisms that share just a
corner would hold each other up, and finding out that the rest does not touch costs most of a step.
"""

from __future__ import annotations

from dataclasses import replace

import shapely

from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.errors import InputError
from mocca_robot.geometry.polygons import to_shapely
from sim.shapes.contact_model import ContactModel, Geom, pieces


def flat_pieces(assembly: Assembly, resting: ContactModel, part: int, clearance: float = 0.0) -> ContactModel:
    """Return the model for driving `part`, made smaller by `clearance` (m) all around; the others keep their size.

    `resting` are all parts with the pairs that meet at rest (`pieces` with contacts). Raises InputError when nothing
    of the part is left.
    """
    keep = [k for k, g in enumerate(resting.geoms) if g.part != part]
    new = {old: k for k, old in enumerate(keep)}
    pairs = tuple((new[a], new[b]) for a, b in resting.pairs or () if a in new and b in new)
    own = [g for g in resting.geoms if g.part == part] if clearance == 0.0 else _shrunk(assembly, part, clearance)
    others = (replace(resting.geoms[k], role="face") for k in keep)
    return ContactModel((*others, *(replace(g, part=part, role="point") for g in own)), pairs)


def _shrunk(assembly: Assembly, part: int, clearance: float) -> tuple[Geom, ...]:
    shape = assembly.parts[part].shape
    assert isinstance(shape, Polygon)
    smaller = shapely.buffer(to_shapely(shape), -clearance, join_style="mitre", mitre_limit=2.0)
    if smaller.is_empty:
        raise InputError(
            f"Nothing of part '{assembly.parts[part].name}' is left with {clearance * 1e3:.3g} mm of clearance; "
            "ask for less."
        )
    largest = max(shapely.get_parts(smaller), key=shapely.area)
    rings = [shapely.get_coordinates(r)[:-1] for r in (largest.exterior, *largest.interiors)]
    lone = replace(assembly.parts[part], shape=Polygon(rings[0], tuple(rings[1:]), shape.thickness))
    return pieces(Assembly(assembly.name, (lone,), gravity=assembly.gravity)).geoms
