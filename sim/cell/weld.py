"""Welds that give like springs: MuJoCo's own are as stiff as the bodies they hold are heavy."""

from __future__ import annotations

from typing import Any

import numpy as np

from mocca_robot.arrays import Array

IMPEDANCE = 0.95
LEAST_STEPS = 2.5
"""Time constants of fewer steps are not stable."""


def spring(stiffness_n_m: float, stiffness_nm_rad: float, inverse_weights: Array, step_s: float) -> tuple[Array, float]:
    """Return `solref` (2,) and the torque scale of a weld that gives like a spring under a steady load.

    `inverse_weights` (2,) are the sums of both bodies' `body_invweight0`, 1/kg and 1/(kg m²). At rest a constraint of
    impedance d and regularisation R = (1 - d)/d × inverse weight gives way by R/k per newton, with k = 1/(d T²) of its
    time constant T at critical damping; half the angle counts as a length by the torque scale. A weld cannot be
    stiffer than T of a few steps allows: then it is softer than asked.
    """
    give = (1.0 - IMPEDANCE) / IMPEDANCE
    rate = stiffness_n_m * give * float(inverse_weights[0])
    time = max(float(1.0 / np.sqrt(IMPEDANCE * rate)), LEAST_STEPS * step_s)
    rate = 1.0 / (IMPEDANCE * time**2)
    scale = 2.0 * float(np.sqrt(stiffness_nm_rad * give * float(inverse_weights[1]) / rate))
    return np.array([time, 1.0]), scale


def soften(model: Any, weld: int, stiffness_n_m: float, stiffness_nm_rad: float) -> None:
    """Have a weld between two bodies of `model` give like a spring."""
    bodies = [int(model.eq_obj1id[weld]), int(model.eq_obj2id[weld])]
    weights = model.body_invweight0[bodies].sum(axis=0)
    solref, scale = spring(stiffness_n_m, stiffness_nm_rad, weights, float(model.opt.timestep))
    model.eq_solref[weld], model.eq_solimp[weld, :2], model.eq_data[weld, 10] = solref, IMPEDANCE, scale
