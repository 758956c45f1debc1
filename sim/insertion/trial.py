"""Parts driven home by a compliant hand, judged along the whole path.

The hand holds the part with springs of stated stiffness and moves their far end along a straight line to the seat,
starting where part and neighbours no longer face each other. Judging the end alone would be wrong: a compliant
hand lets a part ride over an obstacle and still arrive.

With springs k and k·r² (r: the part's reach) the hand stores ½ k e² when its grip is off by the length
e = √(|shift|² + (r·turn)²), and no free path makes it push harder than k·e. More than that, plus 5 % of the part's
weight, means that something stood in the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.verdicts.physics import InsertionTrial
from sim.heard import heard
from sim.insertion.directions import Direction
from sim.insertion.hand import HAND, STEADY, HandOptions, HandPath, PlacingError, grip_offset
from sim.insertion.trial_scene import InsertionScene
from sim.motion import LOOK, reach, step_failure
from sim.scene import Compiled

LEAST_SINE = 1e-3
"""Of a cone's half-angle: in a narrower cone, the distance at which walls count as near stays finite."""

GENTLE = 0.8
"""Share of the force allowed for meeting a neighbour that the speed of a part gripped off its place may use up."""
NEAR = 2.0
"""Errors of the grip, over the sine of the cone's half-angle: from there on to its seat a part may meet neighbours."""
HOPELESS = 10.0
"""Times the force allowed, beyond which nothing further can be learned."""
LAST_STRETCH = 0.4
"""Share of the hand's steps for the last stretch of a way, all that is gone among free neighbours."""


def insert(
    ready: InsertionScene,
    direction: Direction,
    *,
    error: PlacingError = STEADY,
    hand: HandOptions = HAND,
) -> InsertionTrial:
    """Return the trial of driving the part in along `direction`. Safe to call from several threads.

    A part gripped off its place, or whose seat has sunk, is slow where it meets its neighbours, so that it hits no
    harder than the hand pushes. In a cone it meets those that it will touch only near its seat, and comes there
    faster; whatever then fails is tried again, slow all the way.
    """
    assembly, part = ready.compiled.scene.assembly, ready.cone.part
    far = float(reach(assembly)[part])
    offset, effective = grip_offset(assembly, direction.vector, error, far)
    travel = ready.travel(direction.vector, hand)
    least = max(1, round(hand.steps * ready.finer))
    off = effective + ready.sunk
    near = NEAR * off / max(np.sin(ready.cone.realised_rad), LEAST_SINE)
    if ready.below == "free":
        # Further out it meets the same neighbours, in the same places, as with all of them held.
        travel, least = min(travel, near + hand.lead * 2.0 * far), max(1, round(LAST_STRETCH * least))
    quick = (travel, least)
    if off == 0.0:
        return _driven(ready, direction, (quick,), offset, effective, hand)
    speed = _gentle_speed(ready, off, hand)
    if near < 0.5 * travel:
        found = _driven(ready, direction, (quick, (near, _steps(ready, near, speed))), offset, effective, hand)
        if found.succeeded:
            return found
    slow = (travel, max(least, _steps(ready, travel, speed)))
    return _driven(ready, direction, (slow,), offset, effective, hand)


def _gentle_speed(ready: InsertionScene, off: float, hand: HandOptions) -> float:
    """Return the speed (m/s) at which a part that is `off` metres beside its way may meet a neighbour.

    A mass m on a spring k that meets a wall at speed v adds v √(k m) to the spring's force.
    """
    scene = ready.compiled.scene
    assert scene.hand is not None
    mass = scene.assembly.parts[ready.cone.part].mass
    weight = mass * float(np.linalg.norm(scene.assembly.gravity))
    spare = hand.weight_share * weight + hand.impact * scene.hand.stiffness * off
    return min(hand.touching_speed, GENTLE * spare / float(np.sqrt(scene.hand.stiffness * mass)))


def _steps(ready: InsertionScene, distance: float, speed: float) -> int:
    """Return the steps for a distance at no more than a speed: minimum jerk peaks at 15/8 of the mean speed."""
    return max(1, int(1.875 * distance / speed / ready.compiled.model.opt.timestep))


