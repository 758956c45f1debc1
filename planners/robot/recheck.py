"""A second look at a finished plan, from its waypoints alone: is anything touched anywhere, is every limit kept?

Nothing of the search is believed: the parts are carried from tray to place as the waypoints say, every millimetre is
looked at, and limits are judged from differences of the waypoints.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.motion.ways_out import sweep_blockers
from mocca_robot.plan.plan import Move, MoveKind, Plan, Step, Waypoint, insertion_axis
from mocca_robot.plan.pose import transform
from mocca_robot.plan.safety import PlanFinding, findings
from planners.robot.cell import RobotCell
from planners.robot.scene import CellScene
from planners.robot.site import Site
from planners.robot.trajectory import jerk_cap
from planners.robot.tray import Tray

TOUCH_M = 2e-4
"""The second look asks for less clearance than planning kept: only rounding between samples may use it up."""
JERK_SLACK = 1.25
"""Third differences of a sampled path overestimate its jerk where it starts and ends."""
OPENINGS = 7
"""Openings that are looked at while the hand opens for the next part."""
PLACED_M = 1e-3
"""How far from its place a part may end."""


def recheck(plan: Plan, cell: RobotCell, site: Site, tray: Tray, *, step_m: float = 1e-3) -> list[PlanFinding]:
    """Return everything wrong with `plan`: what the driver's own checks find, jerk, then collisions of arm, gripper and
    carried part with the structure as it stands at that moment, places at most `step_m` apart for every point of arm,
    tool and part.

    While a part slides in its own fit is judged exactly, by the sweep along its line, not by the convex pieces of its
    neighbours. `cell`, `site` and `tray` are those that the plan was made for.
    """
    out = findings(plan, cell.model)
    scene = CellScene(cell, site, TOUCH_M)
    for body in site.bodies:
        scene.place(body.name, tray.motions.get(body.name, np.eye(4)))
    known = {b.name for b in site.bodies}
    opening = plan.steps[0].moves[0].gripper_m
    for i, step in enumerate(plan.steps):
        if step.part not in known:
            out.append(PlanFinding(f"step {i}", "part", step.part, "a part of the design", "Plan again."))
            continue
        out.extend(_open_hand(step.moves[0], opening, f"step {i} ({step.part}), move 0", scene))
        out.extend(_step(step, f"step {i} ({step.part})", cell, site, tray, scene, step_m))
        opening = step.moves[-1].gripper_m
        scene.place(step.part, np.eye(4))
    return out


def _open_hand(move: Move, before_m: float, where: str, scene: CellScene) -> Iterator[PlanFinding]:
    """Yield what the hand meets where it is opened, or narrowed, from `before_m` for the first move of a step."""
    scene.assign()
    for opening in np.linspace(before_m, move.gripper_m, OPENINGS).tolist():
        if hit := scene.hit(np.array(move.path[0].q), opening, None):
            what = f"a collision at an opening of {1e3 * opening:.0f} mm"
            yield PlanFinding(f"{where}, waypoint 0", what, hit, "none", "Plan this part again.")
            return


def _step(
    step: Step, here: str, cell: RobotCell, site: Site, tray: Tray, scene: CellScene, step_m: float
) -> Iterator[PlanFinding]:
    index = site.assembly.index(step.part)
    carried, grip = False, np.eye(4)
    corners = np.concatenate(site.bodies[index].pieces)
    for k, move in enumerate(step.moves):
        where = f"{here}, move {k} ({move.kind})"
        fitted = carried and move.kind in (MoveKind.INSERT, MoveKind.APPROACH)
        opening = step.grasp.width_m if carried or move.kind is MoveKind.PICK else move.gripper_m
        if move.kind is MoveKind.RELEASE:
            carried, opening = False, move.gripper_m
            scene.place(step.part, np.eye(4))
        near = move.kind in (MoveKind.APPROACH, MoveKind.PICK, MoveKind.RELEASE, MoveKind.RETREAT)
        if fitted:
            scene.assign(absent=(step.part,))
        elif carried:
            scene.assign(carried=step.part)
        else:
            scene.assign(grasped=step.part if near else None)
        held = grip if carried and not fitted else None
        part = corners @ grip[:3, :3].T + grip[:3, 3] if carried else np.zeros((0, 3))
        for name, path in _paths(move, where):
            yield from _jerk(path, name, jerk_cap(cell.limits))
            for q, w in samples(path, cell, part, step_m):
                hit = scene.hit(q, opening, held)
                if hit:
                    yield PlanFinding(f"{name}, waypoint {w}", "a collision", hit, "none", "Plan this part again.")
                    break
            if move.kind is MoveKind.INSERT:
                yield from _sweep(site, index, path, name)
        if move.kind is MoveKind.PICK:
            carried = True
            grip = np.linalg.inv(cell.model.frames(move.path[-1].q)[-1]) @ tray.motions[step.part]
        if move.kind is MoveKind.INSERT:
            final = cell.model.frames(move.path[-1].q)[-1] @ grip
            off = float(np.linalg.norm(corners @ final[:3, :3].T + final[:3, 3] - corners, axis=1).max())
            if off > PLACED_M:
                limit = f"{1e3 * PLACED_M:g} mm"
                yield PlanFinding(
                    where, "distance of the part from its place", f"{1e3 * off:.2f} mm", limit, "Plan again."
                )


def _paths(move: Move, where: str) -> Iterator[tuple[str, Sequence[Waypoint]]]:
    yield where, move.path
    for a, path in enumerate(move.alternatives):
        yield f"{where}, alternative {a}", path


def _sweep(site: Site, index: int, path: Sequence[Waypoint], where: str) -> Iterator[PlanFinding]:
    axis, depth = insertion_axis(path)
    if depth <= 0.0:
        return
    way = -(axis @ site.turn)
    hit = sweep_blockers(site.assembly, index, way[None] / np.linalg.norm(way))
    if hit:
        names = ", ".join(site.assembly.parts[h].name for h in hit)
        yield PlanFinding(where, "the way in", f"meets {names}", "free", "Insert inside the cone.")


def _jerk(path: Sequence[Waypoint], where: str, cap: float) -> Iterator[PlanFinding]:
    """Yield where a joint's third difference exceeds what times were made for; the arm stands still at both ends."""
    steps = np.diff([w.t for w in path])
    if len(path) < 4 or (steps <= 0).any():
        return
    still = np.zeros((1, 6))
    rates = np.vstack([still, np.diff([w.q for w in path], axis=0) / steps[:, None], still])
    spans = np.concatenate([[steps[0]], steps[:-1] + steps[1:], [steps[-1]]]) / 2.0
    change = np.diff(rates, axis=0) / spans[:, None]  # accelerations at the waypoints
    jerk = np.abs(np.diff(change, axis=0) / steps[:, None])
    w, j = np.unravel_index(int(np.argmax(jerk)), jerk.shape)
    if jerk[w, j] > JERK_SLACK * cap:
        yield PlanFinding(
            f"{where}, waypoint {w}",
            f"jerk of joint {j}",
            f"{jerk[w, j]:.3g} rad/s³",
            f"{cap:.3g} rad/s³",
            "Ramp the acceleration up and down more gently.",
        )


def samples(path: Sequence[Waypoint], cell: RobotCell, part: Array, step_m: float) -> Iterator[tuple[Array, int]]:
    """Yield joint angles (6,) along a path and the waypoint before each, so closely that no joint's centre, the tool's
    tip, nor any of the points `part` (n, 3, flange frame) moves farther than `step_m` from one to the next.
    """
    q = np.array([w.q for w in path])
    frames = cell.model.frames(q)
    tip = transform(cell.gripper.tcp_offset)[:3, 3]
    fixed = np.vstack([tip, part]) if len(part) else tip[None]
    flange = frames[-1]
    points = np.concatenate(
        [
            np.stack([np.broadcast_to(f[..., :3, 3], (len(q), 3)) for f in frames], axis=1),
            np.einsum("nij,pj->npi", flange[:, :3, :3], fixed) + flange[:, None, :3, 3],
        ],
        axis=1,
    )
    travel = np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1, initial=0.0)
    yield q[0], 0
    for w, (a, b) in enumerate(itertools.pairwise(q)):
        count = max(1, int(np.ceil(travel[w] / step_m)))
        for n in range(1, count + 1):
            yield a + n / count * (b - a), w
