"""Explicit steps of rigid parts that stand on springs with Coulomb friction, compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.runtime.compiled import compiled

BRAKE = 0.2
"""Largest share of a part's speed that damping takes in one step: more would turn it round, and rattle."""


class ContactSprings(NamedTuple):
    """C springs between P parts of unit mass and the ground, which is number P.

    Attributes:
        first, second: (C,) the part on either side.
        rows: (C, 2, d, dof) [normal; tangents] of both sides: speeds q̇ of a part move its side by rows · q̇.
        normal, tangential, friction: (C,) stiffnesses and Coulomb coefficients.
        squeeze: (C,) by how much parts are pressed into each other while the load comes on.
    """

    first: IntArray
    second: IntArray
    rows: Array
    normal: Array
    tangential: Array
    friction: Array
    squeeze: Array


class Resting(NamedTuple):
    """The state of parts and springs, changed in place.

    Attributes:
        motion, speed, force: (P + 1, dof) since the start, per step, and what nothing balances; the ground's stay zero.
        gap: (C,) how far open, negative where pressed.
        shear: (C, d − 1) forces of the tangential springs on the second side.
    """

    motion: Array
    speed: Array
    force: Array
    gap: Array
    shear: Array


Advance: TypeAlias = Callable[[ContactSprings, Array, Array, Resting, int, int, int, float, float], None]


def _advance(d: int, dof: int) -> Advance:
    """Return `advance` for contacts of d directions and parts of `dof` coordinates; fixed numbers make it 3× faster."""

    @compiled
    def advance(
        springs: ContactSprings,
        before: Array,
        load: Array,
        state: Resting,
        taken: int,
        steps: int,
        ramp: int,
        damping: float,
        viscosity: float,
    ) -> None:
        first, second, rows, normal, tangential, friction, squeeze = springs
        motion, speed, force, gap, shear = state
        way = np.zeros(d)
        push = np.zeros(d)
        for step in range(taken, taken + steps):
            share = min(1.0, (step + 1) / ramp)
            grown = share - min(1.0, step / ramp)
            for p in range(len(load)):
                for a in range(dof):
                    force[p, a] = before[p, a] + share * (load[p, a] - before[p, a])
            for c in range(len(rows)):
                i, j = first[c], second[c]
                for k in range(d):
                    total = 0.0
                    for a in range(dof):
                        total += rows[c, 1, k, a] * speed[j, a] - rows[c, 0, k, a] * speed[i, a]
                    way[k] = total
                gap[c] += way[0] - grown * squeeze[c]
                if gap[c] >= 0.0:
                    for k in range(d - 1):
                        shear[c, k] = 0.0
                    continue
                push[0] = max(0.0, -normal[c] * (gap[c] + viscosity * way[0]))
                most = friction[c] * push[0]
                pulled = 0.0
                for k in range(d - 1):
                    shear[c, k] -= tangential[c] * way[k + 1]
                    pulled += shear[c, k] ** 2
                slips = pulled > most * most
                shrink = most / np.sqrt(pulled) if slips else 1.0
                pulled = 0.0
                for k in range(d - 1):
                    shear[c, k] *= shrink
                    push[k + 1] = shear[c, k] if slips else shear[c, k] - tangential[c] * viscosity * way[k + 1]
                    pulled += push[k + 1] ** 2
                if pulled > most * most:
                    for k in range(d - 1):
                        push[k + 1] *= most / np.sqrt(pulled)
                for a in range(dof):
                    on_first, on_second = 0.0, 0.0
                    for k in range(d):
                        on_first += rows[c, 0, k, a] * push[k]
                        on_second += rows[c, 1, k, a] * push[k]
                    force[i, a] -= on_first
                    force[j, a] += on_second
            for p in range(len(load)):
                pull, fast = 0.0, 0.0
                for a in range(dof):
                    pull += force[p, a] ** 2
                    fast += speed[p, a] ** 2
                brake = min(BRAKE, damping * np.sqrt(pull / fast)) if fast > 0.0 else 0.0
                for a in range(dof):
                    speed[p, a] += force[p, a] - brake * speed[p, a]
                    motion[p, a] += speed[p, a]

    return advance


ADVANCE = {2: _advance(2, 3), 3: _advance(3, 6)}
"""By dimension d: functions that take `steps` steps of unit length and change `state`.

The normal force is k · max(0, −gap); sliding does not lift. The tangential spring stretches with what moves across
and slips at μ times the normal force. Steps from `taken` on bring the load from `before` to `load` (P, dof), which
acts in full after `ramp` steps. `damping` holds a part back by that share of the force on it that nothing balances:
none where all is balanced, and none that could hold up what falls. `viscosity` (steps) damps what rattles in a
contact, never what slides.
"""
