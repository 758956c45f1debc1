"""`mocca-robot check`: is an input sound, and how does it stand as it is, without any design?"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import positive_if
from mocca_robot.cli.simulate import stored_design
from mocca_robot.errors import InputError

DESCRIPTION = """Prints what was understood (unit, contacts, and the parts with sizes and masses in the order of
assembly) and what looks suspicious. Then it says whether every state of the sequence stands, how far the ground can
tilt, whether anything can move at all, whether everything interlocks (with --key), and how each part goes in. The
cones it prints are the widest that any joint could leave: a joint never leaves more room than the flat contact that
it replaces."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "check", help="say whether the input is sound, and how it stands as it is", description=DESCRIPTION
    )
    arguments.add_input(parser, "FILE")
    parser.add_argument("--friction", type=float, metavar="MU", help="Coulomb coefficient (default: the file's, or 0)")
    parser.add_argument("--key", metavar="PART", help="ask whether everything interlocks while this part is held")
    parser.add_argument("--azimuths", type=int, metavar="N", help="directions of tilt of solids (default 8)")
    parser.add_argument("--picture", metavar="FILE", help="draw the parts: an .svg, or a .png (needs typst)")
    parser.add_argument(
        "--heal",
        nargs="?",
        const="",
        metavar="DIR",
        help="write a copy in which parts that nearly touch share their faces exactly (default: out/NAME_healed)",
    )
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 when every verdict is positive, 1 otherwise."""
    from mocca_robot.cli import input_findings, mended_copy, understood
    from mocca_robot.contacts.find import find_contacts, require_sound
    from mocca_robot.files.output import make_folder, safe_file_names
    from mocca_robot.motion.parts_graph import PartsGraph

    further: dict[str, Any] = {}
    if args.friction is not None:
        further["friction"] = args.friction
    console = Console(args.json)
    if args.picture is not None:
        make_folder(Path(args.picture).parent)
    config = arguments.read(args, console, further)
    azimuths = config.simulate.azimuths if args.azimuths is None else args.azimuths
    if azimuths < 1:
        raise InputError(f"--azimuths is {azimuths}; give at least 1.")
    if args.key is not None:
        config.assembly.index(args.key)
    picture = None
    with console.stage("contacts"):
        report = find_contacts(config.assembly)
        graph = PartsGraph.of(config.assembly, report.contacts, config.insertion)
    if args.heal is not None:
        folder = Path(
            args.heal or Path("out") / f"{safe_file_names([config.assembly.name])[config.assembly.name]}_healed"
        )
        return mended_copy.write_healed(config, report, folder, console)
    for line in understood.lines(config, graph):
        console.say(line)
    if args.picture is not None:
        with console.stage("picture"):
            picture = understood.write_picture(Path(args.picture), graph)
        console.say(f"picture: {picture}")
    nested = understood.nested(graph)
    for line in nested:
        console.warn(f"suspicious: {line}")
    require_sound(config.assembly, report)
    for line in mended_copy.accepted_lines(report.accepted):
        console.say(line)
    suspicions = understood.suspicions(graph)
    for line in suspicions:
        console.warn(f"suspicious: {line}")
    with console.stage("statics"):
        found = input_findings.checkup(
            graph, report.near_misses, config.friction, args.key, azimuths, config.joints.tilt_margin_rad
        )
    for line in input_findings.lines(found, built=stored_design(Path(args.input)) is not None):
        console.say(line)
    console.say(console.times())
    further = {
        "taken_as_touching": mended_copy.accepted_data(report.accepted),
        "suspicious": [*nested, *suspicions],
        "picture": None if picture is None else str(picture),
    }
    data = {**input_findings.document(found), **understood.document(config), **further}
    return console.finish(positive_if(not found.findings), data)
