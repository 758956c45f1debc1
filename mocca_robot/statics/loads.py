"""Load cases: one external wrench per part, for the parts that are there (design goals → Eq. 13's sum)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array, BoolArray, read_only
from mocca_robot.assembly import Assembly, Equilibrium, Goal, Interlocking, Lateral, SupportFree
from mocca_robot.geometry.cones import cross
from mocca_robot.geometry.frames import tangents
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.applied import combined


@dataclass(frozen=True, eq=False)
class LoadCase:
    """What acts on which parts.

    Attributes:
        name: 'gravity', 'tilt_090', 'state_p05' or 'interlocking'.
        gravity: (d,) acceleration, or None for interlocking: every contact is pushed apart by a unit force.
        present: (N,) parts that are placed; contacts with absent parts do not exist.
        held: (N,) parts that cannot move: fixed ones, and the key under interlocking.
        applied: (N, dof) further wrenches about the world origin, newtons and newton metres.
    """

    name: str
    gravity: Array | None
    present: BoolArray
    held: BoolArray
    applied: Array | None = None

    @property
    def free(self) -> BoolArray:
        """Return (N,) the parts that are there and can move."""
        return np.asarray(self.present & ~self.held)


def tilted_gravity(gravity: Array, angle_rad: float, azimuth_rad: float = 0.0) -> Array:
    """Return gravity (d,) as a structure feels it whose ground is tilted by `angle_rad` towards an azimuth.

    Gravity turns towards the azimuth: +x for 0, in 2D −x for π. Its magnitude stays.
    """
    g = float(np.linalg.norm(gravity))
    down = gravity / g
    if len(gravity) == 2:
        side = tangents(down)[0] * (1.0 if np.cos(azimuth_rad) >= 0 else -1.0)
    else:
        seed = np.array([1.0, 0.0, 0.0]) if abs(down[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        x = seed - (seed @ down) * down
        x /= np.linalg.norm(x)
        y = np.cross(-down, x)
        side = np.cos(azimuth_rad) * x + np.sin(azimuth_rad) * y
    return np.asarray(g * (np.cos(angle_rad) * down + np.sin(angle_rad) * side))


def load_cases(graph: PartsGraph, goals: Sequence[Goal] | None = None) -> tuple[LoadCase, ...]:
    """Return the load cases that `goals` (default: the assembly's own) ask for, gravity first.

    Support-free adds one case per intermediate state: 'state_X' is the assembly just after X was placed. The
    last state is 'gravity' itself. Combinations of loads follow as 'load_NAME', or 'load_NAME_state_X' for each state.
    """
    assembly = graph.assembly
    goals = assembly.goals if goals is None else goals
    n = len(assembly.parts)
    everything = np.ones(n, dtype=np.bool_)
    fixed = assembly.fixed
    cases: list[LoadCase] = []
    if any(isinstance(g, Equilibrium | SupportFree | Lateral) for g in goals):
        cases.append(LoadCase("gravity", assembly.gravity, everything, fixed))
    for goal in goals:
        if isinstance(goal, SupportFree):
            cases.extend(state_cases(graph)[:-1])
        elif isinstance(goal, Lateral):
            for azimuth in tilt_azimuths(assembly.dimension, goal.azimuths):
                g = tilted_gravity(assembly.gravity, goal.angle_rad, azimuth)
                cases.append(LoadCase(f"tilt_{np.rad2deg(azimuth):03.0f}", read_only(g), everything, fixed))
        elif isinstance(goal, Interlocking):
            # Someone holds the key against the ground: otherwise all the rest could leave it the way it came in.
            held = np.array(fixed)
            held[assembly.index(goal.key)] = True
            cases.append(LoadCase("interlocking", None, everything, held))
    if assembly.combinations and cases and cases[0].gravity is not None:
        cases.extend(combination_cases(graph))
    return tuple(cases)


def combination_cases(graph: PartsGraph) -> tuple[LoadCase, ...]:
    """Return the load cases of the assembly's combinations of loads."""
    assembly = graph.assembly
    cases = []
    for combination in assembly.combinations:
        moments = [("", graph)]
        if combination.states == "all":
            moments = [(f"_state_{assembly.parts[p].name}", state) for p, state in graph.states.items()]
        for suffix, state in moments:
            gravity, applied = combined(state, combination)
            name = f"load_{combination.name}{suffix}"
            cases.append(LoadCase(name, read_only(gravity), state.present, assembly.fixed, read_only(applied)))
    return tuple(cases)


def state_cases(graph: PartsGraph) -> tuple[LoadCase, ...]:
    """Return one gravity case per part placed after the fixed ones: the assembly as it stands just then."""
    assembly = graph.assembly
    return tuple(
        LoadCase(f"state_{assembly.parts[part].name}", assembly.gravity, state.present, assembly.fixed)
        for part, state in graph.states.items()
    )


def tilt_azimuths(dimension: int, count: int) -> Array:
    """Return azimuths in radians: right and left in 2D, `count` even ones in 3D."""
    if dimension == 2:
        return np.array([0.0, np.pi])
    return np.asarray(2 * np.pi * np.arange(count) / count)


def gravity_wrenches(assembly: Assembly, gravity: Array) -> Array:
    """Return (N, dof) weights about the world origin."""
    centroids = np.array([p.centroid for p in assembly.parts])
    forces = np.array([p.mass for p in assembly.parts])[:, None] * gravity
    return np.concatenate([forces, cross(centroids, forces)], axis=1)


def case_wrenches(case: LoadCase, graph: PartsGraph) -> Array:
    """Return (N, dof) external wrenches about the origin; zero on parts that are absent.

    Interlocking pushes P_i and P_j apart with a unit force along each contact's normal, at its centre, in units
    of the assembly's mean weight so that the numbers stay comparable with gravity.
    """
    assembly = graph.assembly
    if case.gravity is not None:
        wrenches = gravity_wrenches(assembly, case.gravity)
        if case.applied is not None:
            wrenches = wrenches + case.applied
    else:
        unit = float(np.mean([p.mass for p in assembly.parts]) * np.linalg.norm(assembly.gravity))
        wrenches = np.zeros((len(assembly.parts), assembly.dof))
        for contact in graph.contacts:
            i, j = contact.parts
            push = np.concatenate([contact.normal, cross(contact.centre, contact.normal)]) * unit
            wrenches[j] += push
            wrenches[i] -= push
    wrenches[~case.present] = 0.0
    return wrenches
