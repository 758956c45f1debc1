"""Where things of a cell really are, from places that the arm's tip touched: least squares, with the residual.

What is touched are points whose places on the thing are known: marks on the build plate, corners of the tray or of an
obstacle, any points of the table. A rigid motion takes those onto the touched ones as well as it can (Kabsch, Acta
Crystallographica A32, 1976); points on one line fix none, and points that contradict each other leave a residual.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, read_only
from mocca_robot.errors import InputError, nearest
from planners.robot.cell import RobotCell

FEWEST = 3
SPREAD_M = 0.02
"""Across the line on which they lie best, points have to reach this far: less fixes no plane."""
RESIDUAL_M = 2e-3
"""A point farther than this from where the others have it contradicts them: a tip touches to half a millimetre."""
TILT_RAD = np.deg2rad(1.0)
"""Cells stand level: of a plane that is tilted by more, a structure of 0.3 m would lean by 5 mm."""
TRAY_YAW_RAD = np.deg2rad(0.5)
"""A tray has no turn in the cell file: at 0.5 m this is 4 mm."""
BUILD_MARKS_M = ((0.0, 0.0), (0.1, 0.0), (0.0, 0.1))
THINGS = ("build", "tray", "table")


@dataclass(frozen=True, eq=False, kw_only=True)
class Fit:
    """How a thing lies.

    Attributes:
        turn, shift: base-frame point = turn (3, 3) @ point on the thing + shift (3,).
        residuals_m: (n,) how far each touched point is from where the fit has it.
        yaw_rad, tilt_rad: turn about z, and how far the thing's z leans from the base's.
    """

    turn: Array
    shift: Array
    residuals_m: Array
    yaw_rad: float
    tilt_rad: float


def marks(cell: RobotCell, thing: str, given: Sequence[tuple[float, float]] = ()) -> Array:
    """Return the points (n, 3) on a thing that are to be touched, in its own frame; `given` (x, y) in place of them.

    `thing` is `build`, `tray`, `table` or an obstacle's name. InputError for any other, and for given points that are
    too few or on one line.
    """
    known = [*THINGS, *(o.name for o in cell.obstacles)]
    if thing not in known:
        raise InputError(
            f"'{thing}' is nothing in the cell '{cell.name}' that could be touched; {nearest(thing, known)}"
        )
    if given:
        flat = np.array(given, dtype=np.float64)
    elif thing == "build":
        flat = np.array(BUILD_MARKS_M)
    elif thing == "tray":
        w, h = cell.tray_m[1] - cell.tray_m[0]
        flat = np.array([[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]])
    elif thing == "table":
        flat = np.zeros((FEWEST, 2))  # anywhere: only the plane counts
    else:
        x, y, _ = next(o for o in cell.obstacles if o.name == thing).half
        flat = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    out = np.column_stack([flat, np.zeros(len(flat))])
    if thing != "table":
        _require_plane(out, "The given points")
    return read_only(out)


def fit(thing: str, known: Array, touched: Array) -> Fit:
    """Return how a thing lies whose points `known` (n, 3) were touched at `touched` (n, 3), base frame.

    InputError for too few points, points on one line, contradicting ones, and a thing that is tilted.
    """
    touched = np.asarray(touched, dtype=np.float64)
    _require_plane(touched, "The touched points")
    if thing == "table":
        turn, shift, residuals = _plane(touched)
    else:
        turn, shift = _rigid(known, touched)
        residuals = np.linalg.norm(known @ turn.T + shift - touched, axis=1)
    worst = int(np.argmax(residuals))
    if residuals[worst] > RESIDUAL_M:
        raise InputError(
            f"The touched points contradict each other: point {worst + 1} is {1e3 * residuals[worst]:.1f} mm from "
            f"where the others have it, limit {1e3 * RESIDUAL_M:g} mm. Check that each was touched where it was asked "
            "for, and touch them again."
        )
    yaw = float(np.arctan2(turn[1, 0], turn[0, 0]))
    tilt = float(np.arccos(np.clip(turn[2, 2], -1.0, 1.0)))
    if tilt > TILT_RAD:
        raise InputError(
            f"The plane of the touched points leans by {np.rad2deg(tilt):.1f}°, limit {np.rad2deg(TILT_RAD):g}°: level "
            "it, or the base, with shims."
        )
    return Fit(turn=turn, shift=shift, residuals_m=residuals, yaw_rad=yaw, tilt_rad=tilt)


def registered(cell: RobotCell, thing: str, found: Fit) -> dict[str, Any]:
    """Return the cell's document with `thing` where it was found; InputError where the file cannot say so."""
    out: dict[str, Any] = copy.deepcopy(dict(cell.document))
    x, y, z = (round(float(v), 5) for v in found.shift)
    if thing == "build":
        out["build"] = {**out["build"], "origin_m": [x, y, z], "yaw_deg": round(float(np.rad2deg(found.yaw_rad)), 3)}
    elif thing == "table":
        low, high = out["table_m"]
        out["table_m"] = [low, [*high[:2], z]]
    elif thing == "tray":
        if abs(found.yaw_rad) > TRAY_YAW_RAD:
            raise InputError(
                f"The tray is turned by {np.rad2deg(found.yaw_rad):.1f}°, limit {np.rad2deg(TRAY_YAW_RAD):g}°: turn it "
                "parallel to the base's x axis, or give tray.parts with their own yaw_deg."
            )
        size = cell.tray_m[1] - cell.tray_m[0]
        out["tray"] = {**out["tray"], "low_m": [x, y], "high_m": [round(x + size[0], 5), round(y + size[1], 5)]}
    else:
        out["obstacles"] = {**out["obstacles"], thing: _box(cell, thing, found)}
    return out


