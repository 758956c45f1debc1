"""A step with times: transit, approach, pick, lift, transit, approach, insert, release, retreat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.design import Insertion
from mocca_robot.plan.plan import Grasp, Move, MoveKind, Step, Waypoint
from mocca_robot.plan.pose import pose_of, three
from planners.robot.bench import Bench
from planners.robot.pick import Pick
from planners.robot.scene import straight
from planners.robot.seat import Seat
from planners.robot.tolerance import tolerance
from planners.robot.tool import SuctionGripper
from planners.robot.trajectory import joint_motion, line_motion
from planners.robot.transit import way

INSERT_M = 0.015
"""The compliant part of the way in; before it the arm is guarded, and any contact stops it."""
PICK_M = 0.008
"""The last part of the way to a part in the tray."""
SQUEEZE_M = 0.002
"""Fingers are sent this much closer than the part is wide."""
FORCE_N = 20.0
GENTLE_M_S2 = 0.5
"""Acceleration of guarded moves, whatever the preset: the hand's own inertia must not feel like a contact."""


@dataclass(frozen=True, eq=False)
class TimedStep:
    """A step and the share of the cone that the arm could use, radians; or why a part of it has no times."""

    step: Step | None
    usable_rad: float
    reason: str


def timed_step(
    bench: Bench,
    index: int,
    insertion: Insertion,
    direction: Array,
    seat: Seat,
    pick: Pick,
    to_tray: Sequence[Array],
    to_seat: Sequence[Array],
) -> TimedStep:
    """Return the step that takes part `index` as `pick` does and puts it in as `seat` does, along the two transits."""
    cell, grasp = bench.cell, seat.grasp
    limits = cell.limits
    body = bench.site.bodies[index]
    opened = cell.gripper.opened_m(grasp.width_m)
    closed = max(cell.gripper.stroke_m[0], grasp.width_m - SQUEEZE_M)
    slow, fast = limits.approach_speed_m_s, limits.transfer_speed_m_s
    quick = limits.transfer_acceleration_m_s2
    gentle = min(GENTLE_M_S2, quick)
    tool = pick.flange[:3, 2]
    reasons: list[str] = []

    def moved(start: Array, travel: Array, q: Array, speed: float, acceleration: float) -> tuple[Waypoint, ...]:
        path, reason = line_motion(cell, start, travel, q, speed, acceleration)
        reasons.extend([reason] if reason else [])
        return path

    above = straight(-pick.above_m * tool) @ pick.flange
    near = straight(-PICK_M * tool) @ pick.flange
    before = straight(-seat.standoff_m * direction) @ seat.flange
    entry = straight(-INSERT_M * direction) @ seat.flange
    approach = moved(above, (pick.above_m - PICK_M) * tool, pick.q_above, slow, gentle)
    taken = approach and moved(near, PICK_M * tool, end(approach), slow, gentle)
    lift = taken and moved(pick.flange, pick.lift, end(taken), limits.lift_speed_m_s, quick)
    across = lift and joint_motion(cell, to_seat)
    inward = across and moved(before, (seat.standoff_m - INSERT_M) * direction, end(across), slow, gentle)
    insert = inward and moved(
        entry, INSERT_M * direction, end(inward), limits.insert_speed_m_s, limits.insert_acceleration_m_s2
    )
    retreat = insert and moved(seat.flange, seat.retreat, end(insert), limits.retreat_speed_m_s, quick)
    if not retreat:
        return TimedStep(None, 0.0, reasons[-1])
    cone = max(0.0, insertion.alpha_rad)
    usable, alternatives = tolerance(bench, index, direction, cone, seat, end(insert), INSERT_M)
    rest = Waypoint(0.0, insert[-1].q, insert[-1].tcp)
    force = min(FORCE_N, limits.abort_force_n)
    moves = (
        Move(
            kind=MoveKind.TRANSIT,
            path=joint_motion(cell, to_tray),
            speed_m_s=fast,
            force_limit_n=force,
            gripper_m=opened,
        ),
        Move(kind=MoveKind.APPROACH, path=approach, speed_m_s=slow, force_limit_n=force, gripper_m=opened),
        Move(kind=MoveKind.PICK, path=taken, speed_m_s=slow, force_limit_n=force, gripper_m=closed),
        Move(kind=MoveKind.LIFT, path=lift, speed_m_s=limits.lift_speed_m_s, force_limit_n=force, gripper_m=closed),
        Move(kind=MoveKind.TRANSIT, path=across, speed_m_s=fast, force_limit_n=force, gripper_m=closed),
        Move(kind=MoveKind.APPROACH, path=inward, speed_m_s=slow, force_limit_n=force, gripper_m=closed),
        Move(
            kind=MoveKind.INSERT,
            path=insert,
            speed_m_s=limits.insert_speed_m_s,
            force_limit_n=force,
            gripper_m=closed,
            alternatives=alternatives,
        ),
        Move(kind=MoveKind.RELEASE, path=(rest,), speed_m_s=slow, force_limit_n=force, gripper_m=opened),
        Move(
            kind=MoveKind.RETREAT,
            path=retreat,
            speed_m_s=limits.retreat_speed_m_s,
            force_limit_n=force,
            gripper_m=opened,
        ),
    )
    motion = bench.waiting(body.name)
    held = Grasp(
        width_m=grasp.width_m,
        mass_kg=body.mass_kg,
        cog_m=three((np.linalg.inv(seat.flange) @ np.append(body.centroid, 1.0))[:3]),
        force_n=min(cell.gripper.force_n, 235.0),
        tray_motion=pose_of(motion),
        extra={
            "kind": "suction" if isinstance(cell.gripper, SuctionGripper) else "parallel",
            "cone_usable_deg": float(np.rad2deg(usable)),
        },
    )
    kept = tuple(m for m in moves if len(m.path) > 1 or m.kind is MoveKind.RELEASE)
    return TimedStep(Step(body.name, held, kept, three(direction), cone), usable, "")


def end(path: Sequence[Waypoint]) -> Array:
    """Return the joints (6,) where a path ends."""
    return np.array(path[-1].q)


def homeward(bench: Bench, step: Step, seed: int) -> Step:
    """Return the last step with the way home, if there is one; `seed` decides where it is looked for."""
    bench.scene.assign()
    at = end(step.moves[-1].path)
    opening = step.moves[-1].gripper_m
    limit = np.asarray(bench.cell.model.joint_limit_rad)
    legs = way(at, np.array(bench.cell.home), lambda q: not bench.free(q, opening), limit, seed)
    if legs is None:
        return step
    limits = bench.cell.limits
    force = min(FORCE_N, limits.abort_force_n)
    move = Move(
        kind=MoveKind.TRANSIT,
        path=joint_motion(bench.cell, legs),
        speed_m_s=limits.transfer_speed_m_s,
        force_limit_n=force,
        gripper_m=opening,
    )
    return replace(step, moves=(*step.moves, move))
