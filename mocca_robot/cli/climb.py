"""The largest tilt that joints can hold: in words, and as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mocca_robot.cli.reasons import degrees

if TYPE_CHECKING:
    from planners.cone_joints.largest_tilt import LargestTilt


def climb_words(climb: LargestTilt) -> str:
    """Return the largest angle, and what stands beyond it: a proof, or only the end of a search."""
    if climb.angle_rad is None:
        found = f"largest tilt: no design was found, not even at {degrees(climb.rungs[0].angle_rad)}"
    else:
        found = f"largest tilt: a design was found up to {degrees(climb.angle_rad)}"
    if climb.failed_rad is not None:
        rung = min((r for r in climb.rungs if not r.achieved), key=lambda r: r.angle_rad)
        found += f"; at {degrees(rung.angle_rad)} the search ended with E/|w|² = {rung.infeasibility:.1g}"
    if climb.impossible_rad is not None:
        return f"{found}; from {degrees(climb.impossible_rad)} on no joints within the bounds can hold it (proven)"
    return f"{found}; what lies beyond is open, nothing proves it impossible"


def climb_data(climb: LargestTilt) -> dict[str, Any]:
    """Return the climb for JSON, in degrees."""

    def number(angle_rad: float | None) -> float | None:
        return None if angle_rad is None else float(np.rad2deg(angle_rad))

    return {
        "largest_angle": {
            "angle_deg": number(climb.angle_rad),
            "failed_deg": number(climb.failed_rad),
            "impossible_deg": number(climb.impossible_rad),
            "tried": [
                {"angle_deg": number(r.angle_rad), "achieved": r.achieved, "infeasibility": r.infeasibility}
                for r in climb.rungs
            ],
        }
    }
