"""`mocca-robot design`: an assembly → joints under which it stands, with drawings and a report; no physics."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console


def add(commands: Any) -> None:
    """Add the command."""
    text = "find joints that make an assembly stand, and write them (design.json, report.html; flat: cut.svg, cut.dxf)"
    parser: argparse.ArgumentParser = commands.add_parser("design", help=text, description=text)
    arguments.add_input(parser)
    arguments.add_output(parser)
    arguments.add_json(parser)
    parser.add_argument(
        "--largest-angle",
        action="store_true",
        help="with a lateral goal: look for the largest angle at which a design stands, beginning with the goal's, and "
        "say what is known beyond it",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return the exit status of the command. Ctrl-C keeps the joints as far as they were found."""
    from mocca_robot.cli import designing, stages
    from mocca_robot.cli.climb import climb_data, climb_words
    from mocca_robot.cli.closing_lines import conclude, introduce
    from mocca_robot.cli.strength import ask_strength

    console = Console(args.json)
    config = arguments.read(args, console)
    folder = arguments.prepare_output(args, config.assembly.name)
    contacts = stages.read_contacts(config.assembly, console)
    introduce(config.assembly, len(contacts.contacts), console)
    if args.largest_angle:
        climb = designing.find_largest_tilt(config, contacts, console)
        result, further = climb.designed, climb_data(climb)
    else:
        found = designing.design_in_order(config, contacts, folder, console)
        if found.designed is None:
            return designing.tell_no_order(found, console)
        config, further = replace(config, assembly=found.assembly), {}
        result = designing.strengthen_joints(config, found.designed, console)
    files, problems = stages.write_files(result, config, folder, console)
    if result.interrupted is not None:
        return designing.tell_interruption(result, files, folder, console)
    outcome = stages.verify_files(folder, result, files, problems, console)
    outcome = stages.find_reserve(outcome, config, console, result)
    outcome = ask_strength(outcome, config, folder, console)
    outcome = stages.write_pages(outcome, config, folder, console)
    designing.forget_progress(folder)
    if args.largest_angle:
        console.say(climb_words(climb))
    return conclude(outcome, console, further=further)
