"""`mocca-robot run`: the whole line, from an assembly to a report of a design that physics has judged."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from mocca_robot.cli import arguments, simulate
from mocca_robot.cli.console import Console


def add(commands: Any) -> None:
    """Add the command."""
    text = "read, design, verify from the written files, simulate in MuJoCo and report: everything at once"
    parser: argparse.ArgumentParser = commands.add_parser("run", help=text, description=text)
    arguments.add_input(parser)
    arguments.add_output(parser)
    arguments.add_json(parser)
    simulate.add_questions(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return the exit status of the command. Ctrl-C keeps what the design has found and what physics has said."""
    from mocca_robot.cli import designing, stages
    from mocca_robot.cli.closing_lines import conclude, first_words, introduce
    from mocca_robot.cli.strength import ask_strength

    console = Console(args.json)
    config = arguments.read(args, console)
    questions = simulate.questions(args, config)
    folder = arguments.prepare_output(args, config.assembly.name)
    contacts = stages.read_contacts(config.assembly, console)
    introduce(config.assembly, len(contacts.contacts), console)
    found = designing.design_in_order(config, contacts, folder, console)
    if found.designed is None:
        return designing.tell_no_order(found, console)
    config = replace(config, assembly=found.assembly)
    result = designing.strengthen_joints(config, found.designed, console)
    files, problems = stages.write_files(result, config, folder, console)
    if result.interrupted is not None:
        return designing.tell_interruption(result, files, folder, console)
    outcome = stages.verify_files(folder, result, files, problems, console)
    outcome = stages.find_reserve(outcome, config, console, result)
    outcome = ask_strength(outcome, config, folder, console)
    outcome = stages.write_pages(outcome, config, folder, console)
    console.say(first_words(outcome, console))
    outcome, interrupted = stages.simulate_design(outcome, questions, folder, console)
    outcome = stages.write_pages(outcome, config, folder, console)
    if not interrupted:
        designing.forget_progress(folder)
    return conclude(outcome, console, interrupted=interrupted)
