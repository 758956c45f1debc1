"""A plan for the whole build: for every part pick, transit, insertion along its cone's axis, release and retreat.

Grasps and arm branches are tried until one works from tray to seat; a part that cannot be placed comes back with the
reasons of all attempts.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from mocca_robot.assembly import Array, Assembly
from mocca_robot.contacts import find_contacts
from mocca_robot.design import Design, Insertion
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import StoredDesign
from mocca_robot.loads import LoadCase, state_cases
from mocca_robot.ur.plan import Grasp, Move, MoveKind, Plan, Step, Waypoint
from mocca_robot.ur.pose import three, transform
from mocca_robot.verify import insertion_rim, solve_case, sweep_blockers
from planners.arm_poses import branches, nearest_turn, trace
from planners.cell import RobotCell
from planners.grasp import GraspPose, find_grasps, summary
from planners.scene import Scene, straight
from planners.site import Site, site
from planners.trajectory import joint_motion, line, line_motion, reversed_motion
from planners.transit import connect
from planners.tray import Tray, tray_layout

INSERT_M = 0.015
"""The compliant part of the way in; before it the arm is guarded, and any contact stops it."""
STANDOFFS_M = (0.045, 0.07, 0.1, 0.14, 0.2)
"""How far from its place a part may begin its straight way in: the first that is clear of everything."""
RETREATS_M = (0.08, 0.06, 0.04, 0.1, 0.14)
PICK_M = 0.008
"""The last part of the way to a part in the tray."""
LIFTS_M = (0.06, 0.1, 0.04)
SQUEEZE_M = 0.002
"""Fingers are sent this much closer than the part is wide."""
FORCE_N = 20.0
FRACTIONS = (1.0, 0.75, 0.5, 0.25)
"""Shares of the cone's half-angle that are tried as tolerance."""
ATTEMPTS = 80
"""Per part: grasps times branches that the arm can reach and that fit between the neighbours."""
TRANSIT_FAILURES = 8


@dataclass(frozen=True)
class PartReport:
    """How planning one part went.

    Attributes:
        placed: whether a way was found.
        seconds: wall time.
        attempts: grasps times arm branches tried.
        reasons: why attempts failed, with their counts.
        grasp_width_m: of the grasp used.
        cone_rad, usable_rad: the part's cone, and how far from its axis the arm could insert instead: its tolerance.
    """

    part: str
    placed: bool
    seconds: float
    attempts: int
    reasons: str
    grasp_width_m: float = 0.0
    cone_rad: float = 0.0
    usable_rad: float = 0.0


@dataclass(frozen=True)
class Fall:
    """A state that falls when the gripper lets go: after `part` was placed, `moving` move."""

    part: str
    moving: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class BuildPlan:
    """A plan, or why there is none.

    Attributes:
        plan: None when a state falls or a part cannot be placed.
        reports: one per part that was planned; the last one tells what failed.
        falls: states that fall without declared supports.
        out_of_reach: parts that no grasp brings to their place with any arm branch, whatever stands around.
        site, tray: where everything stands.
    """

    plan: Plan | None
    reports: tuple[PartReport, ...]
    falls: tuple[Fall, ...]
    out_of_reach: tuple[str, ...]
    site: Site
    tray: Tray


def falls(assembly: Assembly, friction: float = 0.0, supports: Collection[str] = ()) -> tuple[Fall, ...]:
    """Return the states of the sequence that do not stand once the part is released; `supports` name parts that
    something holds from the moment they are placed.
    """
    contacts = find_contacts(assembly).contacts
    held_always = np.array([p.fixed or p.name in supports for p in assembly.parts])
    found = []
    for case, part in zip(state_cases(assembly), [p for p in assembly.parts if not p.fixed], strict=True):
        held = case.held | held_always
        if not (case.present & ~held).any():
            continue
        verdict = solve_case(assembly, contacts, LoadCase(case.name, case.gravity, case.present, held), friction)
        if not verdict.result.stands:
            found.append(Fall(part.name, verdict.moving))
    return tuple(found)


