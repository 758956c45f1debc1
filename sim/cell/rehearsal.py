"""A rehearsal: a plan built in the simulated cell, part by part, with what was seen of each.

Every part has to be grasped and kept, slid to its depth, and let go; after each release the structure is watched
until it rests. At the end the supports are taken away.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Interlocking
from mocca_robot.contacts.find import find_contacts
from mocca_robot.design import Design
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import StoredDesign
from mocca_robot.plan.executor import execute
from mocca_robot.plan.person import Everybody
from mocca_robot.plan.plan import MoveKind, Plan, insertion_axis
from mocca_robot.plan.pose import rotation_matrix, transform
from mocca_robot.plan.safety import require_sound
from mocca_robot.plan.status import ExecutionEvent, ExecutionStatus
from mocca_robot.report.rehearsal import Chapter
from planners.robot.cell import cell_of
from planners.robot.site import site
from sim.cell.cell_model import Pose, Workplace, seat, workplace
from sim.cell.fingers import Track
from sim.cell.rehearsal_result import Options, PartRehearsal, Rehearsal, StandingCheck
from sim.cell.simulated_arm import SimulatedCell
from sim.cell.world import CannotBelieve

FAR_M, FAR_SHARE = 0.002, 0.02
"""A part counts as moved when it rests farther from its place than 2 mm or 2 % of its size, whichever is more: an
insertion counts as complete 1 mm before its end."""
REST_SHARE_S = 4e-3
"""Sizes per second below which a part rests."""
LONGEST_S = 4.0
"""The structure is given up after this: it neither rested nor fell."""


class _Log:
    """What the executor tells, turned into what was seen of each part."""

    def __init__(self, cell: SimulatedCell, progress: Callable[[PartRehearsal], None]) -> None:
        self.cell = cell
        self.parts: list[PartRehearsal] = []
        self.chapters: list[Chapter] = []
        self._progress = progress
        self._insert: tuple[float | None, int] = (None, 0)
        self._inserted: bool | None = None

    def append(self, event: ExecutionEvent) -> None:
        """Nothing is kept of single events; a rehearsal can be repeated."""

    def listen(self, event: ExecutionEvent) -> None:
        """Move the cell along, and conclude a step when it ends."""
        if event.event == "step_started":
            self._insert, self._inserted = (None, 0), None
            self.chapters.append(Chapter(self.cell.time_s, f"{event.part}", event.part or ""))
        self.cell.heed(event)
        if event.kind == MoveKind.INSERT and event.event in ("attempt_failed", "move_finished", "move_stopped"):
            self._insert = (event.depth_m, self._insert[1] + 1)
            self._inserted = event.event == "move_finished"
        if event.event in ("step_finished", "move_stopped"):
            self._conclude(event)

    def _conclude(self, event: ExecutionEvent) -> None:
        assert event.step is not None and event.part is not None and event.status is not None
        step, place, track = self.cell.plan.steps[event.step], self.cell.place, self.cell.track
        standing = None
        if event.event == "step_finished":
            standing = watch(self.cell, place.assembly.index(step.part))
            if standing.stands is not True:
                self.cell.refuse(f"after {step.part} was let go, {standing.reason}")
        self.parts.append(
            _seen(event, track, self._insert, self._inserted, step_depth(self.cell.plan, event.step), standing)
        )
        self._progress(self.parts[-1])


def _seen(
    event: ExecutionEvent,
    track: Track,
    insert: tuple[float | None, int],
    inserted: bool | None,
    wanted_m: float | None,
    standing: StandingCheck | None,
) -> PartRehearsal:
    assert event.part is not None and event.status is not None
    return PartRehearsal(
        part=event.part,
        status=event.status,
        detail=event.detail,
        width_m=track.width_m,
        held=track.held,
        slip_m=track.slip_m,
        slip_rad=track.slip_rad,
        inserted=inserted,
        depth_m=insert[0],
        wanted_m=wanted_m,
        attempts=insert[1],
        peak_force_n=track.peak_insert_n if insert[1] else None,
        touches=tuple(sorted(track.touches.items())),
        standing=standing,
    )


def step_depth(plan: Plan, step: int) -> float | None:
    """Return the planned depth of a step's insertion, metres; None without one."""
    path = next((m.path for m in plan.steps[step].moves if m.kind is MoveKind.INSERT), None)
    return None if path is None else insertion_axis(path)[1]


def watch(cell: SimulatedCell, part: int | None) -> StandingCheck:
    """Return whether the structure stands once `part` is let go, or, with None, once its supports are gone."""
    assembly = cell.place.assembly
    sizes = np.array([float(np.linalg.norm(np.ptp(p.shape.bounds, axis=0))) for p in assembly.parts])

    def enough(speeds: Array) -> bool:
        free = list(cell.free)
        far = any(displacement(cell, k) > 4.0 * max(FAR_M, FAR_SHARE * sizes[k]) for k in free)
        return far or bool((speeds <= REST_SHARE_S * sizes[free]).all())

    seconds = cell.settle(part, LONGEST_S, enough)
    free = list(cell.free)
    # A part that its support took over stays as it was let go: it can be out of place, though it cannot fall.
    judged = free if part is None or part in free else [*free, part]
    if not judged:
        return StandingCheck(
            stands=True,
            farthest="",
            displacement_m=0.0,
            allowed_m=FAR_M,
            moved=(),
            seconds=seconds,
            reason="everything is held",
        )
    gaps = np.array([displacement(cell, k) for k in judged])
    allowed = np.maximum(FAR_M, FAR_SHARE * sizes[judged])
    resting = bool((cell.speeds() <= REST_SHARE_S * sizes[free]).all())
    worst = int((gaps / allowed).argmax())
    moved = tuple(assembly.parts[k].name for k, g, a in zip(judged, gaps, allowed) if g > a)
    name = assembly.parts[judged[worst]].name
    held = judged[worst] not in free
    where = "its place, on its support" if held else "its place"
    words = f"{name} is {1e3 * gaps[worst]:.2f} mm from {where}, limit {1e3 * allowed[worst]:.2f} mm"
    if moved:
        stands: bool | None = False
    elif resting:
        stands = True
    else:
        stands, words = None, f"it still moves after {seconds:.1f} s; {words}"
    return StandingCheck(
        stands=stands,
        farthest=name,
        displacement_m=float(gaps[worst]),
        allowed_m=float(allowed[worst]),
        moved=moved,
        seconds=seconds,
        reason=words,
        on_support=held,
    )


