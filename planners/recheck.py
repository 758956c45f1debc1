"""A second look at a finished plan, from its waypoints alone: is anything touched anywhere, is every limit kept?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from mocca_robot.ur.checks import Finding, findings
from mocca_robot.ur.plan import MoveKind, Plan, Waypoint, insertion_axis
from mocca_robot.ur.pose import transform
from mocca_robot.verify import sweep_blockers
from planners.cell import RobotCell
from planners.scene import Scene
from planners.site import Site
from planners.tray import Tray

TOUCH_M = 2e-4
"""The second look asks for less clearance than planning kept: only rounding between samples may use it up."""


def recheck(plan: Plan, cell: RobotCell, site: Site, tray: Tray, *, step_m: float = 1e-3) -> list[Finding]:
    """Return everything wrong with `plan`: what the driver's own checks find, then collisions of arm, gripper and
    carried part with the structure as it stands at that moment, at most `step_m` of tool travel apart.

    While a part slides in or leaves its nest its own fit is judged exactly, by the sweep along its line, not by the
    convex pieces of its neighbours.
    """
    out = findings(plan)
    scene = Scene(cell, site, TOUCH_M)
    for body in site.bodies:
        scene.place(body.name, tray.motions.get(body.name, np.eye(4)))
    for i, step in enumerate(plan.steps):
        index = site.assembly.index(step.part)
        carried, grip = False, np.eye(4)
        for k, move in enumerate(step.moves):
            where = f"step {i} ({step.part}), move {k} ({move.kind})"
            opening = move.gripper_m if not carried or move.kind is MoveKind.RELEASE else step.grasp.width_m
            fitted = move.kind is MoveKind.INSERT or (move.kind is MoveKind.APPROACH and carried)
            if move.kind is MoveKind.PICK:
                opening = step.grasp.width_m
            if move.kind is MoveKind.RELEASE:
                carried = False
                scene.place(step.part, np.eye(4))
            near = move.kind in (MoveKind.APPROACH, MoveKind.PICK, MoveKind.RELEASE, MoveKind.RETREAT)
            if fitted:
                scene.roles(absent=(step.part,))
            elif carried:
                scene.roles(carried=step.part)
            else:
                scene.roles(grasped=step.part if near else None)
            for name, path in (
                (where, move.path),
                *((f"{where}, alternative {a}", p) for a, p in enumerate(move.alternatives)),
            ):
                for q, w in _samples(path, step_m):
                    hit = scene.hit(q, opening, grip if carried and not fitted else None)
                    if hit:
                        out.append(
                            Finding(f"{name}, waypoint {w}", "a collision", hit, "none", "Plan this part again.")
                        )
                        break
                if move.kind is MoveKind.INSERT:
                    out.extend(_sweep(site, index, path, name))
            if move.kind is MoveKind.PICK:
                carried = True
                flange = cell.model.frames(move.path[-1].q)[-1]
                grip = np.linalg.inv(flange) @ tray.motions[step.part]
            if move.kind is MoveKind.INSERT:
                final = cell.model.frames(move.path[-1].q)[-1] @ grip
                off = float(np.abs(final - np.eye(4)).max())
                if off > 1e-3:
                    out.append(
                        Finding(
                            where, "distance of the part from its place", f"{1e3 * off:.2f} mm", "1 mm", "Plan again."
                        )
                    )
        scene.place(step.part, np.eye(4))
    return out


def _sweep(site: Site, index: int, path: Sequence[Waypoint], where: str) -> Iterator[Finding]:
    axis, _ = insertion_axis(path)
    way = -(axis @ site.turn)
    hit = sweep_blockers(site.assembly, index, way[None] / np.linalg.norm(way))
    if hit:
        names = ", ".join(site.assembly.parts[h].name for h in hit)
        yield Finding(where, "the way in", f"meets {names}", "free", "Insert inside the cone.")


def _samples(path: Sequence[Waypoint], step_m: float) -> Iterator[tuple[np.ndarray, int]]:
    """Yield joint angles along a path, and the waypoint before each."""
    yield np.array(path[0].q), 0
    for w, (a, b) in enumerate(itertools.pairwise(path)):
        qa, qb = np.array(a.q), np.array(b.q)
        moved = max(
            float(np.linalg.norm(transform(b.tcp)[:3, 3] - transform(a.tcp)[:3, 3])), 0.5 * float(np.abs(qb - qa).max())
        )
        count = max(1, int(np.ceil(moved / step_m)))
        for n in range(1, count + 1):
            yield qa + n / count * (qb - qa), w
