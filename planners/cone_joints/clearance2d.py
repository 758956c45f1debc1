"""Room for flat joints inside their parts, as distances to the edges they must keep away from (Fig. 10, 14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Assembly, Polygon
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.frames import tangents
from mocca_robot.joints.options import JointOptions
from mocca_robot.tolerances import COARSE, TINY

STAYS = 1e-4
"""Relative to the assembly's size: edges this near a contact are the contact itself."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Clearance2D:
    """Boundary edges that each joint must keep away from.

    A joint's bump stays `margin` away from every other edge of the part it goes into, and nearer to its own
    contact than to any other contact of that part, so that joints never meet whatever their parameters.

    Attributes:
        start, end: (E, 2, K, 2) obstacle edges for joint e on side 0 (inside P_i) and 1 (inside P_j), padded.
        is_contact: (E, 2, K) whether the obstacle may itself become a joint.
        margin: (E,) metres.
        origin, normal: (E, 2) first end and normal of each contact. length: (E,) m.
    """

    start: Array
    end: Array
    is_contact: BoolArray
    margin: Array
    origin: Array
    normal: Array
    length: Array

    def violation(self, curves: Array) -> Array:
        """Return (E, V) how far, m, curve points (E, V, 2) are beyond their room; ≤ 0 where all is well."""
        offset = curves - self.origin[:, None]
        height = np.einsum("evd,ed->ev", offset, self.normal)
        along = np.einsum("evd,ed->ev", offset, tangents(self.normal)[:, 0])
        beside = np.maximum(np.maximum(-along, along - self.length[:, None]), 0.0)
        own = np.hypot(height, beside)
        # Every point looks at the obstacles of the part it is in.
        side = (height > 0).astype(np.int64)
        joint = np.arange(len(curves))[:, None]
        a = self.start[joint, side]
        d = self.end[joint, side] - a
        to_point = curves[:, :, None] - a
        t = (to_point * d).sum(axis=-1) / np.maximum((d * d).sum(axis=-1), TINY)
        gap = to_point - np.clip(t, 0.0, 1.0)[..., None] * d
        distance = np.sqrt((gap * gap).sum(axis=-1))
        needed = self.margin[:, None, None] + np.where(self.is_contact[joint, side], own[..., None], 0.0)
        worst = (needed - distance).max(axis=-1)
        flat = np.abs(height) <= COARSE * self.length[:, None]
        return np.where(flat, -self.length[:, None], worst)


def clearance_2d(assembly: Assembly, contacts: Sequence[Contact], options: JointOptions) -> Clearance2D:
    """Return the obstacles of every contact: the edges of its two parts within reach of an allowed bump."""
    pieces = [_boundary_pieces(assembly, contacts, part) for part in range(len(assembly.parts))]
    lengths = np.array([c.measure for c in contacts])
    margin = np.maximum(options.margin * lengths, options.min_distance)
    near: list[list[tuple[Array, Array, BoolArray]]] = []
    for e, contact in enumerate(contacts):
        # Farther than this from the middle of the contact no bump point is within its margin, or half way.
        reach = lengths[e] * (0.5 + 2.0 * options.max_height) + margin[e]
        sides = []
        for part in contact.parts:
            start, end, owner = pieces[part]
            close = (owner != e) & (_distance_to_segments(contact.centre, start, end) <= reach)
            sides.append((start[close], end[close], np.asarray(owner[close] >= 0)))
        near.append(sides)
    most = max((len(s[0]) for sides in near for s in sides), default=0) or 1
    far = 1e3 * assembly.size
    start = np.full((len(contacts), 2, most, 2), far)
    end = start + 1.0
    is_contact = np.zeros((len(contacts), 2, most), dtype=np.bool_)
    for index, sides in enumerate(near):
        for side, (a, b, joints) in enumerate(sides):
            start[index, side, : len(a)] = a
            end[index, side, : len(a)] = b
            is_contact[index, side, : len(a)] = joints
    origin = np.array([c.polygon[0] for c in contacts])
    # The line through both ends, not the contact's own normal: drawings are exact to about six digits only.
    t = (np.array([c.polygon[1] for c in contacts]) - origin) / lengths[:, None]
    return Clearance2D(
        start=start,
        end=end,
        is_contact=is_contact,
        margin=margin,
        origin=origin,
        normal=np.stack([t[:, 1], -t[:, 0]], axis=1),
        length=lengths,
    )


def _distance_to_segments(point: Array, start: Array, end: Array) -> Array:
    d = end - start
    t = np.clip(((point - start) * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), TINY), 0.0, 1.0)
    return np.asarray(np.linalg.norm(point - start - t[:, None] * d, axis=1))


def _boundary_pieces(assembly: Assembly, contacts: Sequence[Contact], part: int) -> tuple[Array, Array, IntArray]:
    """Return the boundary of a part cut at its contacts: starts, ends (K, 2) and the contact's index or −1."""
    shape = assembly.parts[part].shape
    assert isinstance(shape, Polygon)
    tolerance = STAYS * assembly.size
    start = np.concatenate(shape.rings)
    end = np.concatenate([np.roll(r, -1, axis=0) for r in shape.rings])
    length = np.linalg.norm(end - start, axis=1)
    t = (end - start) / length[:, None]
    outward = np.stack([t[:, 1], -t[:, 0]], axis=1)
    cuts: dict[int, list[tuple[float, float, int]]] = {}
    for e, contact in enumerate(contacts):
        if part not in contact.parts:
            continue
        offset = contact.polygon[None] - start[:, None]  # (edges, 2, 2)
        along = np.einsum("esd,ed->es", offset, t)
        off = np.abs(np.einsum("esd,ed->es", offset, outward)).max(axis=1)
        facing = outward @ contact.normal * (1.0 if contact.parts[0] == part else -1.0)
        inside = (along.min(axis=1) > -tolerance) & (along.max(axis=1) < length + tolerance)
        for k in np.flatnonzero(inside & (off < tolerance) & (facing > 0.9)):
            cuts.setdefault(int(k), []).append((float(along[k].min()), float(along[k].max()), e))
    whole = np.ones(len(start), dtype=np.bool_)
    whole[list(cuts)] = False
    starts, ends, owners = [start[whole]], [end[whole]], [np.full(int(whole.sum()), -1)]
    for edge, marks in cuts.items():
        marks.sort()
        position = 0.0
        for left, right, owner in [*marks, (float(length[edge]), float(length[edge]), -1)]:
            if left - position > tolerance:
                _append(starts, ends, owners, start[edge], t[edge], position, left, -1)
            if owner >= 0:
                _append(starts, ends, owners, start[edge], t[edge], left, right, owner)
            position = right
    return np.concatenate(starts), np.concatenate(ends), np.concatenate(owners)


def _append(
    starts: list[Array], ends: list[Array], owners: list[IntArray], origin: Array, t: Array, a: float, b: float, e: int
) -> None:
    starts.append((origin + a * t)[None])
    ends.append((origin + b * t)[None])
    owners.append(np.array([e]))
