"""How high solid joints of every family may get: clear of boundaries and of all other joints of the assembly."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mocca_robot.arrays import Array, BoolArray, read_only
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.clearance import height_limits
from mocca_robot.joints.families.family import Family
from mocca_robot.joints.families.sites import JointSites
from mocca_robot.joints.options import JointOptions

LEAN_IN_REACH = 0.2
"""Further lean of u (as |u' − u|, 11°) for which the reach of bumps is computed."""
MID_FLANK = 0.5
"""How far up the middle of a flank is."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BumpRoom:
    """How high bumps may get on every contact, worked out when it is first asked for.

    Attributes:
        sites: where the joints stand.
        can_curve: (E,) which contacts may become joints.
        u: (E, 3) their principal directions; bumps may lean from them by `LEAN_IN_REACH`.
    """

    assembly: Assembly
    contacts: tuple[Contact, ...]
    sites: JointSites
    can_curve: BoolArray
    u: Array
    options: JointOptions
    known: dict[tuple[float, bool], Array] = field(default_factory=dict)

    def of(self, family: Family) -> Array:
        """Return (E, 2) lowest and highest joint of a family on every contact, m."""
        key = (family.flank, family.follows_outline)
        if key not in self.known:
            self.known[key] = self._limits(family)
        return self.known[key]

    def _limits(self, family: Family) -> Array:
        reach = np.zeros((len(self.contacts), 2))
        some = np.flatnonzero(self.can_curve)
        if len(some):
            chosen = [self.contacts[int(e)] for e in some]
            sites = self.sites.only(some)
            margin = np.maximum(self.options.margin * sites.lengths, self.options.min_distance)
            samples = _outline_samples(sites, family.flank) if family.follows_outline else None
            low, high = height_limits(
                self.assembly,
                chosen,
                sites.rectangles,
                self.u[some],
                margin,
                LEAN_IN_REACH,
                family.flank,
                samples,
            )
            reach[some] = np.stack([low, high], axis=1)
        return read_only(reach)


def _outline_samples(sites: JointSites, flank: float) -> tuple[Array, Array]:
    """Return where (E, S, 2) bumps over outlines are asked for room, and how far up (S,) they are there."""
    rings = sites.outlines
    middle = np.full((len(rings), 1, 2), 0.5)
    mid_flank, top = (0.5 + (1.0 - 2.0 * share * flank) * (rings - 0.5) for share in (MID_FLANK, 1.0))
    up = np.repeat([MID_FLANK, 1.0, 1.0], [rings.shape[1], rings.shape[1], 1])
    return np.concatenate([mid_flank, top, middle], axis=1), up