def build_plan(
    design: Design | StoredDesign,
    cell: RobotCell,
    design_sha256: str,
    *,
    friction: float = 0.0,
    supports: Sequence[str] = (),
    seed: int = 0,
    design_path: str | None = None,
) -> BuildPlan:
    """Return a plan that builds `design` in `cell`, with what was found for every part.

    `supports` are parts that stand by other means once placed; InputError for names that are no parts, and when the
    tray is too small.
    """
    for name in supports:
        design.assembly.index(name)
    where = site(design.assembly, cell)
    tray = tray_layout(where, cell)
    fallen = falls(design.assembly, friction, supports)
    unreachable = out_of_reach(where, cell)
    if fallen or unreachable:
        return BuildPlan(None, (), fallen, unreachable, where, tray)
    bench = _Bench(cell, where, tray, Scene(cell, where), np.random.default_rng(seed))
    insertions = {i.part: i for i in design.insertion}
    steps: list[Step] = []
    reports: list[PartReport] = []
    at = np.array(cell.home)
    for body in where.bodies:
        bench.scene.place(body.name, straight(tray.offsets.get(body.name, np.zeros(3))))
    for index, part in enumerate(where.assembly.parts):
        if part.fixed:
            continue
        started = time.perf_counter()
        found = _placed(bench, index, insertions.get(part.name), at)
        report = found.report(part.name, time.perf_counter() - started)
        reports.append(report)
        if found.step is None:
            return BuildPlan(None, tuple(reports), (), (), where, tray)
        steps.append(found.step)
        at = np.array(found.step.moves[-1].path[-1].q)
        bench.scene.place(part.name, np.eye(4))
    if not steps:
        raise InputError(f"'{design.assembly.name}' has no free parts: there is nothing to build.")
    steps[-1] = _homeward(bench, steps[-1])
    plan = Plan(
        design_sha256,
        cell.model.name,
        cell.gripper.name,
        cell.execution,
        tuple(steps),
        design=design_path,
        supports=tuple(supports),
    )
    return BuildPlan(plan, tuple(reports), (), (), where, tray)


def out_of_reach(where: Site, cell: RobotCell) -> tuple[str, ...]:
    """Return the parts that no grasp brings to their place with any branch of the arm, even in an empty cell."""
    back = np.linalg.inv(transform(cell.gripper.tcp_offset))
    names = []
    for index, body in enumerate(where.bodies):
        if body.fixed:
            continue
        grasps = find_grasps(where, index, cell).grasps
        if grasps and not any(branches(cell.model, g.tcp @ back) for g in grasps):
            names.append(body.name)
    return tuple(names)


@dataclass
class _Bench:
    cell: RobotCell
    site: Site
    tray: Tray
    scene: Scene
    rng: np.random.Generator

    def free(self, q: Array, opening_m: float, grip: Array | None = None) -> str:
        """Return '' or what is wrong with a configuration."""
        if (np.abs(q) > np.asarray(self.cell.model.joint_limit_rad)).any():
            return "a joint at its limit"
        tcp = self.cell.model.tcp_matrix(q, self.cell.gripper.tcp_offset)[:3, 3]
        low, high = self.cell.workspace_m
        if (tcp < low).any() or (tcp > high).any():
            return "outside the workspace box"
        return self.scene.hit(q, opening_m, grip)


@dataclass
class _Attempt:
    step: Step | None = None
    attempts: int = 0
    reasons: dict[str, int] = field(default_factory=dict)
    width_m: float = 0.0
    cone_rad: float = 0.0
    usable_rad: float = 0.0
    transit_failures: int = 0

    def failed(self, reason: str) -> None:
        self.reasons[reason] = self.reasons.get(reason, 0) + 1

    def report(self, part: str, seconds: float) -> PartReport:
        return PartReport(
            part,
            self.step is not None,
            seconds,
            self.attempts,
            summary(self.reasons),
            self.width_m,
            self.cone_rad,
            self.usable_rad,
        )


