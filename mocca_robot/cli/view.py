"""`mocca-robot view`: a design or an assembly in the browser."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode

DESCRIPTION = """Shows parts in the browser: the sequence, an exploded view, insertion cones, contact forces, and what
happens when the finished assembly is let go. Needs viser: pip install mocca-robot[viewer]. Ctrl-C ends it. With
--mujoco the finished assembly is let go in MuJoCo's own window instead, where you can pull at parts."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "view", help="look at a design or an assembly in the browser", description=DESCRIPTION
    )
    arguments.add_input(parser, "X")
    parser.add_argument("--export", metavar="FILE", help="write a self-contained page that plays it, and end")
    parser.add_argument("--port", type=int, default=8080, metavar="N", help="port on this computer (default 8080)")
    parser.add_argument("--mujoco", action="store_true", help="MuJoCo's own viewer instead; needs a screen")
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 after writing the page, or when Ctrl-C ends the viewer."""
    from mocca_robot.contacts.find import find_contacts, require_sound
    from mocca_robot.files.output import writable_folder
    from mocca_robot.motion.parts_graph import PartsGraph
    from sim.show.view import export_page, open_viewer, shown

    console = Console(args.json)
    if args.export:
        writable_folder(Path(args.export).parent)
    with console.stage("read"):
        config = arguments.load(args)
        report = find_contacts(config.assembly)
        require_sound(config.assembly, report)
    if args.mujoco:
        from sim.show.native_view import open_native_viewer

        open_native_viewer(config.assembly, report.contacts, config.simulate.friction)
        return console.finish(ExitCode.POSITIVE, {})
    with console.stage("view"):
        what = shown(PartsGraph.of(config.assembly, report.contacts, config.insertion))
        if args.export:
            path = export_page(what, Path(args.export))
            console.say(str(path))
            return console.finish(ExitCode.POSITIVE, {"file": str(path)})
        server = open_viewer(what, args.port)
    console.say(f"http://127.0.0.1:{server.get_port()} (Ctrl-C ends)")
    try:
        while True:
            time.sleep(1.0)
    except KeyboardInterrupt:
        server.stop()
    return console.finish(ExitCode.POSITIVE, {})
