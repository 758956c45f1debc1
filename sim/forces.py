"""Forces of loads on the free parts of a scene in MuJoCo, put on anew before every step.

A weight keeps its direction while its place goes with the part; what presses on a face turns with it. Each part has one
resultant of either kind. Of weights the sum of r ⊗ f is kept, too: it tells their torque however the part has turned.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from sim.scene import Compiled
from sim.shapes.contact_model import embed


@dataclass(frozen=True, eq=False)
class AppliedForces:
    """Forces on F bodies, which turn about their centres of mass.

    Attributes:
        bodies: (F,) MuJoCo's numbers of them.
        velocity: (F, 3 | 6) addresses of their velocities.
        steady: (F, 3) newtons in the world.
        arms: (F, 3, 3) sum of r ⊗ f of these, r in the body's frame.
        turning: (F, 6) force and torque in the body's frame.
    """

    bodies: Array
    velocity: Array
    steady: Array
    arms: Array
    turning: Array

    def put(self, data: Any) -> None:
        """Put the forces on; the bodies' poses are those of the last step."""
        data.xfrc_applied[self.bodies] = self._now(data)

    def work(self, data: Any, seconds: float) -> float:
        """Return the work (J) of the forces put on last over a step that was just made."""
        push, speed = data.xfrc_applied[self.bodies], data.qvel[self.velocity]
        if speed.shape[1] == 3:
            power = push[:, 0] * speed[:, 0] + push[:, 2] * speed[:, 1] - push[:, 4] * speed[:, 2]
            return seconds * float(power.sum())
        # MuJoCo tells how a free body turns in its own frame.
        turn = np.einsum("fij,fj->fi", data.xmat[self.bodies].reshape(-1, 3, 3), speed[:, 3:])
        return seconds * float((push[:, :3] * speed[:, :3]).sum() + (push[:, 3:] * turn).sum())

    def _now(self, data: Any) -> Array:
        turned = data.xmat[self.bodies].reshape(-1, 3, 3)
        both = np.einsum("fij,fkj->fki", turned, self.turning.reshape(-1, 2, 3)).reshape(-1, 6)
        both[:, :3] += self.steady
        m = turned @ self.arms
        both[:, 3:] += np.stack([m[:, 1, 2] - m[:, 2, 1], m[:, 2, 0] - m[:, 0, 2], m[:, 0, 1] - m[:, 1, 0]], axis=1)
        return np.asarray(both)


def forces_of(compiled: Compiled) -> AppliedForces | None:
    """Return the forces of a compiled scene's loads on what can move; None when there are none."""
    scene = compiled.scene
    row = {int(part): k for k, part in enumerate(compiled.parts)}
    steady, arms, turning = np.zeros((len(row), 3)), np.zeros((len(row), 3, 3)), np.zeros((len(row), 6))
    acting = [p for p in scene.pushes if p.part in row]
    for push in acting:
        k, force = row[push.part], embed(push.force)
        arm = embed(push.point - scene.assembly.parts[push.part].centroid)
        if push.turns:
            turning[k] += np.concatenate([force, np.cross(arm, force)])
        else:
            steady[k] += force
            arms[k] += np.outer(arm, force)
    if not acting:
        return None
    bodies = np.array([compiled.model.body(scene.assembly.parts[p].name).id for p in compiled.parts])
    return AppliedForces(bodies, compiled.dof, steady, arms, turning)


def heaviest(compiled: Compiled) -> float:
    """Return the largest force on a free part, its own weight aside, over the weight of the lightest thing it moves."""
    forces = forces_of(compiled)
    if forces is None:
        return 0.0
    parts = compiled.scene.assembly.parts
    weight = np.array([parts[p].mass for p in compiled.parts]) * float(np.linalg.norm(compiled.scene.assembly.gravity))
    sums = np.linalg.norm(forces.steady + forces.turning[:, :3], axis=1)
    return float((sums / weight).max())
