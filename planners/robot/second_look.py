"""A plan judged from its file alone, against its design and its cell: what an edited one would destroy is found here.

`recheck` carries the parts along the waypoints; here stands what it takes for granted: that the plan's own account of
cell and parts is the one that it was made with, and that parts come in the order of the design, each once.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mocca_robot.assembly import Assembly
from mocca_robot.plan.plan import MoveKind, Plan, Step
from mocca_robot.plan.pose import transform
from mocca_robot.plan.safety import PlanFinding
from mocca_robot.tolerances import COARSE
from planners.robot.cell import RobotCell, cell_of
from planners.robot.recheck import recheck
from planners.robot.site import Body, Site, site
from planners.robot.tray import Tray

FAR_AWAY_M = 100.0
"""Parts that the plan does not place are put this far below, out of everything's way."""
MASS_SHARE, MASS_KG = 0.05, 0.005
COG_M = 0.005
"""Masses and centres of gravity come from the design: they agree but for rounding, and for a tool that was weighed."""
AGAIN = "Plan again, or give the plan as it was written."


def look_again(plan: Plan, assembly: Assembly) -> list[PlanFinding]:
    """Return everything wrong with `plan`, made for a design of `assembly`; InputError when it describes no cell."""
    cell = cell_of(plan)
    where = site(assembly, cell)
    out = [*_cell_differs(plan, cell), *_parts_differ(plan, where)]
    if out:
        return out
    motions = {s.part: transform(s.grasp.tray_motion) for s in plan.steps if s.grasp.tray_motion is not None}
    away = np.eye(4)
    away[2, 3] = -FAR_AWAY_M
    elsewhere = {b.name: away for b in where.bodies if not b.fixed and b.name not in motions}
    for i, step in enumerate(plan.steps):
        body = where.bodies[where.assembly.index(step.part)]
        out.extend(_load_differs(step, body, cell, f"step {i} ({step.part})"))
    return [*out, *recheck(plan, cell, where, Tray({**elsewhere, **motions}))]


def _cell_differs(plan: Plan, cell: RobotCell) -> Iterator[PlanFinding]:
    """Yield where the figures that execution obeys are not those of the cell that the plan describes."""
    if plan.robot != cell.model.name:
        yield PlanFinding("plan", "robot", plan.robot, f"{cell.model.name} (its cell)", AGAIN)
    said, meant = plan.cell, cell.execution
    for name in (
        "tcp_offset",
        "tool_mass_kg",
        "tool_cog_m",
        "gripper_stroke_m",
        "workspace_m",
        "vacuum",
        "fingers",
        "gripper_address",
        "serial",
        "limits",
    ):
        a, b = getattr(said, name), getattr(meant, name)
        if a != b:
            yield PlanFinding("cell", name, f"{a}", f"{b} (the cell that the plan describes)", AGAIN)


def _parts_differ(plan: Plan, where: Site) -> Iterator[PlanFinding]:
    """Yield steps of parts that are not the design's, come twice or out of order, or have no place in the tray."""
    known = {b.name: k for k, b in enumerate(where.bodies) if not b.fixed}
    before = -1
    for i, step in enumerate(plan.steps):
        here = f"step {i}"
        if step.part not in known:
            yield PlanFinding(here, "part", step.part, "a part of the design that is not fixed", AGAIN)
            continue
        if known[step.part] <= before:
            yield PlanFinding(here, "part", step.part, "the design's order, each part once", AGAIN)
        before = max(before, known[step.part])
        if step.grasp.tray_motion is None:
            yield PlanFinding(here, "tray_motion", "missing", "where the part waits in the tray", AGAIN)


def _load_differs(step: Step, body: Body, cell: RobotCell, here: str) -> Iterator[PlanFinding]:
    """Yield where the part is heavier, lighter or elsewhere in the hand than its design says, or squeezed harder."""
    grasp = step.grasp
    if abs(grasp.mass_kg - body.mass_kg) > MASS_KG + MASS_SHARE * body.mass_kg:
        yield PlanFinding(here, "mass_kg", f"{grasp.mass_kg:.3g}", f"{body.mass_kg:.3g} (the design)", AGAIN)
    if grasp.force_n > cell.gripper.force_n * (1.0 + COARSE):
        limit = f"{cell.gripper.force_n:g} N (the cell's gripper)"
        yield PlanFinding(here, "force_n", f"{grasp.force_n:g}", limit, AGAIN)
    taken = next((m.path[-1] for m in step.moves if m.kind is MoveKind.PICK), None)
    if taken is None or grasp.tray_motion is None:
        return
    flange = np.asarray(cell.model.frames(taken.q)[-1])
    held = np.linalg.inv(flange) @ transform(grasp.tray_motion) @ np.append(body.centroid, 1.0)
    gap = float(np.linalg.norm(held[:3] - grasp.cog_m))
    if gap > COG_M:
        limit = f"{1e3 * COG_M:g} mm from where the design has it"
        yield PlanFinding(here, "cog_m", f"{1e3 * gap:.0f} mm away", limit, AGAIN)
