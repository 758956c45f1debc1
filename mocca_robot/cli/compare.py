"""`mocca-robot compare`: flat, single-direction and cone joints side by side, in statics and in MuJoCo."""

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
    def remarks(self) -> tuple[str, ...]:
        """Return what a reader should know."""


def add(commands: Any) -> None:
    """Add the command."""
    text = "compare the same parts with flat, single-direction and cone joints, side by side, in statics and MuJoCo"
    parser: argparse.ArgumentParser = commands.add_parser("compare", help=text, description=text)
    arguments.add_input(parser)
    arguments.add_output(parser)
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 when the cone joints hold what is asked, 1 otherwise; the other variants are there to fail."""
    from mocca_robot.cli import reasons, stages
    from mocca_robot.report.comparison import write_comparison

    console = Console(args.json)
    config = arguments.read(args, console)
    folder = arguments.output_folder(args, config.assembly.name)
    contacts = stages.read_contacts(config.assembly, console)
    with console.stage("design") as show:
        comparison = import_module(COMPARISON)
        found = comparison.joineries(
            config.assembly, config.joints, contacts=contacts, progress=lambda what, _: show(what)
        )
    variants = []
    for joinery in found:
        with console.stage(joinery.name):
            variants.append(judged(joinery))
    with console.stage("report"):
        path = write_comparison(folder / "comparison.html", config.assembly.name, variants)
    for variant in variants:
        console.say(words(variant))
    designed = next(v for v in variants if v.name == comparison.CONE_JOINTS)
    findings = reasons.statics_findings(designed.assembly, designed.verification)
    for finding in findings:
        console.say(f"✗ {designed.name}: {finding.text}")
    console.say(console.times())
    console.say(str(path))
    document = {
        "name": config.assembly.name,
        "variants": [_data(v) for v in variants],
        "findings": reasons.findings_data(findings),
        "files": {"comparison": str(path)},
    }
    return console.finish(positive_if(not findings), document)


def judged(joinery: JoinedParts) -> Variant:
    """Return a variant with every verdict: statics, insertion, deadlock, tilt, and MuJoCo's on the finished state.

    Where a key is asked for, somebody holds it in physics too, and statics is asked about that state as well; such a
    structure gets no tilt.
    """
    from dataclasses import replace

    import numpy as np

    from mocca_robot.assembly import Interlocking
    from mocca_robot.motion.insertion import insertion_verdicts
    from mocca_robot.report.comparison import Variant
    from mocca_robot.statics.mobility import leaving_parts
    from mocca_robot.verdicts.physics import Verdict
    from mocca_robot.verdicts.verification import verify
    from sim.shapes.contact_model import contact_model
    from sim.stability import free_scene, stability

    assembly = joinery.assembly
    directions = {i.part: i.direction for i in joinery.insertion}
    verification = verify(assembly, directions=directions)
    graph, contacts = verification.graph, verification.contacts
    held = np.array(assembly.fixed)
    for goal in assembly.goals:
        if isinstance(goal, Interlocking):
            held[assembly.index(goal.key)] = True
    keyed = bool((held & ~assembly.fixed).any())
    if keyed:
        verification = replace(verification, cases=(*verification.cases, _key_held(graph, held)))
    physics = stability(free_scene(assembly, contact_model(assembly, contacts), held=held))
    tilt, physical = (None, None) if keyed else _weakest_tilt(graph)
    straight = insertion_verdicts(replace(graph, assembly=replace(assembly, alpha_rad=None)))
    leaving = leaving_parts(graph)
    return Variant(
        name=joinery.name,
        assembly=assembly,
        verification=verification,
        joints=joinery.joints,
        insertion=joinery.insertion,
        physics_stands=None if physics.verdict is Verdict.FAILED else physics.stands,
        tilt_rad=tilt,
        physics_tilt_rad=physical,
        goes_in=all(i.alpha_rad > -ANGLE_ROUNDING_RAD and not i.collides for i in straight),
        deadlocked=not leaving,
        remarks=(*joinery.remarks, *_deadlock_remarks(verification, leaving)),
    )


def _key_held(graph: PartsGraph, held: BoolArray) -> CaseVerdict:

    from mocca_robot.statics.cases import solve_case
    from mocca_robot.statics.loads import LoadCase

    return solve_case(graph, LoadCase("gravity_key_held", graph.assembly.gravity, graph.present, held))


def _weakest_tilt(graph: PartsGraph) -> tuple[float, float]:
    """Return the smallest critical tilt over azimuths by statics, and MuJoCo's towards the same azimuth."""
    import numpy as np

    from mocca_robot.statics.cases import critical_tilts
    from mocca_robot.statics.loads import tilt_azimuths
    from sim.shapes.contact_model import contact_model
    from sim.tilt import physical_tilt, tilt_scene

    azimuths = tilt_azimuths(graph.assembly.dimension, 8)
    tilts = critical_tilts(graph, azimuths)
    weakest = int(np.argmin(tilts))
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
    measured = "" if variant.physics_tilt_rad is None else f" (MuJoCo {degrees(variant.physics_tilt_rad)})"
    deadlock = "; deadlocked: no part can leave" if variant.deadlocked else ""
    return (
        f"{variant.name}: statics {'stands' if variant.verification.stands else 'falls'}, MuJoCo {physics}{tilt}"
        f"{measured}; {free} of {len(insertions)} parts go in as asked{one_way}{deadlock}"
    )


def _data(variant: Variant) -> dict[str, Any]:
    import numpy as np

    from mocca_robot.cli import reasons

    return {
        "name": variant.name,
        "cases": reasons.cases_data(variant.verification.cases),
        "insertions": reasons.insertions_data(variant.verification.insertions),
        "physics_stands": variant.physics_stands,
        "tilt_deg": None if variant.tilt_rad is None else float(np.rad2deg(variant.tilt_rad)),
        "physics_tilt_deg": None if variant.physics_tilt_rad is None else float(np.rad2deg(variant.physics_tilt_rad)),
        "goes_in": variant.goes_in,
        "deadlocked": variant.deadlocked,
        "remarks": list(variant.remarks),
    }
