"""`mocca-robot compare`: flat, single-direction and cone joints side by side, or cone joints that count on friction."""

from __future__ import annotations

import argparse
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import positive_if
from mocca_robot.tolerances import ANGLE_ROUNDING_RAD

if TYPE_CHECKING:
    from mocca_robot.arrays import BoolArray
    from mocca_robot.assembly import Assembly
    from mocca_robot.design import Insertion
    from mocca_robot.joints.joint import Joint
    from mocca_robot.motion.parts_graph import PartsGraph
    from mocca_robot.report.comparison import Variant
    from mocca_robot.statics.cases import CaseVerdict
    from mocca_robot.verdicts.verification import Verification

COMPARISON = "planners.baselines.comparison"
"""The module whose `joineries(assembly, options, contacts=, progress=)` returns the variants.

Its `CONE_JOINTS` is the name of the designed one.
"""


MOST_FRICTION = 10.0
"""As of `joints.friction`."""


class JoinedParts(Protocol):
    """One way to join the same parts, before anybody has judged it: what `joineries` returns several of."""

    @property
    def name(self) -> str:
        """Return 'planar', 'single direction', 'cone joints', …"""

    @property
    def assembly(self) -> Assembly:
        """Return the built geometry."""

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Return one joint per contact of the input."""

    @property
    def insertion(self) -> tuple[Insertion, ...]:
        """Return the way in of every free part."""

    @property
    def friction(self) -> float:
        """Return the Coulomb coefficient to judge it with."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Return what a reader should know."""