def _placed(bench: _Bench, index: int, insertion: Insertion | None, at: Array) -> _Attempt:
    """Try grasps, branches and stand-offs for one part, best first, until a whole way is found."""
    out = _Attempt()
    name = bench.site.assembly.parts[index].name
    if insertion is None:
        out.failed("the design has no insertion direction for it")
        return out
    search = find_grasps(bench.site, index, bench.cell, rng=bench.rng)
    out.reasons.update({f"no grasp: {r}": n for r, n in search.rejected.items()})
    if not search.grasps:
        return out
    back = np.linalg.inv(transform(bench.cell.gripper.tcp_offset))
    direction = bench.site.turn @ insertion.direction
    out.cone_rad = max(0.0, insertion.alpha_rad)
    for grasp in search.grasps:
        seat = grasp.tcp @ back
        options = [nearest_turn(bench.cell.model, q, at) for q in branches(bench.cell.model, seat)]
        if not options:
            out.failed("seat: out of the arm's reach")
        for q in sorted(options, key=lambda o: float(np.abs(o - at).max())):
            if out.attempts >= ATTEMPTS or out.transit_failures >= TRANSIT_FAILURES:
                return out
            ways = _ways(bench, name, grasp, seat, q, direction, at, out)
            if ways is None:
                continue
            out.width_m = grasp.width_m
            out.step = _step(bench, index, insertion, direction, grasp, ways, out)
            if out.step is not None:
                return out
    return out


@dataclass(frozen=True, eq=False)
class _Ways:
    """The corners of a step: joint-space transits and the flange poses and joints between which lines run."""

    to_tray: list[Array]
    pick: Array
    q_above: Array
    q_pick: Array
    lift: Array
    to_seat: list[Array]
    seat: Array
    q_seat: Array
    standoff_m: float
    retreat: Array


def _ways(
    bench: _Bench, name: str, grasp: GraspPose, seat: Array, q_seat: Array, direction: Array, at: Array, out: _Attempt
) -> _Ways | None:
    opened = grasp.width_m + bench.cell.gripper.opening_m
    closed = grasp.width_m
    model, scene = bench.cell.model, bench.scene
    grip = np.asarray(np.linalg.inv(seat), dtype=np.float64)
    tool = seat[:3, 2]

    scene.place(name, np.eye(4))
    scene.roles(grasped=name)
    for opening in (opened, closed):
        reason = bench.free(q_seat, opening)
        if reason:
            out.failed(f"seat: {reason}")
            scene.place(name, straight(bench.tray.offsets[name]))
            return None
    retreat = next((r for r in RETREATS_M if not _blocked(bench, seat, -r * tool, q_seat, opened)), None)
    scene.place(name, straight(bench.tray.offsets[name]))
    out.attempts += 1
    if retreat is None:
        out.failed(f"retreat: {_blocked(bench, seat, -RETREATS_M[2] * tool, q_seat, opened) or 'blocked'}")
        return None

    scene.roles(carried=name)
    standoff, reason = None, ""
    for distance in STANDOFFS_M:
        flanges = line(seat, -distance * direction, 30)
        joints, reason = trace(model, flanges, q_seat)
        reason = reason or bench.free(joints[-1], closed, grip)
        if not reason:
            scene.roles(absent=(name,))
            reason = next((r for q in joints if (r := bench.free(q, closed))), "")
            scene.roles(carried=name)
        if not reason:
            standoff = distance
            break
    if standoff is None:
        out.failed(f"insertion: {reason}")
        return None
    q_before = joints[-1]

    shift = bench.tray.offsets[name]
    pick = straight(shift) @ seat
    for q_pick in sorted(
        (nearest_turn(model, q, q_before) for q in branches(model, pick)),
        key=lambda o: float(np.abs(o - q_before).max()),
    ):
        found = _from_tray(bench, name, grasp, pick, q_pick, q_before, at, out)
        if found is not None:
            q_above, lift, to_tray, to_seat = found
            return _Ways(to_tray, pick, q_above, q_pick, lift, to_seat, seat, q_seat, standoff, -retreat * tool)
    return None