def _driven(
    ready: InsertionScene,
    direction: Direction,
    legs: Sequence[tuple[float, int]],
    offset: Array,
    effective: float,
    hand: HandOptions,
) -> InsertionTrial:
    import mujoco

    compiled, cone = ready.compiled, ready.cone
    scene, model = compiled.scene, compiled.model
    assembly = scene.assembly
    far = float(reach(assembly)[cone.part])
    size = 2.0 * far
    weight = assembly.parts[cone.part].mass * float(np.linalg.norm(assembly.gravity))
    assert scene.hand is not None
    # With friction the hand also drags the part along what it rubs against, on both sides at most.
    beyond = 1.0 + hand.impact + 2.0 * scene.settings.friction
    allowed = hand.weight_share * weight + scene.hand.stiffness * (effective + ready.sunk) * beyond
    path = HandPath(model, compiled, cone.part, direction.vector, legs=legs, offset=offset)
    data = mujoco.MjData(model)
    heard()
    path.place(data)
    mujoco.mj_forward(model, data)
    start_overlap = _penetration(data)
    weights = path.force_weights(far)
    watch = _Below(compiled, cone.part, data)
    force_squared = depth = 0.0
    hopeless = (HOPELESS * allowed) ** 2
    failure: str | None = None
    step = 0
    mine = path.body if ready.below == "free" else None
    gentle, below = (ready.gentle_steps(hand), ready.below_dof) if ready.below == "free" else (0, None)
    # Views into `data`: asking for them anew after every step takes longer than a step of a small structure.
    pushed, where, iterations, most = data.qfrc_constraint, data.qpos, data.solver_niter, model.opt.iterations
    visited = np.empty((path.steps + 1, len(path.qpos)))
    if start_overlap <= hand.penetration * size:
        for step in range(1, path.steps + 1):
            data.ctrl[:] = path.commands[step]
            mujoco.mj_step(model, data)
            if step <= gentle:
                data.qvel[below] = 0.0
            push = pushed[path.dof] * weights
            force_squared = max(force_squared, float(push @ push))
            depth = max(depth, _penetration(data, mine))
            visited[step] = where[path.qpos]
            # Warnings and numbers that are not finite stay; iterations are those of the last step alone.
            if not step % LOOK or step == path.steps or iterations.max() >= most:
                failure = step_failure(model, data)
            if failure is not None or force_squared > hopeless:
                break
    force, deviation = float(np.sqrt(force_squared)), path.deviation(visited[1 : step + 1], far)
    moved = watch.moved(data, hand.sag_share)
    reason = _reason(
        assembly.parts[cone.part].name,
        hand,
        size,
        start_overlap,
        failure,
        (force, allowed),
        depth,
        (deviation, effective),
        moved,
    )
    return InsertionTrial(
        part=assembly.parts[cone.part].name,
        kind=direction.kind,
        direction=tuple(float(x) for x in direction.vector),
        clearance=ready.clearance,
        error=effective,
        below=ready.below,
        succeeded=reason == "",
        reason=reason or "went in freely",
        peak_force=force,
        allowed_force=allowed,
        peak_penetration=max(depth, start_overlap),
        tracking_error=deviation,
        moved_below=moved,
        steps=step,
    )


def _reason(
    name: str,
    hand: HandOptions,
    size: float,
    start_overlap: float,
    failure: str | None,
    force: tuple[float, float],
    depth: float,
    deviation: tuple[float, float],
    moved: tuple[str, ...],
) -> str:
    if start_overlap > hand.penetration * size:
        return f"'{name}' cannot even be brought there: at the start of the path it overlaps by {start_overlap:.2g} m"
    if failure is not None:
        return f"the run cannot be believed: {failure}"
    if force[0] > force[1]:
        return f"jammed: contact force {force[0]:.3g} N, allowed {force[1]:.3g} N"
    deepest = hand.penetration * size + hand.pressed * deviation[1]
    if depth > deepest:
        return f"penetrated by {depth * 1e6:.3g} µm, allowed {deepest * 1e6:.3g} µm"
    if deviation[0] > hand.tracking * size + 2.0 * deviation[1]:
        return f"left its path by {deviation[0] * 1e3:.3g} mm"
    if moved:
        return f"pushed {', '.join(moved)} away"
    return ""


class _Below:
    """The earlier parts that are free: where they were."""

    def __init__(self, compiled: Compiled, part: int, data: Any) -> None:
        keep = compiled.parts != part
        d = compiled.scene.assembly.dimension
        self.parts, self.qpos = compiled.parts[keep], compiled.qpos[keep][:, :d]
        self.start = data.qpos[self.qpos].copy()
        self.assembly = compiled.scene.assembly

    def moved(self, data: Any, share: float) -> tuple[str, ...]:
        if not len(self.parts):
            return ()
        size = 2.0 * reach(self.assembly)[self.parts]
        far = np.linalg.norm(data.qpos[self.qpos] - self.start, axis=1)
        return tuple(self.assembly.parts[p].name for p, m, s in zip(self.parts, far, size) if m > share * s)


def _penetration(data: Any, body: int | None = None) -> float:
    """Return the deepest penetration, metres; of one body only when given."""
    if data.ncon == 0:
        return 0.0
    distance = data.contact.dist
    if body is not None:
        model = data.model
        distance = distance[(model.geom_bodyid[data.contact.geom] == body).any(axis=1)]
    return max(0.0, -float(distance.min(initial=0.0)))
