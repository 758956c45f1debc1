"""Every part's way past all that is placed before it: bumps that close one are lowered, dented or turned round.

Descent keeps a cone open among a part's own contacts. A bump of an earlier part may still stand in that cone further
out, or a part grown by a bump of its own may no longer pass. The height of such a bump is limited, to half or to
nothing on the side that it grows to, and joints are searched again within the new limits. With no bump on the later
side of any contact the parts are nowhere larger than in the input, so that a way that was free there stays free.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array, BoolArray, read_only
from mocca_robot.assembly import Assembly
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.motion.ways_out import first_free, insertion_rim, roomiest, spread_directions, sweep_blockers
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD, CASE_SOLVED, VIOLATED
from planners.cone_joints.building import Built, build
from planners.cone_joints.search import MANY_JOINTS, FoundJoints, Progress, search
from planners.cone_joints.shapes import Shapes
from planners.cone_joints.unknowns import JointParameters, JointProblem

SHARES = (0.5, 0.0)
"""Shares of a bump's height that are tried: lower, then only into the other part."""
FEW_ON_RIM = 3
"""Ways on the rim of a solid's cone that are swept where joints are many; a verdict sweeps eight."""
RINGS = 4
"""Cones inside that of α along which a way is swept in 2D: what stands between its middle and its rim counts."""
LOOKED_AT = {2: 72, 3: 200}
"""Directions among which another way is looked for, by dimension."""

ROUNDS = 8
"""Times that bumps are limited and joints searched again, about the same ways."""
WAYS = 3
"""Sets of ways that are tried, the first of which is the one that the search chose by itself."""


@dataclass(frozen=True, eq=False)
class ClosedWay:
    """A part that its own contacts let in, but others do not.

    Attributes:
        part: index.
        way_out: (d,) the way that was wanted.
        blockers: indices of the earlier parts that are hit.
    """

    part: int
    way_out: Array
    blockers: tuple[int, ...]


def closed_ways(built: Built) -> tuple[ClosedWay, ...]:
    """Return the parts that cannot go in within α although the contacts with their neighbours leave the cone."""
    alpha = built.assembly.alpha_rad
    if alpha is None:
        return ()
    graph = PartsGraph.joined(built.assembly, built.joints)
    few = len(built.joints) > MANY_JOINTS
    closed = []
    for insertion in built.insertion:
        part, way = built.assembly.index(insertion.part), -insertion.direction
        if graph.motion(part).room(way) < alpha - ANGLE_ROUNDING_RAD:
            continue
        blockers = sweep_blockers(built.assembly, part, _swept(way, alpha, few))
        if blockers:
            closed.append(ClosedWay(part, way, blockers))
    return tuple(closed)


def _swept(way_out: Array, alpha_rad: float, few: bool = False) -> Array:
    """Return ways (m, d) in the cone of α that stand for all of it; few of them where sweeps are many and dear."""
    if len(way_out) == 3:
        return insertion_rim(way_out, alpha_rad, FEW_ON_RIM if few else 8)
    return np.concatenate([insertion_rim(way_out, alpha_rad * k / RINGS) for k in range(1, RINGS + 1)])


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcome:
    """Where a search ended, built.

    Attributes:
        problem: with the families and limits of the joints that were found.
        given: (N,) parts that keep their way out.
        searched: what the search found.
        built: the parts.
        closed: the ways that these parts close.
    """

    problem: JointProblem
    given: BoolArray
    searched: FoundJoints
    built: Built
    closed: tuple[ClosedWay, ...]

    @classmethod
    def of(cls, assembly: Assembly, problem: JointProblem, given: BoolArray, searched: FoundJoints) -> Outcome:
        """Return it with the parts of `assembly` built, and their ways checked where the loads are held."""
        problem = replace(problem, shapes=searched.shapes)
        built = build(assembly, problem, searched.polished.parameters, given)
        polished = searched.polished
        held = polished.infeasibility[: problem.required].max(initial=0.0) <= CASE_SOLVED
        closed = closed_ways(built) if held and polished.violation <= VIOLATED else ()
        return cls(problem=problem, given=given, searched=searched, built=built, closed=closed)

    @property
    def solved(self) -> bool:
        """Return whether the joints hold what they have to, within their bounds."""
        polished = self.searched.polished
        held = polished.infeasibility[: self.problem.required].max(initial=0.0) <= CASE_SOLVED
        return bool(held and polished.violation <= VIOLATED)