def _from_tray(
    bench: _Bench, name: str, grasp: GraspPose, pick: Array, q_pick: Array, q_before: Array, at: Array, out: _Attempt
) -> tuple[Array, Array, list[Array], list[Array]] | None:
    """Return the joints above the part, the lift, and the transits to the tray and on to the seat."""
    opened = grasp.width_m + bench.cell.gripper.opening_m
    closed = grasp.width_m
    scene, model = bench.scene, bench.cell.model
    grip: Array = np.linalg.inv(pick) @ straight(bench.tray.offsets[name])
    scene.place(name, straight(bench.tray.offsets[name]))
    scene.roles(grasped=name)
    reason = bench.free(q_pick, opened) or _blocked(bench, pick, -0.07 * pick[:3, 2], q_pick, opened)
    if reason:
        out.failed(f"pick: {reason}")
        return None
    joints, _ = trace(model, line(pick, -0.07 * pick[:3, 2], 24), q_pick)
    q_above = joints[-1]
    scene.roles(carried=name)
    lift = None
    for height in LIFTS_M:
        reason = _blocked(bench, pick, np.array([0.0, 0.0, height]), q_pick, closed, grip)
        if not reason:
            lift = np.array([0.0, 0.0, height])
            break
    if lift is None:
        out.failed(f"lift: {reason}")
        return None
    q_lifted = trace(model, line(pick, lift, 24), q_pick)[0][-1]
    limit = np.asarray(model.joint_limit_rad)
    to_seat = connect(q_lifted, q_before, lambda q: not bench.free(q, closed, grip), limit, bench.rng)
    scene.place(name, straight(bench.tray.offsets[name]))
    if to_seat is None:
        out.failed("transit to the structure: no way found")
        out.transit_failures += 1
        return None
    scene.roles()
    to_tray = connect(at, q_above, lambda q: not bench.free(q, opened), limit, bench.rng)
    if to_tray is None:
        reason = bench.free(at, opened)
        out.failed(f"transit to the tray: {reason or 'no way found'}")
        out.transit_failures += 1
        return None
    return q_above, lift, to_tray, to_seat


def _blocked(
    bench: _Bench, start: Array, travel: Array, q_start: Array, opening_m: float, grip: Array | None = None
) -> str:
    """Return '' or why the tool cannot go straight from flange pose `start` by `travel`."""
    joints, reason = trace(bench.cell.model, line(start, travel, 24), q_start)
    if reason:
        return reason
    return next((r for q in joints if (r := bench.free(q, opening_m, grip))), "")


def _step(
    bench: _Bench,
    index: int,
    insertion: Insertion,
    direction: Array,
    grasp: GraspPose,
    ways: _Ways,
    out: _Attempt,
) -> Step | None:
    """Return the timed step through the corners of `ways`."""
    cell = bench.cell
    limits = cell.limits
    part = bench.site.bodies[index]
    opened = grasp.width_m + cell.gripper.opening_m
    closed = max(cell.gripper.stroke_m[0], grasp.width_m - SQUEEZE_M)
    slow, gentle = limits.approach_speed_m_s, limits.transfer_acceleration_m_s2
    tool = ways.pick[:3, 2]

    def moved(start: Array, travel: Array, q: Array, speed: float, acceleration: float) -> tuple[Waypoint, ...]:
        path, reason = line_motion(cell, start, travel, q, speed, acceleration)
        if reason:
            out.failed(f"timing: {reason}")
        return path

    above = straight(-0.07 * tool) @ ways.pick
    near = straight(-PICK_M * tool) @ ways.pick
    approach = moved(above, (0.07 - PICK_M) * tool, ways.q_above, slow, gentle)
    pick = approach and moved(near, PICK_M * tool, _end(approach), slow, gentle)
    lift = pick and moved(ways.pick, ways.lift, _end(pick), slow, gentle)
    to_seat = lift and joint_motion(cell, [_end(lift), *ways.to_seat[1:]])
    before = straight(-ways.standoff_m * direction) @ ways.seat
    entry = straight(-INSERT_M * direction) @ ways.seat
    inward = to_seat and moved(before, (ways.standoff_m - INSERT_M) * direction, _end(to_seat), slow, gentle)
    insert = inward and moved(
        entry, INSERT_M * direction, _end(inward), limits.insert_speed_m_s, limits.insert_acceleration_m_s2
    )
    retreat = insert and moved(ways.seat, ways.retreat, _end(insert), slow, gentle)
    if not retreat:
        return None
    q_seat = _end(insert)
    out.usable_rad, alternatives = _tolerance(bench, index, direction, out.cone_rad, ways.seat, q_seat, grasp)
    rest = Waypoint(0.0, insert[-1].q, insert[-1].tcp)
    force = min(FORCE_N, limits.abort_force_n)
    fast = limits.transfer_speed_m_s
    moves: tuple[Move, ...] = (
        Move(MoveKind.TRANSIT, joint_motion(cell, ways.to_tray), fast, force, opened),
        Move(MoveKind.APPROACH, approach, slow, force, opened),
        Move(MoveKind.PICK, pick, slow, force, closed),
        Move(MoveKind.LIFT, lift, slow, force, closed),
        Move(MoveKind.TRANSIT, to_seat, fast, force, closed),
        Move(MoveKind.APPROACH, inward, slow, force, closed),
        Move(MoveKind.INSERT, insert, limits.insert_speed_m_s, force, closed, alternatives),
        Move(MoveKind.RELEASE, (rest,), slow, force, opened),
        Move(MoveKind.RETREAT, retreat, slow, force, opened),
    )
    moves = tuple(m for m in moves if len(m.path) > 1 or m.kind is MoveKind.RELEASE)
    cog = (np.linalg.inv(ways.seat) @ np.append(part.centroid, 1.0))[:3]
    held = Grasp(
        grasp.width_m,
        part.mass_kg,
        three(cog),
        cell.gripper.force_n,
        {"cone_usable_deg": float(np.rad2deg(out.usable_rad)), "tray_offset_m": bench.tray.offsets[part.name].tolist()},
    )
    return Step(part.name, held, moves, three(direction), out.cone_rad)


