"""`mocca-robot examples`: the configurations that come along, listed or copied."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode

DESCRIPTION = """Lists the configurations that come with mocca-robot, or copies those that you name into a folder,
with the drawings and meshes they need: something to run, change and learn from."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "examples", help="list the example configurations, or copy them", description=DESCRIPTION
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="examples to copy; without a name, all are listed")
    parser.add_argument("--all", action="store_true", help="copy all of them")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for the copies (default: examples)")
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 after listing or copying."""
    from mocca_robot.config.examples import copy_examples, examples

    console = Console(args.json)
    known = examples()
    listed = [{"name": e.name, "about": e.about} for e in known]
    if not args.names and not args.all:
        width = max(len(e.name) for e in known)
        for example in known:
            console.say(f"{example.name:{width}}  {example.about}")
        console.say("\nCopy with `mocca-robot examples NAME`, then `mocca-robot run examples/NAME.yaml`.")
        return console.finish(ExitCode.POSITIVE, {"examples": listed})
    names = [e.name for e in known] if args.all else args.names
    files = copy_examples(names, Path(args.output or "examples"))
    for file in files:
        console.say(str(file))
    return console.finish(ExitCode.POSITIVE, {"files": [str(f) for f in files]})
