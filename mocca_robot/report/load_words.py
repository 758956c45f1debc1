"""How large a load is, in words."""

from __future__ import annotations

import math

import numpy as np

from mocca_robot.actions import Action, AddedMass, BodyAcceleration, LineForce, PointForce, SupportMove, Worker


def load_size(action: Action) -> str:
    """Return how large a load is, with its unit (not escaped)."""
    if isinstance(action, SupportMove):
        return f"'{action.part}' moves by {move_words(float(np.linalg.norm(action.shift)), action.turn_rad)}"
    if isinstance(action, PointForce):
        return f"{np.linalg.norm(action.force):.4g} N on '{action.part}'"
    if isinstance(action, LineForce):
        return f"{np.linalg.norm(action.force):.4g} N/m on '{action.part}'"
    if isinstance(action, AddedMass):
        return f"{action.mass_kg:.4g} kg on '{action.part}'"
    if isinstance(action, Worker):
        return f"{action.mass_kg:.4g} kg on what was placed last"
    if isinstance(action, BodyAcceleration):
        return f"{np.linalg.norm(action.acceleration):.4g} m/s²"
    return f"{action.pressure_pa:.4g} Pa"


def move_words(metres: float, radians: float) -> str:
    """Return how far a support moves: 12 mm and 3°."""
    said = [f"{1e3 * metres:.4g} mm"] if metres else []
    return " and ".join([*said, f"{math.degrees(radians):.4g}°"] if radians else said)
