"""`mocca-robot compare`: flat, single-direction and cone joints side by side, in statics and in MuJoCo."""

from __future__ import annotations

import argparse
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console

if TYPE_CHECKING:
    from mocca_robot.assembly import Assembly
    from mocca_robot.design import Insertion
    from mocca_robot.joints.joint import Joint
    from mocca_robot.report.comparison import Variant

COMPARISON = "planners.comparison"
"""The module whose `joineries(assembly, options, contacts=, progress=)` returns the variants, cone joints last."""


class Joinery(Protocol):
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
    text = "the same parts with flat, single-direction and cone joints, side by side, in statics and MuJoCo"
    parser: argparse.ArgumentParser = commands.add_parser("compare", help=text, description=text)
    arguments.add_input(parser)
    arguments.add_output(parser)
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 when the cone joints hold what is asked, 1 otherwise; the other variants are there to fail."""
    from mocca_robot.cli import evidence, stages
    from mocca_robot.report.comparison import write_comparison

    console = Console(args.json)
    with console.stage("read"):
        config = arguments.load(args)
    folder = arguments.output_folder(args, config.assembly.name)
    contacts = stages.read_contacts(config.assembly, console)
    with console.stage("design") as show:
        joineries = import_module(COMPARISON).joineries
        found = joineries(config.assembly, config.joints, contacts=contacts, progress=lambda what, _: show(what))
    variants = []
    for joinery in found:
        with console.stage(joinery.name):
            variants.append(judged(joinery))
    with console.stage("report"):
        path = write_comparison(folder / "comparison.html", config.assembly.name, variants)
    for variant in variants:
        console.say(words(variant))
    findings = evidence.statics_findings(variants[-1].assembly, variants[-1].verification)
    for finding in findings:
        console.say(f"✗ {variants[-1].name}: {finding.text}")
    console.say(console.times())
    console.say(str(path))
    document = {
        "name": config.assembly.name,
        "variants": [_data(v) for v in variants],
        "findings": evidence.findings_data(findings),
        "files": {"comparison": str(path)},
    }
    return console.finish(1 if findings else 0, document)


def judged(joinery: Joinery) -> Variant:
    """Return a variant with every verdict: statics, insertion, deadlock, tilt, and MuJoCo's on the finished state."""
    import numpy as np

    from mocca_robot.loads import tilt_azimuths
    from mocca_robot.mobility import mobility
    from mocca_robot.report.comparison import Variant
    from mocca_robot.verify import critical_tilt, verify
    from sim.contact_model import contact_model
    from sim.stability import Verdict, free_scene, stability
    from sim.tilt import physical_tilt, tilt_scene

    assembly = joinery.assembly
    verification = verify(assembly, directions={i.part: i.direction for i in joinery.insertion})
    contacts = verification.contacts
    azimuths = tilt_azimuths(assembly.dimension, 8)
    tilts = [critical_tilt(assembly, contacts, float(a)) for a in azimuths]
    weakest = int(np.argmin(tilts))
    model = contact_model(assembly, contacts)
    physics = stability(free_scene(assembly, model))
    tilt = physical_tilt(tilt_scene(assembly, model), contacts, float(azimuths[weakest]))
    return Variant(
        joinery.name,
        assembly,
        verification,
        joinery.joints,
        joinery.insertion,
        None if physics.verdict is Verdict.FAILED else physics.stands,
        tilts[weakest],
        tilt.critical_rad,
        mobility(assembly, contacts).locked,
        joinery.remarks,
    )


def words(variant: Variant) -> str:
    """Return a variant's verdicts in one line."""
    from mocca_robot.cli.evidence import degrees

    physics = {None: "no verdict", True: "stands", False: "falls"}[variant.physics_stands]
    insertions = variant.verification.insertions
    free = sum(i.assemblable for i in insertions)
    tilt = "" if variant.tilt_rad is None else f"; falls at a tilt of {degrees(variant.tilt_rad)}"
    measured = "" if variant.physics_tilt_rad is None else f" (MuJoCo {degrees(variant.physics_tilt_rad)})"
    deadlock = "; deadlocked: nothing can move" if variant.deadlocked else ""
    return (
        f"{variant.name}: statics {'stands' if variant.verification.stands else 'falls'}, MuJoCo {physics}{tilt}"
        f"{measured}; {free} of {len(insertions)} parts go in as asked{deadlock}"
    )


def _data(variant: Variant) -> dict[str, Any]:
    import numpy as np

    from mocca_robot.cli import evidence

    return {
        "name": variant.name,
        "cases": evidence.cases_data(variant.verification.cases),
        "insertions": evidence.insertions_data(variant.verification.insertions),
        "physics_stands": variant.physics_stands,
        "tilt_deg": None if variant.tilt_rad is None else float(np.rad2deg(variant.tilt_rad)),
        "physics_tilt_deg": None if variant.physics_tilt_rad is None else float(np.rad2deg(variant.physics_tilt_rad)),
        "deadlocked": variant.deadlocked,
        "remarks": list(variant.remarks),
    }
