"""Parts → contacts: where neighbouring parts share a flat interface.

A contact is a segment in 2D and a polygon in 3D. `find_contacts` also reports what nearly is one, so that a
drawing error shows up by name instead of as a structure that mysteriously falls.
"""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import ContactReport
from mocca_robot.contacts.flat import find_contacts_2d
from mocca_robot.contacts.inside import parts_inside
from mocca_robot.errors import InputError, NearlyTouching
from mocca_robot.tolerances import ROUNDING, TOLERANCES, Tolerances

CUT = (
    "Cut one out of the other (in Rhino: BooleanDifference; in Blender: the modifier Boolean, Difference; in FreeCAD: "
    "Part, Cut; in Inkscape: copy one, then Path, Difference), or move it."
)
"""What to do about parts that overlap, where they were made."""


def find_contacts(assembly: Assembly, tolerances: Tolerances = TOLERANCES) -> ContactReport:
    """Return all contacts between the parts of `assembly`, exact up to `tolerances.contact_gap` × size or its own
    `tolerance_m`.

    Contacts come sorted by pair, then along the boundary of the earlier part. Parts that overlap, and faces
    that nearly touch, are reported rather than raised: `require_sound` turns overlaps into an error.
    """
    if assembly.dimension == 3:
        from mocca_robot.contacts.solid import find_contacts_3d

        return find_contacts_3d(assembly, tolerances)
    return find_contacts_2d(assembly, tolerances)


def require_sound(assembly: Assembly, report: ContactReport) -> None:
    """Raise InputError when parts overlap, none is fixed, or a part touches nothing.

    It is a NearlyTouching where the parts were probably meant to touch.
    """
    if not assembly.fixed.any():
        raise InputError(
            f"No part of '{assembly.name}' is fixed; mark at least one as fixed (it stands on the ground)."
        )
    if report.overlaps:
        worst = max(report.overlaps, key=lambda o: o.depth_m)
        more = len(report.overlaps) - 1
        others = f" ({more} more pair{' overlaps' if more == 1 else 's overlap'})" if more else ""
        message = (
            f"Parts '{worst.parts[0]}' and '{worst.parts[1]}' overlap by {worst.depth_m * 1e3:.4g} mm near "
            f"({', '.join(f'{x:.4g}' for x in worst.place_m)}) m; parts may touch but not penetrate.{others} {CUT}"
        )
        _raise(assembly, report, message, worst.depth_m)
    touched = {p for c in report.contacts for p in c.parts}
    for index, part in enumerate(assembly.parts):
        if index not in touched and not part.fixed:
            near = [n for n in report.near_misses if part.name in n.parts]
            if not near:
                around = [outer for inner, outer in parts_inside(assembly, report.contacts) if inner == index]
                lies = f", and lies inside '{assembly.parts[around[0]].name}'" if around else ""
                raise InputError(
                    f"Part '{part.name}' floats free: it shares no face with any other part{lies}; move it against a "
                    "neighbour or remove it."
                )
            message = (
                f"Part '{part.name}' floats free: it shares no face with any other part; its nearest parallel face is "
                f"{near[0].gap_m * 1e3:.4g} mm away from '{next(p for p in near[0].parts if p != part.name)}'; "
                "close that gap."
            )
            _raise(assembly, report, message, near[0].gap_m)


def require_exact(assembly: Assembly, report: ContactReport) -> None:
    """Raise NearlyTouching when contacts exist only within the assembly's tolerance: joints and physics need parts that
    share their faces exactly.
    """
    if not report.accepted:
        return
    worst = max(report.accepted, key=lambda a: max(a.overlap_m, a.gap_m))
    overlaps = worst.overlap_m >= worst.gap_m
    amount = f"{'overlap by' if overlaps else 'are'} {max(worst.overlap_m, worst.gap_m) * 1e3:.4g} mm"
    more = len(report.accepted) - 1
    others = f" ({more} more pair{'' if more == 1 else 's'} like them)" if more else ""
    raise NearlyTouching(
        f"Parts '{worst.parts[0]}' and '{worst.parts[1]}' {amount}{'' if overlaps else ' apart'}{others}: within the "
        "tolerance, but joints and physics need parts that share their faces exactly.",
        rounded_up(assembly.tolerance_m),
    )


def _raise(assembly: Assembly, report: ContactReport, message: str, depth: float) -> NoReturn:
    """Raise NearlyTouching where a tolerance of what overlaps or misses is small beside every part, else InputError."""
    largest, _ = largest_tolerance(assembly)
    gaps = [n.gap_m for n in report.near_misses if n.gap_m <= 0.1 * largest]
    tolerance = rounded_up(1.05 * max([depth, *(o.depth_m for o in report.overlaps), *gaps]))
    if tolerance <= largest:
        raise NearlyTouching(message, tolerance)
    raise InputError(message)


def rounded_up(length: float) -> float:
    """Return the least length of two digits that is not smaller."""
    unit = 10.0 ** (np.floor(np.log10(length)) - 1)
    return float(f"{np.ceil(length / unit * (1.0 - ROUNDING)) * unit:.2g}")


def largest_tolerance(assembly: Assembly) -> tuple[float, str]:
    """Return the largest tolerance that still tells faces of one part apart, metres, and the thinnest part: a tenth of
    the least extent of any part.
    """
    least = [float(np.ptp(p.shape.bounds, axis=0).min()) for p in assembly.parts]
    thinnest = int(np.argmin(least))
    return 0.1 * least[thinnest], assembly.parts[thinnest].name
