"""`mocca-robot strength`: what share of its strength every part and joint uses, and how large it may be built."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import positive_if
from mocca_robot.cli.simulate import stored_design

if TYPE_CHECKING:
    from mocca_robot.cli.stages import DesignOutcome
    from mocca_robot.config.config import Config
    from mocca_robot.motion.parts_graph import PartsGraph
    from mocca_robot.strength.uses import AssemblyStrength

DESCRIPTION = """Says how many times its loads every part bears: largest tension, compression and shear, bearing in the
joints, with the place and the load case, and the thinnest neck. Every load case of the goals, every state of the
sequence that stands, and, with a force, every insertion and grip is looked at by a fast estimate; the worst of each
part by finite elements, where the packages of mocca-robot[strength] are installed. Parts need a material. Results go to
strength.json and strength.html beside the design."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "strength", help="say whether parts and joints break, and how large it may be built", description=DESCRIPTION
    )
    arguments.add_input(parser, "X")
    arguments.add_output(parser)
    arguments.add_json(parser)
    parser.add_argument("--material", metavar="NAME", help="material of every part (default: the configuration's)")
    parser.add_argument("--safety", type=float, metavar="N", help="how many times its loads it has to bear (default 3)")
    parser.add_argument("--estimate", action="store_true", help="the fast estimate alone, no finite elements")
    parser.add_argument("--quick", action="store_true", help="load cases of the goals only, no states of the sequence")
    parser.add_argument("--scale", action="store_true", help="say how many times as large it may be built")
    parser.add_argument("--threads", type=int, metavar="N", help="processes side by side (default: one per core)")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 when every part bears its loads as many times as asked, 1 otherwise."""
    from mocca_robot.contacts.find import find_contacts, require_sound
    from mocca_robot.motion.parts_graph import PartsGraph
    from mocca_robot.strength.options import made_of

    further: dict[str, Any] = {} if args.material is None else {"material": args.material}
    if args.safety is not None:
        args.set = [*args.set, f"strength.safety={args.safety!r}"]
    console = Console(args.json)
    with console.stage("read"):
        config = arguments.load(args, further)
        made_of(config.assembly, config.strength)
        stored = stored_design(Path(args.input))
    if args.output is None and stored is not None:
        args.output = str(stored.parent)
    folder = arguments.prepare_output(args, config.assembly.name)
    for note in config.notes:
        console.warn(f"note: {note}")
    with console.stage("contacts"):
        report = find_contacts(config.assembly)
        require_sound(config.assembly, report)
        graph = PartsGraph.of(config.assembly, report.contacts, config.insertion)
    found = assessed(graph, config, console, estimate=args.estimate, states=not args.quick, threads=args.threads)
    if args.scale:
        found = with_scale(found, graph, config, console)
    files = write(found, config, folder, console)
    say(found, config, console)
    console.say(console.times())
    for path in files.values():
        console.say(f"{path}")
    from mocca_robot.strength.strength_json import strength_to_data

    data = strength_to_data(found, config.assembly.name)
    return console.finish(positive_if(found.holds), {**data, "files": {k: str(p) for k, p in files.items()}})


def ask_strength(outcome: DesignOutcome, config: Config, folder: Path, console: Console) -> DesignOutcome:
    """Return the outcome of `run` with its strength, where the configuration asks for it."""
    from mocca_robot.cli.reasons import NegativeVerdict
    from mocca_robot.report.strength import MILLIMETRES, broken_words
    from mocca_robot.strength.strength_json import write_strength

    if not config.asks_strength or not outcome.after.stands:
        return outcome
    found = assessed(outcome.after.graph, config, console)
    broken = [
        NegativeVerdict("breaks", broken_words(p, found.safety, *MILLIMETRES), (p.part,), p.uses[0].case)
        for p in found.broken
    ]
    files = {"strength": write_strength(found, folder / "strength.json", config.assembly.name)}
    return replace(outcome, strength=found, findings=(*outcome.findings, *broken), files={**outcome.files, **files})


def assessed(
    graph: PartsGraph,
    config: Config,
    console: Console,
    *,
    estimate: bool = False,
    states: bool = True,
    threads: int | None = None,
) -> AssemblyStrength:
    """Return the strength of parts and joints; without the packages for elements the estimate alone, with a note."""
    from mocca_robot.runtime.executors import executor
    from mocca_robot.strength.assess import MANY, assess
    from mocca_robot.strength.elements import missing_packages
    from mocca_robot.strength.part_elements import solve_part

    solve = None if estimate else solve_part
    if missing := () if estimate else missing_packages(graph.assembly.dimension):
        console.warn(
            f"note: no finite elements, since {' and '.join(missing)} is not installed: "
            "pip install 'mocca-robot[strength]'. What follows is the fast estimate."
        )
        solve = None
    asked = partial(assess, graph, config.strength, friction=config.friction, states=states, elements=solve)
    with console.stage("strength") as show:
        # Processes pay for themselves where there are many parts, or solids with elements in them.
        if len(graph.assembly.parts) < MANY and (solve is None or graph.assembly.dimension == 2):
            return asked(progress=show)
        with executor(threads) as processes:
            return asked(executor=processes, progress=show)


def with_scale(found: AssemblyStrength, graph: PartsGraph, config: Config, console: Console) -> AssemblyStrength:
    """Return the same with the largest scale at which it holds."""
    from mocca_robot.strength.scale import largest_scale

    with console.stage("scale"):
        scale = largest_scale(graph, config.strength, found, friction=config.friction)
    return replace(found, largest_scale=scale)


def write(found: AssemblyStrength, config: Config, folder: Path, console: Console) -> dict[str, Path]:
    """Return the files with the result."""
    from mocca_robot.report.strength_page import write_strength_page
    from mocca_robot.strength.strength_json import write_strength

    with console.stage("write"):
        return {
            "strength": write_strength(found, folder / "strength.json", config.assembly.name),
            "page": write_strength_page(folder / "strength.html", config.assembly, found, config.unit, config.unit_m),
        }


def say(found: AssemblyStrength, config: Config, console: Console) -> None:
    """Say the verdict, and every part that bears too little."""
    from mocca_robot.report.strength import broken_words, factor, strength_words

    console.say(f"strength:  {strength_words(found, config.unit, config.unit_m)}")
    if found.largest_scale is not None:
        console.say(f"scale:     may be built up to {factor(found.largest_scale)} times as large")
    for note in found.notes[:4]:
        console.say(f"note: {note}")
    if len(found.notes) > 4:
        console.say(f"note: and {len(found.notes) - 4} more parts like these")
    if found.left_out:
        console.say(f"note: {len(found.left_out)} states or insertions are not in equilibrium and were left out")
    for part in found.broken[:6]:
        console.say(f"✗ {broken_words(part, found.safety, config.unit, config.unit_m)}")
    if len(found.broken) > 6:
        console.say(f"✗ and {len(found.broken) - 6} more parts")
