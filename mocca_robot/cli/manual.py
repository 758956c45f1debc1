"""`mocca-robot manual`: an illustrated assembly manual, with the bill of parts."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode
from mocca_robot.cli.simulate import stored_design
from mocca_robot.errors import InputError

if TYPE_CHECKING:
    from mocca_robot.design import Insertion
    from mocca_robot.motion.parts_graph import PartsGraph

DESCRIPTION = """Writes one step per part: what stands already, the part in front of its seat, the way it goes in with
its cone, and what has to be held. The bill of parts is in the manual and in bill.csv beside it. HTML prints well; for a
.pdf you need typst: pip install mocca-robot[manual]."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "manual", help="write an illustrated assembly manual and the bill of parts", description=DESCRIPTION
    )
    arguments.add_input(parser, "DESIGN")
    parser.add_argument(
        "-o", "--output", metavar="FILE", help=".html or .pdf (default: manual.html beside the design, or in out/NAME)"
    )
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 after writing the manual and the bill."""
    from mocca_robot.cli.stages import read_contacts
    from mocca_robot.fabrication.bill import bill_csv
    from mocca_robot.files.output import prepare_file, safe_file_names, write_atomic
    from mocca_robot.motion.parts_graph import PartsGraph
    from mocca_robot.report.manual import manual, write_manual
    from mocca_robot.statics.cases import solve_case
    from mocca_robot.statics.loads import state_cases

    console = Console(args.json)
    config = arguments.read(args, console)
    stored = stored_design(Path(args.input))
    assembly = config.assembly
    beside = stored.parent if stored else Path("out") / safe_file_names([assembly.name])[assembly.name]
    target = prepare_file(args.output, beside / "manual.html")
    if target.suffix.lower() not in (".html", ".pdf"):
        raise InputError(f"'{target}' ends in '{target.suffix}'; a manual is a .html or a .pdf.")
    report = read_contacts(assembly, console)
    with console.stage("statics"):
        graph = PartsGraph.of(assembly, report.contacts, config.insertion)
        states = [solve_case(graph, case, config.friction) for case in state_cases(graph)]
    with console.stage("draw"):
        what = manual(graph, _ways(graph, stored), states)
        files = [write_manual(what, target), write_atomic(target.with_name("bill.csv"), bill_csv(assembly))]
    for file in files:
        console.say(str(file))
    return console.finish(ExitCode.POSITIVE, {"files": [str(f) for f in files], "steps": len(what.steps)})


def _ways(graph: PartsGraph, stored: Path | None) -> tuple[Insertion, ...]:
    """Return how the parts go in: as the design says, else along the axis of what their contacts leave."""
    from mocca_robot.design import Insertion
    from mocca_robot.files.design_json import read_design

    found = {i.part: i for i in read_design(stored).insertion} if stored else {}
    for index, motion in graph.motions():
        node = graph.placed(index)
        found.setdefault(node.part.name, Insertion(node.part.name, node.direction, motion.alpha_rad))
    return tuple(found.values())
