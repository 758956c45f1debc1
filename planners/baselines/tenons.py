"""Single-direction joints for comparison: tenons along each contact's normal, a part's way out, or a bump's u."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.contacts.contact import Contact
from mocca_robot.joints.bicubic import MAX_LEAN, Rectangles, largest_rectangle
from mocca_robot.joints.clearance import height_limits
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.joints.options import JointOptions
from mocca_robot.joints.tenon import tenon_joint, tenon_joint_2d, tenon_of
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.tolerances import COARSE
from planners.cone_joints.clearance2d import clearance_2d

LEVEL = 1e-3
"""Height relative to its width from which on a joint counts as a bump."""

BREADTH = (0.3, 0.7)
"""Ends of a flat tenon, as shares of its contact's length."""
INSET = 0.25
"""Share of the contact's rectangle that an upright tenon leaves free on every side."""
UPRIGHT = 1.0 / np.sqrt(1.0 + MAX_LEAN**2)
"""Smallest u·n: a tenon along a contact would leave it sideways."""


def tenons_along_exits(graph: PartsGraph, exits: Mapping[int, Array], options: JointOptions) -> tuple[Joint, ...]:
    """Return flat joints that let every part leave along its way out `exits[part]` (2,) and in no other way.

    Tenons are as high as the parts have room for, up to 0.35 of the contact's length. Contacts that are nearly
    parallel to the way out, or too tight for a tenon, stay planar.
    """
    clearance = clearance_2d(graph.assembly, graph.contacts, options)
    joints = list(graph.joints)
    for share in (0.35, 0.25, 0.15, 0.08):
        for sign in (1.0, -1.0):
            tried = [_flat_tenon(c, exits.get(c.parts[1]), sign * share) for c in graph.contacts]
            curves = np.array([_dense(t or flat) for t, flat in zip(tried, graph.joints)])
            room = clearance.violation(curves).max(axis=1)
            joints = [t if j.is_planar and t and r <= 0.0 else j for j, t, r in zip(joints, tried, room)]
    return tuple(joints)


def _flat_tenon(contact: Contact, way_out: Array | None, share: float) -> Joint | None:
    if way_out is None or float(way_out @ contact.normal) < UPRIGHT:
        return None
    return tenon_joint_2d(contact, way_out, *BREADTH, share * contact.measure)


def _dense(joint: Joint) -> Array:
    """Return (61, 2) points along a flat joint, evenly spread over its length."""
    run = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(joint.vertices, axis=0), axis=1))]
    at = np.linspace(0.0, run[-1], 61)
    return np.stack([np.interp(at, run, joint.vertices[:, k]) for k in range(2)], axis=1)


def upright_tenons(graph: PartsGraph, options: JointOptions) -> tuple[Joint, ...]:
    """Return solid mortise-and-tenon joints along every contact's normal, where a rectangle fits.

    Their height is half of what a bump over the same rectangle has room for, at most half of its shorter side.
    """
    contacts = graph.contacts
    margins = [max(options.margin * float(np.sqrt(c.measure)), options.min_distance) for c in contacts]
    found = [largest_rectangle(c, m) for c, m in zip(contacts, margins)]
    some = [e for e, r in enumerate(found) if r is not None]
    rectangles = [r for r in found if r is not None]
    joints = list(graph.joints)
    if not some:
        return tuple(joints)
    normals = np.array([contacts[e].normal for e in some])
    low, high = height_limits(
        graph.assembly,
        [contacts[e] for e in some],
        Rectangles.of(rectangles),
        normals,
        np.array([margins[e] for e in some]),
    )
    for k, e in enumerate(some):
        room = float(high[k] if high[k] >= -low[k] else low[k])
        h = 0.5 * float(np.clip(room, -rectangles[k].l2, rectangles[k].l2))
        if abs(h) > LEVEL * rectangles[k].l2:
            joints[e] = tenon_joint(contacts[e], rectangles[k].part((INSET, INSET), (1 - INSET, 1 - INSET)), h)
    return tuple(joints)


def tilted_tenons(joints: Sequence[Joint], exits: Mapping[int, Array]) -> tuple[tuple[Joint, ...], dict[int, Array]]:
    """Return mortise-and-tenon joints in place of solid bumps (Fig. 16d), and each part's one way out.

    A tenon opens along its own direction only, so all of a part's must be parallel for it to go in. They follow the
    bumps' u where those agree and nothing planar is in that way, and the part's way out `exits[part]` (3,)
    otherwise: it lies in the motion cone of each of them. Every block stands inside its bump when it follows u.
    """
    chosen = dict(exits)
    for part in exits:
        mine = [j for j in joints if j.contact.parts[1] == part]
        bumps = [j.direction for j in mine if not j.is_planar]
        if not bumps or max(float(np.linalg.norm(u - bumps[0])) for u in bumps) > COARSE:
            continue
        if all(float(j.contact.normal @ bumps[0]) >= 0.0 for j in mine):
            chosen[part] = bumps[0]
    result = []
    for joint in joints:
        u = chosen.get(joint.contact.parts[1], joint.direction)
        leans = not joint.is_planar and float(u @ joint.contact.normal) >= UPRIGHT
        # Bumps have their full height over the middle third.
        result.append(tenon_of(replace(joint, direction=u), 1.0 / 3.0) if leans else planar(joint.contact))
    return tuple(result), chosen


__all__ = ["tenons_along_exits", "tilted_tenons", "upright_tenons"]
