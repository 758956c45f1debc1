"""Joints of a stored design as geometry again: their numbers, over the contacts of the assembly as it was handed in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.contacts.contact import Contact
from mocca_robot.errors import InputError, nearest
from mocca_robot.files.design_json import StoredDesign, StoredJoint
from mocca_robot.joints.bicubic import bicubic_joint, rectangle_from
from mocca_robot.joints.families.known import STORED
from mocca_robot.joints.frustum import frustum_joint
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.joints.spline import SplineKind, polyline_joint, spline_points
from mocca_robot.joints.tenon import tenon_joint, tenon_joint_2d
from mocca_robot.tolerances import TOLERANCES

KINDS = {
    2: ("planar", "n", "z", "piecewise_n", "piecewise_z", "tenon"),
    3: ("planar", "bicubic", "bicubic_z", "piecewise", "piecewise_z", "frustum", "tenon", *STORED),
}


def joints_of(stored: StoredDesign, contacts: Sequence[Contact]) -> tuple[Joint, ...]:
    """Return the joints of `stored` over `contacts`, those of its source, in the file's order.

    Raises InputError when the file does not hold its source, lists other joints than the contacts leave room for,
    knows a kind or numbers that cannot be built, or when a joint is not what its two parts have between them.
    """
    where = f"'{stored.path}'"
    source = stored.source
    if not stored.joints:
        return ()
    if source is None:
        raise InputError(f"{where} does not hold the parts as they were handed in; design again to see the joints.")
    waiting: dict[tuple[str, str], list[Contact]] = {}
    for contact in contacts:
        first, second = (source.parts[p].name for p in contact.parts)
        waiting.setdefault((first, second), []).append(contact)
    found = []
    for k, joint in enumerate(stored.joints):
        place = f"{where}: joints[{k}] ({joint.parts[0]} – {joint.parts[1]})"
        mine = waiting.get(joint.parts)
        if not mine:
            raise InputError(f"{place} has no contact of its own in the source; the file was altered. Design again.")
        found.append(_built(joint, mine.pop(0), place))
        if not _stands_in(stored.assembly, found[-1]):
            raise InputError(f"{place} is not what lies between the parts; the file was altered. Design again.")
    return tuple(found)


def _built(stored: StoredJoint, contact: Contact, where: str) -> Joint:
    dimension = contact.polygon.shape[1]
    if stored.kind not in KINDS[dimension]:
        raise InputError(f"{where} is of the unknown type '{stored.kind}'; {nearest(stored.kind, KINDS[dimension])}")
    if stored.kind == "planar":
        return planar(contact)
    try:
        return _flat(stored, contact) if dimension == 2 else _solid(stored, contact)
    except KeyError as error:
        raise InputError(f"{where} lacks the parameter {error}; the file is incomplete. Design again.") from None
    except ValueError as error:  # a direction along the contact, a rectangle without sides
        raise InputError(f"{where} cannot be built: {error}. Design again.") from None


def _flat(stored: StoredJoint, contact: Contact) -> Joint:
    numbers, u = stored.parameters, stored.direction
    if stored.kind == "tenon":
        return tenon_joint_2d(contact, u, numbers["a"], numbers["b"], numbers["height_m"])
    names = ("w1", "w2", "h1", "h2") if stored.kind.endswith("z") else ("w1", "w2", "h")
    shape = np.zeros((1, 4))
    shape[0, : len(names)] = [numbers[name] / contact.measure for name in names]
    piecewise = stored.kind.startswith("piecewise")
    family: SplineKind = "z" if stored.kind.endswith("z") else "n"
    points = spline_points(family, contact.polygon[None], u[None], shape, piecewise)[0]
    return polyline_joint(contact, stored.kind, u, points, dict(numbers))


def _solid(stored: StoredJoint, contact: Contact) -> Joint:
    numbers, rectangle = stored.parameters, rectangle_from(stored.parameters)
    if not min(rectangle.l1, rectangle.l2) > 0.0:
        raise ValueError(f"its rectangle has sides of {rectangle.l1:g} m and {rectangle.l2:g} m")
    if stored.kind == "tenon":
        return tenon_joint(contact, rectangle, numbers["height_m"], stored.direction, numbers["draft_rad"])
    if stored.kind == "frustum":
        return frustum_joint(contact, rectangle, numbers["height_m"], stored.direction, numbers["flank"])
    segments = 1 if stored.kind == "outline" else int(numbers["flank_segments"])
    if not 1 <= segments <= 100:
        raise ValueError(f"{segments} pieces per flank")
    if stored.kind in STORED:
        return STORED[stored.kind](contact, rectangle, stored.direction, numbers, segments)
    family = "z" if stored.kind.endswith("_z") else "n"
    return bicubic_joint(contact, rectangle, numbers["height_m"], stored.direction, segments, family)


def _stands_in(built: Assembly, joint: Joint) -> bool:
    """Return whether every point of the joint's surface is a point of both parts' boundaries."""
    if joint.is_planar:
        return True
    rim = sum(len(ring) for ring in (joint.contact.polygon, *joint.contact.holes))
    surface = joint.vertices[1:-1] if built.dimension == 2 else joint.vertices[rim:]
    if not np.isfinite(surface).all():
        return False
    gap = 4.0 * TOLERANCES.contact_gap * built.size
    for part in joint.contact.parts:
        distance, _ = KDTree(_corners(built, part)).query(surface)
        if np.max(distance, initial=0.0) > gap:
            return False
    return True


def _corners(assembly: Assembly, part: int) -> Array:
    shape = assembly.parts[part].shape
    return np.concatenate(shape.rings) if isinstance(shape, Polygon) else shape.vertices
