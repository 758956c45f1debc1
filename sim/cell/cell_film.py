"""What happened in a cell, to look at: bodies with surfaces, and where each was when; for the player and for films."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mocca_robot.arrays import Array, read_only
from mocca_robot.assembly import Mesh
from mocca_robot.geometry.extrusion import surface
from mocca_robot.plan.arm_links import capsules
from mocca_robot.plan.arm_models import RobotModel
from mocca_robot.report.rehearsal import CellFilm, Chapter, ShownBody
from planners.robot.obstacles import CellBox
from planners.robot.tool import Gripper, SuctionGripper
from sim.cell.cell_model import Workplace
from sim.cell.world import Frame
from sim.shapes.contact_model import embed
from sim.show.film import FilmOptions, render, write_images
from sim.show.mjcf import colour

STEEL, DARK, WOOD = (0.72, 0.74, 0.77), (0.3, 0.32, 0.35), (0.92, 0.9, 0.86)
MOST_FRAMES = 1500
FILM_SPEED = 8.0
"""Simulated seconds in one second of an MP4."""


def film(place: Workplace, frames: Sequence[Frame], chapters: Sequence[Chapter] = ()) -> CellFilm:
    """Return what `frames` show, at most `MOST_FRAMES` of them, evenly."""
    import mujoco

    chosen = np.unique(np.linspace(0, len(frames) - 1, min(MOST_FRAMES, len(frames))).round().astype(int))
    bodies = (*_cell_bodies(place), *_part_bodies(place))
    first = len(bodies) - len(place.assembly.parts)
    poses = np.zeros((len(chosen), len(bodies), 7))
    poses[:, :, 3] = 1.0
    turn = np.zeros(4)
    mujoco.mju_mat2Quat(turn, np.ascontiguousarray(place.turn).ravel())
    quat = np.zeros(4)
    for row, k in enumerate(chosen):
        frame = frames[int(k)]
        for n, matrix in enumerate(_hand_frames(place.cell.model, frame)):
            mujoco.mju_mat2Quat(quat, np.ascontiguousarray(matrix[:3, :3]).ravel())
            poses[row, 1 + n] = [*matrix[:3, 3], *quat]
        for part, pose in frame.parts:
            mujoco.mju_mulQuat(quat, turn, np.array(pose.quat_wxyz))
            poses[row, first + part] = [*(place.turn @ pose.position + place.shift), *quat]
    return CellFilm(bodies, read_only([frames[int(k)].time_s for k in chosen]), read_only(poses), tuple(chapters))


def _hand_frames(model: RobotModel, frame: Frame) -> list[Array]:
    """Return the frames of links 0–5, the palm and the two fingers."""
    frames = model.frames(frame.joints[:6])
    turned = []
    for k in range(6):
        c, s = np.cos(frame.joints[k]), np.sin(frame.joints[k])
        turned.append(frames[k] @ np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
    fingers = []
    for sign, opening in zip((1.0, -1.0), frame.joints[6:8]):
        shifted = np.eye(4)
        shifted[1, 3] = sign * opening
        fingers.append(frames[6] @ shifted)
    return [*turned, frames[6], *fingers]


def _cell_bodies(place: Workplace) -> Iterator[ShownBody]:
    import trimesh

    gripper = place.cell.gripper
    boxes = [_box(c) for c in (place.cell.table_m, place.plinth) if c is not None]
    boxes += [_box(np.stack([-o.half, o.half]), o) for o in place.cell.obstacles]
    yield ShownBody("table", _joined(boxes), WOOD, False)
    for k, link in enumerate(capsules(place.cell.model)):
        pieces = []
        for c in link:
            start, end = np.array(c.start), np.array(c.end)
            length = float(np.linalg.norm(end - start))
            capsule = trimesh.creation.capsule(height=length, radius=c.radius, count=[10, 10])
            along = trimesh.geometry.align_vectors([0, 0, 1], (end - start) / length)
            capsule.apply_transform(along)
            capsule.apply_translation(start)
            pieces.append(capsule)
        yield ShownBody(f"link {k}", _joined([Mesh(p.vertices, p.faces) for p in pieces]), STEEL, False)
    yield ShownBody("palm", _hand(gripper), DARK, False)
    if isinstance(gripper, SuctionGripper):
        return
    low, high = gripper.finger_m
    yield ShownBody("finger left", _box(gripper.finger_m), DARK, False)
    mirror = np.array([1.0, -1.0, 1.0])
    yield ShownBody("finger right", _box(np.sort(np.stack([low * mirror, high * mirror]), axis=0)), DARK, False)


def _part_bodies(place: Workplace) -> Iterator[ShownBody]:
    for k, part in enumerate(place.assembly.parts):
        mesh = surface(part)
        centred = Mesh(mesh.vertices - embed(part.centroid), mesh.faces)
        yield ShownBody(part.name, centred, colour(place.assembly, k), True)


def _hand(gripper: Gripper) -> Mesh:
    """Return the hand without its fingers, with the stem of a cup."""
    if not isinstance(gripper, SuctionGripper):
        return _box(gripper.palm_m)
    x, y, lip = gripper.tcp_offset[:3]
    r, c = gripper.stem_radius_m, gripper.cup_radius_m
    stem = np.array([[x - r, y - r, gripper.palm_m[1, 2]], [x + r, y + r, lip - 0.01]])
    cup = np.array([[x - c, y - c, lip - 0.01], [x + c, y + c, lip]])
    return _joined([_box(gripper.palm_m), _box(stem), _box(cup)])


def _joined(meshes: Sequence[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + start for m, start in zip(meshes, starts)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


def _box(corners: Array, placed: CellBox | None = None) -> Mesh:
    """Return a box between corners (2, 3), in its own frame or where an obstacle has it."""
    import trimesh

    low, high = corners
    box = trimesh.creation.box(extents=high - low)
    corners = box.vertices + 0.5 * (low + high)
    return Mesh(corners if placed is None else placed.placed(corners), box.faces)


def write_cell_film(moving: CellFilm, path: str | Path, options: FilmOptions | None = None) -> Path:
    """Return `path` after writing a film there, eight times as fast as it happened: an .mp4, else PNG frames.

    Raises EnvironmentNeeded when OpenGL, or for .mp4 imageio-ffmpeg, is missing.
    """
    options = options or FilmOptions(azimuth_deg=150.0, elevation_deg=-25.0)
    return write_images(_render(moving, options), Path(path), options)


def _render(moving: CellFilm, options: FilmOptions) -> Iterator[NDArray[np.uint8]]:
    import mujoco

    spec = mujoco.MjSpec()
    for n, body in enumerate(moving.bodies):
        name = f"body {n}"
        spec.add_mesh(
            name=name,
            uservert=body.mesh.vertices.ravel(),
            userface=body.mesh.faces.ravel().astype(np.int32),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        node = spec.worldbody.add_body(name=name, mocap=True)
        node.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0, rgba=[*body.rgb, 1.0])
    seconds = float(moving.times[-1] - moving.times[0]) / FILM_SPEED
    wanted = np.linspace(moving.times[0], moving.times[-1], max(2, round(seconds * options.fps) + 1))
    rows = np.clip(np.searchsorted(moving.times, wanted), 0, len(moving.times) - 1)

    def put_states(data: Any) -> Iterator[None]:
        for row in rows:
            # A mesh's own frame is its principal axes: the compiler has moved the geom, not the body.
            data.mocap_pos[:] = moving.poses[row, :, :3]
            data.mocap_quat[:] = moving.poses[row, :, 3:]
            yield

    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat[:] = [0.35, 0.0, 0.2]
    camera.distance = 1.7
    camera.azimuth, camera.elevation = options.azimuth_deg, options.elevation_deg
    return render(spec, camera, put_states, options)
