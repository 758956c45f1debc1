"""Where two fingers can hold a solid part: at two places that look away from each other, each as large as a pad.

Places are drawn from the surface; the fingers close along the mean of the two normals, so slanted and curved faces
count as long as each stays within the pads' friction, and the hand may come from any side that is not below.
"""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.assembly import Mesh
from mocca_robot.geometry.frames import tangents
from mocca_robot.tolerances import COARSE, EXACT, TINY
from planners.robot.grasp_pose import GraspPose, count, frame, spread, too_wide
from planners.robot.rays import first_hits
from planners.robot.site import Site
from planners.robot.tool import ParallelGripper

SAMPLES = 500
"""Points tried on the surface of a solid part."""
ANTIPODAL_RAD = np.deg2rad(18.0)
"""Largest angle between a face's normal and the way the fingers close: well inside rubber pads' friction (27°)."""
PAD_GIVES_M = 1.5e-3
"""How uneven the part may be under a pad of 3 mm of rubber."""
TURNS = 12
"""Sides from which the hand is tried around the line on which the fingers close."""
NOT_BELOW = 0.3
"""Largest upward component of the tool's direction: a little more than pointing sideways."""


def across_solid(
    site: Site, shape: Mesh, gripper: ParallelGripper, rng: np.random.Generator, rejected: dict[str, int]
) -> list[GraspPose]:
    """Return the grasps of a solid part, best first; why others are none is added to `rejected`."""
    vertices = site.point(shape.vertices)
    corners = vertices[shape.faces]
    centre = vertices.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    middle, closing, width = _pairs(corners, rng, rejected)
    wide = np.array([bool(too_wide(w, gripper)) for w in width], dtype=bool)
    for w in width[wide]:
        count(rejected, too_wide(w, gripper))
    middle, closing, width = middle[~wide], closing[~wide], width[~wide]
    padded = _padded(corners, middle, closing, width, gripper.pad_radius_m)
    count(rejected, "the part does not fill a pad", int((~padded).sum()))
    middle, closing, width = middle[padded], closing[padded], width[padded]
    away = np.linalg.norm(middle - centre, axis=1) / size
    order = np.argsort(away, kind="stable")
    # Two grasps differ by where and along what: a sign of the closing direction is only a turn of the hand.
    signs = np.sign(closing @ np.array([0.83, 0.55, 0.11]))[:, None]
    apart = spread(np.hstack([middle, 0.4 * size * closing * signs])[order], 0.08 * size, order)[:36]
    surface = _surface(corners, rng)
    found = []
    for k in apart:
        for down in _ways_down(closing[k]):
            for sign in (1.0, -1.0):
                pose = frame(down, sign * closing[k], middle[k])
                if sign > 0 and _hand_meets(surface, pose, gripper, float(width[k])):
                    count(rejected, "the hand would touch the part")
                    break
                lean = float(np.arccos(np.clip(-down[2], -1.0, 1.0)))
                found.append(GraspPose(pose, float(width[k]), float(away[k]) + 0.3 * lean + (0.01 if sign < 0 else 0)))
    return found


def _pairs(corners: Array, rng: np.random.Generator, rejected: dict[str, int]) -> tuple[Array, Array, Array]:
    """Return the middles (n, 3) between opposite places, the closing directions (n, 3) and widths (n,)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(area, TINY)[:, None]
    face = rng.choice(len(area), size=SAMPLES, p=area / area.sum())
    start = np.einsum("nk,nkd->nd", rng.dirichlet(np.ones(3), SAMPLES), corners[face])
    other, distance = first_hits(corners, start, -normal[face])
    facing = other >= 0
    face, start, other, distance = face[facing], start[facing], other[facing], distance[facing]
    mean = normal[other] - normal[face]
    closing = mean / np.maximum(np.linalg.norm(mean, axis=1), EXACT)[:, None]
    middle = start - 0.5 * distance[:, None] * normal[face]
    ahead, there = first_hits(corners, middle, closing)
    behind, here = first_hits(corners, middle, -closing)
    both = (ahead >= 0) & (behind >= 0)
    slack = np.cos(ANTIPODAL_RAD)
    good = both & ((normal[ahead] * closing).sum(axis=1) > slack) & ((normal[behind] * closing).sum(axis=1) < -slack)
    count(rejected, "the opposite face is not parallel", int((~good).sum()))
    shift = 0.5 * np.where(good, there - here, 0.0)[:, None]
    return (middle + shift * closing)[good], closing[good], (there + here)[good]


def _padded(corners: Array, middle: Array, closing: Array, width: Array, radius: float) -> BoolArray:
    """Return which places fill the pads (n,): rays beside the middle meet the part about as far away as it does."""
    if not len(middle):
        return np.zeros(0, dtype=bool)
    first, second = np.moveaxis(tangents(closing), 1, 0)
    good = np.ones(len(middle), dtype=bool)
    for angle in np.arange(6) * np.pi / 3:
        start = middle + radius * (np.cos(angle) * first + np.sin(angle) * second)
        for sign in (1.0, -1.0):
            _, distance = first_hits(corners, start, sign * closing)
            good &= np.abs(distance - 0.5 * width) < PAD_GIVES_M
    return good


def _ways_down(closing: Array) -> list[Array]:
    """Return tool directions across `closing`, the one that points down most first; none points up."""
    down = np.array([0.0, 0.0, -1.0])
    first = down - (down @ closing) * closing
    if np.linalg.norm(first) < COARSE:
        first = np.cross(closing, [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(closing, first)
    angles = np.arange(TURNS) * (2 * np.pi / TURNS)
    ways = [np.cos(a) * first + np.sin(a) * second for a in angles]
    return sorted((w for w in ways if w[2] < NOT_BELOW), key=lambda w: float(w[2]))


def _surface(corners: Array, rng: np.random.Generator) -> Array:
    """Return points (n, 3) all over a surface: corners, middles of edges and of faces, and some at random."""
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = rng.choice(len(area), size=600, p=area / area.sum())
    drawn = np.einsum("nk,nkd->nd", rng.dirichlet(np.ones(3), 600), corners[face])
    edges = 0.5 * (corners + np.roll(corners, -1, axis=1))
    return np.concatenate([corners.reshape(-1, 3), edges.reshape(-1, 3), corners.mean(axis=1), drawn])


def _hand_meets(points: Array, pose: Array, gripper: ParallelGripper, width: float) -> bool:
    """Return whether the part lies in the palm or in a finger, fingers open."""
    local = (points - pose[:3, 3]) @ pose[:3, :3] + np.asarray(gripper.tcp_offset[:3])
    palm = (local > gripper.palm_m[0] - 0.003).all(axis=1) & (local < gripper.palm_m[1] + 0.003).all(axis=1)
    outward = np.stack([local[:, 0], np.abs(local[:, 1]) - 0.5 * width, local[:, 2]], axis=1)
    finger = (outward > gripper.finger_m[0]).all(axis=1) & (outward < gripper.finger_m[1]).all(axis=1)
    return bool(palm.any() or finger.any())
