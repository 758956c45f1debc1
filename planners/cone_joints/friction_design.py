"""A design that counts on friction, judged by the friction that comes about and not by the friction that could.

The search asks whether some forces within reduced friction cones hold every load, which is necessary and not enough
(`mocca_robot.statics.coulomb`). What stands only clamped is therefore designed again with half of the coefficient, a
few times, and in the end without any.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from mocca_robot.contacts.friction import sprung, tangential_ratio
from mocca_robot.design import CountedFriction
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import load_cases
from planners.cone_joints.outcome import Designed

TRIES = 3
"""Coefficients that are counted on before none is, each half of the one before."""


def counting_on_friction(design_with: Callable[[JointOptions], Designed], options: JointOptions) -> Designed:
    """Return the first design that `design_with` makes and whose friction comes about, or the one without friction.

    `options.friction` is above zero. A design stands when every required case does with that coefficient and with the
    reduced one. What is proven impossible with friction, or was interrupted, is returned as it is.
    """
    counted = options
    for _ in range(TRIES):
        found = design_with(counted)
        use = CountedFriction(float(options.friction), counted.counted_friction, tangential_ratio(options.friction))
        kept = replace(found, design=replace(found.design, friction=use))
        # A proof or a narrow part holds with less friction, too; a search that missed may find another way with it.
        settled = found.impossible is not None or bool(found.narrow) or found.interrupted is not None
        if settled or (found.achieved and stands_with(kept, use)):
            return kept
        counted = replace(counted, friction_safety=2.0 * counted.friction_safety)
    found = design_with(replace(options, friction=0.0))
    note = (
        f"joints.friction is {options.friction:g}, but this design counts on none: with less than that, down to "
        f"{use.counted:.2g}, no design was found that meets every goal and stands with forces that come about."
    )
    return replace(found, design=replace(found.design, notes=(*found.design.notes, note)))


def stands_with(found: Designed, use: CountedFriction) -> bool:
    """Return whether friction that comes about holds every required case of the built parts, full and reduced."""
    ways = {i.part: i.direction for i in found.design.insertion}
    graph = PartsGraph.of(found.design.assembly, insertion=ways)
    cases = load_cases(graph)
    frictions = [sprung(mu, use.tangential_ratio) for mu in (use.counted, use.coefficient)]
    return all(solve_case(graph, case, mu).result.stands for mu in frictions for case in cases)
