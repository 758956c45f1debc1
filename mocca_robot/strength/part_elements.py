"""One part under its worst load cases, by finite elements: meshed, loaded, solved, and compared with its strength."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Mesh, Polygon
from mocca_robot.runtime.threads import with_one_blas_thread
from mocca_robot.strength.assess import ElementsSaid, PartTask
from mocca_robot.strength.cases import PartLoads
from mocca_robot.strength.elements import Elements, meshed
from mocca_robot.strength.mesh2d import NotMeshed
from mocca_robot.strength.options import StrengthOptions
from mocca_robot.strength.settings import TINY
from mocca_robot.strength.uses import Use, shares, worst_of

DEFAULT_SHARE = StrengthOptions.elements
"""Elements get smaller together with what is asked beside it."""
SOLIDS = 1.6
"""Elements of solids are so many times as large: a solid has many more of them."""
THROUGH = 0.6
"""Largest element over the mean thickness of a part: quadratic ones bend well with two across."""
PATCH = 1.0 / 40.0
"""Loads at one place are spread over so much of the part's size: nothing real acts at a point."""
UNBALANCED = 0.02
"""Share of the loads that meshing may leave unbalanced; more, and the part's loads do not fit its mesh."""
SHADES = 1500
"""Places with a share for pictures, at most."""


@with_one_blas_thread
def solve_part(task: PartTask) -> ElementsSaid:
    """Return the worst uses of a part's strength in its load cases, or why the elements say nothing about it."""
    part = task.assembly.parts[0]
    try:
        points, cells = meshed(part.shape, element_size(part.shape, task.element_size))
    except NotMeshed as error:
        return ElementsSaid(why=str(error))
    thick = part.shape.thickness if isinstance(part.shape, Polygon) else 1.0
    material = task.made.material
    elements = Elements(points, cells, material.stiffness, material.poisson, thick)
    uses: list[Use] = []
    most = np.zeros(len(points))
    for loads in task.loads:
        load, left = elements.balanced(nodal_forces(elements, part.density, loads))
        if left > UNBALANCED:
            return ElementsSaid(why=f"its mesh leaves {left:.0%} of the load '{loads.case}' unbalanced")
        stress = elements.stress(elements.solve(load))
        if not np.isfinite(stress).all():
            return ElementsSaid(why=f"its equations have no solution under '{loads.case}'")
        used, limits = shares(task.made, stress)
        most = np.maximum(most, used.max(axis=1))
        uses += _uses(points, used, limits, loads.case)
    return ElementsSaid(uses=worst_of(uses), shade=_shade(points, most))


def _uses(points: Array, used: Array, limits: Array, case: str) -> list[Use]:
    found = []
    for column, kind in enumerate(("tension", "compression", "shear")):
        worst = int(used[:, column].argmax())
        share, limit = float(used[worst, column]), float(limits[worst, column])
        use = Use(
            kind=kind, share=share, stress=share * limit, strength=limit, place=points[worst], case=case,
            method="elements",
        )  # fmt: skip
        found.append(use)
    return found


def element_size(shape: Polygon | Mesh, share: float) -> float:
    """Return the largest edge of an element in metres: `share` of the size, and not much more than it is thick."""
    size = float(np.linalg.norm(np.ptp(shape.bounds, axis=0)))
    if isinstance(shape, Polygon):
        rim = sum(float(np.linalg.norm(np.roll(r, -1, axis=0) - r, axis=1).sum()) for r in shape.rings)
        thick = 2.0 * shape.area_moments[0] / rim
    else:
        a, b, c = (shape.vertices[shape.faces[:, k]] for k in range(3))
        thick = 4.0 * shape.volume_moments[0] / float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    largest = min(share * size, THROUGH * thick * share / DEFAULT_SHARE)
    return largest if isinstance(shape, Polygon) else SOLIDS * largest


def nodal_forces(elements: Elements, density: float, loads: PartLoads) -> Array:
    """Return (N,) nodal forces of weight, contact forces and user loads."""
    out = elements.body(density * loads.gravity)
    if len(loads.points):
        out = out + elements.pressed(loads.points, loads.forces, loads.normals, loads.areas)
    reach = PATCH * float(np.linalg.norm(np.ptp(elements.points, axis=0)))
    for point, force in zip(*loads.further):
        out = out + _spread(elements, point, force, reach)
    return out


def _spread(elements: Elements, point: Array, force: Array, reach: float) -> Array:
    """Return (N,) nodal forces of a force that acts about a place, as a bell of radius `reach` metres."""
    distance2 = ((elements.places - point) ** 2).sum(axis=1)
    bell = np.exp(-0.5 * (distance2 - distance2.min()) / reach**2)
    d = elements.dimension
    along = elements.mass @ (bell * (elements.axes == 0))
    return np.asarray(elements.mass @ (bell * force[elements.axes]) / max(float(along[::d].sum()), TINY))


def _shade(points: Array, most: Array) -> Array:
    """Return (n, d + 1) places with the share used there, thinned out."""
    step = max(1, len(points) // SHADES)
    order = np.argsort(most, kind="stable")[::-1][: len(points)]
    kept = np.sort(np.unique(np.concatenate([order[:20], np.arange(0, len(points), step)])))
    return np.column_stack([points[kept], most[kept]])
