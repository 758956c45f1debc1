"""Fewer curved joints: of a design that holds, those bumps are kept that it cannot do without.

First Eq. 8 with a price on force through bumps, while every joint may also push as if it were planar; dividing each
price by the force that the joint carried concentrates the slopes on few joints (reweighted ℓ1). Joints without
sloped force become planar again. The price is per joint, so that a bump in use costs no more for being used more.
Then trial: groups of the least used bumps are left out, halved where the rest no longer holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.tolerances import CASE_SOLVED, MARGIN_SOLVED, ROUNDING, TINY, VIOLATED
from planners.cone_joints.descent import evaluate, moved_wrenches, narrowed, surface_of
from planners.cone_joints.energy import each_case
from planners.cone_joints.realization import Polished, as_it_is, polish
from planners.cone_joints.rubbing import pushes, repeated
from planners.cone_joints.unknowns import JointParameters, JointProblem

PASSES = 10
PRICE = 1e-7
"""Of a unit of force through a bump, before weighting: small against the residual that it might buy."""
IN_USE = 1e-3
"""Sloped force, as a share of the largest one, from which a bump counts as used."""
UNEVEN = 0.3
"""Spread of the first prices (standard deviation of their logarithm)."""
FIRST_GROUPS = 8
TRIALS = 120
PATIENCE = 8
"""Bumps that cannot be spared, one after another, after which the rest, which carry more, are not tried."""
FULL_EFFORT = 330
"""Joints up to which all passes and trials are made. Beyond, their number falls with the square of the joints: each one
costs more, and thinning must not take longer than finding a design that holds."""
FEWEST_PASSES = 2
SETTLED_PASSES = 2
"""Passes in a row that choose the same joints, after which more of them would as well."""


def thin(problem: JointProblem, found: Polished, watch: Callable[[Polished], None] | None = None) -> Polished:
    """Return a design with as few curved joints as trial finds that holds as well as `found`, or that one.

    `watch` is shown every design on the way; each of them holds.
    """
    limit = max(float(found.infeasibility.max()), 0.1 * MARGIN_SOLVED)
    best = found

    def holds(fewer: Polished) -> bool:
        """Keep a design as the best if it holds."""
        nonlocal best
        best = replace(best, evaluations=best.evaluations + fewer.evaluations)
        required = fewer.infeasibility[: problem.required].max(initial=0.0)
        if required > CASE_SOLVED or fewer.violation > VIOLATED or fewer.infeasibility.max() > limit:
            return False
        best = replace(fewer, evaluations=best.evaluations)
        if watch is not None:
            watch(best)
        return True

    concentrated, through = _concentrated(problem, found.parameters)
    holds(polish(problem, concentrated, evaluations=12))
    order = np.flatnonzero(best.parameters.curved)
    order = order[np.argsort(through[order], kind="stable")]
    place, size, trials, needed, telling = 0, max(1, len(order) // FIRST_GROUPS), 0, 0, 0
    while place < len(order) and trials < round(TRIALS * _effort(problem)) and needed < PATIENCE:
        trials += 1
        curved = best.parameters.curved.copy()
        curved[order[place : place + size]] = False
        fewer = replace(best.parameters, curved=curved)
        fails = _first_to_fail(problem, fewer, telling)
        if fails is None and holds(as_it_is(problem, fewer)):
            place, size, needed = place + size, 2 * size, 0
            continue
        telling = telling if fails is None else fails
        if size > 1:
            size //= 2
        else:
            place, needed = place + 1, needed + 1
    return best


def _first_to_fail(problem: JointProblem, parameters: JointParameters, telling: int) -> int | None:
    """Return a load case that does not hold, the one numbered `telling` being asked before the others, or None.

    What one trial fails under, the next one mostly fails under as well: that costs one case instead of all.
    """
    inset, cases = problem.shapes.options.inset, np.arange(len(problem.loads.gravity))
    for asked in (cases[[telling]], np.delete(cases, telling)):
        if not len(asked):
            continue
        part = replace(problem, loads=problem.loads.only(asked))
        left = evaluate(part, parameters, inset).infeasibility
        if left.max() > MARGIN_SOLVED:
            return int(asked[left.argmax()])
    return None


def _effort(problem: JointProblem) -> float:
    return min(1.0, (FULL_EFFORT / len(problem.pairs)) ** 2)


def _concentrated(problem: JointProblem, parameters: JointParameters) -> tuple[JointParameters, Array]:
    """Return `parameters` with every bump made planar that no force needs, and the sloped force (E,) of each joint."""
    shapes, pairs, loads = problem.shapes, problem.pairs, problem.loads
    surface = surface_of(problem, parameters)
    rays_of = shapes.rays(narrowed(shapes, surface, shapes.options.inset))
    flat = repeated(shapes, np.einsum("erd,ed->er", rays_of[1], shapes.normals) > 1.0 - ROUNDING)
    points, normals = pushes(shapes, *rays_of)
    planar = replace(parameters, curved=np.zeros_like(parameters.curved))
    rays_of = shapes.rays(narrowed(shapes, surface_of(problem, planar), shapes.options.inset))
    flat_points, flat_normals = pushes(shapes, *rays_of)
    rays = points.shape[1]
    both = np.concatenate([points, flat_points], axis=1).reshape(-1, points.shape[2])
    directions = np.concatenate([normals, flat_normals], axis=1).reshape(-1, points.shape[2])
    free = np.asarray(loads.free.any(axis=0))
    owner = np.repeat(np.arange(len(pairs)), 2 * rays)
    system = ContactSystem.build(pairs[owner], both, directions, free, loads.about, loads.length)
    wrenches = moved_wrenches(problem, surface)[:, free].reshape(len(loads.gravity), -1) / loads.scale[:, None]
    sloped = np.concatenate([~flat, np.zeros_like(flat)], axis=1).ravel()
    # Equal prices would leave equal joints of a symmetric structure equally used, all of them.
    weight: Array = np.exp(UNEVEN * np.random.default_rng(0).standard_normal(len(pairs)))
    used: BoolArray = parameters.curved
    through: Array = np.zeros(len(pairs))
    settled = 0
    for _ in range(max(FEWEST_PASSES, round(PASSES * _effort(problem)))):
        forces = each_case(system, wrenches, loads.active[:, owner], loads.free, PRICE * sloped * weight[owner])[1]
        through = np.asarray(np.bincount(owner, forces.max(axis=0) * sloped, len(pairs)), dtype=np.float64)
        most = float(through.max(initial=0.0))
        before, used = used, parameters.curved & (through > IN_USE * most)
        settled = settled + 1 if bool((used == before).all()) else 0
        if settled >= SETTLED_PASSES:
            break
        weight = 1.0 / (through / max(most, TINY) + 1e-2)
        weight /= weight.min()
    return replace(parameters, curved=used), through