@dataclass(frozen=True, eq=False, kw_only=True)
class Passage:
    """What joints are asked to leave open.

    Attributes:
        assembly: the input.
        limits: (E, 2) lowest and highest bump of each joint, m.
        ways: the way out (d,) that a part keeps, by index.
    """

    assembly: Assembly
    limits: Array
    ways: dict[int, Array]

    @classmethod
    def open(cls, assembly: Assembly, joints: int) -> Passage:
        """Return the passage that asks for nothing."""
        return cls(assembly=assembly, limits=read_only(np.tile([-np.inf, np.inf], (joints, 1))), ways={})

    def narrowed(self, outcome: Outcome) -> Passage | None:
        """Return the passage with those bumps limited that close ways; None when no limit on bumps opens them."""
        parameters = outcome.searched.polished.parameters
        limits, ways = np.array(self.limits), dict(self.ways)
        for shut in outcome.closed:
            way = ways.get(shut.part, self._free_in_input(shut, parameters))
            ways[shut.part] = way
            for side, e, height in self._opening(outcome.problem, parameters, outcome.built, shut.part, way):
                limits[e, side] = height
        if (limits == self.limits).all() and len(ways) == len(self.ways):
            return None
        return Passage(assembly=self.assembly, limits=read_only(limits), ways=ways)

    def _free_in_input(self, shut: ClosedWay, parameters: JointParameters) -> Array:
        """Return the way out to keep: the wanted one, or the designed one if only that is free among flat contacts."""
        designed = parameters.axis[shut.part]
        way = first_free(self.assembly, shut.part, [shut.way_out, designed])
        return designed if way is None else way

    def _opening(
        self, problem: JointProblem, parameters: JointParameters, built: Built, part: int, way_out: Array
    ) -> Iterator[tuple[int, int, float]]:
        """Yield (side, joint, height) limits that open a way, as few and as high as trial finds."""
        rays = _swept(way_out, self.assembly.alpha_rad or 0.0)
        for blocker in sweep_blockers(built.assembly, part, rays):
            suspects = list(self._suspects(problem, parameters, part, blocker))
            near = [e for e, c in enumerate(problem.shapes.contacts) if {part, blocker} & set(c.parts)]

            def free(tried: dict[int, Joint], near: list[int] = near, blocker: int = blocker) -> bool:
                joints = [tried.get(e, built.joints[e]) for e in near]
                return blocker not in sweep_blockers(build_parts(self.assembly, joints), part, rays)

            lowered = [(s, e, share) for share in SHARES for s, e in suspects]
            one = next((x for x in lowered if free({x[1]: _cut_down(problem, parameters, *x)})), None)
            for s, e, share in [(s, e, 0.0) for s, e in suspects] if one is None else [one]:
                yield s, e, share * _height(problem, parameters, s, e)

    def _suspects(
        self, problem: JointProblem, parameters: JointParameters, part: int, blocker: int
    ) -> Iterator[tuple[int, int]]:
        """Yield (side, joint) of the bumps by which `blocker` or `part` is larger than in the input."""
        for e, (i, j) in enumerate(problem.pairs):
            if not parameters.curved[e]:
                continue
            grown = (i in (part, blocker) and j >= part, j == part)
            for side, grows in ((1, grown[0]), (0, grown[1])):
                if grows and _height(problem, parameters, side, e) != 0.0:
                    yield side, e


def _height(problem: JointProblem, parameters: JointParameters, side: int, joint: int) -> float:
    """Return the height (m) of a joint's highest bump into its later part (side 1), or the depth of its deepest into
    the earlier one (side 0), 0 when there is none.
    """
    heights = parameters.shape[joint, list(problem.shapes.heights)] * problem.shapes.lengths[joint]
    return float(max(heights.max(), 0.0) if side else min(heights.min(), 0.0))


def _cut_down(problem: JointProblem, parameters: JointParameters, side: int, joint: int, share: float) -> Joint:
    """Return a joint with its bump on one side cut down to a share of its height."""
    shape, columns = parameters.shape[joint].copy(), list(problem.shapes.heights)
    limit = share * _height(problem, parameters, side, joint) / problem.shapes.lengths[joint]
    shape[columns] = np.minimum(shape[columns], limit) if side else np.maximum(shape[columns], limit)
    if not shape[columns].any():
        return planar(problem.shapes.contacts[joint])
    return problem.shapes.joint(joint, shape, problem.shapes.directions(parameters.lean)[joint])


