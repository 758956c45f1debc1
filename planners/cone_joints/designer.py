"""From a planar assembly to a designed one: kinematic design and geometric realization, iterated (§6)."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mocca_robot.arrays import Array, BoolArray, read_only
from mocca_robot.assembly import Assembly, Lateral
from mocca_robot.contacts.contact import Contact, ContactReport
from mocca_robot.contacts.find import find_contacts, require_exact, require_sound
from mocca_robot.design import CaseResult, Design
from mocca_robot.errors import InputError
from mocca_robot.joints.build3d import joints_to_cut
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.motion.ways_out import ways_out
from mocca_robot.runtime.threads import with_one_blas_thread
from mocca_robot.statics.loads import LoadCase, load_cases, tilt_azimuths, tilted_gravity
from mocca_robot.statics.mobility import loose_with_key
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD, CASE_HELD, CASE_SOLVED, MARGIN_SOLVED, VIOLATED
from planners.cone_joints.building import build
from planners.cone_joints.descent import evaluate
from planners.cone_joints.energy import Loads
from planners.cone_joints.friction_design import counting_on_friction
from planners.cone_joints.kinematic import bound
from planners.cone_joints.outcome import Designed, NarrowPart
from planners.cone_joints.passage import Outcome, WayOpener, closed_ways
from planners.cone_joints.realization import Polished
from planners.cone_joints.search import FoundJoints, Keep, Progress, SearchState, search
from planners.cone_joints.shapes import Shapes
from planners.cone_joints.shapes2d import Shapes2D
from planners.cone_joints.shapes3d import Shapes3D
from planners.cone_joints.tight_bounds import tight_joints
from planners.cone_joints.unknowns import JointParameters, JointProblem


def design(
    assembly: Assembly,
    options: JointOptions | None = None,
    *,
    insertion: Mapping[str, Array] | None = None,
    contacts: ContactReport | None = None,
    progress: Progress | None = None,
    resume: SearchState | None = None,
    keep: Keep | None = None,
    near: FoundJoints | None = None,
    alone: bool = False,
) -> Designed:
    """Return cone joints under which `assembly` meets its goals, or the evidence that it cannot.

    Ctrl-C during the search for joints ends it with the nearest ones so far, and `interrupted` set.

    Args:
        assembly: planar contacts, parts in assembly order.
        options: bounds on joints; default `JointOptions()`.
        insertion: insertion directions d_j by part name; by default the designer chooses.
        contacts: from `find_contacts`, when already at hand.
        progress: called now and then.
        resume: where an interrupted design of the same assembly with the same options stood.
        near: joints of a similar design over the same contacts (`Designed.searched`), to start from.
        alone: whether nothing but `near` is tried.
        keep: shown every state that `resume` can take; `planners.cone_joints.checkpoint` puts them into a file.

    Raises InputError when parts overlap, float free, or none is fixed.
    """
    options = options or JointOptions()
    if np.isinf(options.tilt_margin_rad):
        raise InputError(
            "tilt_margin_rad is infinite: call planners.design_as_asked, which looks for the largest margin."
        )

    def once(with_options: JointOptions) -> Designed:
        # What was kept belongs to the first coefficient of friction that is tried.
        first = with_options is options
        return _designed(
            assembly,
            with_options,
            insertion=insertion,
            contacts=contacts,
            progress=progress,
            resume=resume if first else None,
            keep=keep if first else None,
            near=near,
            alone=alone,
        )

    return once(options) if options.friction == 0.0 else counting_on_friction(once, options)


@with_one_blas_thread
def _designed(
    assembly: Assembly,
    options: JointOptions,
    *,
    insertion: Mapping[str, Array] | None,
    contacts: ContactReport | None,
    progress: Progress | None,
    resume: SearchState | None,
    keep: Keep | None,
    near: FoundJoints | None,
    alone: bool,
) -> Designed:
    """Return the same by one search, which may count on `options.counted_friction`."""
    started = time.perf_counter()
    report = contacts or find_contacts(assembly)
    require_sound(assembly, report)
    require_exact(assembly, report)
    found = joint_contacts(assembly, report)
    if not found:
        raise InputError(f"'{assembly.name}' has no part that moves and touches another; there is nothing to design.")
    chosen = {name: np.asarray(way) / np.linalg.norm(way) for name, way in (insertion or {}).items()}
    graph = PartsGraph.of(assembly, found, chosen)
    required = load_cases(graph)
    given = np.array([graph.placed(p).chosen is not None for p in range(len(assembly.parts))])
    axis = start_axes(graph)
    margins = margin_cases(assembly, required, options.tilt_margin_rad)
    loads = Loads.of(graph, (*required, *margins))
    shapes = joint_shapes(graph, options, axis)
    # In 3D a way out is a sweep-confirmed find among parts further away: joints are made for it, it stays.
    turning = ~given & (assembly.dimension == 2 and assembly.alpha_rad is not None)
    pairs = np.array([c.parts for c in found])
    problem = JointProblem(
        shapes=shapes, loads=loads, required=len(required), pairs=pairs, alpha_rad=assembly.alpha_rad, turning=turning
    )
    start = _planar_start(shapes, axis)
    before = evaluate(problem, start)
    narrow = _narrow_parts(graph, axis)

    impossible = None
    unsearched = Polished(start, before.infeasibility, 0.0, 0)
    outcome: Outcome | None = None
    kinematic = realization = 0.0
    if before.infeasibility.max(initial=0.0) > CASE_SOLVED and not narrow:
        # A state to go on from exists only where the bound proved nothing.
        proof = None
        if resume is None:
            proof = bound(graph, shapes.can_curve, options, loads, len(required))
        impossible = None if proof is None else (required[proof.case].name, proof)
        kinematic = time.perf_counter() - started
        if impossible is None:
            searched = search(problem, start, progress, resume=resume, keep=keep, near=near, alone=alone)
            opener = WayOpener(
                graph=graph,
                problem=problem,
                start=start,
                reshaped=lambda axis: joint_shapes(graph, options, axis),
                progress=progress,
            )
            outcome = opener.open(Outcome.of(assembly, problem, given, searched))
            shapes = outcome.problem.shapes
        realization = time.perf_counter() - started - kinematic
    polished = unsearched if outcome is None else outcome.searched.polished
    result = build(assembly, problem, start, given) if outcome is None else outcome.built
    held = bool(polished.infeasibility[: len(required)].max(initial=0.0) <= CASE_HELD)
    held = held and loose_with_key(PartsGraph.of(result.assembly)) is None
    open_ways = not (closed_ways(result) if outcome is None else outcome.closed)
    seconds = {"kinematic": kinematic, "realization": realization, "total": time.perf_counter() - started}
    notes = _notes(graph, shapes, report)
    finished = Design(
        source=assembly,
        assembly=result.assembly,
        joints=result.joints,
        insertion=result.insertion,
        load_cases=tuple(
            CaseResult(case.name, float(b), float(a))
            for case, b, a in zip(required, before.infeasibility, polished.infeasibility)
        ),
        seconds=seconds,
        notes=notes,
    )
    return Designed(
        design=finished,
        achieved=held and not narrow and open_ways and polished.violation <= VIOLATED,
        impossible=impossible,
        narrow=narrow,
        margin_rad=options.tilt_margin_rad if polished.infeasibility.max(initial=0.0) <= MARGIN_SOLVED else 0.0,
        evaluations=polished.evaluations,
        interrupted=None if outcome is None else outcome.searched.interrupted,
        searched=None if outcome is None else outcome.searched,
        cases=required,
        tight=() if outcome is None else tight_joints(outcome.problem, polished.parameters),
    )


def joint_contacts(assembly: Assembly, report: ContactReport) -> tuple[Contact, ...]:
    """Return the contacts that joints may replace: between two fixed parts nothing is carried or inserted."""
    return tuple(c for c in report.contacts if not assembly.fixed[list(c.parts)].all())


def joint_shapes(graph: PartsGraph, options: JointOptions, axis: Array) -> Shapes:
    """Return the parametrised joints over all contacts, for parts that leave along `axis` (N, d)."""
    if graph.assembly.dimension == 2:
        return Shapes2D.of(graph.assembly, graph.contacts, options)
    shapes = Shapes3D.of(graph.assembly, graph.contacts, options, axis)
    _require_cells(shapes)
    cut = joints_to_cut(graph.assembly, graph.joints)
    return shapes if cut.all() else replace(shapes, can_curve=read_only(shapes.can_curve & cut, np.bool_))


def _require_cells(shapes: Shapes3D) -> None:
    """Raise InputError when not even the largest contact has cells that the tool can cut."""
    options, radius = shapes.options, shapes.options.min_radius
    if "heights" not in options.kinds or options.control_heights == JointOptions().control_heights:
        return
    widest = float(shapes.lengths[shapes.can_curve].max(initial=0.0))
    if widest < 2.0 * radius * (options.control_heights + 1):
        cell = widest / (options.control_heights + 1)
        raise InputError(
            f"joints.control_heights is {options.control_heights}, which leaves cells of {cell * 1e3:.3g} mm on the "
            f"largest contact; a tool of joints.min_radius {radius * 1e3:.3g} mm cuts {2e3 * radius:.3g} mm or more. "
            "Lower either, or leave 'heights' out of joints.kinds."
        )


def contacts_left_planar(assembly: Assembly, report: ContactReport) -> tuple[str, ...]:
    """Return what is known before any search: the contacts into which no joint can be cut, each with its reason."""
    if assembly.dimension == 2:
        return ()
    return _left_planar(PartsGraph.of(assembly, joint_contacts(assembly, report)))


def _left_planar(graph: PartsGraph) -> tuple[str, ...]:
    if graph.assembly.dimension == 2:
        return ()
    return tuple(
        f"The contact between {_between(graph.assembly, contact)} stays planar: with it, and its other contacts, one "
        "of the two would not close."
        for contact, cut in zip(graph.contacts, joints_to_cut(graph.assembly, graph.joints))
        if not cut
    )


def margin_cases(assembly: Assembly, required: Sequence[LoadCase], tilt_rad: float) -> tuple[LoadCase, ...]:
    """Return every required gravity case again with the ground tilted a little further, towards each side.

    A design on the very edge of equilibrium would fall in physics and on the table. Interlocking has no margin.
    """
    if tilt_rad <= 0.0:
        return ()
    cases = []
    lateral = any(isinstance(g, Lateral) for g in assembly.goals)
    for case in required:
        if case.gravity is None or (lateral and case.name == "gravity"):
            continue
        for azimuth in tilt_azimuths(assembly.dimension, 4):
            gravity = tilted_gravity(case.gravity, tilt_rad, float(azimuth))
            name = f"{case.name}+{np.rad2deg(azimuth):.0f}"
            cases.append(LoadCase(name, gravity, case.present, case.held, case.applied))
    return tuple(cases)


def start_axes(graph: PartsGraph) -> Array:
    """Return (N, d) the direction in which each part leaves: the chosen one, or a free one with room for joints."""
    up = np.zeros(graph.assembly.dimension)
    up[-1] = 1.0
    axis = np.tile(up, (len(graph.assembly.parts), 1))
    # Sweeps are only needed where nobody has chosen a direction.
    given = all(graph.placed(p).chosen is not None for p in graph.free)
    free = {} if given else ways_out(graph, room_rad=float(np.deg2rad(5.0)))
    for part, motion in graph.motions():
        axis[part] = free.get(part, motion.axis)
    for part in graph.there:
        chosen = graph.placed(part).chosen
        if chosen is not None:
            axis[part] = -chosen
    return axis


def _planar_start(shapes: Shapes, axis: Array) -> JointParameters:
    count = len(shapes.contacts)
    lean = np.zeros((len(shapes.pair_normal), shapes.n_lean))
    return JointParameters(np.tile(shapes.rest, (count, 1)), lean, axis, np.zeros(count, dtype=np.bool_))


def _narrow_parts(graph: PartsGraph, axis: Array) -> tuple[NarrowPart, ...]:
    """Return parts whose planar contacts leave less than α, about the chosen direction where there is one."""
    assembly = graph.assembly
    if assembly.alpha_rad is None:
        return ()
    narrow = []
    for p, motion in graph.motions():
        room = motion.alpha_rad if graph.placed(p).chosen is None else motion.room(axis[p])
        if room < assembly.alpha_rad - ANGLE_ROUNDING_RAD:
            blockers = tuple(assembly.parts[b].name for b in motion.blockers)
            narrow.append(NarrowPart(assembly.parts[p].name, room, assembly.alpha_rad, blockers))
    return tuple(narrow)


def _notes(graph: PartsGraph, shapes: Shapes, report: ContactReport) -> tuple[str, ...]:
    assembly = graph.assembly
    notes = list(_left_planar(graph))
    kept: BoolArray = ~shapes.can_curve
    if assembly.dimension == 3:
        kept &= joints_to_cut(assembly, graph.joints)
    for e in np.flatnonzero(kept):
        names = _between(assembly, shapes.contacts[e])
        notes.append(f"The contact between {names} stays planar: too small, or across its pair's direction.")
    for miss in report.near_misses:
        notes.append(f"'{miss.parts[0]}' and '{miss.parts[1]}' nearly touch: {miss.gap_m * 1e3:.3g} mm apart.")
    return tuple(notes)


def _between(assembly: Assembly, contact: Contact) -> str:
    return " and ".join(f"'{assembly.parts[p].name}'" for p in contact.parts)
