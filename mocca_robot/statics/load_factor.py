"""How much of a load a structure takes: the factor λ at which it first falls, as one parametric problem.

Under w(λ) = w₀ + λ w₁ a structure that falls shows a motion v that no contact resists and that gains power,
w(λ)·v > 0. The same motion is possible under every other factor, so no structure stands where its power is positive:
not beyond λ' = −(w₀·v)/(w₁·v). The next problem is solved there, as for the critical tilt (`statics.tilt`). The factor
is looked for as an angle, λ = tan θ, so that "any amount" is an end of the range like any other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.actions import Combination, SupportMove
from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.joints.joint import contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.applied import combined
from mocca_robot.statics.cases import moving_parts, solve_case, solve_rays
from mocca_robot.statics.coulomb_tilt import largest_tilt
from mocca_robot.statics.friction_cases import present_corners, standing_case
from mocca_robot.statics.friction_verdict import FrictionVerdict
from mocca_robot.statics.loads import LoadCase, case_wrenches
from mocca_robot.statics.solution import EquilibriumResult, Status

RESOLUTION = 1e-10
"""Steps of θ shorter than this end the search."""
AT_THE_BORDER = 1e-12
"""E / |w|² below which 'inaccurate' means that the structure is about to fall: a millionth is unbalanced."""
MAX_STEPS = 60
FRICTION_RESOLUTION = 1e-3
"""Width of the bracket, as a share of the bound, at which the search with friction ends."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadFactor:
    """How much of one load a structure takes.

    Attributes:
        name: the load, or the combination, whose loads grow together.
        factor: λ, the largest multiple of the load that stands; 0 when it falls without it, inf when any amount
            stands; None when the solver gave no verdict.
        bound: with friction, a factor beyond which no forces hold it; below it nothing need bring them about. Else λ.
        motions: (N, dof) how it falls just beyond; zero when nothing falls.
        moving: names of the parts that move then.
        steps: problems solved; 0 where the load presses on nothing that can move.
        placed: the part just placed in the state that this is about; '' = the finished structure.
        move: metres and radians of a support that moves, of which `factor` is a multiple; None for loads.
    """

    name: str
    factor: float | None
    bound: float | None
    motions: Array
    moving: tuple[str, ...]
    steps: int
    placed: str = ""
    move: tuple[float, float] | None = None


def load_factors(graph: PartsGraph, friction: float = 0.0) -> tuple[LoadFactor, ...]:
    """Return how much of every load, and then of every combination of several, the structure takes beside gravity.

    A combination's loads grow together, its factor on gravity stays. Where a load acts in every state of the sequence
    the state that takes least counts. Friction is a Coulomb coefficient.
    """
    return tuple(_least(graph, combination, friction) for combination in asked_combinations(graph.assembly))


def asked_combinations(assembly: Assembly) -> tuple[Combination, ...]:
    """Return what load factors are found of: each load alone, then combinations of several or with gravity factored.

    Supports that move are no loads: see `mocca_robot.statics.moving_support`.
    """
    states = {c.name: c.states for c in assembly.combinations}
    alone = (
        Combination(name=a.name, factors={a.name: 1.0}, states=states.get(a.name, "finished"))
        for a in assembly.actions
        if not isinstance(a, SupportMove)
    )
    return (*alone, *(c for c in assembly.combinations if len(c.factors) > 1 or c.gravity != 1.0))


def growing_cases(state: PartsGraph, combination: Combination) -> tuple[LoadCase, LoadCase]:
    """Return what stays and what grows of a combination, as cases on the parts of a state that are there."""
    fixed, own = state.assembly.fixed, combination.gravity * state.assembly.gravity
    gravity, applied = combined(state, combination)
    steady = LoadCase(combination.name, own, state.present, fixed)
    return steady, LoadCase(combination.name, gravity - own, state.present, fixed, applied)


def _least(graph: PartsGraph, combination: Combination, friction: float) -> LoadFactor:
    """Return the factor of a combination in the state that takes least of it."""
    assembly = graph.assembly
    moments = {-1: graph} if combination.states == "finished" else graph.states
    found = []
    for part, state in moments.items():
        steady, growing = growing_cases(state, combination)
        if case_wrenches(growing, graph)[growing.free].any():
            placed = "" if state.present.all() else assembly.parts[part].name
            factor = load_factor(graph, combination.name, steady, growing, friction)
            found.append(replace(factor, placed=placed))
    if not found:
        nothing = np.zeros((len(assembly.parts), assembly.dof))
        return LoadFactor(name=combination.name, factor=np.inf, bound=np.inf, motions=nothing, moving=(), steps=0)
    return min(found, key=lambda f: -1.0 if f.factor is None else f.factor)


