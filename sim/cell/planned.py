"""A plan as it is meant to go: where arm, hand and parts are when, from the waypoints alone, without physics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.design import Design
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import StoredDesign
from mocca_robot.plan.plan import Move, MoveKind, Plan, Step
from mocca_robot.plan.pose import transform
from mocca_robot.report.rehearsal import Chapter
from planners.robot.cell import cell_of
from planners.robot.site import site
from planners.robot.tool import ParallelGripper
from sim.cell.cell_model import Pose, Workplace, workplace
from sim.cell.world import Frame
from sim.shapes.contact_model import embed

FRAME_S = 0.1
"""Between two frames of a motion."""
GRIP_S = 1.0
"""So long a grip is shown; a plan does not say how long it takes."""


@dataclass(frozen=True, eq=False)
class PlannedBuild:
    """What to show: the place, its frames, and when each part's step begins."""

    place: Workplace
    frames: tuple[Frame, ...]
    chapters: tuple[Chapter, ...]


def planned(plan: Plan, design: Design | StoredDesign) -> PlannedBuild:
    """Return `plan` in motion, made for `design`; InputError for a part that is not the design's, or waits nowhere."""
    cell = cell_of(plan)
    where = site(design.assembly, cell)
    place = workplace(cell, where, (), 0.0, cell.gripper.friction)
    names = [p.name for p in where.assembly.parts]
    motions: dict[int, Array] = {k: np.eye(4) for k, p in enumerate(where.assembly.parts) if p.fixed}
    for step in plan.steps:
        if step.part not in names or step.grasp.tray_motion is None:
            raise InputError(f"The plan's part '{step.part}' is no part of the design, or waits nowhere. Plan again.")
        motions[names.index(step.part)] = transform(step.grasp.tray_motion)
    frames: list[Frame] = []
    chapters = []
    clock = 0.0
    for step in plan.steps:
        chapters.append(Chapter(clock, step.part, step.part))
        clock = _step(place, step, names.index(step.part), motions, frames, clock)
    return PlannedBuild(place, tuple(frames), tuple(chapters))


def _step(
    place: Workplace, step: Step, part: int, motions: dict[int, Array], frames: list[Frame], clock: float
) -> float:
    """Add the frames of a step, moving its part along; return the time at its end."""
    grip: Array | None = None
    for move in step.moves:
        open_m = move.gripper_m if grip is None else step.grasp.width_m
        if move.kind is MoveKind.PICK:
            open_m = step.moves[0].gripper_m
        for t, q in _sampled(move):
            flange = place.cell.model.frames(q)[-1]
            if grip is not None:
                motions[part] = flange @ grip
            frames.append(_frame(place, clock + t, q, open_m, motions))
        clock += move.path[-1].t
        if move.kind is MoveKind.PICK:
            grip = np.linalg.inv(place.cell.model.frames(move.path[-1].q)[-1]) @ motions[part]
        if move.kind is MoveKind.RELEASE:
            grip, motions[part] = None, np.eye(4)
        if move.kind in (MoveKind.PICK, MoveKind.RELEASE):
            closed = step.grasp.width_m if move.kind is MoveKind.PICK else move.gripper_m
            clock += GRIP_S
            frames.append(_frame(place, clock, np.array(move.path[-1].q), closed, motions))
    return clock


def _sampled(move: Move) -> list[tuple[float, Array]]:
    times = np.array([w.t for w in move.path])
    joints = np.array([w.q for w in move.path])
    asked = np.linspace(0.0, times[-1], max(1, int(np.ceil(times[-1] / FRAME_S))) + 1) if times[-1] > 0 else times[:1]
    return [(float(t), np.array([np.interp(t, times, column) for column in joints.T])) for t in asked]


def _frame(place: Workplace, time_s: float, q: Array, opening_m: float, motions: dict[int, Array]) -> Frame:
    """Return a frame; parts are where `motions` (4, 4, base frame) take them from their places."""
    import mujoco

    fingers = (0.5 * opening_m,) * 2 if isinstance(place.cell.gripper, ParallelGripper) else ()
    shown = []
    for k, motion in sorted(motions.items()):
        there = place.turn @ embed(place.assembly.parts[k].centroid) + place.shift
        at = place.turn.T @ (motion[:3, :3] @ there + motion[:3, 3] - place.shift)
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(place.turn.T @ motion[:3, :3] @ place.turn).ravel())
        x, y, z = (float(v) for v in at)
        w, a, b, c = (float(v) for v in quat)
        shown.append((k, Pose((x, y, z), (w, a, b, c))))
    return Frame(time_s, (*(float(v) for v in q), *fingers), tuple(shown))
