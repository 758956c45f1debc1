"""Fewer curved joints: of a design that holds, those bumps are kept that carry force along their slopes.

Eq. 8 with a price on force through bumps, while every joint may also push as if it were planar; dividing each
price by the force that the joint carried concentrates the slopes on few joints (reweighted ℓ1). Joints without
sloped force become planar again. The price is per joint, so that a bump in use costs no more for being used more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mocca_robot.assembly import Array, BoolArray
from mocca_robot.statics.system import ContactSystem
from planners.descent import Parameters, Problem, moved_wrenches, narrowed, surface_of
from planners.energy import each_case

PASSES = 5
PRICE = 1e-7
"""Of a unit of force through a bump, before weighting: small against the residual that it might buy."""
IN_USE = 1e-3
"""Sloped force, as a share of the largest one, from which a bump counts as used."""


def thinned(problem: Problem, parameters: Parameters) -> Parameters:
    """Return `parameters` with every bump made planar that the load cases of `problem` can do without."""
    shapes, pairs, loads = problem.shapes, problem.pairs, problem.loads
    surface = surface_of(problem, parameters)
    points, normals = shapes.rays(narrowed(shapes, surface, shapes.options.inset))
    planar = replace(parameters, curved=np.zeros_like(parameters.curved))
    flat_points, flat_normals = shapes.rays(narrowed(shapes, surface_of(problem, planar), shapes.options.inset))
    rays = points.shape[1]
    both = np.concatenate([points, flat_points], axis=1).reshape(-1, points.shape[2])
    directions = np.concatenate([normals, flat_normals], axis=1).reshape(-1, points.shape[2])
    free = np.asarray(loads.free.any(axis=0))
    owner = np.repeat(np.arange(len(pairs)), 2 * rays)
    system = ContactSystem.build(pairs[owner], both, directions, free, loads.about, loads.length)
    wrenches = moved_wrenches(problem, surface)[:, free].reshape(len(loads.gravity), -1) / loads.scale[:, None]
    flat = np.einsum("erd,ed->er", normals, shapes.normals) > 1.0 - 1e-9
    sloped = np.concatenate([~flat, np.zeros_like(flat)], axis=1).ravel()
    weight: Array = np.ones(len(pairs))
    used: BoolArray = parameters.curved
    for _ in range(PASSES):
        forces = each_case(system, wrenches, loads.active[:, owner], loads.free, PRICE * sloped * weight[owner])[1]
        through = np.asarray(np.bincount(owner, forces.max(axis=0) * sloped, len(pairs)), dtype=np.float64)
        most = float(through.max(initial=0.0))
        used = parameters.curved & (through > IN_USE * most)
        weight = 1.0 / (through / max(most, 1e-300) + 1e-2)
        weight /= weight.min()
    return replace(parameters, curved=used)
