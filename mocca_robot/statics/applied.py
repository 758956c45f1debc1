"""What loads come to: forces on parts, from those at a place, pressures, masses, wind and accelerations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.actions import (
    Action,
    AddedMass,
    BodyAcceleration,
    Combination,
    LineForce,
    PointForce,
    Pressure,
    SupportMove,
    Wind,
    Worker,
)
from mocca_robot.arrays import Array, BoolArray
from mocca_robot.assembly import Assembly
from mocca_robot.geometry.cones import cross
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.exposed import standing_place, surface_forces


@dataclass(frozen=True, eq=False, kw_only=True)
class Push:
    """One force of a load on one part.

    Attributes:
        part: its index.
        force: (d,) newtons.
        point: (d,) where it acts, metres.
        turns: whether it turns with the part, as what presses square on a face does; weights keep their direction.
    """

    part: int
    force: Array
    point: Array
    turns: bool = False


def pushes(graph: PartsGraph, action: Action) -> list[Push]:
    """Return the forces of one load on the parts of a state that are there; a `Worker` is on what was placed last."""
    assembly, there = graph.assembly, graph.present
    if isinstance(action, SupportMove):
        return []
    if isinstance(action, BodyAcceleration):
        found = [
            Push(part=k, force=part.mass * action.acceleration, point=part.centroid)
            for k, part in enumerate(assembly.parts)
        ]
    elif isinstance(action, Pressure | Wind):
        axes = [0, 2] if assembly.dimension == 2 else [0, 1, 2]
        found = [
            Push(part=part, force=force[axes], point=point[axes], turns=True)
            for part, force, point in surface_forces(graph, action)
        ]
    else:
        part, force, point = _single(assembly, action, there)
        found = [Push(part=part, force=force, point=point)]
    return [push for push in found if there[push.part]]


def applied_forces(graph: PartsGraph, action: Action, cell: float) -> list[tuple[int, Array, Array]]:
    """Return part, force (d,) and its point (d,) of every piece of a load but an acceleration: what `applied_wrenches`
    sums up, with lines and pressed faces cut into pieces of at most about `cell` metres.
    """
    if isinstance(action, BodyAcceleration | SupportMove):
        return []
    if isinstance(action, Pressure | Wind):
        flat = [0, 2] if graph.assembly.dimension == 2 else [0, 1, 2]
        return [(k, force[flat], point[flat]) for k, force, point in surface_forces(graph, action, cell)]
    found = [(push.part, push.force, push.point) for push in pushes(graph, action)]
    if not isinstance(action, LineForce):
        return found
    count = max(2, int(np.ceil(np.linalg.norm(action.end - action.start) / cell)))
    shares = (np.arange(count)[:, None] + 0.5) / count
    places = action.start + shares * (action.end - action.start)
    return [(part, force / count, place) for part, force, _ in found for place in places]


def applied_wrenches(graph: PartsGraph, action: Action) -> Array:
    """Return (N, dof) [force; torque about the world origin] of one load on the parts of a state that are there.

    Newtons and newton metres; zero on absent parts.
    """
    return _wrenches(graph.assembly, pushes(graph, action))


def combined(graph: PartsGraph, combination: Combination) -> tuple[Array, Array]:
    """Return gravity (d,) m/s² and the further wrenches (N, dof) of a combination of the assembly's loads.

    Accelerations come back as gravity, so that they act on whatever mass a part has once joints are cut in.
    """
    gravity, found = combined_pushes(graph, combination)
    return gravity, _wrenches(graph.assembly, found)


def combined_pushes(graph: PartsGraph, combination: Combination) -> tuple[Array, list[Push]]:
    """Return gravity (d,) m/s², with accelerations, and all other forces of a combination of the assembly's loads.

    Accelerations that act together with masses shake these, too.
    """
    assembly = graph.assembly
    acting = [(combination.factors[a.name], a) for a in assembly.actions if combination.factors.get(a.name, 0.0)]
    shaken = sum(
        (f * a.acceleration for f, a in acting if isinstance(a, BodyAcceleration)), np.zeros(assembly.dimension)
    )
    found = []
    for factor, action in acting:
        if isinstance(action, BodyAcceleration):
            continue
        for push in pushes(graph, action):
            inertia = action.mass_kg * shaken if isinstance(action, AddedMass | Worker) else 0.0
            found.append(replace(push, force=factor * (push.force + inertia)))
    return np.asarray(combination.gravity * assembly.gravity + shaken), found


def _wrenches(assembly: Assembly, found: Sequence[Push]) -> Array:
    """Return (N, dof) the sums of forces on every part about the world origin."""
    wrenches = np.zeros((len(assembly.parts), assembly.dof))
    for push in found:
        wrenches[push.part] += np.concatenate([push.force, cross(push.point, push.force)])
    return wrenches


def _single(
    assembly: Assembly, action: PointForce | LineForce | AddedMass | Worker, present: BoolArray
) -> tuple[int, Array, Array]:
    """Return part, force (d,) and its point (d,) of a load that acts at one place."""
    if isinstance(action, Worker):
        part = int(np.flatnonzero(present)[-1])
        return part, action.mass_kg * assembly.gravity, standing_place(assembly.parts[part], assembly.size)
    part = assembly.index(action.part)
    if isinstance(action, LineForce):
        span = action.end - action.start
        return part, action.force * float(np.linalg.norm(span)), 0.5 * (action.start + action.end)
    point = assembly.parts[part].centroid if action.at is None else action.at
    return part, action.force if isinstance(action, PointForce) else action.mass_kg * assembly.gravity, point
