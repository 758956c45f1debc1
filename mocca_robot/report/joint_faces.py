"""Which faces of a solid part belong to its curved joints, so that pictures can show them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mocca_robot.arrays import BoolArray
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.joints.joint import Joint
from mocca_robot.tolerances import COARSE, TINY

EMPHASIS = "#f5c518"
"""Fill of the faces of curved joints: no part has it."""


def curved_faces(mesh: Mesh, joints: Sequence[Joint]) -> BoolArray:
    """Return for every face of a part's mesh (F,) whether it lies on the curved surface of one of its joints.

    A face does when it lies in the plane of one of the joint's facets that is not the plane of the contact: joints
    and parts are cut from the same surface, but not into the same triangles.
    """
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), TINY)[:, None]
    centres = corners.mean(axis=1)
    found = np.zeros(len(centres), dtype=np.bool_)
    reach = float(np.ptp(mesh.vertices, axis=0).max())
    for joint in joints:
        rises = np.abs((joint.vertices - joint.contact.polygon[0]) @ joint.contact.normal) > COARSE * reach
        bent = rises[joint.facets].any(axis=1)
        low, high = joint.vertices.min(axis=0) - COARSE * reach, joint.vertices.max(axis=0) + COARSE * reach
        near = np.flatnonzero(((centres >= low) & (centres <= high)).all(axis=1))
        facets, at = joint.facet_normals[bent], joint.vertices[joint.facets[bent, 0]]
        parallel = np.abs(normals[near] @ facets.T) > 1.0 - COARSE
        level = np.abs(centres[near] @ facets.T - np.einsum("ij,ij->i", facets, at)) < COARSE * reach
        found[near] |= (parallel & level).any(axis=1)
    return found


def with_joints_apart(
    assembly: Assembly, joints: Sequence[Joint], meshes: Sequence[Mesh], fills: Sequence[str]
) -> tuple[list[Mesh], list[str], list[bool]]:
    """Return (meshes, fills, hatched) in which the faces of curved joints are meshes of their own, in `EMPHASIS`.

    `meshes` are the parts' own, moved or not; `fills` their colours.
    """
    parts = assembly.parts
    own: list[list[Joint]] = [[] for _ in parts]
    for joint in joints:
        if not joint.is_planar:
            for side in joint.contact.parts:
                own[side].append(joint)
    shown, colours, hatched = list(meshes), list(fills), [p.fixed for p in parts]
    for k, part in enumerate(parts):
        if not own[k] or not isinstance(part.shape, Mesh):
            continue
        curved = curved_faces(part.shape, own[k])
        shown[k] = Mesh(meshes[k].vertices, meshes[k].faces[~curved])
        shown.append(Mesh(meshes[k].vertices, meshes[k].faces[curved]))
        colours.append(EMPHASIS)
        hatched.append(False)
    return shown, colours, hatched
