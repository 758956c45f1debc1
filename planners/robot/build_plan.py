"""A plan for the whole build: for every part pick, transit, insertion along its cone's axis, release and retreat.

First the structure's side: where it stands, and for every part a way into its place between what stands already. Then
the tray, every part turned so that the tool can take it as it is needed in its place. Then whole steps. A part that
cannot be placed comes back with the reasons of all attempts, and the others are planned as if it had been placed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from mocca_robot.arrays import Array, BoolArray
from mocca_robot.design import Design, Insertion
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import StoredDesign
from mocca_robot.plan.plan import Plan, Step
from planners.robot.bench import Bench
from planners.robot.build_result import BuildPlan, PartReport
from planners.robot.cell import RobotCell
from planners.robot.effort import strain
from planners.robot.falling_states import falls
from planners.robot.grasp import GraspSearch, find_grasps
from planners.robot.grasp_pose import GraspPose, count, summary
from planners.robot.obstacles import require_room
from planners.robot.pick import Pick, picks, reachable, tool_down
from planners.robot.scene import CellScene
from planners.robot.seat import Seat, seats
from planners.robot.site import Site, site
from planners.robot.standing_place import carried_over, standings
from planners.robot.timed_step import end, homeward, timed_step
from planners.robot.transit import way
from planners.robot.tray import tray_layout, with_layout

ATTEMPTS = 60
"""Per part: grasps times branches that the arm can reach and that fit between the neighbours."""
TRANSIT_FAILURES = 6
PLACES = 3
"""Standing places that are looked at in full when some part finds no way into its place."""

STRAINED = 8
"""So many ways that flip the elbow or turn a joint very far are found before the least strained of them is taken."""

_Ways = tuple[list[Array], list[Array]]
_Strained = tuple[tuple[int, float], int, Seat, Pick, _Ways]
Progress = Callable[[str], None]


def build_plan(
    design: Design | StoredDesign,
    cell: RobotCell,
    design_sha256: str,
    *,
    friction: float = 0.0,
    supports: Sequence[str] = (),
    cradles: Sequence[str] = (),
    seed: int = 0,
    partial: bool = False,
    design_path: str | None = None,
    progress: Progress = lambda text: None,
) -> BuildPlan:
    """Return a plan that builds `design` in `cell`, with what was found for every part.

    `supports` are parts that stand by other means once placed, `cradles` those that a cradle holds at their place,
    besides those that the cell declares; InputError for names that are no parts, and when the tray is too small. When
    a part cannot be placed there is no plan, or, with `partial`, one that ends before it. `progress` is told what is
    being done.
    """
    names = [p.name for p in design.assembly.parts if not p.fixed]
    if not names:
        raise InputError(f"'{design.assembly.name}' has no free parts: there is nothing to build.")
    cradles = _declared(cell.cradles, cradles, names)
    supports = _declared(cell.supports, [*supports, *cradles], names)
    for name in supports:
        design.assembly.index(name)
    where = site(design.assembly, cell)
    fallen = falls(design.assembly, friction, supports)
    if fallen:
        return BuildPlan(plan=None, reports=(), falls=fallen, cell=cell, site=where, tray=tray_layout(where, cell))
    insertions = {i.part: i for i in design.insertion}
    search = _Search(insertions=insertions, seed=seed)
    bench, turns = _structure_side(where, cell, search, progress)
    tray = tray_layout(bench.site, cell, turns)
    cell = with_layout(bench.cell, bench.site, tray)
    bench.cell = cell
    require_room(cell.obstacles, bench.site.bodies, tray.motions)
    bench.clear(tray)
    steps = _steps(bench, search, progress)
    reports = tuple(search.reports[n] for n in names)
    if len(steps) < len(names):
        before = names[: _first_missing(reports)] if partial else []
        steps = [s for s in steps if s.part in before]
        if not steps:
            return BuildPlan(plan=None, reports=reports, falls=(), cell=cell, site=bench.site, tray=tray)
    for name in names[len(steps) :]:
        bench.scene.place(name, bench.waiting(name))
    steps[-1] = homeward(bench, steps[-1], seed)
    plan = Plan(
        design_sha256=design_sha256,
        robot=cell.model.name,
        gripper=cell.gripper.name,
        cell=cell.execution,
        steps=tuple(steps),
        design=design_path,
        supports=supports,
        cradles=cradles,
    )
    return BuildPlan(plan=plan, reports=reports, falls=(), cell=cell, site=bench.site, tray=tray)


def _declared(by_cell: tuple[str, ...], besides: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys([*(names if by_cell == ("all",) else by_cell), *besides]))


def _first_missing(reports: Sequence[PartReport]) -> int:
    return next((k for k, r in enumerate(reports) if not r.placed), len(reports))


@dataclass(kw_only=True)
class _Search:
    """What is known so far, by part name."""

    insertions: dict[str, Insertion]
    seed: int
    found: dict[str, GraspSearch] = field(default_factory=dict)
    grasps: dict[str, list[GraspPose]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    reports: dict[str, PartReport] = field(default_factory=dict)

    def add_seconds(self, part: str, since: float) -> None:
        self.seconds[part] = self.seconds.get(part, 0.0) + time.perf_counter() - since


def _structure_side(
    where: Site, cell: RobotCell, search: _Search, progress: Progress
) -> tuple[Bench, dict[str, Array]]:
    """Return the bench with the structure in the place where most parts find a way in, and how each part that does
    should lie in the tray.
    """
    for index, body in enumerate(where.bodies):
        if body.fixed:
            continue
        started = time.perf_counter()
        rng = np.random.default_rng([search.seed, index])
        search.found[body.name] = find_grasps(where, index, cell, rng=rng)
        search.add_seconds(body.name, started)
        progress(f"grasps of {body.name}")
    order = [b.name for b in where.bodies if not b.fixed]
    ranked = standings(where, cell, [search.found[n].grasps for n in order])
    best: tuple[int, Bench, dict[str, Array], dict[str, list[GraspPose]]] | None = None
    for standing in ranked[:PLACES]:
        grasps = {n: carried_over(search.found[n].grasps, where, standing.site) for n in order}
        bench = Bench(standing.cell, standing.site, CellScene(standing.cell, standing.site))
        bench.clear(None)
        turns = {}
        for body in standing.site.bodies:
            if body.fixed:
                continue
            started = time.perf_counter()
            seat = _first_seat(bench, search, body.name, grasps[body.name])
            if seat is not None:
                turns[body.name] = tool_down(seat) if where.assembly.dimension == 3 else np.eye(3)
            bench.scene.place(body.name, np.eye(4))
            search.add_seconds(body.name, started)
            progress(f"a way into its place for {body.name}")
        if best is None or len(turns) > best[0]:
            best = len(turns), bench, turns, grasps
        if len(turns) == len(order):
            break
    assert best is not None
    search.grasps = best[3]
    return best[1], best[2]


def _first_seat(bench: Bench, search: _Search, name: str, grasps: Sequence[GraspPose]) -> Seat | None:
    insertion = search.insertions.get(name)
    if insertion is None:
        return None
    direction = bench.site.turn @ insertion.direction
    return next(seats(bench, name, grasps, direction, np.array(bench.cell.home), {}), None)


def _steps(bench: Bench, search: _Search, progress: Progress) -> list[Step]:
    """Return the steps that were found, in order; every part is reported."""
    steps: list[Step] = []
    at = np.array(bench.cell.home)
    for index, body in enumerate(bench.site.bodies):
        if body.fixed:
            continue
        started = time.perf_counter()
        attempt = _Attempt(bench=bench, index=index, search=search, at=at)
        step = attempt.step()
        search.add_seconds(body.name, started)
        search.reports[body.name] = attempt.report(search.seconds[body.name])
        if step is not None:
            steps.append(step)
            at = end(step.moves[-1].path)
        bench.scene.place(body.name, np.eye(4))
        progress(f"{body.name} planned" if step is not None else f"{body.name} cannot be placed")
    return steps


@dataclass(kw_only=True)
class _Attempt:
    """The search for one part's step; the arm starts at `at`."""

    bench: Bench
    index: int
    search: _Search
    at: Array
    placed: bool = False
    attempts: int = 0
    transit_failures: int = 0
    width_m: float = 0.0
    usable_rad: float = 0.0
    reasons: dict[str, int] = field(default_factory=dict)

    def step(self) -> Step | None:
        """Return the first step without strain, of ways into the place, best first, each with ways to take the part; or
        the least strained of the first few.
        """
        bench, name = self.bench, self.bench.site.bodies[self.index].name
        insertion = self.search.insertions.get(name)
        if insertion is None:
            count(self.reasons, "the design has no insertion direction for it")
            return None
        for reason, times in self.search.found[name].rejected.items():
            count(self.reasons, f"no grasp: {reason}", times)
        grasps = self.search.grasps[name]
        direction = bench.site.turn @ insertion.direction
        usable = reachable(bench, name, grasps) if grasps else None
        for flipped in (False, True):
            strained: list[_Strained] = []
            step = self._unstrained(insertion, direction, flipped, usable, strained)
            for candidate in sorted(strained, key=lambda s: s[:2]):
                step = step or self._timed(insertion, direction, *candidate[2:])
            if step is not None:
                return step
        return None

    def _unstrained(
        self,
        insertion: Insertion,
        direction: Array,
        flipped: bool,
        usable: BoolArray | None,
        strained: list[_Strained],
    ) -> Step | None:
        """Return the first step without strain among seats on one side of the elbow; others go to `strained`."""
        bench, name = self.bench, self.bench.site.bodies[self.index].name
        grasps, attempts, failures = self.search.grasps[name], self.attempts, self.transit_failures
        for seat in seats(bench, name, grasps, direction, self.at, self.reasons, usable, flipped=flipped):
            self.attempts += 1
            for pick in picks(bench, name, seat, self.reasons):
                found = self._connect(name, seat, pick.q_above, pick.q_lifted, pick.flange)
                if found is not None:
                    cost = strain(bench.cell, found)
                    strained.append((cost, len(strained), seat, pick, found))
                    if cost[0] == 0 and (step := self._timed(insertion, direction, *strained.pop()[2:])):
                        return step
                if len(strained) >= STRAINED or self.transit_failures - failures >= TRANSIT_FAILURES:
                    return None
            if self.attempts - attempts >= ATTEMPTS:
                return None
        return None

    def _timed(self, insertion: Insertion, direction: Array, seat: Seat, pick: Pick, ways: _Ways) -> Step | None:
        timed = timed_step(self.bench, self.index, insertion, direction, seat, pick, *ways)
        if timed.step is None:
            count(self.reasons, f"timing: {timed.reason}")
            return None
        self.placed, self.usable_rad, self.width_m = True, timed.usable_rad, seat.grasp.width_m
        return timed.step

    def _connect(self, name: str, seat: Seat, q_above: Array, q_lifted: Array, pick: Array) -> _Ways | None:
        """Return the legs of the ways to the tray and on to the structure."""
        bench = self.bench
        limit = np.asarray(bench.cell.model.joint_limit_rad)
        opened, closed = bench.cell.gripper.opened_m(seat.grasp.width_m), seat.grasp.width_m
        waiting = bench.waiting(name)
        seed = 2 * (self.search.seed + 1000 * self.index + self.transit_failures)
        bench.scene.assign(carried=name)
        grip: Array = np.linalg.inv(pick) @ waiting
        to_seat = way(q_lifted, seat.q_before, lambda q: not bench.free(q, closed, grip), limit, seed)
        bench.scene.place(name, waiting)
        bench.scene.assign()
        if to_seat is None:
            count(self.reasons, "transit to the structure: no way found")
            self.transit_failures += 1
            return None
        to_tray = way(self.at, q_above, lambda q: not bench.free(q, opened), limit, seed + 1)
        if to_tray is None:
            count(self.reasons, f"transit to the tray: {bench.free(self.at, opened) or 'no way found'}")
            self.transit_failures += 1
            return None
        return to_tray, to_seat

    def report(self, seconds: float) -> PartReport:
        """Return how it went."""
        name = self.bench.site.bodies[self.index].name
        insertion = self.search.insertions.get(name)
        seen = [r for r in self.reasons if not r.startswith("no grasp")]
        far = not self.placed and bool(seen) and all(r == "seat: out of the arm's reach" for r in seen)
        return PartReport(
            part=name,
            placed=self.placed,
            seconds=seconds,
            attempts=self.attempts,
            reasons=summary(self.reasons),
            grasp_width_m=self.width_m,
            cone_rad=max(0.0, insertion.alpha_rad) if insertion else 0.0,
            usable_rad=self.usable_rad,
            out_of_reach=far,
        )
