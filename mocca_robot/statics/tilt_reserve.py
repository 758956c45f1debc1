"""The smallest reserve against tilting: over every state that has to stand, every azimuth, and what gives way there.

One state after the other, from the tilt that the weakest so far survives: most states stand there and cost one problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Lateral
from mocca_robot.geometry.cones import cross
from mocca_robot.joints.bounds import TightJoint
from mocca_robot.joints.joint import contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import CaseVerdict, solve_case
from mocca_robot.statics.friction_cases import tilt_of_case
from mocca_robot.statics.load_factor import power
from mocca_robot.statics.loads import LoadCase, load_cases, tilt_azimuths, tilted_gravity
from mocca_robot.statics.solution import EquilibriumResult
from mocca_robot.statics.tilt import critical_angle

REACHED_RAD = 1e-4
"""How much a reserve may fall short of what was asked by rounding: 0.006°, what a second decimal rounds away."""

BEYOND_RAD = 1e-3
"""How far beyond the critical tilt the fall is looked at: near enough that every contact still carries its share."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TiltReserve:
    """How far the ground can tilt before the first of the states that have to stand falls.

    Attributes:
        critical_rad: the tilt at which that state first falls, at most π/2.
        azimuth_rad: towards which side.
        case: the load case, 'gravity' for the finished structure.
        goal_rad: the tilt that a lateral goal asks of this state, 0 without one.
        margin_rad: the reserve asked for beyond it (`JointOptions.tilt_margin_rad`); infinite: the largest there is.
        moving: the parts that move just beyond it, in assembly order; empty at π/2.
        pairs: pairs of parts whose contacts give way in that motion: where forces slide most along the contact first.
        friction: the Coulomb coefficient that it counts on; 0 for none.
        limits: the joints of these pairs and the bounds they have reached; empty where their design is not known.
    """

    critical_rad: float
    azimuth_rad: float
    case: str
    goal_rad: float
    margin_rad: float
    moving: tuple[str, ...] = ()
    pairs: tuple[tuple[str, str], ...] = ()
    limits: tuple[TightJoint, ...] = ()
    friction: float = 0.0

    @property
    def reserve_rad(self) -> float:
        """Return the tilt that is left beyond the goal's own; negative where the goal itself is missed."""
        return self.critical_rad - self.goal_rad

    @property
    def asked_rad(self) -> float:
        """Return the tilt that was asked for in all; of the largest there is, what the goal asks for."""
        return self.goal_rad if self.largest else self.goal_rad + self.margin_rad

    @property
    def largest(self) -> bool:
        """Return whether the largest reserve that is found was asked for."""
        return bool(np.isinf(self.margin_rad))

    @property
    def missed(self) -> bool:
        """Return whether the structure falls before the tilt that was asked for."""
        return self.critical_rad < self.asked_rad - REACHED_RAD

    def limited_by(self, joints: Sequence[TightJoint]) -> TiltReserve:
        """Return the same with what the joints that give way are limited by."""
        return replace(self, limits=tuple(j for pair in self.pairs for j in joints if j.parts == pair))


def tilt_reserve(
    graph: PartsGraph,
    margin_rad: float,
    azimuths: int = 8,
    cases: Sequence[LoadCase] | None = None,
    friction: float = 0.0,
) -> TiltReserve | None:
    """Return the smallest reserve of the cases that stand under gravity; None when no goal asks for that.

    Args:
        graph: parts and contacts as they are.
        margin_rad: the reserve that was asked for.
        azimuths: sides towards which solids are tilted; flat structures have two.
        cases: default: every load case that the assembly's goals ask for.
        friction: with it, the tilt is that of the forces that come about (`coulomb_tilt`).
    """
    assembly = graph.assembly
    lateral = max((float(g.angle_rad) for g in assembly.goals if isinstance(g, Lateral)), default=0.0)
    weakest: TiltReserve | None = None
    for case in load_cases(graph) if cases is None else cases:
        if case.gravity is None or case.name.startswith("tilt_"):  # those tilts are the finished structure's own
            continue
        goal = lateral if case.name == "gravity" else 0.0
        for azimuth in tilt_azimuths(assembly.dimension, azimuths):
            start = np.pi / 2 if weakest is None else float(np.clip(weakest.reserve_rad + goal, 0.0, np.pi / 2))
            critical_rad, fallen = _critical(graph, case, float(azimuth), start, friction)
            if weakest is not None and critical_rad - goal >= weakest.reserve_rad:
                continue
            weakest = TiltReserve(
                critical_rad=critical_rad,
                azimuth_rad=float(azimuth),
                case=case.name,
                goal_rad=goal,
                margin_rad=margin_rad,
                moving=() if fallen is None else fallen.moving,
                pairs=() if fallen is None else _giving_way(graph, fallen),
                friction=friction,
            )
    return weakest


