"""How far a structure can be tilted beside what was asked for, and what limits it: in words, and as data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from mocca_robot.errors import quoted
from mocca_robot.joints.bounds import Bound
from mocca_robot.report.case_words import case_words
from mocca_robot.statics.load_factor import LoadFactor
from mocca_robot.statics.tilt_reserve import TiltReserve
from mocca_robot.verdicts.agreement import towards

BOUND_WORDS = {
    Bound.SLOPE: "as steep as joints.max_slope_deg allows",
    Bound.ALPHA: "as narrow as alpha_deg allows",
    Bound.HEIGHT: "as high as joints.max_height allows",
    Bound.ROOM: "as near to its part's boundary or to another joint as joints.margin allows",
    Bound.RADIUS: "as sharp as joints.min_radius allows",
    Bound.FLAT: "flat, too small for a joint or across its pair's direction",
}


def tilt_words(reserve: TiltReserve, dimension: int) -> str:
    """Return the smallest critical tilt, what gives way there and what was asked for, as a sentence (not escaped)."""
    if not reserve.moving:
        return f"stands at every tilt up to {math.degrees(reserve.critical_rad):.0f}°, {friction_words(reserve)}"
    state = "" if reserve.case == "gravity" else f" ({case_words(reserve.case)})"
    asked = f"; asked for: {_degrees(reserve.asked_rad)}" if reserve.asked_rad > 0.0 else ""
    asked = "; asked for: the largest that is found" if reserve.largest else asked
    return (
        f"falls at a tilt of {_degrees(reserve.critical_rad)} towards {towards(reserve.azimuth_rad, dimension)}"
        f"{state}, {friction_words(reserve)}; then {quoted(reserve.moving, 4)} would move{asked}"
    )


def friction_words(reserve: TiltReserve) -> str:
    """Return what friction it counts on."""
    return f"with friction {reserve.friction:g}" if reserve.friction else "without friction"


def positive_words(reserve: TiltReserve | None, factors: Sequence[LoadFactor] = ()) -> str:
    """Return that nothing speaks against a structure, by how much its reserve falls short of what was asked for, and
    of which loads it is not decided how much stands.
    """
    silent = [f.name for f in factors if f.factor is None]
    undecided = f"; how much it takes of {quoted(silent, 4)} is not decided" if silent else ""
    return _reserve_words(reserve) + undecided


def _reserve_words(reserve: TiltReserve | None) -> str:
    if reserve is None or not reserve.missed:
        return "every verdict is positive"
    return (
        "it stands and every part goes in, but with less reserve than asked for: "
        f"it falls at a tilt of {_degrees(reserve.critical_rad)}, not {_degrees(reserve.asked_rad)}"
    )


def limit_words(reserve: TiltReserve) -> str:
    """Return what keeps a structure from standing at a larger tilt, as a sentence (not escaped); '' if not known."""
    tight = [j for j in reserve.limits if j.bounds]
    if tight:
        said = "; ".join(
            f"'{j.parts[0]}'–'{j.parts[1]}' is {' and '.join(BOUND_WORDS[b] for b in j.bounds)}" for j in tight[:3]
        )
        return f"limited where it gives way: {said}"
    names = "; ".join(f"'{i}'–'{j}'" for i, j in reserve.pairs[:3])
    if reserve.limits:
        return f"gives way at {names}, where no bound on joints is reached: the search found nothing better"
    return f"gives way at {names}" if names else ""


def _degrees(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.2f}°"


def both_data(reserve: TiltReserve | None, dry: TiltReserve | None) -> dict[str, Any]:
    """Return the smallest reserve for JSON, and that without friction where it counts on some."""
    more = {} if dry is None else {"reserve_without_friction": tilt_data(dry)}
    return {"reserve": tilt_data(reserve), **more}


def tilt_data(reserve: TiltReserve | None) -> dict[str, Any] | None:
    """Return the smallest reserve against tilting for JSON, in degrees; None where nothing has to stand."""
    if reserve is None:
        return None
    return {
        "critical_deg": math.degrees(reserve.critical_rad),
        "azimuth_deg": math.degrees(reserve.azimuth_rad),
        "case": reserve.case,
        "goal_deg": math.degrees(reserve.goal_rad),
        "margin_deg": "max" if reserve.largest else math.degrees(reserve.margin_rad),
        "reached": not reserve.missed,
        **({"friction": float(reserve.friction)} if reserve.friction else {}),
        "moving": list(reserve.moving),
        "gives_way": [list(pair) for pair in reserve.pairs],
        "limits": [{"parts": list(j.parts), "bounds": [str(b) for b in j.bounds]} for j in reserve.limits],
    }