def _end(path: Sequence[Waypoint]) -> Array:
    return np.array(path[-1].q)


def _tolerance(
    bench: _Bench, index: int, direction: Array, cone_rad: float, seat: Array, q_seat: Array, grasp: GraspPose
) -> tuple[float, tuple[tuple[Waypoint, ...], ...]]:
    """Return how far from the cone's axis the arm could insert on every side, and paths at half of that."""
    name = bench.site.assembly.parts[index].name
    bench.scene.roles(absent=(name,))
    for fraction in FRACTIONS:
        if all(p for p in _rim_paths(bench, index, direction, fraction * cone_rad, seat, q_seat, grasp)):
            usable = fraction * cone_rad
            paths = list(_rim_paths(bench, index, direction, 0.5 * usable, seat, q_seat, grasp))
            return usable, tuple(p for p in paths if p)
    return 0.0, ()


def _rim_paths(
    bench: _Bench, index: int, direction: Array, angle_rad: float, seat: Array, q_seat: Array, grasp: GraspPose
) -> Iterator[tuple[Waypoint, ...]]:
    """Yield the way in along each direction of the cone's rim: empty where it is blocked."""
    cell, turn = bench.cell, bench.site.turn
    limits = cell.limits
    if angle_rad <= 0.0:
        return
    for way in insertion_rim(-direction @ turn, angle_rad, 4)[1:]:
        if sweep_blockers(bench.site.assembly, index, way[None]):
            yield ()
            continue
        path, reason = line_motion(
            cell, seat, INSERT_M * (turn @ way), q_seat, limits.insert_speed_m_s, limits.insert_acceleration_m_s2
        )
        blocked = reason or next((r for w in path if (r := bench.free(np.array(w.q), grasp.width_m))), "")
        yield () if blocked else reversed_motion(path)


def _homeward(bench: _Bench, step: Step) -> Step:
    """Return the last step with the way home, if there is one."""
    scene = bench.scene
    scene.roles()
    at = _end(step.moves[-1].path)
    opening = step.moves[-1].gripper_m
    limit = np.asarray(bench.cell.model.joint_limit_rad)
    way = connect(at, np.array(bench.cell.home), lambda q: not bench.free(q, opening), limit, bench.rng)
    if way is None:
        return step
    limits = bench.cell.limits
    move = Move(
        MoveKind.TRANSIT,
        joint_motion(bench.cell, way),
        limits.transfer_speed_m_s,
        min(FORCE_N, limits.abort_force_n),
        opening,
    )
    return Step(step.part, step.grasp, (*step.moves, move), step.direction, step.alpha_rad)
