"""What the sensor in the wrist would feel, and what touches what: read from MuJoCo's contacts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, BoolArray


def hand_wrench(model: Any, data: Any, hand: BoolArray, point: Array) -> Array:
    """Return the wrench (6,), world frame and about `point`, that others exert on the bodies where `hand` is true.

    Weight and inertia of the hand are left out, as a controller does that knows its payload.
    """
    import mujoco

    out, force, frame = np.zeros(6), np.zeros(6), np.zeros(3)
    for k, sign in _crossing(model, data, hand):
        mujoco.mj_contactForce(model, data, k, force)
        contact = data.contact[k]
        frame = contact.frame.reshape(3, 3).T @ force[:3]
        out[:3] += sign * frame
        out[3:] += sign * np.cross(contact.pos - point, frame)
    return out


def touched(model: Any, data: Any, hand: BoolArray) -> dict[str, float]:
    """Return which shapes of the hand press against which others, in words, with the normal force in newtons."""
    import mujoco

    out: dict[str, float] = {}
    force = np.zeros(6)
    for k, sign in _crossing(model, data, hand):
        mujoco.mj_contactForce(model, data, k, force)
        first, second = (_word(model, int(g)) for g in data.contact[k].geom)
        words = f"{second} against {first}" if sign > 0 else f"{first} against {second}"
        out[words] = out.get(words, 0.0) + float(force[0])
    return out


def _crossing(model: Any, data: Any, hand: BoolArray) -> Iterator[tuple[int, float]]:
    """Yield contacts between hand and others, with +1 where the hand is the second shape: it feels what is exerted."""
    if data.ncon == 0:
        return
    inside = hand[model.geom_bodyid[data.contact.geom]]
    for k in np.flatnonzero(inside[:, 0] != inside[:, 1]):
        yield int(k), 1.0 if inside[k, 1] else -1.0


def _word(model: Any, geom: int) -> str:
    """Return the body that a shape belongs to, in words."""
    return str(model.body(int(model.geom_bodyid[geom])).name)
