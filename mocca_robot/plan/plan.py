"""A plan: what a robot is to do, part by part, as timed joint paths with forces and gripper openings.

The data model of `plan.json` and its writing; `reader` reads it, `safety` judges whether it is safe to run.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.files.output import write_atomic
from mocca_robot.files.versions import PLAN
from mocca_robot.plan.limits import MotionLimits
from mocca_robot.plan.pose import Six, Three
from mocca_robot.plan.wiring import FingerWiring, VacuumWiring
from mocca_robot.tolerances import ROUNDING


class MoveKind(StrEnum):
    """What a move is for; it decides speed cap, guard and gripper action."""

    TRANSIT = "transit"
    """Free motion; a force above the move's limit stops it."""
    APPROACH = "approach"
    """Guarded free motion; any contact stops it."""
    PICK = "pick"
    """Guarded motion to the part, then the gripper closes and the part's width is checked."""
    LIFT = "lift"
    """Slow motion with the part, away from the tray."""
    INSERT = "insert"
    """Compliant push along the line from the first to the last waypoint; success is measured depth."""
    RELEASE = "release"
    """The gripper opens to the move's opening; the arm stands still."""
    RETREAT = "retreat"
    """Slow motion away from the placed part."""


@dataclass(frozen=True)
class Waypoint:
    """Time from the start of the move (s), joint angles (rad), pose of the tool's centre point in the base frame."""

    t: float
    q: Six
    tcp: Six


