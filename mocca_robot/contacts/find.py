"""Parts → contacts: where neighbouring parts share a flat interface.

A contact is a segment in 2D and a polygon in 3D. `find_contacts` also reports what nearly is one, so that a
drawing error shows up by name instead of as a structure that mysteriously falls.
"""

from __future__ import annotations

from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.contacts.flat import find_contacts_2d
from mocca_robot.errors import InputError
from mocca_robot.tolerances import TOLERANCES, Tolerances


def find_contacts(assembly: Assembly, tolerances: Tolerances = TOLERANCES) -> ContactReport:
    """Return all contacts between the parts of `assembly`, exact up to `tolerances.contact_gap` × size.

    Contacts come sorted by pair, then along the boundary of the earlier part. Parts that overlap, and faces
    that nearly touch, are reported rather than raised: `require_sound` turns overlaps into an error.
    """
    if assembly.dimension == 3:
        from mocca_robot.contacts.solid import find_contacts_3d

        return find_contacts_3d(assembly, tolerances)
    return find_contacts_2d(assembly, tolerances)


def require_sound(assembly: Assembly, report: ContactReport) -> None:
    """Raise InputError when parts overlap, none is fixed, or a part touches nothing."""
    if not assembly.fixed.any():
        raise InputError(
            f"No part of '{assembly.name}' is fixed; mark at least one as fixed (it stands on the ground)."
        )
    if report.overlaps:
        worst = max(report.overlaps, key=lambda o: o.depth_m)
        more = len(report.overlaps) - 1
        others = f" ({more} more pair{' overlaps' if more == 1 else 's overlap'})" if more else ""
        raise InputError(
            f"Parts '{worst.parts[0]}' and '{worst.parts[1]}' overlap by {worst.depth_m * 1e3:.4g} mm; "
            f"parts may touch but not penetrate.{others}"
        )
    touched = {p for c in report.contacts for p in c.parts}
    for index, part in enumerate(assembly.parts):
        if index not in touched and not part.fixed:
            near = [n for n in report.near_misses if part.name in n.parts]
            hint = (
                f"its nearest parallel face is {near[0].gap_m * 1e3:.4g} mm away from "
                f"'{next(p for p in near[0].parts if p != part.name)}'; close that gap"
                if near
                else "move it against a neighbour or remove it"
            )
            raise InputError(f"Part '{part.name}' floats free: it shares no face with any other part; {hint}.")