def _critical(
    graph: PartsGraph, case: LoadCase, azimuth_rad: float, start_rad: float, friction: float
) -> tuple[float, CaseVerdict | None]:
    """Return the critical tilt of one case, at most `start_rad`, and how it falls just beyond; None: not before."""
    assembly, gravity = graph.assembly, case.gravity
    assert gravity is not None
    about = np.array([p.centroid for p in assembly.parts])
    masses = np.array([p.mass for p in assembly.parts]) * case.present

    def at(angle_rad: float) -> CaseVerdict:
        return solve_case(graph, replace(case, gravity=tilted_gravity(gravity, angle_rad, azimuth_rad)), friction)

    def solve(angle_rad: float) -> EquilibriumResult:
        return at(angle_rad).result

    def steady(motions: Array) -> float:
        return 0.0 if case.applied is None else power(case.applied * case.present[:, None], motions, about)

    level = tilted_gravity(gravity, np.pi / 2, azimuth_rad)
    upright = at(0.0)
    if not upright.result.stands:
        return 0.0, upright
    if friction > 0.0:
        if at(start_rad).result.stands:
            return start_rad, None
        found = tilt_of_case(graph, case, azimuth_rad, friction, start_rad)
        return found.critical_rad, at(found.fails_rad)
    angle = critical_angle(solve, masses, gravity, level, start_rad=start_rad, applied=steady)[0]
    if angle >= start_rad:
        return float(angle), None
    return float(angle), at(angle + BEYOND_RAD)


def _giving_way(graph: PartsGraph, fallen: CaseVerdict) -> tuple[tuple[str, str], ...]:
    """Return the pairs of parts whose forces slide along their contacts in the motion, most first.

    Force times sliding speed is how fast the motion would lose power if the contact were steeper there.
    """
    assembly = graph.assembly
    d = assembly.dimension
    pairs, points, normals = contact_rays(graph.contacts)
    velocities = []
    for side in (0, 1):
        part = pairs[:, side]
        motion = fallen.result.motions[part]
        arm = points - np.array([assembly.parts[p].centroid for p in part])
        turn = np.stack([-arm[:, 1], arm[:, 0]], axis=1) * motion[:, d:] if d == 2 else cross(motion[:, d:], arm)
        velocities.append(motion[:, :d] + turn)
    apart = velocities[1] - velocities[0]
    sliding = np.linalg.norm(apart - np.einsum("cd,cd->c", apart, normals)[:, None] * normals, axis=1)
    forces = fallen.result.forces
    pressing = forces if forces.ndim == 1 else np.einsum("cd,cd->c", forces, normals)
    weight: dict[tuple[int, int], float] = {}
    for (i, j), w in zip(pairs.tolist(), pressing * sliding):
        weight[i, j] = weight.get((i, j), 0.0) + float(w)
    most = max(weight.values(), default=0.0)
    ranked = sorted((pair for pair, w in weight.items() if w > 0.1 * most > 0.0), key=lambda pair: -weight[pair])
    return tuple((assembly.parts[i].name, assembly.parts[j].name) for i, j in ranked)
