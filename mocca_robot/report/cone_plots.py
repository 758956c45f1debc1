"""Motion cones as plane figures: the conic section of a 2D joint, the map of free directions of a 3D part."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.geometry.cones import cross, extreme_rays
from mocca_robot.joints.joint import Joint
from mocca_robot.report.markup import degrees, esc, point_list, px
from mocca_robot.tolerances import COARSE, EXACT, ROUNDING
from mocca_robot.verdicts.physics import InsertionTrial

SECTION_HALVES = (2.0, 4.0, 8.0, 16.0)
"""Half-widths of the window on the cut plane c·v = 1: the first that holds all sliding of the section."""
SIZE = 104.0


def section_polygon(normals: Array, frame: Array, half: float) -> Array:
    """Return the corners (k, 2) of V ∩ {c·v = 1}, clipped to a square window; empty when V misses it.

    Args:
        normals: (m, 3) generalized normals; V = {v : normals·v ≥ 0} (Eq. 1).
        frame: rows c, e1, e2, orthonormal: a point (x, y) of the window is v = c + x e1 + y e2.
    """
    window = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    c, e1, e2 = frame
    for normal in normals:
        value = normal @ c + window @ np.array([normal @ e1, normal @ e2])
        kept: list[Array] = []
        for k in range(len(window)):
            here, there = value[k], value[(k + 1) % len(window)]
            if here >= 0.0:
                kept.append(window[k])
            if (here >= 0.0) != (there >= 0.0):
                kept.append(window[k] + here / (here - there) * (window[(k + 1) % len(window)] - window[k]))
        window = np.array(kept).reshape(-1, 2)
        if len(window) == 0:
            break
    return window


def section_frame(normals: Array) -> Array:
    """Return rows c, e1, e2 (3, 3): c inside cone(N), so that the section of V is bounded where V is pointed;
    e2 the turning direction as far as it lies in the plane, e1 the sliding one."""
    c = normals.mean(axis=0)
    norm = float(np.linalg.norm(c))
    c = np.array([0.0, 1.0, 0.0]) if norm < ROUNDING else c / norm
    turn = np.array([0.0, 0.0, 1.0]) - c[2] * c
    if np.linalg.norm(turn) < COARSE:
        turn = np.array([0.0, 1.0, 0.0]) - c[1] * c
    e2 = turn / np.linalg.norm(turn)
    return np.array([c, np.cross(e2, c), e2])


def joint_section(joint: Joint, about: Array, length: float, way_out: Array | None, alpha_rad: float) -> str:
    """Return the conic section of a 2D joint's motion cone as SVG: the joint's filled, its planar contact's dashed,
    the required translations K(−d, α) as a bar. Across: sliding; up: turning (about `about`, × `length`)."""
    normals = joint.motion_cone(about, length).normals
    normals = normals[extreme_rays(normals)]
    flat = np.repeat(joint.contact.normal[None], 2, axis=0)
    corners = joint.contact.polygon
    before = np.concatenate([flat, cross(corners - about, flat) / length], axis=1)
    frame = section_frame(before)
    half = SECTION_HALVES[1]
    if not joint.is_planar:
        reach = np.abs(section_polygon(normals, frame, SECTION_HALVES[-1])[:, 0]).max(initial=0.0)
        half = next((h for h in SECTION_HALVES if reach < h), SECTION_HALVES[-1])
    body = [_axes(half)]
    for rows, cls in ((before, "section-flat"), (normals, "section")):
        polygon = section_polygon(rows, frame, half)
        if len(polygon):
            body.append(f'<polygon class="{cls}" points="{point_list(_pixels(polygon, half))}"/>')
    if way_out is not None:
        base = np.arctan2(way_out[1], way_out[0])
        angles = base + np.array([-alpha_rad, alpha_rad])
        motions = np.stack([np.cos(angles), np.sin(angles), np.zeros(2)], axis=1)
        height = motions @ frame[0]
        if (height > COARSE).all():
            ends = (motions @ frame[1:].T) / height[:, None]
            (x0, y0), (x1, y1) = _pixels(ends, half)
            bar = f'x1="{px(x0)}" y1="{px(y0)}" x2="{px(x1)}" y2="{px(y1)}"'
            body.append(f'<line class="section-asked" {bar}/>')
    return _small(body, "Conic section of the joint's motion cone")


def direction_map(
    normals: Array, way_out: Array, alpha_rad: float, trials: Sequence[InsertionTrial] = (), limit_deg: float = 90.0
) -> str:
    """Return the map of translations around `way_out` (3,) as SVG: angle from the axis as radius, 0 to `limit_deg`.

    The free directions {x : normals·x ≥ 0} are filled, K(−d, α) is a ring, insertion `trials` are dots,
    crosses where they failed.
    """
    axes = tangent_axes(way_out)
    azimuths = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    reach = free_reach(normals, way_out, axes, azimuths)
    radius = np.minimum(np.rad2deg(reach) / limit_deg, 1.0)
    rim = radius[:, None] * np.stack([np.cos(azimuths), np.sin(azimuths)], axis=1)
    body = [_rings(limit_deg), f'<polygon class="section" points="{point_list(_pixels(rim, 1.0))}"/>']
    middle = SIZE / 2
    if alpha_rad > 0:
        r = np.rad2deg(alpha_rad) / limit_deg * 0.94 * middle
        body.append(f'<circle class="alpha-ring" cx="{px(middle)}" cy="{px(middle)}" r="{px(float(r))}"/>')
    for trial in trials:
        body.append(_trial(trial, way_out, axes, limit_deg))
    title = f"Free directions around the way out; asked for ±{degrees(alpha_rad)}"
    return _small(body, title)


def free_reach(normals: Array, axis: Array, axes: Array, azimuths: Array) -> Array:
    """Return (k,) how far, in radians, a direction can lean from unit `axis` (3,) towards each azimuth before it
    leaves {x : normals·x ≥ 0}; zero where the axis itself is outside. `axes` is `tangent_axes(axis)`."""
    around = np.cos(azimuths)[:, None] * axes[0] + np.sin(azimuths)[:, None] * axes[1]
    reach = np.full(len(azimuths), np.pi)
    for normal in normals:
        # n·(cos t a + sin t s) vanishes at t = atan2(n·a, −n·s).
        up, out = float(normal @ axis), around @ normal
        if up < -ROUNDING:
            return np.zeros(len(azimuths))
        here = np.where((up <= ROUNDING) & (out >= -ROUNDING), np.pi, np.arctan2(max(up, 0.0), -out))
        reach = np.minimum(reach, here)
    return reach


def tangent_axes(axis: Array) -> Array:
    """Return two unit vectors (2, 3) that span the plane across `axis`; the second points as far up as it can."""
    up = np.array([0.0, 0.0, 1.0]) if abs(axis[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    second = up - (up @ axis) * axis
    second /= np.linalg.norm(second)
    return np.array([np.cross(second, axis), second])


def _trial(trial: InsertionTrial, way_out: Array, axes: Array, limit_deg: float) -> str:
    if len(trial.direction) != len(way_out):
        return ""
    out = -np.asarray(trial.direction, dtype=np.float64)
    out = out / max(float(np.linalg.norm(out)), EXACT)
    angle = np.rad2deg(np.arccos(np.clip(out @ way_out, -1.0, 1.0))) / limit_deg
    azimuth = np.arctan2(out @ axes[1], out @ axes[0])
    x, y = _pixels(min(angle, 1.0) * np.array([[np.cos(azimuth), np.sin(azimuth)]]), 1.0)[0]
    title = f"<title>{esc(trial.peak_force)} N</title>"
    if trial.succeeded:
        return f'<circle class="trial-ok" cx="{px(x)}" cy="{px(y)}" r="2">{title}</circle>'
    cross_path = f"M{px(x - 2.5)} {px(y - 2.5)}l5 5m0-5l-5 5"
    return f'<path class="trial-bad" d="{cross_path}">{title}</path>'


def _pixels(points: Array, half: float) -> Array:
    middle = SIZE / 2
    return np.stack(
        [middle + points[:, 0] / half * 0.94 * middle, middle - points[:, 1] / half * 0.94 * middle], axis=1
    )


def _axes(half: float) -> str:
    middle, low, high = px(SIZE / 2), px(0.03 * SIZE), px(0.97 * SIZE)
    return (
        f'<path class="grid" d="M{low} {middle}H{high}M{middle} {low}V{high}"/>'
        f'<text class="tick" x="{high}" y="{px(SIZE / 2 - 3)}" text-anchor="end">slide {half:g}</text>'
        f'<text class="tick" x="{px(SIZE / 2 + 3)}" y="{px(0.1 * SIZE)}">turn {half:g}</text>'
    )


def _rings(limit_deg: float) -> str:
    middle = SIZE / 2
    rings = "".join(
        f'<circle class="grid" cx="{px(middle)}" cy="{px(middle)}" r="{px(0.94 * middle * share)}"/>'
        for share in (1 / 3, 2 / 3, 1.0)
    )
    return f'{rings}<text class="tick" x="{px(middle)}" y="{px(0.09 * SIZE)}">{limit_deg:.0f}°</text>'


def _small(body: Sequence[str], label: str) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="mini" role="img" aria-label="{esc(label)}" '
        f'viewBox="0 0 {px(SIZE)} {px(SIZE)}" width="{px(SIZE)}" height="{px(SIZE)}">'
        f"<title>{esc(label)}</title>{''.join(body)}</svg>"
    )
