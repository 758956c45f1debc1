"""A rehearsal as `rehearsal.json`: degrees, metres, newtons, for other programs to read."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from mocca_robot.files.output import write_json
from mocca_robot.files.versions import REHEARSAL
from sim.cell.rehearsal_result import PartRehearsal, Rehearsal, StandingCheck


def write_rehearsal(rehearsal: Rehearsal, path: str | Path) -> Path:
    """Return `path` after writing the rehearsal there."""
    return write_json(Path(path), rehearsal_to_data(rehearsal))


def rehearsal_to_data(rehearsal: Rehearsal) -> dict[str, Any]:
    """Return plain JSON values; what was not reached is null."""
    plan, options = rehearsal.plan, rehearsal.options
    return {
        "format": REHEARSAL.name,
        "version": REHEARSAL.version,
        "name": rehearsal.name,
        "engine": rehearsal.engine,
        "plan_sha256": plan.sha256,
        "design_sha256": plan.design_sha256,
        "robot": plan.robot,
        "gripper": plan.gripper,
        "options": {
            "friction": options.friction,
            "pad_friction": rehearsal.place.pad_friction,
            "pose_noise_m": options.noise_m,
            "pose_noise_deg": math.degrees(options.noise_rad),
            "seed": options.seed,
            "speed": options.speed,
        },
        "supports": list(plan.supports),
        "cradles": list(plan.cradles),
        "planned_parts": rehearsal.planned,
        "partial": rehearsal.partial,
        "succeeded": rehearsal.succeeded,
        "interrupted": rehearsal.interrupted,
        "simulated_s": rehearsal.simulated_s,
        "seconds": rehearsal.seconds,
        "parts": [_part(p) for p in rehearsal.parts],
        "whole": _standing(rehearsal.whole),
    }


def _part(p: PartRehearsal) -> dict[str, Any]:
    grasped = inserted = None
    if p.width_m is not None:
        slip_deg = None if p.slip_rad is None else math.degrees(p.slip_rad)
        grasped = {"width_m": p.width_m, "held": p.held, "slip_m": p.slip_m, "slip_deg": slip_deg}
    if p.inserted is not None:
        inserted = {
            "succeeded": p.inserted,
            "depth_m": p.depth_m,
            "planned_depth_m": p.wanted_m,
            "attempts": p.attempts,
            "peak_force_n": p.peak_force_n,
        }
    return {
        "part": p.part,
        "succeeded": p.succeeded,
        "status": str(p.status),
        "detail": p.detail,
        "grasped": grasped,
        "inserted": inserted,
        "touches": [{"what": what, "force_n": force} for what, force in p.touches],
        "standing": _standing(p.standing),
    }


def _standing(s: StandingCheck | None) -> dict[str, Any] | None:
    if s is None:
        return None
    return {
        "stands": s.stands,
        "farthest": s.farthest,
        "displacement_m": s.displacement_m,
        "allowed_m": s.allowed_m,
        "moved": list(s.moved),
        "settled_s": s.seconds,
        "reason": s.reason,
    }
