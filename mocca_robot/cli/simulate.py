"""`mocca-robot simulate`: what physics says about a design, or about parts as they are."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.errors import InputError

if TYPE_CHECKING:
    from mocca_robot.assembly import Assembly
    from sim.questions import Questions

DESCRIPTION = """Asks physics about a design, or about parts as they are: whether every state of the sequence stands, at
which tilt and under how much of every load it falls, and whether every part goes in along all directions of its cone.
Results go to simulation.json and report.html beside the design. Without --states, --tilt, --loads, --insert or
--robust, it does all but the last."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "simulate", help="ask physics: states, tilt table, insertions, robustness", description=DESCRIPTION
    )
    arguments.add_input(parser, "X")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for the results (default: beside the design)")
    arguments.add_json(parser)
    add_questions(parser)
    parser.add_argument(
        "--film", metavar="FILE", help="film the fall on ground that tilts: an .mp4, or else a folder of PNG frames"
    )
    parser.set_defaults(run=run)


def add_questions(parser: argparse.ArgumentParser) -> None:
    """Add what can be asked of physics."""
    group = parser.add_argument_group("physics")
    depth = group.add_mutually_exclusive_group()
    depth.add_argument(
        "--quick",
        action="store_true",
        help="only --states: seconds, not minutes; tilts and insertions by statics alone",
    )
    depth.add_argument("--thorough", action="store_true", help="everything, --robust included: many minutes")
    group.add_argument("--states", action="store_true", help="let go of every intermediate assembly of the sequence")
    group.add_argument(
        "--tilt",
        action="store_true",
        help="find the tilt at which it falls, towards each azimuth, with and without friction",
    )
    group.add_argument("--loads", action="store_true", help="find how much of every load it takes before it falls")
    group.add_argument(
        "--insert", action="store_true", help="insert every part along its cone: axis, rim, just outside"
    )
    group.add_argument(
        "--robust", action="store_true", help="build with random friction, density, clearance and placement"
    )
    group.add_argument("--friction", type=float, metavar="MU", help="Coulomb coefficient (default: the configuration)")
    group.add_argument("--azimuths", type=int, metavar="N", help="number of directions in which solids are tilted")
    group.add_argument("--directions", type=int, metavar="N", help="number of ways in that are tried per part")
    group.add_argument("--seed", type=int, metavar="N", help="seed of everything that is drawn at random")
    group.add_argument("--threads", type=int, metavar="N", help="threads side by side (default: one per core)")


def questions(args: argparse.Namespace, config: Any) -> Questions:
    """Return what is asked of physics: arguments before configuration before defaults."""
    from sim.questions import Questions

    asked = {
        "states": args.states,
        "tilt": args.tilt,
        "loads": args.loads,
        "insertion": args.insert,
        "robust": args.robust,
    }
    stages = tuple(name for name, wanted in asked.items() if wanted)
    if stages and (args.quick or args.thorough):
        named = "--quick" if args.quick else "--thorough"
        other = "insert" if stages[0] == "insertion" else stages[0]
        raise InputError(f"{named} says what is asked; leave out --{other}.")
    if args.quick or args.thorough:
        stages = tuple(asked) if args.thorough else ("states",)
    if args.threads is not None and args.threads < 1:
        raise InputError(f"--threads is {args.threads}; give at least 1.")

    def chosen(name: str) -> Any:
        value = getattr(args, name)
        return getattr(config.simulate, name) if value is None else value

    from mocca_robot.contacts.friction import sprung, tangential_ratio  # loads numpy

    found = Questions(
        friction=sprung(chosen("friction"), tangential_ratio(config.friction)),
        azimuths=chosen("azimuths"),
        directions=chosen("directions"),
        seed=chosen("seed"),
        threads=args.threads,
    )
    return replace(found, stages=stages) if stages else found


def run(args: argparse.Namespace) -> int:
    """Return the exit status of the command. Ctrl-C keeps what is finished; the same command goes on from there."""
    from mocca_robot.cli import stages
    from mocca_robot.cli.closing_lines import conclude, introduce

    console = Console(args.json)
    config = arguments.read(args, console)
    asked = questions(args, config)
    stored = stored_design(Path(args.input))
    if args.output is None and stored is not None:
        args.output = str(stored.parent)
    folder = arguments.prepare_output(args, config.assembly.name)
    contacts = stages.read_contacts(config.assembly, console)
    introduce(config.assembly, len(contacts.contacts), console)
    if stored is not None and not args.set:
        outcome = stages.judge_stored(stored, console)
    else:
        outcome = stages.judge_as_is(config, contacts, console)
    outcome = stages.find_reserve(outcome, config, console)
    outcome, interrupted = stages.simulate_design(outcome, asked, folder, console)
    outcome = stages.write_pages(outcome, config, folder, console)
    # After the report, which is there then also where OpenGL is missing.
    if args.film and not interrupted:
        with console.stage("film"):
            film = _film(outcome.design.assembly, asked.friction, Path(args.film))
        outcome = replace(outcome, files={**outcome.files, "film": film})
    return conclude(outcome, console, interrupted=interrupted)


def _film(assembly: Assembly, friction: float, path: Path) -> Path:
    """Return `path` after filming a platform that tilts 5° beyond the critical tilt by statics towards +x."""
    from math import pi, radians

    from mocca_robot.motion.parts_graph import PartsGraph
    from mocca_robot.statics.cases import critical_tilt
    from sim.scene import compile_scene
    from sim.shapes.contact_model import contact_model
    from sim.show.film import platform_motion, write_film
    from sim.stability import free_scene

    graph = PartsGraph.of(assembly)
    model = contact_model(assembly, graph.contacts, friction)
    compiled = compile_scene(free_scene(assembly, model, friction=friction))
    angle = min(pi / 2, critical_tilt(graph, 0.0, friction) + radians(5.0))
    return write_film(compiled.scene, platform_motion(compiled, 0.0, angle), path)


def stored_design(path: Path) -> Path | None:
    """Return the design.json that `path` is or holds; None for every other input."""
    from mocca_robot.files.documents import parse_json, read_text
    from mocca_robot.files.versions import DESIGN

    file = path / "design.json" if path.is_dir() else path
    if file.suffix.lower() != ".json" or not file.is_file():
        return None
    data = parse_json(read_text(file), f"'{file}'")
    return file if isinstance(data, dict) and data.get("format") == DESIGN.name else None