def add(commands: Any) -> None:
    """Add the command."""
    text = (
        "compare the same parts with flat, single-direction and cone joints, or with cone joints that count on "
        "different friction, side by side, in statics and physics"
    )
    parser: argparse.ArgumentParser = commands.add_parser("compare", help=text, description=text)
    arguments.add_input(parser)
    arguments.add_output(parser)
    arguments.add_json(parser)
    parser.add_argument(
        "--friction", type=float, nargs="+", metavar="MU",
        help="compare cone joints that count on these Coulomb coefficients instead, such as 0 0.2 0.4",
    )  # fmt: skip
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 when the cone joints hold what is asked, 1 otherwise; the other variants are there to fail.

    With `--friction` all of them have to hold.
    """
    from mocca_robot.cli import reasons, stages
    from mocca_robot.contacts.friction import sprung, tangential_ratio
    from mocca_robot.report.comparison import write_comparison

    console = Console(args.json)
    config = arguments.read(args, console)
    ratio = tangential_ratio(config.friction)
    frictions = [sprung(mu, ratio) for mu in _frictions(args.friction)]
    folder = arguments.prepare_output(args, config.assembly.name)
    contacts = stages.read_contacts(config.assembly, console)
    with console.stage("design") as show:
        comparison = import_module(COMPARISON)
        asked = {"contacts": contacts, "progress": lambda what, _: show(what)}
        if frictions:
            found = comparison.designs_with_friction(config.assembly, frictions, config.joints, **asked)
        else:
            found = comparison.joineries(config.assembly, config.joints, **asked)
    variants = []
    for joinery in found:
        with console.stage(joinery.name):
            variants.append(judged(joinery))
    with console.stage("report"):
        path = write_comparison(folder / "comparison.html", config.assembly.name, variants)
    for variant in variants:
        console.say(words(variant))
    findings = []
    for variant in variants:
        if frictions or variant.name == comparison.CONE_JOINTS:
            theirs = reasons.statics_findings(variant.assembly, variant.verification)
            for finding in theirs:
                console.say(f"✗ {variant.name}: {finding.text}")
            findings += theirs
    console.say(console.times())
    console.say(str(path))
    document = {
        "name": config.assembly.name,
        "variants": [_data(v) for v in variants],
        "findings": reasons.findings_data(findings),
        "files": {"comparison": str(path)},
    }
    return console.finish(positive_if(not findings), document)


def _frictions(given: list[float] | None) -> list[float]:
    """Return the coefficients to design with. Raises InputError for what is no coefficient, or is there twice."""
    from mocca_robot.errors import InputError

    for friction in given or ():
        if not 0.0 <= friction <= MOST_FRICTION:
            raise InputError(f"--friction {friction:g}: give numbers from 0 to {MOST_FRICTION:g}, such as 0 0.2 0.4.")
    if given and len(set(given)) < len(given):
        raise InputError(f"--friction names {max(given, key=given.count):g} twice; keep one.")
    return given or []


def judged(joinery: JoinedParts) -> Variant:
    """Return a variant with every verdict: statics, insertion, deadlock, tilt, and physics' on the finished state.

    Where a key is asked for, somebody holds it in physics too, and statics is asked about that state as well; such a
    structure gets no tilt.
    """
    from dataclasses import replace

    import numpy as np

    from mocca_robot.assembly import Interlocking
    from mocca_robot.motion.insertion import insertion_verdicts
    from mocca_robot.report.comparison import Variant
    from mocca_robot.statics.mobility import leaving_parts
    from mocca_robot.verdicts.verification import verify

    assembly, friction = joinery.assembly, joinery.friction
    directions = {i.part: i.direction for i in joinery.insertion}
    verification = verify(assembly, friction=friction, directions=directions)
    graph = verification.graph
    held = np.array(assembly.fixed)
    for goal in assembly.goals:
        if isinstance(goal, Interlocking):
            held[assembly.index(goal.key)] = True
    keyed = bool((held & ~assembly.fixed).any())
    if keyed:
        verification = replace(verification, cases=(*verification.cases, _key_held(graph, held, friction)))
    tilt, physical = (None, None) if keyed else _weakest_tilt(graph, friction)
    straight = insertion_verdicts(replace(graph, assembly=replace(assembly, alpha_rad=None)))
    leaving = leaving_parts(graph)
    return Variant(
        name=joinery.name,
        assembly=assembly,
        verification=verification,
        joints=joinery.joints,
        insertion=joinery.insertion,
        friction=friction,
        physics_stands=_physics_stands(graph, held, friction),
        tilt_rad=tilt,
        physics_tilt_rad=physical,
        goes_in=all(i.alpha_rad > -ANGLE_ROUNDING_RAD and not i.collides for i in straight),
        deadlocked=not leaving,
        remarks=(*joinery.remarks, *_deadlock_remarks(verification, leaving)),
    )


def _physics_stands(graph: PartsGraph, held: BoolArray, friction: float) -> bool | None:
    """Return the verdict of MuJoCo, with friction of the friction engine, on the finished state; None for none."""
    from mocca_robot.statics.loads import LoadCase
    from mocca_robot.verdicts.physics import Verdict
    from sim.coulomb.judge import rubbing, standing
    from sim.coulomb.settle import SettlingOutcome
    from sim.shapes.contact_model import contact_model
    from sim.stability import free_scene, stability

    if friction > 0.0:
        found = standing(rubbing(graph, friction), LoadCase("gravity", graph.assembly.gravity, graph.present, held))
        return None if found.settled.outcome is SettlingOutcome.UNDECIDED else found.stands
    physics = stability(free_scene(graph.assembly, contact_model(graph.assembly, graph.contacts), held=held))
    return None if physics.verdict is Verdict.FAILED else physics.stands


def _key_held(graph: PartsGraph, held: BoolArray, friction: float) -> CaseVerdict:
    from mocca_robot.statics.cases import solve_case
    from mocca_robot.statics.loads import LoadCase

    return solve_case(graph, LoadCase("gravity_key_held", graph.assembly.gravity, graph.present, held), friction)


def _weakest_tilt(graph: PartsGraph, friction: float) -> tuple[float, float]:
    """Return the smallest critical tilt over azimuths by statics, and that of physics towards the same azimuth."""
    import numpy as np

    from mocca_robot.statics.cases import critical_tilts
    from mocca_robot.statics.loads import tilt_azimuths
    from sim.coulomb.judge import rubbing
    from sim.coulomb.tilting import tilt_bracket
    from sim.shapes.contact_model import contact_model
    from sim.tilt import physical_tilt, tilt_scene

    azimuths = tilt_azimuths(graph.assembly.dimension, 8)
    tilts = critical_tilts(graph, azimuths, friction)
    weakest = int(np.argmin(tilts))
    if friction > 0.0:
        found = tilt_bracket(rubbing(graph, friction), float(azimuths[weakest]), tilts[weakest])
        return tilts[weakest], found.critical_rad
    scene = tilt_scene(graph.assembly, contact_model(graph.assembly, graph.contacts))
    return tilts[weakest], physical_tilt(scene, graph, float(azimuths[weakest])).critical_rad


def _deadlock_remarks(verification: Verification, leaving: tuple[str, ...]) -> tuple[str, ...]:
    from mocca_robot.statics.mobility import mobility

    if leaving:
        return ()
    moving = mobility(verification.graph).moving
    stuck = [i for i in verification.insertions if i.alpha_rad < -ANGLE_ROUNDING_RAD]
    remarks = ["Deadlocked: no part can leave while the others stay."]
    if moving:
        remarks.append(f"Only together can they move: {', '.join(moving[:6])}{' …' if len(moving) > 6 else ''}.")
    if stuck:
        worst = [f"'{i.part}' (by {', '.join(i.blockers)})" for i in stuck[:4]]
        remarks.append(
            f"Nor can they be put together in sequence: blocked from every direction are {'; '.join(worst)}."
        )
    return tuple(remarks)


def words(variant: Variant) -> str:
    """Return a variant's verdicts in one line."""
    from mocca_robot.cli.reasons import degrees

    physics = {None: "no verdict", True: "stands", False: "falls"}[variant.physics_stands]
    insertions = variant.verification.insertions
    free = sum(i.assemblable for i in insertions)
    one_way = " (each along one direction)" if variant.goes_in and free < len(insertions) else ""
    tilt = "" if variant.tilt_rad is None else f"; stands up to a tilt of {degrees(variant.tilt_rad)}"
    engine = "friction engine" if variant.friction else "MuJoCo"
    measured = "" if variant.physics_tilt_rad is None else f" ({engine} {degrees(variant.physics_tilt_rad)})"
    deadlock = "; deadlocked: no part can leave" if variant.deadlocked else ""
    curved = sum(not j.is_planar for j in variant.joints)
    joints = f"{curved} curved joints, {heights_m(variant) * 1e3:.0f} mm high in all; "
    return (
        f"{variant.name}: {joints if curved else ''}statics {_by_statics(variant)}, {engine} {physics}{tilt}"
        f"{measured}; {free} of {len(insertions)} parts go in as asked{one_way}{deadlock}"
    )


