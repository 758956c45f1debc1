"""Where joints stand on their contacts: the rectangle inside each, and the outline, at a margin from the boundary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mocca_robot.arrays import Array, IntArray, read_only
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.frames import tangents
from mocca_robot.joints.bumps import Rectangles
from mocca_robot.joints.families.ring import ring_of, round_ring
from mocca_robot.joints.options import JointOptions
from mocca_robot.joints.rectangle import Rectangle, largest_rectangle

SMALLEST_SIDE = 1e-3
"""Of a rectangle that stands for a contact without room, as a share of the contact's length."""


@dataclass(frozen=True, eq=False)
class JointSite:
    """Where one joint stands: its contact, the rectangle on it, and the distance kept from the contact's boundary."""

    contact: Contact
    rectangle: Rectangle
    margin: float

    @property
    def length(self) -> float:
        """Return the shorter side, m: the same number, to the last bit, as `JointSites.lengths` has."""
        return float(np.linalg.norm((self.rectangle.l2 * self.rectangle.axis_y)[None], axis=1)[0])

    def middle(self, size: float) -> Rectangle:
        """Return the middle of the rectangle, `size` of its sides."""
        low, high = 0.5 - 0.5 * size, 0.5 + 0.5 * size
        return self.rectangle.part((low, low), (high, high))


def about_middle(xy: Array, sizes: Array) -> Array:
    """Return (E, K, 2) places xy (K, 2) in a rectangle's middle, `sizes` (E,) of its sides, in shares of the whole."""
    return np.asarray(0.5 + sizes[:, None, None] * (xy - 0.5))


@dataclass(frozen=True, eq=False, kw_only=True)
class JointSites:
    """Where E joints stand.

    Attributes:
        single: the site of each joint; None where a contact has no room for a joint.
        rectangles: of all joints, a tiny stand-in where there is none.
    """

    single: tuple[JointSite | None, ...]
    rectangles: Rectangles

    @classmethod
    def of(cls, contacts: Sequence[Contact], options: JointOptions) -> JointSites:
        """Return the sites of joints over `contacts`."""
        single = tuple(_site(c, options) for c in contacts)
        rectangles = [s.rectangle if s is not None else _stand_in(c) for s, c in zip(single, contacts)]
        return cls(single=single, rectangles=Rectangles.of(rectangles))

    @cached_property
    def lengths(self) -> Array:
        """Return (E,) shorter sides of the rectangles, m."""
        return read_only(np.linalg.norm(self.rectangles.edge_y, axis=1))

    @cached_property
    def aspect(self) -> Array:
        """Return (E,) shorter over longer sides of the rectangles."""
        return read_only(self.lengths / np.linalg.norm(self.rectangles.edge_x, axis=1))

    @cached_property
    def outlines(self) -> Array:
        """Return (E, M, 2) closed outlines inside the contacts, counter-clockwise, in shares of the rectangle."""
        return read_only(
            [round_ring() if s is None else ring_of(s.contact, s.rectangle, s.margin) for s in self.single]
        )

    def only(self, index: IntArray) -> JointSites:
        """Return the sites of the joints with these indices."""
        r = self.rectangles
        part = Rectangles(r.origin[index], r.edge_x[index], r.edge_y[index])
        return JointSites(single=tuple(self.single[int(e)] for e in index), rectangles=part)


def _site(contact: Contact, options: JointOptions) -> JointSite | None:
    scale = float(np.sqrt(contact.measure))
    if scale < options.min_contact:
        return None
    margin = max(options.margin * scale, options.min_distance)
    found = largest_rectangle(contact, margin)
    # Slivers hold nothing: below a tenth of the contact's size a bump is a scratch.
    return JointSite(contact, found, margin) if found is not None and found.l2 > 0.1 * scale else None


def _stand_in(contact: Contact) -> Rectangle:
    """Return a tiny rectangle in a contact that has no room for one, so that arrays stay rectangular."""
    x, y = tangents(contact.normal)
    side = SMALLEST_SIDE * float(np.sqrt(contact.measure))
    return Rectangle(read_only(contact.centre), read_only(x), read_only(y), side, side)