def _box(cell: RobotCell, thing: str, found: Fit) -> Mapping[str, Any]:
    half = next(o for o in cell.obstacles if o.name == thing).half
    middle = found.shift - np.array([0.0, 0.0, half[2]])  # its top was touched
    corners = [[round(float(v), 5) for v in middle + sign * half] for sign in (-1.0, 1.0)]
    return {"box_m": corners, "yaw_deg": round(float(np.rad2deg(found.yaw_rad)), 3)}


def _require_plane(points: Array, what: str) -> None:
    if len(points) < FEWEST:
        raise InputError(f"{what} are {len(points)}; {FEWEST} are needed at least.")
    middle = points - points.mean(axis=0)
    axes = np.linalg.svd(middle)[2]
    across = float(np.ptp(middle @ axes[1]))
    if across < SPREAD_M:
        raise InputError(
            f"{what} lie on one line: they reach {1e3 * across:.1f} mm across it, at least {1e3 * SPREAD_M:g} mm are "
            "needed. Take points farther apart."
        )


def _rigid(known: Array, touched: Array) -> tuple[Array, Array]:
    a, b = known - known.mean(axis=0), touched - touched.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    mirrored = np.sign(np.linalg.det(v.T @ u.T))
    turn = v.T @ np.diag([1.0, 1.0, mirrored]) @ u.T
    return turn, touched.mean(axis=0) - turn @ known.mean(axis=0)


def _plane(touched: Array) -> tuple[Array, Array, Array]:
    """Return the turn of a plane about the horizontal, its height below the base's axis, and distances from it."""
    middle = touched.mean(axis=0)
    normal = np.linalg.svd(touched - middle)[2][2]
    normal = normal if normal[2] > 0 else -normal
    x = np.cross([0.0, 1.0, 0.0], normal)
    x /= np.linalg.norm(x)
    turn = np.column_stack([x, np.cross(normal, x), normal])
    height = float(middle @ normal / normal[2])
    return turn, np.array([0.0, 0.0, height]), np.abs((touched - middle) @ normal)
