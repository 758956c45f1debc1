"""Contact points with friction and springs, and the clamping that is declared between parts: all but the load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.contacts.friction import TANGENTIAL_RATIO
from mocca_robot.errors import InputError
from mocca_robot.geometry.frames import tangents
from mocca_robot.statics.friction import equilibrium_with_friction, steepness, three_rows
from mocca_robot.statics.solution import EquilibriumResult
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.tolerances import TINY


@dataclass(frozen=True, eq=False, kw_only=True)
class FrictionalContacts:
    """C contact points with friction and springs between N parts: all that does not depend on the load.

    Attributes:
        pairs, points, normals, free, about, length: as in `ContactSystem`.
        friction: (C,) coefficients ≥ 0.
        rows: the system with three rows a contact, [n/μ; t₁; t₂].
        axes: (C, 3, d) unit n, t₁, t₂; in 2D the last is zero.
        softness: (C, 3) compliance along the axes, relative to that of the mean contact point along its normal.
        clamping: (C,) newtons with which a point presses if nothing gives.
    """

    pairs: IntArray
    points: Array
    normals: Array
    free: BoolArray
    about: Array
    length: float
    friction: Array
    rows: ContactSystem
    axes: Array
    softness: Array
    clamping: Array

    @classmethod
    def of(
        cls,
        pairs: IntArray,
        points: Array,
        normals: Array,
        free: BoolArray,
        friction: float | Array,
        *,
        about: Array | None = None,
        length: float | None = None,
        weights: Array | None = None,
        tangential_ratio: float = TANGENTIAL_RATIO,
        clamping: Mapping[tuple[int, int], float] | None = None,
    ) -> FrictionalContacts:
        """Return the contacts of points (C, d) with unit normals (C, d) from part i into j of `pairs` (C, 2).

        Args:
            pairs, points, normals, free, about, length: as in `ContactSystem.build`.
            friction: one coefficient, or (C,) one a point.
            weights: (C,) relative stiffness of the points; default: all alike.
            tangential_ratio: k_t/k_n.
            clamping: newtons by pair (i, j) of parts: with what force they press on each other if nothing gives.

        Raises InputError for what `ContactSystem.build` refuses, for friction, weights or ratio out of range and for
        clamping between parts that do not touch.
        """
        plain = ContactSystem.build(pairs, points, normals, free, about, length)
        pairs, points, normals = plain.pairs, np.asarray(points, float), np.asarray(normals, float)
        count, d = points.shape
        mu = _one_a_point(friction, count, "friction", "≥ 0", 0.0)
        weight = _one_a_point(1.0 if weights is None else weights, count, "weights", "> 0", TINY)
        if not (np.isfinite(tangential_ratio) and tangential_ratio > 0):
            raise InputError(f"The ratio k_t/k_n is {tangential_ratio}; it must be a number > 0.")
        axes = np.zeros((count, 3, d))
        axes[:, 0], axes[:, 1:d] = normals, tangents(normals)
        rows = three_rows(pairs, points, axes, plain.free, mu, plain.about, plain.length)
        soft = weight.mean() / weight if count else weight
        softness = soft[:, None] * np.array([1.0, 1.0 / tangential_ratio, 1.0 / tangential_ratio])
        pressed = _clamped(pairs, weight, clamping or {})
        return cls(
            pairs=pairs,
            points=points,
            normals=normals,
            free=rows.free,
            about=rows.about,
            length=rows.length,
            friction=mu,
            rows=rows,
            axes=axes,
            softness=softness,
            clamping=pressed,
        )

    @property
    def steep(self) -> Array:
        """Return (C, 3) what turns axes into rows: 1/μ, 1, 1."""
        steep = steepness(self.friction, len(self.pairs))
        steep[:, 2] *= self.axes[:, 2].any(axis=1)
        return steep

    def bound(self, wrenches: Array) -> EquilibriumResult:
        """Return whether some forces within the friction cones hold `wrenches` (N, dof): a bound (Eq. 8)."""
        return equilibrium_with_friction(
            self.pairs, self.points, self.normals, wrenches, self.free, self.friction, self.about, self.length
        )


def _one_a_point(given: float | Array, count: int, name: str, limit: str, least: float) -> Array:
    values = np.asarray(given, dtype=np.float64)
    if values.ndim > 1 or (values.ndim == 1 and len(values) != count):
        raise InputError(
            f"{name} has shape {values.shape}; give one number, or one for each of {count} contact points."
        )
    wrong = ~(np.isfinite(values) & (values >= least))
    if wrong.any():
        raise InputError(f"{name} is {np.atleast_1d(values)[np.atleast_1d(wrong)][0]:g}; it must be a number {limit}.")
    return np.array(np.broadcast_to(values, (count,)))


def _clamped(pairs: IntArray, weight: Array, clamping: Mapping[tuple[int, int], float]) -> Array:
    """Return (C,) what every point presses with, shared between those of a pair by their stiffness."""
    out = np.zeros(len(pairs))
    for (i, j), force in clamping.items():
        if not (np.isfinite(force) and force >= 0):
            raise InputError(f"The clamping force between parts {i} and {j} is {force} N; it must be a number ≥ 0.")
        mine = ((pairs == (i, j)) | (pairs == (j, i))).all(axis=1)
        if not mine.any():
            raise InputError(f"Parts {i} and {j} do not touch: no force can clamp them together.")
        out[mine] += force * weight[mine] / weight[mine].sum()
    return out