def displacement(cell: SimulatedCell, part: int) -> float:
    """Return how far a part's points are from their places at most, metres: shift, and turn at half its size."""
    pose, goal = cell.pose(part), seat(cell.place.assembly.parts[part])
    shift = float(np.linalg.norm(np.subtract(pose.position, goal.position)))
    w = min(1.0, abs(pose.quat_wxyz[0]))
    size = float(np.linalg.norm(np.ptp(cell.place.assembly.parts[part].shape.bounds, axis=0)))
    return shift + size * math.sqrt(1.0 - w * w)


def rehearse(
    plan: Plan,
    design: Design | StoredDesign,
    options: Options | None = None,
    *,
    progress: Callable[[PartRehearsal], None] = lambda _: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Rehearsal:
    """Return how building `plan` went in MuJoCo; InputError for a plan that is unsound or does not describe its cell.

    `design` must be the one that the plan was made for. `progress` hears of every part as it is done; once `cancelled`
    returns True, the rehearsal ends with what it has.
    """
    options = options or Options()
    require_sound(plan)
    if options.parts is not None and not 1 <= options.parts <= len(plan.steps):
        raise InputError(f"{options.parts} parts cannot be rehearsed; the plan has {len(plan.steps)}.")
    whole_plan, plan = plan, replace(plan, steps=plan.steps[: options.parts])
    started = time.perf_counter()
    cell = cell_of(plan)
    where = site(design.assembly, cell)
    contacts = find_contacts(where.assembly).contacts
    place = workplace(cell, where, contacts, options.friction, options.pad_friction or cell.gripper.friction)
    whole, interrupted = None, False
    with SimulatedCell(place, plan, waiting(place, plan, options), speed=options.speed, cancelled=cancelled) as arm:
        log = _Log(arm, progress)
        try:
            result = execute(plan, arm, log, listener=log.listen, speed=options.speed, person=Everybody())
            interrupted = result.status is ExecutionStatus.CANCELLED
            if result.status is ExecutionStatus.SUCCEEDED and all(p.succeeded for p in log.parts):
                if options.parts is not None and options.parts < len(whole_plan.steps):
                    whole = log.parts[-1].standing
                else:
                    arm.hold_key(_key(place))
                    whole = watch(arm, None)
        except CannotBelieve as broken:
            step = plan.steps[len(log.parts)] if len(log.parts) < len(plan.steps) else plan.steps[-1]
            detail = f"no verdict: {broken}"
            log.parts.append(PartRehearsal(step.part, ExecutionStatus.REFUSED, detail))
        return Rehearsal(
            plan=whole_plan,
            name=design.assembly.name,
            options=options,
            engine=f"mujoco {mujoco.__version__}",
            parts=tuple(log.parts),
            whole=whole,
            planned=len(plan.steps),
            interrupted=interrupted,
            simulated_s=arm.time_s,
            seconds=time.perf_counter() - started,
            place=place,
            frames=arm.frames,
            chapters=tuple(log.chapters),
        )


def _key(place: Workplace) -> tuple[int, ...]:
    """Return the parts that have to be held in the end: the key, when interlocking is all that was asked for."""
    goals = place.assembly.goals
    if goals and all(isinstance(g, Interlocking) for g in goals):
        return tuple(place.assembly.index(g.key) for g in goals if isinstance(g, Interlocking))
    return ()


def waiting(place: Workplace, plan: Plan, options: Options) -> dict[int, Pose]:
    """Return where parts wait in the tray, with the errors that `options` asks for; poses in the structure's frame."""
    rng = np.random.default_rng(options.seed)
    out = {}
    for step in plan.steps:
        if step.grasp.tray_motion is None:
            raise InputError(
                f"The plan does not say where {step.part} waits in the tray. Plan again with this version."
            )
        index = place.assembly.index(step.part)
        moved = transform(step.grasp.tray_motion)
        error = rng.normal(0.0, 1.0, 3) * [options.noise_m, options.noise_m, options.noise_rad]
        at_seat = place.turn @ seat(place.assembly.parts[index]).position + place.shift
        position = moved[:3, :3] @ at_seat + moved[:3, 3] + [error[0], error[1], 0.0]
        rotation = place.turn.T @ rotation_matrix([0.0, 0.0, error[2]]) @ moved[:3, :3] @ place.turn
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(rotation).ravel())
        x, y, z = (place.turn.T @ (position - place.shift)).tolist()
        w, i, j, k = quat.tolist()
        out[index] = Pose((x, y, z), (w, i, j, k))
    return out