@dataclass(frozen=True, kw_only=True)
class Move:
    """One motion.

    Attributes:
        kind: what it is for.
        path: at least one waypoint, times increasing from the first.
        speed_m_s: largest speed of the tool's centre point along the path.
        force_limit_n: a larger force over the zeroed bias stops the motion.
        gripper_m: opening between the fingers, commanded by `pick` and `release`, held by the others.
        alternatives: for `insert`: other straight paths to the same final pose, inside the α-cone, for retries.
    """

    kind: MoveKind
    path: tuple[Waypoint, ...]
    speed_m_s: float
    force_limit_n: float
    gripper_m: float
    alternatives: tuple[tuple[Waypoint, ...], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Grasp:
    """How a part is held.

    Attributes:
        width_m: the part's width between the fingers.
        mass_kg: the part's mass.
        cog_m: the part's centre of gravity in the tool flange's frame.
        force_n: gripping force.
        tray_motion: the displacement, as a pose, from the part's place in the structure to the one in the tray.
        extra: whatever else the planner wrote about the grasp; kept and hashed, not used here.
    """

    width_m: float
    mass_kg: float
    cog_m: Three = (0.0, 0.0, 0.0)
    force_n: float = 20.0
    tray_motion: Six | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Step:
    """One part: how it is held, the moves that place it, and the cone inside which it may be inserted (base frame)."""

    part: str
    grasp: Grasp
    moves: tuple[Move, ...]
    direction: Three | None = None
    alpha_rad: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Cell:
    """What stands around the arm, as far as execution needs to know.

    Attributes:
        name: as the person who starts the robot knows it.
        serial: the controller's serial number, if the plan is for one robot only.
        tcp_offset: the tool's centre point in the flange's frame.
        tool_mass_kg, tool_cog_m: the empty gripper, centre of gravity in the flange's frame.
        gripper_stroke_m: smallest and largest opening; of a suction cup: vacuum, none.
        vacuum: how a suction cup is wired, if the cell says so.
        fingers: how fingers are wired that are only open or closed.
        gripper_address: where a gripper listens that the controller does not serve.
        description: the cell file, from which planning and rehearsal read the whole cell; empty when not recorded.
        workspace_m: corners (low, high) of the box, base frame, that the tool's centre point must not leave.
        limits: caps lowered for this cell.
        extra: whatever else the planner wrote about the cell; kept and hashed, not used here.
    """

    name: str
    tcp_offset: Six
    workspace_m: tuple[Three, Three]
    tool_mass_kg: float = 0.0
    tool_cog_m: Three = (0.0, 0.0, 0.0)
    gripper_stroke_m: tuple[float, float] = (0.0, 0.085)
    serial: str | None = None
    limits: MotionLimits = field(default_factory=MotionLimits)
    extra: Mapping[str, Any] = field(default_factory=dict)
    vacuum: VacuumWiring | None = None
    fingers: FingerWiring | None = None
    gripper_address: str = ""
    description: Mapping[str, Any] = field(default_factory=dict)

    def payload(self, grasp: Grasp | None = None) -> tuple[float, Three]:
        """Return the mass at the flange (kg) and its centre of gravity in the flange's frame (m): the gripper's, with
        the part of `grasp` in it where one is given.
        """
        if grasp is None:
            return self.tool_mass_kg, self.tool_cog_m
        mass = self.tool_mass_kg + grasp.mass_kg
        both = zip(self.tool_cog_m, grasp.cog_m, strict=True)
        x, y, z = ((self.tool_mass_kg * a + grasp.mass_kg * b) / max(mass, ROUNDING) for a, b in both)
        return mass, (x, y, z)


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A whole build.

    Attributes:
        design: the design file's path relative to the plan, if recorded.
        supports: parts that something else than the structure has to hold from the moment they are placed.
        cradles: those of them that lie in a cradle, which brings them to their place.
    """

    design_sha256: str
    robot: str
    gripper: str
    cell: Cell
    steps: tuple[Step, ...]
    design: str | None = None
    supports: tuple[str, ...] = ()
    cradles: tuple[str, ...] = ()

    @property
    def sha256(self) -> str:
        """Return the hash that a journal stores: of the plan's canonical JSON, so any changed figure changes it."""
        text = json.dumps(document(self), sort_keys=True, separators=(",", ":"), allow_nan=True)
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def first_waypoint(self) -> Waypoint:
        """Return where the arm has to stand before the first step."""
        return self.steps[0].moves[0].path[0]


def insertion_axis(path: Sequence[Waypoint]) -> tuple[Array, float]:
    """Return the unit direction (3,) from the first to the last waypoint and the distance, metres."""
    delta = np.asarray(path[-1].tcp[:3]) - np.asarray(path[0].tcp[:3])
    depth = float(np.linalg.norm(delta))
    return (delta / depth if depth > 0 else delta), depth


def write_plan(plan: Plan, path: Path | str) -> None:
    """Write `plan` as JSON; `read_plan` returns an equal plan with the same hash."""
    write_atomic(Path(path), json.dumps(document(plan), indent=1) + "\n")


def document(plan: Plan) -> dict[str, Any]:
    """Return the plan as JSON-ready values, format and version first."""
    cell = plan.cell
    return {
        "format": PLAN.name,
        "version": PLAN.version,
        "units": "m",
        "design_sha256": plan.design_sha256,
        **({"design": plan.design} if plan.design else {}),
        **({"supports": list(plan.supports)} if plan.supports else {}),
        **({"cradles": list(plan.cradles)} if plan.cradles else {}),
        "robot": plan.robot,
        "gripper": plan.gripper,
        "cell": {
            **cell.extra,
            "name": cell.name,
            **({"serial": cell.serial} if cell.serial else {}),
            "tcp_offset": list(cell.tcp_offset),
            "tool_mass_kg": cell.tool_mass_kg,
            "tool_cog_m": list(cell.tool_cog_m),
            "gripper_stroke_m": list(cell.gripper_stroke_m),
            **({"vacuum": cell.vacuum.document()} if cell.vacuum else {}),
            **({"fingers": cell.fingers.document()} if cell.fingers else {}),
            **({"gripper_address": cell.gripper_address} if cell.gripper_address else {}),
            "workspace_m": [list(c) for c in cell.workspace_m],
            "limits": cell.limits.changed(),
            **({"description": dict(cell.description)} if cell.description else {}),
        },
        "steps": [_step_document(s) for s in plan.steps],
    }


def _step_document(step: Step) -> dict[str, Any]:
    grasp = step.grasp
    out: dict[str, Any] = {
        "part": step.part,
        "grasp": {
            **grasp.extra,
            "width_m": grasp.width_m,
            "mass_kg": grasp.mass_kg,
            "cog_m": list(grasp.cog_m),
            "force_n": grasp.force_n,
            **({"tray_motion": list(grasp.tray_motion)} if grasp.tray_motion else {}),
        },
    }
    if step.direction is not None:
        out["insertion"] = {"direction": list(step.direction), "alpha_deg": math.degrees(step.alpha_rad)}
    out["moves"] = [
        {
            "kind": str(m.kind),
            "path": _path_document(m.path),
            "speed_m_s": m.speed_m_s,
            "force_limit_n": m.force_limit_n,
            "gripper_m": m.gripper_m,
            **({"alternatives": [_path_document(p) for p in m.alternatives]} if m.alternatives else {}),
        }
        for m in step.moves
    ]
    return out


def _path_document(path: Sequence[Waypoint]) -> list[dict[str, Any]]:
    return [{"t": w.t, "q": list(w.q), "tcp": list(w.tcp)} for w in path]