def heights_m(variant: Variant) -> float:
    """Return the heights of all curved joints, added up, metres."""
    from mocca_robot.report.joints_section import height_of

    return sum(height_of(j) for j in variant.joints if not j.is_planar)


def _by_statics(variant: Variant) -> str:
    cases = [c for c in variant.verification.cases if not c.result.stands]
    if not cases:
        return "stands"
    return "stands only clamped" if all(c.only_clamped for c in cases) else "falls"


def _data(variant: Variant) -> dict[str, Any]:
    import numpy as np

    from mocca_robot.cli import reasons

    return {
        "name": variant.name,
        "friction": variant.friction,
        "curved_joints": sum(not j.is_planar for j in variant.joints),
        "heights_mm": heights_m(variant) * 1e3,
        "verdict": _by_statics(variant),
        "cases": reasons.cases_data(variant.verification.cases),
        "insertions": reasons.insertions_data(variant.verification.insertions),
        "physics_stands": variant.physics_stands,
        "tilt_deg": None if variant.tilt_rad is None else float(np.rad2deg(variant.tilt_rad)),
        "physics_tilt_deg": None if variant.physics_tilt_rad is None else float(np.rad2deg(variant.physics_tilt_rad)),
        "goes_in": variant.goes_in,
        "deadlocked": variant.deadlocked,
        "remarks": list(variant.remarks),
    }