@dataclass(frozen=True, eq=False, kw_only=True)
class WayOpener:
    """Searches joints again until every part can go in.

    Attributes:
        graph: flat contacts of the input.
        problem, start: of the search that came first.
        reshaped: joints made for parts that leave along axes (N, d).
        progress: told of every step.
    """

    graph: PartsGraph
    problem: JointProblem
    start: JointParameters
    reshaped: Callable[[Array], Shapes]
    progress: Progress | None = None

    def open(self, first: Outcome) -> Outcome:
        """Return joints that hold like those of `first` and let every part in, or `first` where none were found.

        About the ways that are wanted, bumps that close them are limited. Where joints within the limits no longer
        hold, the parts go another way that is free among flat contacts. Ways that somebody has chosen stay.
        """
        passage = Passage.open(self.graph.assembly, len(self.problem.pairs))
        tried = {c.part: [c.way_out] for c in first.closed}
        outcome = first
        for _ in range(WAYS):
            outcome = self._limit(outcome, passage, tried)
            if not outcome.closed and outcome.solved:
                return outcome
            free = ((p, self._other_way(p, t)) for p, t in tried.items() if self.graph.placed(p).chosen is None)
            ways = {p: way for p, way in free if way is not None}
            if not ways or outcome.searched.interrupted is not None or len(self.problem.pairs) > MANY_JOINTS:
                break
            for p, way in ways.items():
                tried[p].append(way)
            passage = Passage(assembly=self.graph.assembly, limits=passage.limits, ways=ways)
            outcome = self._search(passage, None)
            if not outcome.closed and outcome.solved:
                return outcome
        interrupted = outcome.searched.interrupted
        return replace(first, searched=replace(first.searched, interrupted=interrupted or first.searched.interrupted))

    def _limit(self, outcome: Outcome, passage: Passage, tried: dict[int, list[Array]]) -> Outcome:
        """Return where limiting bumps about the ways of `passage` ends; `tried` learns of parts that were shut out."""
        for _ in range(ROUNDS):
            if not outcome.closed or outcome.searched.interrupted is not None:
                break
            for shut in outcome.closed:
                tried.setdefault(shut.part, [shut.way_out])
            narrower = passage.narrowed(outcome)
            if narrower is None:
                break
            passage = narrower
            outcome = self._search(passage, outcome.searched)
        return outcome

    def _search(self, passage: Passage, near: FoundJoints | None) -> Outcome:
        axis, turning = self.start.axis.copy(), self.problem.turning.copy()
        for part, way in passage.ways.items():
            axis[part], turning[part] = way, False
        base = self.problem.shapes if near is not None else self.reshaped(axis)
        problem = replace(self.problem, shapes=base.within(passage.limits), turning=turning)
        if near is not None:
            near = _moved_within(near, passage)
        names = ", ".join(self.graph.assembly.parts[p].name for p in sorted(passage.ways))

        def tell(what: str, worst: float) -> None:
            if self.progress is not None:
                self.progress(f"a way in for {names}: {what}", worst)

        found = search(problem, replace(self.start, axis=axis), tell, near=near)
        given = np.isin(np.arange(len(axis)), list(passage.ways)) | self._given
        return Outcome.of(self.graph.assembly, problem, given, found)

    @property
    def _given(self) -> BoolArray:
        return np.array([self.graph.placed(p).chosen is not None for p in range(len(self.graph.assembly.parts))])

    def _other_way(self, part: int, tried: list[Array]) -> Array | None:
        """Return a way out (d,) of a part among flat contacts that is free and as far as can be from those `tried`."""
        assembly = self.graph.assembly
        alpha = assembly.alpha_rad or 0.0
        spread = spread_directions(assembly.dimension, LOOKED_AT[assembly.dimension])
        ways = roomiest(spread, self.graph.motion(part), alpha)
        nearest = (ways @ np.array(tried).T).max(axis=1)
        order = np.argsort(nearest, kind="stable")
        return first_free(assembly, part, ways[order[nearest[order] < np.cos(2.0 * alpha)]])


def _moved_within(found: FoundJoints, passage: Passage) -> FoundJoints:
    """Return joints cut down to the limits of a passage, with parts on its ways."""
    parameters, shapes = found.polished.parameters, found.shapes.within(passage.limits)
    low, top = shapes.bounds()
    columns = list(shapes.heights)
    shape, axis = parameters.shape.copy(), parameters.axis.copy()
    shape[:, columns] = np.clip(shape[:, columns], low[:, columns], top[:, columns])
    for part, way in passage.ways.items():
        axis[part] = way
    moved = JointParameters(shape, parameters.lean, axis, parameters.curved)
    return replace(found, shapes=shapes, polished=replace(found.polished, parameters=moved))
