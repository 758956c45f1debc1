"""The report's section about the joints: their sizes, what each lets move in 2D, and close-ups of them in 3D."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocca_robot.geometry.frames import tangents
from mocca_robot.joints.joint import Joint
from mocca_robot.report import pictures
from mocca_robot.report.cone_plots import joint_section
from mocca_robot.report.data import ReportData
from mocca_robot.report.drawing3d import close_up
from mocca_robot.report.markup import degrees, esc, millimetres, plural, significant, table
from mocca_robot.report.palette import FIXED, LIGHT, part_colours
from mocca_robot.report.sections import section

MOST_CLOSE_UPS = 12
"""Joints that are drawn from near, the highest first: each takes two pictures of some ten kilobytes."""


def joints(data: ReportData) -> str:
    """Return the joints' table, in 2D with the conic section of each motion cone, in 3D with close-ups."""
    rows = [_row(data, joint) for joint in data.design.joints]
    head = ("Parts", "Type", "Height", "Size", "Steepest slope", "Smallest radius")
    body = table(head, rows, caption="Joints", numeric=(2, 3, 4, 5))
    body += _conic_sections(data) if data.design.assembly.dimension == 2 else _close_ups(data)
    return section("joints", "Joints", body + _parameters(data))


def _row(data: ReportData, joint: Joint) -> list[str]:
    slope, radius = pictures.joint_shape(joint)
    bend = "–" if not np.isfinite(radius) else millimetres(radius)
    across = " × ".join(significant(float(edge) * 1e3) for edge in extents(joint))
    height = "–" if joint.is_planar else millimetres(height_of(joint))
    return [_pair(data, joint), esc(joint.kind), height, f"{across} mm", degrees(slope), bend]


def height_of(joint: Joint) -> float:
    """Return how far the joint's surface rises and sinks from its contact in all, metres."""
    return float(np.ptp(joint.vertices @ joint.contact.normal))


def extents(joint: Joint) -> tuple[float, ...]:
    """Return the joint's extent along its contact, metres: the length in 2D; in 3D the longer and the shorter side.

    In 3D these are the sides of the smallest box in the contact's plane about the axis along which it is longest.
    """
    across = tangents(joint.contact.normal)
    flat = joint.vertices @ across.T
    if len(across) > 1:
        centred = flat - flat.mean(axis=0)
        flat = centred @ np.linalg.eigh(centred.T @ centred)[1][:, ::-1]
    return tuple(float(edge) for edge in np.ptp(flat, axis=0))


def _pair(data: ReportData, joint: Joint) -> str:
    i, j = (esc(data.design.assembly.parts[p].name) for p in joint.contact.parts)
    return f"<code>{i}</code> – <code>{j}</code>"


def _conic_sections(data: ReportData) -> str:
    assembly = data.design.assembly
    by_part = {i.part: i for i in data.design.insertion}
    drawn = []
    for joint in data.design.joints:
        later = assembly.parts[joint.contact.parts[1]]
        way = by_part.get(later.name)
        out = None if way is None else -np.asarray(way.direction)
        plot = joint_section(joint, later.centroid, assembly.size / 2, out, assembly.alpha_rad or 0.0)
        drawn.append(f"<figure>{plot}<figcaption>{_pair(data, joint)}</figcaption></figure>")
    words = (
        "<p>Each motion cone {v : n·v ≥ 0} cut by a plane. Filled: the joint's; dashed: the flat contact's; bar: "
        "the translations that insertion needs. The smaller the filled shape, the more the joint holds.</p>"
    )
    return _folded("Conic sections of the joints' motion cones", words, drawn)


def _close_ups(data: ReportData) -> str:
    """Return both faces of the highest joints, side by side, as one who holds the parts sees them."""
    curved = [joint for joint in data.design.joints if not joint.is_planar]
    shown = sorted(curved, key=height_of, reverse=True)[:MOST_CLOSE_UPS]
    fills = [FIXED if c < 0 else LIGHT[c] for c in part_colours(data.after.graph)]
    drawn = []
    for joint in shown:
        faces = "".join(
            close_up(data.design.assembly, joint, side, fills[joint.contact.parts[side]]) for side in (0, 1)
        )
        size = f"{millimetres(height_of(joint))} high"
        drawn.append(
            f'<figure><div class="pair">{faces}</div><figcaption>{_pair(data, joint)}, {size}</figcaption></figure>'
        )
    which = "" if len(shown) == len(curved) else f" The {plural(len(shown), 'highest joint')} of {len(curved)}."
    words = f"<p>Both faces of each joint in yellow, seen from their fronts, a little from above.{which}</p>"
    return _folded("Close-ups of the curved joints", words, drawn, "figures narrow", "open") if drawn else ""


def _parameters(data: ReportData) -> str:
    rows = [
        [_pair(data, joint), ", ".join(f"{esc(k)} = {significant(float(v), 3)}" for k, v in joint.parameters.items())]
        for joint in data.design.joints
        if joint.parameters
    ]
    if not rows:
        return ""
    body = table(("Parts", "Parameters (SI)"), rows, caption="Parameters")
    return f"<details><summary>The parameters that each joint was made from</summary>{body}</details>"


def _folded(title: str, words: str, drawn: Sequence[str], cls: str = "minis", state: str = "") -> str:
    opened = f' {state}="{state}"' if state else ""
    return f'<details{opened}><summary>{esc(title)}</summary>{words}<div class="{cls}">{"".join(drawn)}</div></details>'