def load_factor(graph: PartsGraph, name: str, steady: LoadCase, growing: LoadCase, friction: float = 0.0) -> LoadFactor:
    """Return how many times `growing` the structure carries besides `steady`; both are cases on the same parts.

    What does not grow stays in `steady`: usually gravity. Motions are about the centres of mass. `growing` must press
    on a part that can move. With friction the factor up to which some forces would hold is only a bound; below it the
    forces that come about decide (`statics.coulomb`).
    """
    assembly = graph.assembly
    about = np.array([p.centroid for p in assembly.parts])
    ends = [case_wrenches(case, graph) for case in (steady, growing)]

    def at(*shares: float) -> LoadCase:
        """Return the case of both loads by their shares, handed over as wrenches: the second may have no mass."""
        wrenches = shares[0] * ends[0] + shares[1] * ends[1]
        return LoadCase(name, 0.0 * assembly.gravity, steady.present, steady.held, wrenches)

    def solve(angle: float) -> EquilibriumResult:
        case = at(np.cos(angle), np.sin(angle))
        if friction == 0.0:
            return solve_case(graph, case).result
        there = present_corners(graph, case.present)
        pairs, points, normals = contact_rays(graph.contacts)
        return solve_rays(graph, case, (pairs[there], points[there], normals[there]), friction)

    border = np.inf if friction > 0.0 else AT_THE_BORDER  # with friction a bound is enough, and every angle is one
    angle, steps, last = critical(solve, lambda v: (power(ends[0], v, about), power(ends[1], v, about)), border)
    if friction == 0.0 and angle:  # with friction the search begins there
        upright = solve(0.0)
        steps += 1
        if upright.status is Status.NOT_IN_EQUILIBRIUM:
            angle, last = 0.0, upright
    motions = np.zeros((len(assembly.parts), assembly.dof)) if last is None else last.motions
    bound = None if angle is None else np.inf if angle >= np.pi / 2 else float(np.tan(angle))
    factor = bound
    if friction > 0.0 and bound:
        size = [float(np.linalg.norm(wrenches[:, : assembly.dimension])) for wrenches in ends]

        def decide(share: float, start: Array | None) -> FrictionVerdict:
            return standing_case(graph, at(*_shares(share, bound, size[0] / size[1])), friction, start=start)

        found = largest_tilt(decide, np.pi / 2 if np.isinf(bound) else 1.0, FRICTION_RESOLUTION)
        if found.failure is not None:
            motions = found.failure.motions
            steady_share, growing_share = _shares(found.critical_rad, bound, size[0] / size[1])
            factor = growing_share / steady_share
        steps += found.tries
    moving = moving_parts(assembly, motions)
    return LoadFactor(name=name, factor=factor, bound=bound, motions=motions, moving=moving, steps=steps)


def _shares(along: float, bound: float, scale: float) -> tuple[float, float]:
    """Return the shares of steady and growing load: at `along` ∈ [0, 1] of a finite bound, or at an angle whose tangent
    is the factor over `scale` where any amount is within the bound.
    """
    return (1.0, along * bound) if np.isfinite(bound) else (float(np.cos(along)), float(np.sin(along)) * scale)


def critical(
    solve: Callable[[float], EquilibriumResult],
    powers: Callable[[Array], tuple[float, float]],
    border: float = AT_THE_BORDER,
) -> tuple[float | None, int, EquilibriumResult | None]:
    """Return the largest θ in [0, π/2] at which cos θ·w₀ + sin θ·w₁ is in equilibrium, the number of problems solved,
    and how it falls just beyond; θ is None when a solver gave no verdict.

    `powers` returns the powers of w₀ and w₁ in motions (N, dof). `border`: the E / |w|² up to which 'inaccurate' counts
    as about to fall; up to ∞, θ is only a bound: nothing stands beyond it.
    """
    angle, falls = np.pi / 2, None
    for step in range(1, MAX_STEPS + 1):
        result = solve(angle)
        if result.stands or (result.status is Status.INACCURATE and result.infeasibility <= border):
            return angle, step, falls
        if result.status is Status.INACCURATE:
            return None, step, falls
        falls = result
        steady, growing = powers(result.motions)
        bound = float(np.arctan2(max(0.0, -steady), growing)) if growing > 0.0 else 0.0
        if bound <= RESOLUTION:
            return 0.0, step, falls
        if bound > angle - RESOLUTION:
            return min(angle, bound), step, falls
        angle = bound
    return None, MAX_STEPS, falls


def power(wrenches: Array, motions: Array, about: Array) -> float:
    """Return the power (W per unit of motion) of wrenches (N, dof) about the origin in motions about `about` (N, d)."""
    d = about.shape[1]
    force, torque = wrenches[:, :d], wrenches[:, d:]
    arm = about[:, :1] * force[:, 1:] - about[:, 1:] * force[:, :1] if d == 2 else np.cross(about, force)
    return float((force * motions[:, :d]).sum() + ((torque - arm) * motions[:, d:]).sum())
