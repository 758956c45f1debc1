"""`mocca-robot sequence`: in which order can the parts be placed, and who has to be held meanwhile?"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import positive_if

if TYPE_CHECKING:
    from planners.order.sequence import SequenceResult

DESCRIPTION = """Takes the assembly apart, part by part along straight ways out, and prints the reverse: an order in
which every part has a cone of ways in, and as few parts as possible have to be held. If there is none, says which part
locks which."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "sequence", help="find an order in which the parts can be placed", description=DESCRIPTION
    )
    arguments.add_input(parser, "ASSEMBLY")
    parser.add_argument("--holders", type=int, metavar="K", help="how many parts can be held at once (default: any)")
    parser.add_argument("--friction", type=float, metavar="MU", help="Coulomb coefficient (default: the file's, or 0)")
    parser.add_argument(
        "--states", type=int, default=2000, metavar="N", help="how many states to examine at most (default 2000)"
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=6.0,
        metavar="S",
        help="how long to look for an order with fewer supports before the best so far is printed (default 6)",
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="write the assembly as JSON, in the order that was found"
    )
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 when an order was found, 1 with the reason otherwise."""
    from mocca_robot.cli.stages import read_contacts
    from mocca_robot.files.assembly_json import write_assembly
    from mocca_robot.files.output import prepare_file
    from mocca_robot.motion.parts_graph import PartsGraph
    from planners.order.sequence import find_sequence, reordered

    console = Console(args.json)
    config = arguments.read(args, console, {} if args.friction is None else {"friction": args.friction})
    report = read_contacts(config.assembly, console)
    target = None if args.output is None else prepare_file(args.output, Path("assembly.json"))
    with console.stage("sequence") as show:
        found = find_sequence(
            PartsGraph.of(config.assembly, report.contacts),
            holders=args.holders,
            friction=config.friction,
            states=args.states,
            seconds=args.seconds,
            progress=show,
        )
    for line in lines(found):
        console.say(line)
    if target is not None and found.placements:
        path = write_assembly(reordered(config.assembly, [p.part for p in found.placements]), target)
        console.say(f"written: {path}")
    console.say(console.times())
    return console.finish(positive_if(found.placements), document(found))


def lines(found: SequenceResult) -> list[str]:
    """Return what was found, for people."""
    import numpy as np

    out = []
    for k, p in enumerate(found.placements):
        way = ", ".join(f"{round(float(v), 3) + 0.0:+.3f}" for v in p.direction)  # never -0.000
        held = f"; hold {', '.join(p.held)}" if p.held else ""
        out.append(f"{k + 1:4d}  {p.part}: in along ({way}), up to {np.rad2deg(p.alpha_rad):.1f}° off{held}")
    if found.placements:
        held = f"{found.supports} supports, {found.holders} at once" if found.supports else "every state stands"
        if found.supports:
            held += "; no other order needs fewer" if found.fewest else "; another order may need fewer"
        return [*out, f"an order was found: {held} ({found.states} states examined)"]
    if found.obstacles:
        out = [f"{o.part} is barred by {', '.join(o.blockers[:6])}" for o in found.obstacles]
        count = "1 part is locked in" if len(found.obstacles) == 1 else f"{len(found.obstacles)} parts lock each other"
        if found.proven:
            return [*out, f"no order exists: {count}, whatever leaves first"]
        return [*out, f"no order was found: {count} in every direction that was tried; others may be free"]
    what = f"in the state of {', '.join(found.remaining)} somebody has to hold {', '.join(found.falling)}"
    if found.status == "budget":
        return [f"no order was found in {found.states} states; raise --states, --seconds or --holders ({what})"]
    return [f"no order exists with so few holders: {what}"]


def document(found: SequenceResult) -> dict[str, Any]:
    """Return what was found, for programs; angles in radians."""
    return {
        "status": str(found.status),
        "order": [
            {"part": p.part, "direction": p.direction, "alpha_rad": p.alpha_rad, "held": list(p.held)}
            for p in found.placements
        ],
        "supports": found.supports,
        "holders": found.holders,
        "fewest": found.fewest,
        "proven": found.proven,
        "obstacles": [{"part": o.part, "blockers": list(o.blockers)} for o in found.obstacles],
        "falling": list(found.falling),
        "remaining": list(found.remaining),
        "states": found.states,
    }
