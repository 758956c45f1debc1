"""Which families there are: by the name that users write, by a joint's kind, and again from stored numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, partial

from mocca_robot.arrays import Array
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.bumps import FLANK_SEGMENTS
from mocca_robot.joints.families.bump import Bump
from mocca_robot.joints.families.drawn import Drawn, stored_drawn
from mocca_robot.joints.families.family import Family
from mocca_robot.joints.families.frusta import Frustum
from mocca_robot.joints.families.heights import Heights, stored_heights_joint
from mocca_robot.joints.families.outline import OutlineFrustum, stored_outline
from mocca_robot.joints.families.rib import Rib, stored_rib
from mocca_robot.joints.families.several import Several, stored_several
from mocca_robot.joints.joint import Joint
from mocca_robot.joints.options import JointOptions
from mocca_robot.joints.rectangle import Rectangle

Rebuild = Callable[[Contact, Rectangle, Array, Mapping[str, float], int], Joint]

STORED: dict[str, Rebuild] = {
    "free": stored_heights_joint,
    **{f"heights_{k}": stored_heights_joint for k in (3, 4, 5, 6)},
    **{kind: partial(stored_rib, kind) for kind in ("rib", "rib_across")},
    **{kind: partial(stored_several, kind) for kind in ("twins", "four")},
    "outline": lambda contact, rectangle, u, numbers, _: stored_outline(contact, rectangle, u, numbers),
    "drawn": stored_drawn,
}
"""Kinds of joints that these families build → the joint again from its numbers."""


@cache
def family_named(name: str, options: JointOptions) -> Family:
    """Return a family by its name, as `options` want it tessellated. Raises KeyError for unknown names."""
    pieces = 1 if options.piecewise_planar else FLANK_SEGMENTS
    made: dict[str, Callable[[], Family]] = {
        "n": lambda: Bump(pieces),
        "frustum": lambda: Frustum(pieces),
        "free": lambda: Heights(2, pieces),
        **{f"heights_{k}": partial(Heights, k, pieces) for k in (3, 4, 5, 6)},
        "rib": lambda: Rib(0, pieces),
        "rib_across": lambda: Rib(1, pieces),
        "twins": lambda: Several(1, pieces),
        "four": lambda: Several(2, pieces),
        "outline": lambda: OutlineFrustum(),
        "drawn": lambda: Drawn(options.profile, pieces),
    }
    return made[name]()


def further_families(options: JointOptions) -> tuple[str, ...]:
    """Return the families beyond plain bumps that `options` allow, those with fewest numbers first."""
    asked = {
        "outline": ("outline",),
        "rib": ("rib", "rib_across"),
        "free": ("free",),
        "several": ("twins", "four"),
        "heights": ("free",) if options.control_heights == 2 else (f"heights_{options.control_heights}",),
    }
    names = dict.fromkeys(name for kind, mine in asked.items() if kind in options.kinds for name in mine)
    return tuple(n for n in names if options.min_radius <= 0.0 or not family_named(n, options).sharp)
