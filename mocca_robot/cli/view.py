"""`mocca-robot view`: a design or an assembly in the browser, or a robot's plan as it is meant to go."""

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
--mujoco the finished assembly is let go in MuJoCo's own window instead, where you can pull at parts. Of a plan.json it
writes a page that plays it, plan.html beside it or where --export says; nothing is rehearsed for that."""


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
    if (plan_file := Path(args.input)).suffix == ".json" and is_plan(plan_file):
        return _play_plan(plan_file, args)
    from mocca_robot.cli.stages import read_contacts
    from mocca_robot.files.output import make_folder
    from mocca_robot.motion.parts_graph import PartsGraph
    from sim.show.view import export_page, open_viewer, shown

    console = Console(args.json)
    if args.export:
        make_folder(Path(args.export).parent)
    config = arguments.read(args, console)
    report = read_contacts(config.assembly, console)
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


def is_plan(path: Path) -> bool:
    """Return whether a JSON file says that it is a robot's plan."""
    import json

    from mocca_robot.files.versions import PLAN

    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False  # whoever reads it as a model says what is wrong
    return isinstance(content, dict) and content.get("format") == PLAN.name


def _play_plan(path: Path, args: argparse.Namespace) -> int:
    """Write the page that plays a plan; InputError when its design is not there."""
    from mocca_robot.errors import InputError
    from mocca_robot.files.design_json import read_design
    from mocca_robot.files.output import make_folder
    from mocca_robot.plan.reader import read_plan
    from mocca_robot.report.plan_page import write_plan_page
    from sim.cell.cell_film import film
    from sim.cell.planned import planned

    console = Console(args.json)
    if args.mujoco or args.set:
        raise InputError(f"{path} is a plan: --mujoco and --set are for designs and assemblies.")
    target = Path(args.export) if args.export else path.with_suffix(".html")
    make_folder(target.parent)
    with console.stage("read"):
        plan = read_plan(path)
        source = path.parent / plan.design if plan.design else None
        if source is None or not source.is_file():
            raise InputError(
                f"The design of {path} is not where the plan says ({plan.design or 'nowhere'}). Plan again."
            )
        design = read_design(source)
    with console.stage("view"):
        build = planned(plan, design)
        file = write_plan_page(target, plan, design.assembly.name, film(build.place, build.frames, build.chapters))
    console.say(f"wrote {file}: open it in a browser")
    return console.finish(ExitCode.POSITIVE, {"file": str(file)})
